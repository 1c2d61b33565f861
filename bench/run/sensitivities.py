"""The sensitivities of a settled engine, found by disturbing it in the loop, whatever engine it is.

Steps of fuel and of load up and down by `CHANGE`, in open loop at a high rate; half their
difference, by the step, is a derivative. A step of the fuel shows in the ends of the next strokes,

e_1 = r,  e_2 = a e_1 + b + r,  e_3 = a e_2 + b + r    so that  a = (e_3 - e_2) / (e_2 - e_1),

r being what a charge does to the stroke in which it is lit. A step of the load at each of
`FRACTIONS` of a stroke shows what the rest of the stroke makes of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

from bench.progress import Advance, counted, unseen
from bench.run.offline import Course, simulate
from controller.motion.laws import LAWS
from hil.config.check import check
from hil.config.motion.stroke_map import Effects, SensitivitiesConfig, Stations
from hil.config.plant import SensorConfig
from hil.config.resolved import Resolved
from hil.errors import ConfigError

if TYPE_CHECKING:
    import numpy as np

    Array = np.ndarray[Any, np.dtype[np.float64]]

CHANGE = 0.01
"""Step of fuel and of load, as a share."""

RATE_HZ = 5000
STATIONS = 40
FRACTIONS = tuple(i / 12.0 for i in range(12))
_SLOWEST = 0.15
"""Share of the greatest speed from which on a place of the stroke is a station."""
_TELLING = 0.1
"""Share of the largest deviation of the speed from which on one tells what speed does."""
_LONG, _SHORT = 5.5, 2.5
"""Strokes of a run whose course is needed, and of one of which a stroke is."""


class _Stroke(NamedTuple):
    """One whole stroke in its direction: samples from its dead centre on, end and duration."""

    t_s: Array
    z_m: Array
    v_m_s: Array
    a_m_s2: Array
    end_m: float
    lasts_s: float

    def energy_at(self, z_m: Array) -> Array:
        """v^2 / 2 by place: the cubic of values and slopes, the slope of which is v'."""
        return _hermite(z_m, self.z_m, 0.5 * self.v_m_s**2, self.a_m_s2)

    def time_at(self, z_m: Array) -> Array:
        """Time since the dead centre by place."""
        return _hermite(z_m, self.z_m, self.t_s, 1.0 / self.v_m_s)


class _Pair(NamedTuple):
    """Strokes after a step up and after the same down; each figure is the derivative."""

    up: list[_Stroke]
    down: list[_Stroke]

    def end_m(self, k: int) -> float:
        """Of the dead centre that ends stroke k."""
        return (self.up[k].end_m - self.down[k].end_m) / (2.0 * CHANGE)

    def lasts_s(self, k: int) -> float:
        """Of its duration."""
        return (self.up[k].lasts_s - self.down[k].lasts_s) / (2.0 * CHANGE)

    def speed(self, k: int, z_m: Array, v_m_s: Array) -> Array:
        """Of its speed at places where it ordinarily is v."""
        up, down = self.up[k].energy_at(z_m), self.down[k].energy_at(z_m)
        gained: Array = (up - down) / (2.0 * CHANGE * v_m_s)
        return gained

    def time_s(self, k: int, z_m: Array) -> Array:
        """Of the time at which it is there."""
        gained: Array = (self.up[k].time_at(z_m) - self.down[k].time_at(z_m)) / (2.0 * CHANGE)
        return gained


def believing(scenario: Resolved) -> Resolved:
    """Return the scenario with the sensitivities of its engine, where a law needs and lacks them.

    Raises: ConfigError when the engine does not run as it must for that
    """
    config = scenario.controller
    given = config.stroke_map
    if given.kind != "sensitivities" or given.sensitivities is not None or not _needed(scenario):
        return scenario
    tree = scenario.model_dump()
    tree["controller"]["stroke_map"]["sensitivities"] = identify(scenario).model_dump()
    return check(Resolved, tree, scenario.name)


def _needed(scenario: Resolved) -> bool:
    asked = [event.command.text("law") for event in scenario.events.values()]
    return any(LAWS[law].needs_map for law in (scenario.controller.name, *asked) if law)


