"""A drawing as data: what a page draws interactively and a picture in ink."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple

Mark = Literal["line", "points", "both", "steps"]


class Series(NamedTuple):
    """One curve; x need not rise, so that a loop can be drawn."""

    label: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    mark: Mark = "line"


class Level(NamedTuple):
    """A horizontal line: a limit, or a printed number that the curves are held against."""

    label: str
    y: float


class Chart(NamedTuple):
    """One drawing; labels carry the unit in brackets."""

    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    levels: tuple[Level, ...] = ()
    log_x: bool = False


def series(label: str, x: Iterable[float], y: Iterable[float], mark: Mark = "line") -> Series:
    """Return a curve from anything that gives numbers."""
    return Series(label, tuple(map(float, x)), tuple(map(float, y)), mark)


def thinned(curve: Series, most: int = 1500) -> Series:
    """Return every so manieth point of a long curve, with its last one."""
    step = -(-len(curve.x) // most)
    if step <= 1:
        return curve
    return curve._replace(x=_every(curve.x, step), y=_every(curve.y, step))


def _every(values: Sequence[float], step: int) -> tuple[float, ...]:
    kept = tuple(values[::step])
    return kept if (len(values) - 1) % step == 0 else (*kept, values[-1])
