"""What the loop makes of a bad bus: one fault after the other, injected, detected, survived.

python -m bench.bus.faults    writes docs/bus-faults.md
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Final, NamedTuple

from bench.bus.injectors import (
    FIRST_TICK,
    GOOD_TICKS,
    NEEDED,
    Hurt,
    Injector,
    bus_off,
    duplicates,
    flips,
    loss,
    reordering,
    spikes,
    stuck,
)
from bench.bus.rig import Rig
from bench.run import scenarios
from bench.run.resolve import resolve
from hil import compiled

TABLE: Final = compiled.root() / "docs" / "bus-faults.md"


class Case(NamedTuple):
    """A fault, and which counts say how much of it was noticed."""

    name: str
    hurt: Hurt
    verdicts: tuple[str, ...]


CASES: Final = (
    Case("none", lambda _i, frames, _t: [(frame, 0) for frame in frames], ()),
    Case("1 % random loss", loss(0.01), ("lost",)),
    Case("5 % random loss", loss(0.05), ("lost",)),
    Case("20 % random loss", loss(0.20), ("lost",)),
    Case("1 % of frames with 1 to 3 flipped bits", flips, ("corrupted",)),
    Case("1 % duplicates", duplicates, ("repeated", "reordered")),
    Case("1 % reordered (a tick late)", reordering, ("reordered",)),
    Case("latency spikes of 5 ms, four a second", spikes(5), ("late",)),
    Case("latency spikes of 20 ms, four a second", spikes(20), ("late",)),
    Case("bus-off for 50 ms", bus_off, ("gaps",)),
    Case("plant replaced by a repeater for 50 ms", stuck("plant"), ("repeated",)),
    Case("controller replaced by a repeater for 50 ms", stuck("controller"), ("repeated",)),
)


class Outcome(NamedTuple):
    """What became of a case.

    injected, detected: frames hurt, and the counts that noticed them
    spoilt, gaps: ticks whose sample could not be whole, and ticks stepped without a sample
    tdc_mm: least and largest dead centre before any safe state, and the largest of all
    safe: for both processes when they gave up, if they did
    """

    name: str
    frames: int
    injected: int
    detected: int
    spoilt: int
    gaps: int
    tdc_mm: tuple[float, float, float]
    misfires: int
    safe: dict[str, Safe]
    counts: dict[str, int]

    @property
    def is_met(self) -> bool:
        """Every fault noticed, and the engine within its limits, given up in time where it was."""
        noticed = self.injected == self.detected and self.spoilt == self.gaps
        in_time = all(safe.silent_ticks <= SAFE_TICKS for safe in self.safe.values())
        return noticed and in_time and self.tdc_mm[2] <= LIMIT_MM


class Safe(NamedTuple):
    """How a process came to its safe state: ticks after the first fault, and without the peer."""

    after_ticks: int
    silent_ticks: int


LIMIT_MM: Final = 19.5
SAFE_TICKS: Final = 12
"""Eleven silent ticks, more than 10 ms, and the reaction."""


class Watch:
    """Follows a rig through a case."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.before: list[float] = []
        self.after: list[float] = []
        self.safe: dict[str, Safe] = {}
        self._number = rig.plant.state.dead_centre.number

    def look(self, tick: int) -> None:
        """Take note of a dead centre and of who has given up."""
        rig, since = self.rig, tick - FIRST_TICK + 1
        centre = rig.plant.state.dead_centre
        if centre.number != self._number:
            self._number = centre.number
            tdcs = self.after if self.safe else self.before
            tdcs.append(abs(centre.x_m) * 1e3)
        if rig.is_safe and "controller" not in self.safe:
            self.safe["controller"] = Safe(since, rig.controller.state.stale)
        if rig.plant_is_safe and "plant" not in self.safe:
            self.safe["plant"] = Safe(since, rig.plant.state.stale)

    @property
    def tdc_mm(self) -> tuple[float, float, float]:
        """Least and largest before any safe state, largest of all."""
        low, high = min(self.before), max(self.before)
        return low, high, max(self.before + self.after)


