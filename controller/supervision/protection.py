"""Protection: what is measured of pressure, speed and temperature against its limits.

Up to a share of a limit nothing happens. Beyond it load, fuel or spark is taken back by an
integral,  off += g (value / level - 1)  once a stroke, which gives back by itself; beyond the limit
the engine goes to its safe state.
"""

from __future__ import annotations

from typing import Final, final

from mypy_extensions import i64

from controller.observe.cylinder import compression_pa, knock_w_m2
from controller.observe.plausibility import HOT, KNOCKS, OVERSPEED, PEAK, PRESSURELESS
from hil.config.controller import ControllerConfig
from hil.config.prototypes import Prototype
from hil.values import Value
from hil.wire.messages import CylinderPeak

UNJUDGED: Final = -1
BURNT: Final = 0
MISFIRED: Final = 1

DERATING: Final = "derating"
DERATING_OVER: Final = "derating-over"
NO_PRESSURE: Final = "misfire-by-pressure"
CONTRADICTION: Final = "pressure-contradicts-motion"

Events = tuple[tuple[str, str], ...]
_SIDES: Final = ("left", "right")
_QUIET: Final[Events] = ()
_OUT_OF_REACH: Final = 1e30


@final
class Combustion(Value):
    """The last dead centre of a side: its charge, where it was, and what the motion has told."""

    __slots__ = ("fuel_kg", "tdc_m", "verdict")

    def __init__(self, fuel_kg: float = 0.0, tdc_m: float = 0.0, verdict: i64 = UNJUDGED) -> None:
        self.fuel_kg = fuel_kg
        self.tdc_m = tdc_m
        self.verdict = verdict


@final
class Excess(Value):
    """One limit: the share taken back for it, and the strokes in a row that were beyond it."""

    __slots__ = ("off", "beyond")

    def __init__(self, off: float = 0.0, beyond: i64 = 0) -> None:
        self.off = off
        self.beyond = beyond


_NONE: Final = Excess()
_UNFIRED: Final = Combustion()


@final
class Protection(Value):
    """What is remembered of the limits.

    silent: cycles of a side in a row whose charge has not burnt by their pressure
    trip: by which fault the engine is to go to its safe state, nought by none
    """

    __slots__ = (
        "peak", "knock", "speed", "winding", "left", "right", "silent_left", "silent_right", "trip",
    )  # fmt: skip

    def __init__(
        self, peak: Excess = _NONE, knock: Excess = _NONE, speed: Excess = _NONE,
        winding: Excess = _NONE, left: Combustion = _UNFIRED, right: Combustion = _UNFIRED,
        silent_left: i64 = 0, silent_right: i64 = 0, trip: i64 = 0,
    ) -> None:  # fmt: skip
        self.peak = peak
        self.knock = knock
        self.speed = speed
        self.winding = winding
        self.left = left
        self.right = right
        self.silent_left = silent_left
        self.silent_right = silent_right
        self.trip = trip


UNTOUCHED: Final = Protection()


@final
class CycleReport(Value):
    """A cylinder's cycle for the log: as heard, and what it was worth.

    verdict: BURNT, MISFIRED or UNJUDGED, by its pressure
    """

    __slots__ = ("peak", "knock_w_m2", "verdict", "load_share", "fuel_share", "retard_m")

    def __init__(
        self, peak: CylinderPeak, knock_w_m2: float, verdict: i64, load_share: float,
        fuel_share: float, retard_m: float,
    ) -> None:  # fmt: skip
        self.peak = peak
        self.knock_w_m2 = knock_w_m2
        self.verdict = verdict
        self.load_share = load_share
        self.fuel_share = fuel_share
        self.retard_m = retard_m


@final
class Limit:
    """One limit in one unit; without one nothing is beyond it."""

    def __init__(self, most: float | None, fault: i64, name: str, unit: str, factor: float) -> None:
        self.most = _OUT_OF_REACH if most is None else most
        self.fault = fault
        self.name = name
        self.unit = unit
        self.factor = factor

    def text(self, value: float, lever: str) -> str:
        """What is told of a value that is too large."""
        value, most = value * self.factor, self.most * self.factor
        return f"{self.name} {value:.4g} {self.unit}, limit {most:.4g}: {lever} taken back"