def identify(scenario: Resolved, advance: Advance = unseen) -> SensitivitiesConfig:
    """Disturb the settled engine of a scenario, and read off how its strokes answer.

    `advance` is told of each of `FRACTIONS`. Raises: ConfigError when it does not keep running
    """
    import numpy as np

    config = scenario.controller
    load, fuel_kg = config.supervisory.load_coefficient_n_s_m, config.preset.fuel_kg
    base = _strokes(scenario, _LONG, {})[1]
    loads, fuels = _pair(scenario, _LONG, _load), _pair(scenario, _LONG, _fuel)
    late = [_pair(scenario, _SHORT, _load, part) for part in counted(FRACTIONS, advance)]
    mass_kg = scenario.plant.resolved_prototype().moving_mass_kg
    at_mid = np.zeros(1)
    v_mid = np.sqrt(2.0 * base.energy_at(at_mid))
    by_start = 1.0 / (fuels.end_m(2) - fuels.end_m(1))

    def effects(second: float, third: float, whole: float) -> Effects:
        """From what fuel does to the second and third stroke, and load to the first."""
        start = by_start * (third - second)
        return Effects(start=start, fuel=second - start * fuels.end_m(1), load=whole)

    def at_once(pair: _Pair, k: int) -> tuple[float, float]:
        return float(pair.speed(k, at_mid, v_mid)[0]), float(pair.time_s(k, at_mid)[0])

    mids = at_once(fuels, 2), at_once(fuels, 3), at_once(loads, 1)
    end = effects(fuels.end_m(2), fuels.end_m(3), loads.end_m(1))
    lit = fuels.end_m(1)
    if abs(lit) < 0.2 * abs(end.fuel):  # what a charge does before its dead centre is of the next
        end = end.model_copy(update={"fuel": end.fuel - lit})
    return SensitivitiesConfig(
        origin=_origin(scenario), tdc_m=base.end_m, fuel_kg=fuel_kg, load_n_s_m=load,
        mass_kg=mass_kg, stroke_s=base.lasts_s, v_mid_m_s=float(v_mid[0]),
        mid_s=float(base.time_at(at_mid)[0]), end=end,
        duration=effects(fuels.lasts_s(2), fuels.lasts_s(3), loads.lasts_s(1)),
        speed=effects(mids[0][0], mids[1][0], mids[2][0]),
        passing=effects(mids[0][1], mids[1][1], mids[2][1]),
        stations=_stations(base, loads, fuels, late, load / mass_kg),
    )  # fmt: skip


def _stations(
    base: _Stroke, loads: _Pair, fuels: _Pair, late: list[_Pair], damping: float
) -> Stations:
    """What a piston that is at a place has still before it, by speed, fuel and load."""
    import numpy as np

    fast = np.flatnonzero(base.v_m_s > _SLOWEST * base.v_m_s.max())
    chosen = fast[np.unique(np.linspace(0, len(fast) - 1, STATIONS).round().astype(int))]
    t, z, v, a = (part[chosen] for part in (base.t_s, base.z_m, base.v_m_s, base.a_m_s2))
    at = np.array([*FRACTIONS, 1.0]) * base.lasts_s
    end_by_load = _smooth(t, at, [pair.end_m(1) for pair in late])
    left_by_load = _smooth(t, at, [pair.lasts_s(1) for pair in late])
    by_load, by_fuel = loads.speed(1, z, v), fuels.speed(2, z, v)
    telling = np.abs(by_load) > _TELLING * np.abs(by_load).max()
    end_by_v = _told(telling, loads.end_m(1) - end_by_load, by_load)
    spent = loads.time_s(1, z)
    left_by_v = _told(telling, loads.lasts_s(1) - spent - left_by_load, by_load)
    end_by_fuel = fuels.end_m(2) - end_by_v * by_fuel
    left_by_fuel = fuels.lasts_s(2) - fuels.time_s(2, z) - left_by_v * by_fuel
    figures = {
        "z_m": z, "v_m_s": v, "left_s": base.lasts_s - t, "pull_m_s2": a + damping * v,
        "pull_by_fuel": np.gradient(v * by_fuel, z) + damping * by_fuel,
        "end_by_v": end_by_v, "end_by_fuel": end_by_fuel, "end_by_load": end_by_load,
        "left_by_v": left_by_v, "left_by_fuel": left_by_fuel, "left_by_load": left_by_load,
    }  # fmt: skip
    return Stations(**{name: tuple(map(float, row)) for name, row in figures.items()})


def _told(telling: Array, gained: Array, by_v: Array) -> Array:
    """The quotient where the speed deviates enough to tell; before that as where it first does."""
    import numpy as np

    quotient = gained / np.where(telling, by_v, 1.0)
    first = int(np.argmax(telling))
    told: Array = np.where(np.arange(len(telling)) < first, quotient[first], quotient)
    return told


def _smooth(t: Array, at: Array, figures: list[float]) -> Array:
    """Figures of load steps at these times, nought at the last, between them."""
    import numpy as np

    values = np.array([*figures, 0.0])
    return _hermite(t, at, values, np.gradient(values, at))


