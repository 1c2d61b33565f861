"""The TTL lines and the modes of a run: when which one was high, and which mode held."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.judge.events import Happenings
from bench.report.curves.envelope import Window
from bench.web.plot import Lane
from hil.log import Log, Span
from hil.wire.messages import CHANNELS, MACHINE_MODES

_LOOK_BACK_NS: Final = 60_000_000
"""Pulses are sent at most two strokes ahead of their opening."""


class Pulse(NamedTuple):
    """One pulse of a line, from its opening to its closing on the run's clock [ns]."""

    channel: int
    open_ns: int
    close_ns: int


class Stretch(NamedTuple):
    """A mode and when it held [s]."""

    start_s: float
    end_s: float
    name: str


def read_pulses(log: Log, windows: Sequence[Window]) -> list[Pulse]:
    """Return the pulses that acted in the windows, as the plant got them."""
    found: set[Pulse] = set()
    for low, high in windows:
        rows = log.array("/actuator", Span(max(low - _LOOK_BACK_NS, 0), high))
        found.update(p for p in acted(rows) if p.close_ns >= low and p.open_ns <= high)
    return sorted(found, key=lambda pulse: pulse.open_ns)


def acted(rows: NDArray[Any]) -> Iterable[Pulse]:
    """Tell the pulses that acted from those that a newer frame replaced before they were due."""
    last: dict[int, Pulse] = {}
    for row in rows[rows["pulse_count"] > 0]:
        now_ns = int(row["t_ns"])
        for i in range(int(row["pulse_count"])):
            channel, open_ns = int(row["pulse_channel"][i]), int(row["pulse_open_t_ns"][i])
            pulse = Pulse(channel, open_ns, open_ns + int(row["pulse_duration_ns"][i]))
            before = last.get(channel)
            if before is not None and before.open_ns != open_ns and before.open_ns <= now_ns:
                yield before
            last[channel] = pulse
    yield from last.values()


_COLOURS: Final = ("left", "right", "left", "right", *["valve"] * 4)


def pulse_lanes(pulses: Sequence[Pulse]) -> tuple[Lane, ...]:
    """A row for each line that was ever high: the timing diagram."""
    lanes = []
    for channel, name in CHANNELS.items():
        own = [pulse for pulse in pulses if pulse.channel == channel]
        if own:
            times = np.array([(pulse.open_ns, pulse.close_ns) for pulse in own]) * 1e-9
            lanes.append(Lane(name.replace("_", " "), times[:, 0], times[:, 1], _COLOURS[channel]))
    return tuple(lanes)


def operating_modes(first: str, happenings: Happenings, end_s: float) -> list[Stretch]:
    """The controller's modes, from what it told of their changes."""
    changes = [
        (line.t_ns * 1e-9, line.code.removeprefix("mode "))
        for line in happenings.lines
        if line.source == "controller" and line.code.startswith("mode ")
    ]
    return _stretches([(0.0, first), *changes], end_s)


def machine_modes(log: Log, end_s: float) -> list[Stretch]:
    """The modes of the electric machine as it was ordered."""
    changes: list[tuple[float, str]] = []
    for block in log.blocks("/actuator"):
        before = -1 if not changes else _NUMBERS[changes[-1][1]]
        new = np.flatnonzero(np.diff(block["mode"].astype(np.int64), prepend=before))
        changes += [(block["t_ns"][i] * 1e-9, MACHINE_MODES[int(block["mode"][i])]) for i in new]
    return _stretches(changes, end_s)


_NUMBERS: Final = {name: number for number, name in MACHINE_MODES.items()}
_MODE_COLOURS: Final = {"motor": "motoring", "generator": "generating"}


def _stretches(changes: Sequence[tuple[float, str]], end_s: float) -> list[Stretch]:
    pairs = pairwise([*changes, (end_s, "")])
    return [Stretch(t_s, end, name) for (t_s, name), (end, _) in pairs if end > t_s]


def mode_lane(title: str, stretches: Sequence[Stretch]) -> Lane:
    """A row of named bars."""
    names = tuple(stretch.name for stretch in stretches)
    return Lane(
        title, [s.start_s for s in stretches], [s.end_s for s in stretches], labels=names,
        colours=tuple(_MODE_COLOURS.get(name, name) for name in names),
    )  # fmt: skip