def run_case(case: Case, duration_s: float = 10.0) -> Outcome:
    """Run the settled engine on a bus with this fault."""
    scenario = resolve(scenarios.read("steady", [("run.duration_s", duration_s)]))
    ticks = round(duration_s * scenario.loop.rate_hz)
    injector = Injector(case.hurt, ticks - GOOD_TICKS)
    rig = Rig(scenario, injector)
    watch = Watch(rig)
    for tick in range(ticks):
        rig.turn(tick)
        watch.look(tick)
    counts = _counts(rig)
    return Outcome(
        case.name, rig.wire.delivered, _injected(case, rig, injector),
        sum(counts[verdict] for verdict in case.verdicts), len(injector.spoilt), counts["gaps"],
        watch.tdc_mm, rig.tally.misfires, watch.safe, counts,
    )  # fmt: skip


def _counts(rig: Rig) -> dict[str, int]:
    """Verdicts of both decoders, late samples and ticks stepped without one."""
    both = (rig.plant.decoder.counts(), rig.controller.reception.decoder.counts())
    counts = {name: sum(getattr(c, name) for c in both) for name in both[0]._fields}
    return counts | {"late": rig.controller.late, "gaps": len(rig.without_sample)}


def _injected(case: Case, rig: Rig, injector: Injector) -> int:
    """What a receiver can notice: a frame is lost once a later one of its kind has come."""
    if case.verdicts == ("lost",):
        return rig.wire.missing()
    if case.verdicts == ("reordered",):
        return rig.wire.overtaken()
    if case.verdicts == ("late",):
        return len({frame.tick for frame in injector.done if frame.can_id in NEEDED})
    return len(injector.spoilt) if case.verdicts == ("gaps",) else len(injector.done)


def table(outcomes: Iterable[Outcome]) -> str:
    """Return docs/bus-faults.md."""
    rows = [_row(outcome) for outcome in outcomes]
    return "\n".join([*_PREFACE, *rows, *_NOTES, ""])


_PREFACE: Final = (
    "# Faults on the bus", "",
    "Made by `python -m bench.bus.faults`; do not edit. Cascade at nominal load, harmonic model,",
    "10 s at 1 kHz on a bus of which every frame passes through the fault, in both directions;",
    "loops, link, assembly and codec are those of a run. The seed is fixed.", "",
    "| fault | frames | injected | detected | as | spoilt ticks | ticks without sample |"
    " TDC [mm] | misfires | safe state | met |",
    "|---|---|---|---|---|---|---|---|---|---|---|",
)  # fmt: skip

_NOTES: Final = (
    "",
    "- injected: frames that a receiver can miss or mistrust. A lost frame counts once a later one",
    "  of its kind has come, a reordered one when a later one of its kind came before it; with",
    "  latency the ticks whose sample was held up, with bus-off the ticks without one.",
    "- detected, as: the count of both receivers under these verdicts. A frame that was damaged",
    "  leaves a gap in its counter and so counts as lost as well.",
    "- spoilt ticks: ticks whose head or sample was hurt; the controller steps exactly those",
    "  without a sample.",
    "- TDC: least and largest dead centre before a safe state, set point 15.5 mm, limit 19.5 mm.",
    "- safe state: ticks after the first fault, and how many of them in a row had no valid frames",
    "  of the peer; 10 ms are allowed. Both stay in it until the controller is started again. A",
    "  controller that is not heard is told so by the plant's samples, and gives up too.",
)


def _row(o: Outcome) -> str:
    verdicts = [name for name in o.counts if name not in {"ok", "gaps"} and o.counts[name]]
    low, high, _ = o.tdc_mm
    safe = ", ".join(
        f"{side} after {s.after_ticks} ({s.silent_ticks} silent)" for side, s in o.safe.items()
    )
    told = ", ".join(f"{o.counts[name]} {name}" for name in verdicts) or "nothing"
    return (
        f"| {o.name} | {o.frames} | {o.injected} | {o.detected} | {told} | {o.spoilt} | {o.gaps} |"
        f" {low:.2f} to {high:.2f} | {o.misfires} | {safe or 'not needed'} |"
        f" {'yes' if o.is_met else 'no'} |"
    )


def show() -> int:
    """Run all cases and print a line for each as it ends; 1 when one of them is not met."""
    met = True
    for case in CASES:
        outcome = run_case(case)
        met = met and outcome.is_met
        print(_row(outcome), flush=True)
    return 0 if met else 1


def main() -> int:
    """Run all cases and write the table; 1 when one of them is not met."""
    outcomes = [run_case(case) for case in CASES]
    TABLE.write_text(table(outcomes), encoding="utf-8")
    return 0 if all(outcome.is_met for outcome in outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
