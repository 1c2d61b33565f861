"""What the engine delivers at which dead centre and load: by a map, or by the closed form.

Either is scaled so that it meets the preset, which is the steady state of the plant's own model;
from there it says how fuel, speed and power move.
"""

from __future__ import annotations

from typing import Final, final

from controller.knowledge import OperatingPoint, fuel_per_speed, load_for_power, steady
from controller.supervision.air import LEAST_THROTTLE, Air
from hil.config.controller import ControllerConfig
from hil.config.prototypes import Prototype
from hil.config.supervisory.performance import PerformanceMap
from hil.roots import bisect
from hil.values import Value

LOAD_MAX_N_S_M: Final = 10_000.0
"""What the wire carries at the most."""

_TO_LIMIT: Final = 1e-9


@final
class Steady(Value):
    """Steady running: fuel a stroke, speed at mid-stroke, duration of a stroke, mean power."""

    __slots__ = ("fuel_kg", "v_mid_m_s", "stroke_s", "power_w")

    def __init__(self, fuel_kg: float, v_mid_m_s: float, stroke_s: float, power_w: float) -> None:
        self.fuel_kg = fuel_kg
        self.v_mid_m_s = v_mid_m_s
        self.stroke_s = stroke_s
        self.power_w = power_w


@final
class SteadyLimits:
    """What bounds steady running from above: fuel, air, the time to inject, the machine's force."""

    def __init__(self, config: ControllerConfig, engine: Prototype, period_s: float) -> None:
        timing, injector = config.timing, config.injector
        self._force_n = config.limits.force_n
        self._air = Air(config, engine)
        self._share = 1.0 - config.supervisory.fuel_reserve
        self._flow_kg_s = injector.static_flow_kg_s
        lead_s = timing.injection_lead_ticks * period_s
        self._lost_s = lead_s + timing.injection_margin_s + injector.dead_time_s

    def tightest(self, here: Steady, load_n_s_m: float, throttle: float) -> tuple[float, str]:
        """What is closest to its limit, or furthest beyond it: as a share of it, and its name.

        An injection has the time from mid-stroke to its margin before the dead centre.
        """
        air = self._air
        if air.lambda_ref is not None:
            throttle = 1.0  # it opens as far as it must
        fuel_kg = self._share * air.most_kg(throttle, throttle * air.full_pa)
        flows_kg = max(0.5 * here.stroke_s - self._lost_s, 0.0) * self._flow_kg_s
        force = load_n_s_m * here.v_mid_m_s / self._force_n
        fuel = here.fuel_kg / min(fuel_kg, max(flows_kg, 1e-12))
        if force > fuel:
            return force, f"limits.force_n, {self._force_n:g} N"
        if flows_kg < fuel_kg:
            return fuel, f"the time to inject at this speed, for {flows_kg * 1e6:.3g} mg"
        what = "the air of a charge" if air.limits else "limits.fuel_max_kg"
        return fuel, f"{what}: throttle and reserve leave {fuel_kg * 1e6:.3g} mg"

    def throttle_for(self, fuel_kg: float) -> float:
        """The least opening that admits a fuel and its reserve."""
        air = self._air
        most_kg = self._share * air.most_kg(1.0, air.full_pa)
        return min(max(fuel_kg / most_kg, LEAST_THROTTLE), 1.0)


@final
class Reach(Value):
    """The load [N s/m] that a power comes to, and the limit that has kept it from more or less."""

    __slots__ = ("load_n_s_m", "limit")

    def __init__(self, load_n_s_m: float, limit: str) -> None:
        self.load_n_s_m = load_n_s_m
        self.limit = limit


@final
class Curve:
    """One row of a map: figures over the load, straight between its points and beyond."""

    def __init__(self, given: PerformanceMap, row: int) -> None:
        self.tdc_m = given.tdc_m[row]
        self.ends = given.ends[row]
        self.load = list(given.load_n_s_m[row])
        self.power = list(given.power_w[row])
        self.fuel = list(given.fuel_kg[row])
        self.v_mid = list(given.v_mid_m_s[row])
        self.stroke = list(given.stroke_s[row])
        self.efficiency = list(given.efficiency[row])
        self.throttle = list(given.throttle[row])

    def at(self, load: float) -> Steady:
        """Steady running at a load [N s/m]."""
        x = self.load
        return Steady(
            _on(x, self.fuel, load), _on(x, self.v_mid, load), _on(x, self.stroke, load),
            _on(x, self.power, load),
        )  # fmt: skip

    def load_for(self, power_w: float) -> float:
        """Load that delivers a power [N s/m]."""
        return max(_on(self.power, self.load, power_w), 0.0)

    def delivers(self, power_w: float) -> bool:
        """Whether a power lies within the row."""
        return self.power[0] <= power_w <= self.power[-1]


