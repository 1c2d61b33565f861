"""What an engine delivers at which dead centre and load: measured in the closed loop, as a map.

The controller holds each dead centre while the load is moved away from the nominal one in steps,
up and down, until the engine cannot follow any more. So any model can be mapped, units included.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import controller.build
import controller.step
import plant.build
from bench.progress import Advance, counted, progress, unseen
from bench.run import scenarios
from bench.run.offline import command_of
from bench.run.resolve import resolve
from bench.studies.campaign.table import to_toml
from controller.mode.start_restart import GENERATING
from controller.safety import limit_fuel
from controller.state import Inputs, State, StrokeReport
from controller.supervision.performance import SteadyLimits
from hil.config.detailed import calibrations
from hil.config.load import build, with_override
from hil.config.prototypes import PROTOTYPES
from hil.config.resolved import Resolved
from hil.config.supervisory.performance import FIGURES
from hil.errors import ConfigError
from hil.files import Output
from hil.toml import read_toml
from hil.values import replace
from hil.wire.commands import TDC_REF_M
from hil.wire.messages import PistonSample
from plant.rig.events import MISFIRE
from plant.rig.state import Command, PlantState
from plant.rig.step import step
from plant.sensors import sample, sensed

LOAD_STEP = 1.2
"""From one load of a row to the next, as a factor."""

SETTLE_STROKES, MEAN_STROKES = 30, 20
_MOST_LOAD_N_S_M = 5000.0
_MOST_TICKS = 1_000_000
_HELD_M, _SPREAD_M = 0.05e-3, 0.2e-3
"""A dead centre is held when the mean is so near to it, and no stroke is further away."""


class Point(NamedTuple):
    """Steady running at one dead centre and load; `reason` when there is none."""

    load_n_s_m: float
    power_w: float = math.nan
    fuel_kg: float = math.nan
    v_mid_m_s: float = math.nan
    stroke_s: float = math.nan
    efficiency: float = math.nan
    throttle: float = 1.0
    reason: str = ""


class Checkpoint(NamedTuple):
    """Both loops at one tick: values, from which one may go on more than once."""

    plant: PlantState
    mind: State
    command: Command
    tick: int


class Stand:
    """Plant and controller of one scenario, stepped in turn without a wire."""

    def __init__(self, scenario: Resolved) -> None:
        self.scenario = scenario
        self.params = plant.build.make_params(scenario)
        self.law = controller.build.make_params(
            scenario.controller, scenario.plant.believed(), scenario.loop.period_ns
        )
        engine = scenario.plant.believed()
        self.limits = SteadyLimits(scenario.controller, engine, self.law.dt_s)

    def begin(self) -> Checkpoint:
        """Begin the run."""
        state, _ = plant.build.begin(self.scenario, self.params)
        return Checkpoint(state, controller.build.initial_state(self.law), Command(), 0)

    def strokes(self, at: Checkpoint, count: int) -> tuple[Checkpoint, list[StrokeReport], str]:
        """Go on for so many strokes; returns also why they were not all steered and fired."""
        state, mind, command, tick = at
        found: list[StrokeReport] = []
        for _ in range(_MOST_TICKS):
            seen, power_w = sample(self.params, state), math.nan
            if tick % 2 == 0:
                power_w = float(round(sensed(self.params, state).electric_power_w))
            state, events = step(self.params, state, command)
            lost = [event.text for event in events if event.code == MISFIRE]
            inputs = Inputs(tick, PistonSample(seen.x_m, seen.v_m_s), None, power_w)
            mind, output = controller.step.step(self.law, mind, inputs)
            command, tick = command_of(output), tick + 1
            if output.stroke is not None:
                found.append(output.stroke)
            if lost or mind.mode is not GENERATING:
                why = f"misfire, {lost[0]}" if lost else f"mode {mind.mode.name.lower()}"
                return Checkpoint(state, mind, command, tick), found, why
            if len(found) == count:
                break
        return Checkpoint(state, mind, command, tick), found, ""


def moved(at: Checkpoint, tdc_m: float, load_n_s_m: float) -> Checkpoint:
    """Ask for another dead centre and load from here on."""
    points = replace(
        at.mind.set_points, tdc_target_m=tdc_m, load_target_n_s_m=load_n_s_m, target=None
    )
    return at._replace(mind=replace(at.mind, set_points=points))


def measured(stand: Stand, at: Checkpoint, tdc_m: float, load: float) -> tuple[Checkpoint, Point]:
    """Move to a load, let the strokes settle, and take the mean of those that follow."""
    at, _, why = stand.strokes(moved(at, tdc_m, load), SETTLE_STROKES)
    if why:
        return at, Point(load, reason=why)
    at, found, why = stand.strokes(at, MEAN_STROKES)
    if why:
        return at, Point(load, reason=why)
    if any(_is_limited(stand, at.mind.set_points.most_kg, stroke) for stroke in found):
        return at, Point(load, reason="the fuel is at its limit")
    tdcs = [stroke.tdc_m for stroke in found]
    off_m = abs(_mean(tdcs) - tdc_m)
    if off_m > _HELD_M or max(abs(x - tdc_m) for x in tdcs) > _SPREAD_M:
        return at, Point(load, reason="the dead centre is not held")
    return at, _point(stand, load, found)


def _is_limited(stand: Stand, most_kg: float, stroke: StrokeReport) -> bool:
    limits = stand.law.limits
    more = stroke.demand.of(stroke.demand.fuel_kg * 1.001)
    less = stroke.demand.of(stroke.demand.fuel_kg * 0.999)
    return limit_fuel(limits, most_kg, more) is not more or (
        limit_fuel(limits, most_kg, less) is not less
    )


def _point(stand: Stand, load: float, found: Sequence[StrokeReport]) -> Point:
    """The means of strokes."""
    power_w = _mean([stroke.power_w or 0.0 for stroke in found])
    fuel_kg = _mean([stroke.demand.fuel_kg for stroke in found])
    stroke_s = _mean([0.5 / stroke.speed_hz for stroke in found if stroke.speed_hz])
    return Point(
        load, power_w, fuel_kg, _mean([stroke.v_mid_m_s for stroke in found]), stroke_s,
        power_w * stroke_s / (fuel_kg * heating_value_j_kg(stand.scenario)),
        stand.limits.throttle_for(fuel_kg),
    )  # fmt: skip


def heating_value_j_kg(scenario: Resolved) -> float:
    """Heating value of the fuel that the plant burns: its calibration's, else its prototype's."""
    plant_ = scenario.plant
    calibration = calibrations().get((plant_.model, plant_.prototype))
    if calibration is not None:
        return calibration.heat.heating_value_j_kg
    given = plant_.engine.heating_value_j_kg  # type: ignore[attr-defined]  # made at run time
    return float(given or PROTOTYPES[plant_.prototype].heating_value_j_kg)


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)


def row(stand: Stand, begun: Checkpoint, tdc_m: float) -> tuple[list[Point], str]:
    """Points at one dead centre by rising load and power, and what ends them above.

    Raises: ConfigError when the engine does not even run there at its nominal load
    """
    nominal = begun.mind.set_points.load_n_s_m
    here, middle = measured(stand, begun, tdc_m, nominal)
    if middle.reason:
        raise ConfigError(f"--tdc {tdc_m * 1e3:g}: at {nominal:g} N s/m: {middle.reason}")
    above = list(_onward(stand, here, tdc_m, nominal, LOAD_STEP))
    below = list(_onward(stand, here, tdc_m, nominal, 1.0 / LOAD_STEP))
    ends = next((point.reason for point in above if point.reason), "the map's last load")
    points = [*reversed(below), middle, *above]
    known = [point for point in points if not point.reason]
    kept = known[:1]
    for point in known[1:]:
        if point.power_w <= kept[-1].power_w:  # more load brings no more power
            ends = "the most power there is"
            break
        kept.append(point)
    return kept, ends


def _onward(
    stand: Stand, at: Checkpoint, tdc_m: float, nominal: float, factor: float
) -> Iterator[Point]:
    """Measure load by load, up to the first at which the engine does not run steadily."""
    load = round(nominal * factor, 3)
    while nominal / 8.0 < load < _MOST_LOAD_N_S_M:
        at, point = measured(stand, at, tdc_m, load)
        yield point
        if point.reason:
            return
        load = round(load * factor, 3)


def made(
    scenario: Resolved, tdcs_m: Sequence[float], advance: Advance = unseen
) -> dict[str, Any]:  # fmt: skip
    """The map of a scenario's engine, as the configuration keeps it.

    Parameters: advance : is told of each dead centre

    Raises: ConfigError when the engine does not run at one of the dead centres
    """
    stand = Stand(scenario)
    begun = stand.begin()
    rows = [row(stand, begun, tdc_m) for tdc_m in counted(sorted(tdcs_m), advance)]
    plant_ = scenario.plant
    table: dict[str, Any] = {
        "tdc_m": sorted(tdcs_m),
        "ends": [ends[:80] for _, ends in rows],
        "load_n_s_m": [[point.load_n_s_m for point in points] for points, _ in rows],
    }
    for name in FIGURES:
        table[name] = [[getattr(point, name) for point in points] for points, _ in rows]
    table["origin"] = {
        "model": plant_.fmu.file if plant_.model == "fmu" else plant_.model,
        "prototype": plant_.prototype, "controller": scenario.controller.name,
        "version": version("fpeg-hil"), "strokes": MEAN_STROKES,
    }  # fmt: skip
    return table


def run(
    name: str, tdcs_mm: str | None, out: Path | None, changes: Sequence[tuple[str, Any]], *,
    force: bool = False,
) -> int:  # fmt: skip
    """Map an engine, print the table, write a scenario that has the map; returns the exit code.

    Raises: ConfigError
    """
    file = None if out is None else Output("--out", out, force)
    if file is not None:
        file.check(".toml")
    tree = read_toml(scenarios.find(name))
    for key, value in (*changes, ("link.kind", "memory"), ("loop.clock", "lockstep")):
        tree = with_override(tree, key, value)
    scenario = resolve(build(tree, name))
    tdcs_m = _tdcs(tdcs_mm, scenario)
    with progress("map", len(tdcs_m), "dead centres") as advance:
        found = made(scenario, tdcs_m, advance)
    print(shown(found))
    if file is not None:
        tree = read_toml(scenarios.find(name))
        for key, value in (*changes, ("controller.supervisory.map", found)):
            tree = with_override(tree, key, value)
        build(tree, str(file.path))
        file.write(to_toml(tree))
        print(f"{out}: hil run {out} --set controller.supervisory.target_power_w=1000")
    return 0


def _tdcs(given_mm: str | None, scenario: Resolved) -> list[float]:
    """The dead centres of the rows [m]; without any the set point and a millimetre to each side."""
    if given_mm is None:
        ref = scenario.controller.tdc_ref_m
        most = scenario.controller.limits.tdc_m - scenario.controller.supervisory.tdc_room_m
        return sorted({round(x, 7) for x in (ref - 1e-3, ref, min(ref + 1e-3, most))})
    try:
        found = sorted({round(float(word) * 1e-3, 9) for word in given_mm.split(",")})
    except ValueError:
        found = []
    if not found or not all(TDC_REF_M.low <= tdc_m <= TDC_REF_M.high for tdc_m in found):
        low, high = 1e3 * TDC_REF_M.low, 1e3 * TDC_REF_M.high
        told = f"accepted are millimetres from {low:g} to {high:g}, separated by commas"
        raise ConfigError(f"--tdc {given_mm!r}: {told}")
    return found


def shown(found: dict[str, Any]) -> str:
    """The map as a table."""
    lines = ["TDC mm  load N s/m  power W  fuel mg  speed Hz  efficiency %  throttle"]
    for row_, tdc_m in enumerate(found["tdc_m"]):
        for column, load in enumerate(found["load_n_s_m"][row_]):
            power, fuel, _, stroke, efficiency, throttle = (
                found[name][row_][column] for name in FIGURES
            )
            lines.append(
                f"{tdc_m * 1e3:6.2f}  {load:10.1f}  {power:7.1f}  {fuel * 1e6:7.3f}"
                f"  {0.5 / stroke:8.2f}  {efficiency * 100.0:12.2f}  {throttle:8.3f}"
            )
        lines.append(f"        up to: {found['ends'][row_]}")
    return "\n".join(lines)
