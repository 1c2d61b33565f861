"""The operating mode and the combustion that is being judged, from tick to tick."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, final

from mypy_extensions import i64

from controller.mode.start_restart import GENERATING, MOTORING, Facts, Mode, next_mode
from controller.observe.estimate import Observation
from controller.observe.symptoms import SLOW
from hil.values import Value, replace
from hil.wire.messages import UNHEARD_SAFE

MISFIRE_CHECK_FRACTION: Final = 0.25
"""Part of a stroke after which the piston's speed tells whether the charge has burnt."""

MISFIRE_LATEST_FRACTION: Final = 0.5
"""Part of a stroke after which it does not any more."""

REST_SPEED_M_S: Final = 2e-3
REST_POSITION_M: Final = 2e-3


@final
class Bounds(Value):
    """The most that is borne: position, ticks without a sample, misfires in a row, motoring.

    unheard_ns: after so long in a mode the plant must have taken an answer
    """

    __slots__ = ("limit_m", "stale_ticks", "misfires", "motoring_ns", "unheard_ns")

    def __init__(
        self, limit_m: float, stale_ticks: i64, misfires: i64, motoring_ns: i64,
        unheard_ns: i64 = 10_000_000,
    ) -> None:  # fmt: skip
        self.limit_m = limit_m
        self.stale_ticks = stale_ticks
        self.misfires = misfires
        self.motoring_ns = motoring_ns
        self.unheard_ns = unheard_ns

    def excludes(self, x_m: float) -> bool:
        """Whether the piston must not be there."""
        return abs(x_m) > self.limit_m


@final
class Operation(Value):
    """The mode, since when, and the combustions of the engine.

    fired_t_ns: dead centre of a combustion that is still to be judged, -1 none
    fired_strokes: since the start or restart; misfires: in a row, and of each side in a row
    verdict: on the last combustion, by the motion: -1 none yet, 0 burnt, 1 misfired
    """

    __slots__ = (
        "mode", "since_t_ns", "fired_t_ns", "fired_strokes", "misfires", "misfires_left",
        "misfires_right", "verdict",
    )  # fmt: skip

    def __init__(
        self, mode: Mode, since_t_ns: i64 = 0, fired_t_ns: i64 = -1, fired_strokes: i64 = 0,
        misfires: i64 = 0, misfires_left: i64 = 0, misfires_right: i64 = 0, verdict: i64 = -1,
    ) -> None:  # fmt: skip
        self.mode = mode
        self.since_t_ns = since_t_ns
        self.fired_t_ns = fired_t_ns
        self.fired_strokes = fired_strokes
        self.misfires = misfires
        self.misfires_left = misfires_left
        self.misfires_right = misfires_right
        self.verdict = verdict

    def judged(self, misfired: bool, side: i64) -> Operation:
        """The operation after its combustion on that side has been judged."""
        one = (self.misfires_left if side == 0 else self.misfires_right) + 1 if misfired else 0
        return Operation(
            self.mode, self.since_t_ns, -1, self.fired_strokes,
            self.misfires + 1 if misfired else 0, one if side == 0 else self.misfires_left,
            self.misfires_right if side == 0 else one, 1 if misfired else 0,
        )  # fmt: skip

    def entered(self, mode: Mode, t_ns: i64) -> Operation:
        """The operation in another mode: one combustion begins it, or none is judged any more."""
        if mode is GENERATING:
            return replace(self, mode=mode, since_t_ns=t_ns, fired_strokes=1)
        if mode is MOTORING:
            return replace(self, mode=mode, since_t_ns=t_ns)
        return Operation(mode, t_ns, -1, self.fired_strokes)


