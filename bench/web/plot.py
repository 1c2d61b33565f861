"""Plots as data: what plot.js draws, as the fields of a description."""

from __future__ import annotations

from typing import Any, Final, Literal, NamedTuple

from numpy.typing import ArrayLike

from bench.web.columns import TIME_STEP_S, Columns

Kind = Literal["line", "steps", "points", "stems", "area", "curve"]

TIME: Final = "time"
"""The group of all plots over the time of a run."""


class Series(NamedTuple):
    """One curve.

    kind: line, steps (holds until the next), points, stems (from nought), area (from y to y2),
        curve (x in any order)
    x, y, y2: shape (n,); aside: does not widen the range of y; signal: its name in the log
    """

    label: str
    x: ArrayLike
    y: ArrayLike
    colour: str
    kind: Kind = "line"
    y2: ArrayLike | None = None
    shape: str | None = None
    dash: bool | None = None
    width: float | None = None
    size: float | None = None
    step: bool | None = None
    alpha: float | None = None
    aside: bool | None = None
    signal: str | None = None
    scale: float | None = None
    of: str | None = None


class Mark(NamedTuple):
    """An instant: a dashed line with a few words."""

    x: float
    label: str
    colour: str = "event"


class Lane(NamedTuple):
    """A row of bars at the foot: when a line is high, or which mode holds.

    start, end: shape (n,); labels and colours: one a bar
    """

    label: str
    start: ArrayLike
    end: ArrayLike
    colour: str = "motion"
    labels: tuple[str, ...] | None = None
    colours: tuple[str, ...] | None = None


class Plot(NamedTuple):
    """One plot. low, high: fixed limits of y; square: no time, no measuring cursors."""

    title: str
    x: str
    y: str
    series: tuple[Series, ...]
    group: str | None = TIME
    marks: tuple[Mark, ...] = ()
    lanes: tuple[Lane, ...] = ()
    extent: tuple[float, float] | None = None
    low: float | None = None
    high: float | None = None
    log_x: bool | None = None
    log_y: bool | None = None
    square: bool | None = None
    unlabelled: bool | None = None
    height: int | None = None


def described(plot: Plot, columns: Columns) -> dict[str, Any]:
    """Return a plot as an object for JSON, its arrays as numbers of columns."""
    step = TIME_STEP_S if plot.group == TIME else None
    found = _given(plot)
    found["series"] = [
        _given(s) | {"x": columns.add(s.x, step), "y": columns.add(s.y)}
        | ({} if s.y2 is None else {"y2": columns.add(s.y2)})
        for s in plot.series
    ]  # fmt: skip
    found["marks"] = [_given(mark) for mark in plot.marks]
    found["lanes"] = [_lane(lane, columns) for lane in plot.lanes]
    return found


def _lane(lane: Lane, columns: Columns) -> dict[str, Any]:
    found = _given(lane)
    found["from"] = columns.add(found.pop("start"), TIME_STEP_S)
    found["to"] = columns.add(found.pop("end"), TIME_STEP_S)
    return found


def _given(described: Any) -> dict[str, Any]:  # noqa: ANN401
    return {key: value for key, value in described._asdict().items() if value is not None}
