"""Why a run went to its safe state, or could not be judged: machine, link, or whose fault."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from bench.judge.events import Happening, Happenings
from bench.judge.stalls import BORNE_NS, NOTED_NS, Stall, read_stalls
from bench.run.failure import SAFE_STATES
from hil.config.resolved import Resolved
from hil.log import Log, Span, topics

_BEFORE_NS: Final = 100_000_000
"""What happened in the last two or three strokes may be why a piston went too far."""

_TOGETHER_NS: Final = 3_000_000
_SILENT_TICKS: Final = 3


class Trace(NamedTuple):
    """What of the logs tells why: stalls of both processes, and the first safe state.

    silent: in the ticks before it nothing came from the peer at all
    """

    stalls: tuple[Stall, ...]
    safe: Happening | None
    silent: bool


NO_TRACE: Final = Trace((), None, silent=False)


class Cause(NamedTuple):
    """Why, in words; whether it was the machine's doing, and whether it led to the safe state."""

    text: str
    by_machine: bool
    safe: bool


def read_trace(scenario: Resolved, happenings: Happenings, logs: Mapping[str, Log]) -> Trace:
    """Gather from the logs what tells why; in lockstep nobody can be late."""
    safe = next((line for line in happenings.lines if line.code in SAFE_STATES), None)
    period_ns = scenario.loop.period_ns
    stalls: tuple[Stall, ...] = ()
    if scenario.loop.clock == "realtime":
        parts = [read_stalls(log, name, period_ns) for name, log in logs.items()]
        stalls = tuple(sorted((s for part in parts for s in part), key=lambda stall: stall.t_ns))
    silent = safe is not None and _is_silent(logs[safe.source], safe, period_ns)
    return Trace(stalls, safe, silent)


def _is_silent(log: Log, safe: Happening, period_ns: int) -> bool:
    """Whether nothing came from the peer in the last ticks before the safe state."""
    first_ns = safe.t_ns - _SILENT_TICKS * period_ns
    span = Span(max(first_ns, 0), safe.t_ns)
    if safe.source == "controller":
        status = [
            block["status"][(block["t_ns"] > first_ns) & (block["t_ns"] <= safe.t_ns)]
            for block in log.blocks("/sensor", span)
        ]
        return bool(status) and bool((np.concatenate(status) == topics.SAMPLE_NONE).all())
    received = (record.t_ns for record in log.records("/frames/received", span))
    return not any(first_ns < t_ns <= safe.t_ns for t_ns in received)


def cause_of(scenario: Resolved, trace: Trace, processes: Mapping[str, Any]) -> Cause | None:
    """Return why the run went to its safe state, else what of the machine's doing spoilt it.

    Parameters: processes : what was seen of them from outside, from the run's facts
    """
    judge = _SharedThread if scenario.link.kind == "memory" else _TwoProcesses
    judged = judge(trace.stalls, processes)
    machine = [stall for stall in trace.stalls if judged.is_machines(stall)]
    if trace.safe is not None:
        return _of_the_safe_state(scenario, trace, trace.safe, machine)
    worst = max(machine, key=lambda stall: stall.late_ns, default=None)
    if worst is None or worst.late_ns <= BORNE_NS:
        return None
    return Cause(_machine_told(worst), by_machine=True, safe=False)


def _of_the_safe_state(
    scenario: Resolved, trace: Trace, safe: Happening, machine: Sequence[Stall]
) -> Cause:
    begin = f"safe state of the {safe.source} at {safe.t_ns * 1e-9:.3f} s"
    own = [stall for stall in trace.stalls if stall not in machine]
    if (stall := _worst_before(safe.t_ns, machine)) is not None:
        return Cause(f"{begin}: {_machine_told(stall)}", by_machine=True, safe=True)
    if (stall := _worst_before(safe.t_ns, own)) is not None:
        late = f"the {stall.process} worked for {stall.late_ns * 1e-6:.0f} ms on tick {stall.tick}"
        return Cause(f"{begin}: {late}", by_machine=False, safe=True)
    if trace.silent:
        return _of_the_link(scenario, begin, safe)
    return Cause(f"{begin}: {safe.text}", by_machine=False, safe=True)


def _of_the_link(scenario: Resolved, begin: str, safe: Happening) -> Cause:
    """Nothing came though both were on time: what joins them on one machine only waits for it."""
    what = "sample" if safe.source == "controller" else "answer"
    on_bus = scenario.link.kind == "can"
    how = "was lost on the bus" if on_bus else "came too late: the machine did not carry it in time"
    by_machine = not on_bus and scenario.loop.clock == "realtime"
    if scenario.loop.clock == "lockstep":
        how = "was lost"
    return Cause(f"{begin}: the {what} {how}", by_machine, safe=True)


def _worst_before(t_ns: int, stalls: Sequence[Stall]) -> Stall | None:
    """Return the longest stall that was going on in the last strokes before an instant."""
    near = [s for s in stalls if s.t_ns <= t_ns and s.end_ns >= t_ns - _BEFORE_NS]
    return max(near, key=lambda stall: stall.late_ns, default=None)


def _machine_told(stall: Stall) -> str:
    where = f"{stall.process}, tick {stall.tick}"
    return f"the machine was {stall.late_ns * 1e-6:.0f} ms late ({where})"


class _TwoProcesses:
    """Whether a process was held up by the machine, and not by what it does.

    Nobody who waits for his time or a sample is late by himself, and what the plant does is no
    part of what is judged. Long work is the machine's if the process was not run meanwhile, was
    stopped, or if the other one stalled with it.
    """

    def __init__(self, stalls: Sequence[Stall], processes: Mapping[str, Any]) -> None:
        self._stalls = stalls
        self._processes = processes

    def is_machines(self, stall: Stall) -> bool:
        """Judge one stall."""
        if not stall.working or stall.process == "plant":
            return True
        return self._with(stall) is not None or self._was_held(stall, stall.process)

    def _with(self, stall: Stall) -> Stall | None:
        """Return the stall of the other process that ended with this one."""
        together = (
            other
            for other in self._stalls
            if other.process != stall.process
            and other.late_ns >= NOTED_NS
            and abs(other.end_ns - stall.end_ns) <= _TOGETHER_NS
        )
        return next(together, None)

    def _was_held(self, stall: Stall, process: str) -> bool:
        """Whether the kernel did not run the process for most of it."""
        return any(
            window["from_s"] * 1e9 <= stall.end_ns
            and stall.t_ns <= window["to_s"] * 1e9
            and (window["stopped"] or window["waited_s"] * 1e9 >= 0.5 * stall.late_ns)
            for window in self._processes.get(process, {}).get("held", ())
        )


class _SharedThread(_TwoProcesses):
    """The same where the controller's turn is part of the plant's: its work stalls both."""

    def is_machines(self, stall: Stall) -> bool:
        """Judge one stall."""
        own = stall if stall.process == "controller" else self._with(stall)
        return own is None or not own.working or self._was_held(own, "loop")