@final
class Guard:
    """The protection by one configuration; what changes is a `Protection`."""

    def __init__(self, config: ControllerConfig, engine: Prototype) -> None:
        given = config.protection
        self._engine = engine
        self._peak = Limit(given.peak_pa, PEAK, "peak pressure", "bar", 1e-5)
        self._knock = Limit(given.knock_w_m2, KNOCKS, "knock", "MW/m2", 1e-6)
        self._speed = Limit(given.speed_hz, OVERSPEED, "speed", "Hz", 1.0)
        self._winding = Limit(given.winding_k, HOT, "winding", "K", 1.0)
        self._fired_ratio = given.fired_ratio
        self._derate_at, self._gain, self._most = given.derate_at, given.gain, given.most
        self._patience: i64 = given.patience
        self._misfires: i64 = config.limits.misfires
        self._retards = config.timing.spark_position_m is not None
        self._retard_m = given.retard_m
        limits = (given.peak_pa, given.knock_w_m2, given.speed_hz, given.winding_k)
        self.is_on = given.fired_ratio is not None or any(limit is not None for limit in limits)

    def load_share(self, p: Protection) -> float:
        """Share of the load that is left."""
        off = max(p.peak.off, p.winding.off)
        return 1.0 - (off if self._retards else max(off, p.knock.off))

    def fuel_share(self, p: Protection) -> float:
        """Share of the steady fuel beyond which none is given; 1 is no limit."""
        return 1.0 - p.speed.off

    def retard_m(self, p: Protection) -> float:
        """How much nearer to the head the spark is."""
        return self._retard_m * p.knock.off / self._most if self._retards and p.knock.off else 0.0

    def ended(
        self, p: Protection, side: i64, fired: Combustion, verdict: i64, lasted_s: float
    ) -> tuple[Protection, Events]:
        """A stroke has ended at a side with a charge.

        Parameters: verdict : of the motion on the other side's charge; lasted_s : the stroke
        """
        left = fired if side == 0 else Combustion(p.left.fuel_kg, p.left.tdc_m, verdict)
        right = Combustion(p.right.fuel_kg, p.right.tdc_m, verdict) if side == 0 else fired
        speed, trip, events = p.speed, p.trip, _QUIET
        if lasted_s > 0.0:
            speed, trip, events = self._held(self._speed, p.speed, 0.5 / lasted_s, trip, "fuel")
        return Protection(
            p.peak, p.knock, speed, p.winding, left, right, p.silent_left, p.silent_right, trip
        ), events  # fmt: skip

    def warmed(self, p: Protection, winding_k: float) -> tuple[Protection, Events]:
        """The winding's temperature has been told."""
        winding, trip, events = self._held(self._winding, p.winding, winding_k, p.trip, "load")
        return Protection(
            p.peak, p.knock, p.speed, winding, p.left, p.right, p.silent_left, p.silent_right, trip
        ), events  # fmt: skip

    def heard(self, p: Protection, peak: CylinderPeak) -> tuple[Protection, CycleReport, Events]:
        """A cylinder's cycle has been told."""
        index = knock_w_m2(self._engine, peak)
        lever = "advance of the spark" if self._retards else "load"
        pressure, trip, told = self._held(self._peak, p.peak, peak.p_peak_pa, p.trip, "load")
        knock, trip, more = self._held(self._knock, p.knock, index, trip, lever)
        verdict = self._verdict(p, peak)
        silent, events = self._silence(p, peak, verdict)
        if silent >= self._misfires:
            trip = PRESSURELESS
        is_left = peak.side == 0
        after = Protection(
            pressure, knock, p.speed, p.winding, p.left, p.right,
            silent if is_left else p.silent_left, p.silent_right if is_left else silent, trip,
        )  # fmt: skip
        report = CycleReport(
            peak, index, verdict, self.load_share(after), self.fuel_share(after),
            self.retard_m(after),
        )  # fmt: skip
        return after, report, (*told, *more, *events)

    def _held(
        self, limit: Limit, excess: Excess, value: float, trip: i64, lever: str
    ) -> tuple[Excess, i64, Events]:
        """Hold a value against its limit; returns also the fault that it is, and what to tell."""
        step = self._gain * (value / (self._derate_at * limit.most) - 1.0)
        off = min(max(excess.off + step, 0.0), self._most)
        beyond: i64 = excess.beyond + 1 if value > limit.most else 0
        if beyond >= self._patience:
            trip = limit.fault
        events: Events = ()
        if off > 0.0 and excess.off == 0.0:
            events = ((DERATING, limit.text(value, lever)),)
        elif off == 0.0 and excess.off > 0.0:
            events = ((DERATING_OVER, f"{limit.name}: {lever} given back"),)
        if off == excess.off and beyond == excess.beyond:
            return excess, trip, events
        return Excess(off, beyond), trip, events

    def _verdict(self, p: Protection, peak: CylinderPeak) -> i64:
        """Whether a charge has burnt, by its peak over that of the compression alone."""
        fired = p.left if peak.side == 0 else p.right
        if self._fired_ratio is None or fired.fuel_kg <= 0.0:
            return UNJUDGED
        least_pa = self._fired_ratio * compression_pa(self._engine, peak.side, fired.tdc_m)
        return BURNT if peak.p_peak_pa >= least_pa else MISFIRED

    def _silence(self, p: Protection, peak: CylinderPeak, verdict: i64) -> tuple[i64, Events]:
        """Count what has not burnt; what motion and pressure tell otherwise of is only told."""
        fired, silent = (p.left, p.silent_left) if peak.side == 0 else (p.right, p.silent_right)
        if verdict == UNJUDGED:
            return silent, ()
        bar = f"{_SIDES[peak.side]}: peak {peak.p_peak_pa * 1e-5:.1f} bar"
        if fired.verdict not in (UNJUDGED, verdict):
            said = "burnt" if fired.verdict == BURNT else "misfired"
            return silent, ((CONTRADICTION, f"{bar}, by its motion the charge has {said}"),)
        if verdict == BURNT:
            return 0, ()
        return silent + 1, ((NO_PRESSURE, f"{bar}, the charge has not burnt"),)