def _hermite(x: Array, xs: Array, ys: Array, slopes: Array) -> Array:
    """The piecewise cubic through values with slopes; held to the outermost pieces."""
    import numpy as np

    i = np.clip(np.searchsorted(xs, x) - 1, 0, len(xs) - 2)
    h = xs[i + 1] - xs[i]
    s = (x - xs[i]) / h
    r = 1.0 - s
    y: Array = r * r * ((1.0 + 2.0 * s) * ys[i] + s * h * slopes[i]) + s * s * (
        (1.0 + 2.0 * r) * ys[i + 1] - r * h * slopes[i + 1]
    )
    return y


def _load(share: float, fraction: float) -> Mapping[str, object]:
    return {"kind": "load-scale", "value": share, "at_stroke_fraction": fraction}


def _fuel(share: float, _fraction: float) -> Mapping[str, object]:
    """Efficiencies are at most 1: both steps are about one a little below it."""
    share /= 1.0 + CHANGE
    return {"kind": "efficiency", "low": share, "high": share}


def _pair(scenario: Resolved, strokes: float, event: Any, fraction: float = 0.0) -> _Pair:  # noqa: ANN401
    """Strokes after the event with a share above one, and with as much below."""
    up, down = (
        _strokes(scenario, strokes, event(1.0 + change, fraction)) for change in (CHANGE, -CHANGE)
    )
    return _Pair(up, down)


def _strokes(scenario: Resolved, strokes: float, event: Mapping[str, object]) -> list[_Stroke]:
    """Run in open loop; the whole strokes from the first dead centre that was seen on.

    Stroke 0 is as settled, an event that comes up in it is due in stroke 1.

    Raises: ConfigError when the engine does not keep running
    """
    run = _open_loop(scenario, strokes, event)
    course = simulate(run)
    ends = [dc for dc in course.dead_centres if dc.number > 0]
    if len(ends) < int(strokes) or any(event.code != "disturbance" for event in course.events):
        raise ConfigError(
            f"{scenario.name}: controller.stroke_map: the engine does not run by itself on"
            f" {run.controller.open_loop.fuel_kg} kg, so that its sensitivities cannot be found"
        )
    before = [(0.0, -ends[0].x_m), *((dc.t_ns * 1e-9, dc.x_m) for dc in ends)]
    dt = run.loop.period_ns * 1e-9
    return [_cut(course, dt, begun, ended) for begun, ended in pairwise(before)]


def _cut(
    course: Course, dt: float, begun: tuple[float, float], ended: tuple[float, float]
) -> _Stroke:  # fmt: skip
    """The stroke between two dead centres, given as (time, position)."""
    import numpy as np

    first, last = int(begun[0] / dt) + 2, int(ended[0] / dt) - 1
    way = 1.0 if begun[1] < 0.0 else -1.0
    rows = slice(first - 1, last + 2)
    x, v = way * np.array(course.x_m[rows]), way * np.array(course.v_m_s[rows])
    t: Array = np.arange(first, last + 1, dtype=np.float64) * dt - begun[0]
    a = (v[2:] - v[:-2]) / (2.0 * dt)
    return _Stroke(t, x[1:-1], v[1:-1], a, abs(ended[1]), ended[0] - begun[0])


def _open_loop(scenario: Resolved, strokes: float, event: Mapping[str, object]) -> Resolved:
    """The scenario's engine on the settled fuel, alone but for one event."""
    tree = scenario.model_dump()
    control = tree["controller"]
    control["name"] = "open-loop"
    control["open_loop"]["fuel_kg"] = control["preset"]["fuel_kg"]
    in_first_s = 0.5 * control["preset"]["stroke_s"]
    tree["events"] = {"step": {**event, "at_s": in_first_s}} if event else {}
    tree["expect"] = {}
    tree["begins"] = "settled"
    control["running"] = True
    _make_ideal(tree["plant"])
    tree["loop"] |= {"rate_hz": RATE_HZ, "clock": "lockstep"}
    tree["run"]["duration_s"] = strokes * control["preset"]["stroke_s"]
    return check(Resolved, tree, scenario.name)


def _make_ideal(plant: dict[str, Any]) -> None:
    """Take away what is not the engine's: noise, delays, injectors that differ."""
    plant["sensors"] = SensorConfig().model_dump()
    plant["command_delay_ticks"] = 0
    plant["injector"] |= {"flow_scale_left": 1.0, "flow_scale_right": 1.0}


def _origin(scenario: Resolved) -> str:
    """What the sensitivities are of, for people."""
    plant, config = scenario.plant, scenario.controller
    unit = f" of {plant.fmu.file} (SHA-256 {plant.fmu.sha256})" if plant.model == "fmu" else ""
    return (
        f"model {plant.model}{unit}, prototype {plant.prototype}, {config.preset.fuel_kg:.6g} kg at"
        f" {config.supervisory.load_coefficient_n_s_m:g} N s/m: steps of {CHANGE:.0%} at"
        f" {RATE_HZ} Hz, a load step at {len(FRACTIONS)} places of a stroke"
    )