def _on(xs: list[float], ys: list[float], x: float) -> float:
    """Straight line through the two points about x, or nearest to it."""
    i = 1
    while i < len(xs) - 1 and xs[i] < x:
        i += 1
    share = (x - xs[i - 1]) / (xs[i] - xs[i - 1])
    return ys[i - 1] + share * (ys[i] - ys[i - 1])


@final
class Performance:
    """What is known of one engine's steady running, for one configuration.

    Parameters: begun : with which the run began and which the preset belongs to, if another one
    """

    def __init__(
        self, config: ControllerConfig, engine: Prototype, period_s: float,
        begun: ControllerConfig | None = None,
    ) -> None:  # fmt: skip
        begun = begun or config
        self._engine = engine
        self._curves = _curves_of(config.supervisory.map)
        self._preset = begun.preset
        self._fuel_min_kg = config.limits.fuel_min_kg
        self._limits = SteadyLimits(config, engine, period_s)
        self.tdc_m = begun.tdc_ref_m or engine.tdc_ref_m
        self.load_n_s_m = self._start_load(begun)
        self._start = self._base(self.tdc_m, self.load_n_s_m)

    def _start_load(self, config: ControllerConfig) -> float:
        """Load of the preset: where it says nothing, by the target power as it is [N s/m]."""
        power_w, given = config.supervisory.target_power_w, config.preset.load_coefficient_n_s_m
        if given is not None:
            return given
        if power_w is not None:
            return min(self._base_load(self.tdc_m, power_w), LOAD_MAX_N_S_M)
        return nominal_load(config, self._engine)

    def point(self, tdc_m: float, load_n_s_m: float) -> OperatingPoint:
        """Steady state about which the laws work."""
        here, slope = self.steady(tdc_m, load_n_s_m), self._preset.fuel_per_speed_kg_s_m
        if slope is None:
            slope = fuel_per_speed(self._engine, tdc_m, load_n_s_m)
        return OperatingPoint(here.fuel_kg, here.v_mid_m_s, here.stroke_s, slope)

    def steady(self, tdc_m: float, load_n_s_m: float) -> Steady:
        """Steady running, as it is at the preset and moves from there."""
        preset, start, here = self._preset, self._start, self._base(tdc_m, load_n_s_m)
        fuel, v_mid, stroke = preset.fuel_kg, preset.v_mid_m_s, preset.stroke_s
        return Steady(
            here.fuel_kg if fuel is None else fuel * _ratio(here.fuel_kg, start.fuel_kg),
            here.v_mid_m_s if v_mid is None else v_mid * here.v_mid_m_s / start.v_mid_m_s,
            here.stroke_s if stroke is None else stroke * here.stroke_s / start.stroke_s,
            here.power_w * self._power_scale(),
        )

    def reach(self, tdc_m: float, power_w: float, throttle: float) -> Reach:
        """Load for a power, or the nearest to it that no limit forbids."""
        wanted = self._base_load(tdc_m, power_w / self._power_scale())
        least, below = self._least_load(tdc_m)
        if wanted < least:
            return Reach(least, below)
        high, beyond = self._row_end(tdc_m)
        high = min(high, wanted)
        if self._room(tdc_m, high, throttle) >= -_TO_LIMIT:
            return Reach(high, beyond if wanted > high * (1.0 + _TO_LIMIT) else "")
        most = bisect(lambda load: self._room(tdc_m, load, throttle), 0.0, high)
        return Reach(most, self._limits.tightest(self.steady(tdc_m, most), most, throttle)[1])

    def at_start(self, power_w: float, throttle: float) -> Reach:
        """Load that the preset has for a target power: its own model's figure, or its limit."""
        preset = self._preset
        if preset.load_coefficient_n_s_m is None or preset.power_w is None:
            return self.reach(self.tdc_m, power_w, throttle)
        return Reach(self.load_n_s_m, preset.limit)

    def best(self, power_w: float) -> tuple[float, float]:
        """Dead centre [m] and throttle of the row that delivers a power with the least fuel.

        Of a power outside the map, those of the row that comes nearest to it.
        """
        power_w /= self._power_scale()
        chosen, most = self._curves[0], -1.0
        for curve in self._curves:
            if curve.delivers(power_w):
                efficiency = _on(curve.power, curve.efficiency, power_w)
                if efficiency > most:
                    chosen, most = curve, efficiency
            elif most < 0.0 and _outside(curve, power_w) < _outside(chosen, power_w):
                chosen = curve
        return chosen.tdc_m, min(max(_on(chosen.power, chosen.throttle, power_w), 0.01), 1.0)

    def _base(self, tdc_m: float, load_n_s_m: float) -> Steady:
        """Steady running by map or closed form, as yet unscaled."""
        if not self._curves:
            fuel, v_mid, stroke = steady(self._engine, tdc_m, load_n_s_m)
            return Steady(fuel, v_mid, stroke, 0.5 * load_n_s_m * v_mid * v_mid)
        low, high, share = self._about(tdc_m)
        a, b, rest = low.at(load_n_s_m), high.at(load_n_s_m), 1.0 - share
        return Steady(
            rest * a.fuel_kg + share * b.fuel_kg, rest * a.v_mid_m_s + share * b.v_mid_m_s,
            rest * a.stroke_s + share * b.stroke_s, rest * a.power_w + share * b.power_w,
        )  # fmt: skip

    def _base_load(self, tdc_m: float, power_w: float) -> float:
        """Load for a power by map or closed form, as yet unscaled [N s/m]."""
        if not self._curves:
            return load_for_power(self._engine, tdc_m, power_w)
        low, high, share = self._about(tdc_m)
        return (1.0 - share) * low.load_for(power_w) + share * high.load_for(power_w)

    def _about(self, tdc_m: float) -> tuple[Curve, Curve, float]:
        """The rows about a dead centre, and how far it lies towards the second; none beyond."""
        low = high = self._curves[0]
        for curve in self._curves:
            low, high = high, curve
            if curve.tdc_m >= tdc_m:
                break
        width = high.tdc_m - low.tdc_m
        share = (tdc_m - low.tdc_m) / width if width > 0.0 else 0.0
        return low, high, min(max(share, 0.0), 1.0)

    def _power_scale(self) -> float:
        """Power of the preset as a share of what map or closed form say there."""
        power_w, base_w = self._preset.power_w, self._start.power_w
        return 1.0 if power_w is None or power_w * base_w <= 0.0 else power_w / base_w

    def _row_end(self, tdc_m: float) -> tuple[float, str]:
        """The last load of the map, and why it is [N s/m]."""
        if not self._curves:
            return LOAD_MAX_N_S_M, f"the load that can be commanded, {LOAD_MAX_N_S_M:g} N s/m"
        low, high, share = self._about(tdc_m)
        end = (1.0 - share) * low.load[-1] + share * high.load[-1]
        return end, f"supervisory.map: {(low if share < 0.5 else high).ends}"

    def _least_load(self, tdc_m: float) -> tuple[float, str]:
        """The least load at which the dead centre can be held [N s/m], and why."""
        if self._curves:
            low, high, share = self._about(tdc_m)
            least = (1.0 - share) * low.load[0] + share * high.load[0]
            return least, "supervisory.map: its first load"
        least_kg = self._fuel_min_kg

        def lacking(load: float) -> float:
            return least_kg - self.steady(tdc_m, load).fuel_kg

        least = bisect(lacking, 0.0, LOAD_MAX_N_S_M)
        return least, f"limits.fuel_min_kg, {least_kg * 1e6:g} mg"

    def _room(self, tdc_m: float, load_n_s_m: float, throttle: float) -> float:
        """By what share the tightest limit is kept."""
        return 1.0 - self._limits.tightest(self.steady(tdc_m, load_n_s_m), load_n_s_m, throttle)[0]


def _curves_of(given: PerformanceMap | None) -> list[Curve]:
    return [] if given is None else [Curve(given, row) for row in range(len(given.tdc_m))]


def _outside(curve: Curve, power_w: float) -> float:
    """How far a power lies outside a row [W]."""
    return max(curve.power[0] - power_w, power_w - curve.power[-1], 0.0)


def _ratio(here: float, start: float) -> float:
    """Quotient of two fuels; both are zero without a load."""
    return here / start if start > 0.0 else 1.0


def nominal_load(config: ControllerConfig, engine: Prototype) -> float:
    """Load coefficient without a target power [N s/m]."""
    configured = config.supervisory.load_coefficient_n_s_m
    return engine.load_coefficient_n_s_m if configured is None else configured


def full_load(config: ControllerConfig, engine: Prototype) -> float:
    """Load coefficient of the safe state: the machine brakes as hard as in nominal use [N s/m]."""
    return max(nominal_load(config, engine), engine.load_coefficient_n_s_m)