def is_uneventful(bounds: Bounds, operation: Operation, seen: Observation, stroke_s: float) -> bool:
    """Whether no rule can apply: most ticks of a running engine, told by a few comparisons."""
    return (
        operation.mode is GENERATING
        and seen.stale == 0
        and seen.fault == 0
        and seen.unheard != UNHEARD_SAFE
        and not seen.passed.dead_centre
        and (operation.fired_t_ns < 0 or not _is_check_due(operation, seen, stroke_s))
        and operation.misfires_left < bounds.misfires
        and operation.misfires_right < bounds.misfires
        and operation.misfires < bounds.misfires
        and -bounds.limit_m <= seen.motion.x_m <= bounds.limit_m
    )


def decide(
    bounds: Bounds, operation: Operation, seen: Observation, request: str, *, fuel_kg: float,
    stroke_s: float, has_misfired: Callable[[], bool],
) -> tuple[Operation, str]:  # fmt: skip
    """Judge the combustion, apply the mode table.

    Parameters: request : kind of the operator's command, "" for none; fuel_kg : planned for the
    dead centre of this tick, if it has one
    Returns: the operation from now on, and the name of the rule that has changed the mode, or ""
    """
    fired, misfired = seen.passed.dead_centre and fuel_kg > 0.0, False
    if fired:  # a combustion whose dead centre was not seen is not judged
        fired_t_ns = seen.motion.dc_t_ns if seen.whole else -1
        operation = replace(
            operation, fired_t_ns=fired_t_ns, fired_strokes=operation.fired_strokes + 1, verdict=-1
        )
    elif operation.fired_t_ns >= 0 and _is_check_too_late(operation, seen, stroke_s):
        operation = replace(operation, fired_t_ns=-1)
    elif operation.fired_t_ns >= 0 and seen.stale == 0 and _is_check_due(operation, seen, stroke_s):
        misfired = has_misfired()
        operation = operation.judged(misfired, seen.motion.side)
    facts = _facts(bounds, operation, seen, request, fired, misfired)
    mode, rule = next_mode(operation.mode, facts)
    return (operation.entered(mode, seen.t_ns) if rule else operation), rule


def _facts(
    bounds: Bounds, operation: Operation, seen: Observation, request: str, fired: bool,
    misfired: bool,
) -> Facts:  # fmt: skip
    """What the mode table looks at."""
    motion = seen.motion
    return Facts(
        start_requested=request == "start",
        stop_requested=request == "stop",
        emergency=request == "emergency-stop",
        sample_stale=seen.stale >= bounds.stale_ticks,
        fault=seen.fault,
        unheard=seen.unheard == UNHEARD_SAFE
        and seen.t_ns - operation.since_t_ns > bounds.unheard_ns,
        beyond_limit=bounds.excludes(motion.tdc_m if seen.passed.dead_centre else motion.x_m),
        fired=fired,
        misfired=misfired,
        left_dead=operation.misfires_left >= bounds.misfires,
        right_dead=operation.misfires_right >= bounds.misfires,
        misfires_exhausted=operation.misfires >= bounds.misfires,
        motoring_too_long=seen.t_ns - operation.since_t_ns > bounds.motoring_ns,
        at_rest=abs(motion.v_m_s) < REST_SPEED_M_S and abs(motion.x_m) < REST_POSITION_M,
    )


def _is_check_too_late(operation: Operation, seen: Observation, stroke_s: float) -> bool:
    """Whether so much of the stroke has passed unseen that its speed tells nothing any more."""
    since_ns = float(seen.t_ns - operation.fired_t_ns)
    return since_ns > MISFIRE_LATEST_FRACTION * (stroke_s * 1e9)


def _is_check_due(operation: Operation, seen: Observation, stroke_s: float) -> bool:
    """Whether enough of the stroke has passed to tell combustion from misfire.

    A piston that does not even follow its air spring tells of its sensor, not of the charge.
    """
    if abs(seen.motion.v_m_s) < SLOW * seen.motion.v_mid_m_s:
        return False
    since_ns = float(seen.t_ns - operation.fired_t_ns)
    return since_ns >= MISFIRE_CHECK_FRACTION * (stroke_s * 1e9)
