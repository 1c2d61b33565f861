"""What a run with a detailed engine is filled in with: its calibration's own operating point."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bench.run.filling.start_load import start_load
from controller.supervision.performance import Steady
from hil.config.check import check
from hil.config.controller import ControllerConfig
from hil.config.detailed import Calibration
from hil.config.engine.models import DETAILED_MODELS
from hil.config.prototypes import engine_with
from hil.config.scenario import Scenario
from hil.errors import ConfigError
from hil.roots import secant

if TYPE_CHECKING:
    from plant.engines.detailed.settle import Settled

_FIRES = {
    ("two-stroke", "left"): (False, True),
    ("four-stroke", "both"): (True, False, False, True),
    ("four-stroke", "left"): (False, False, False, True),
    ("speed", "both"): (False,),
}
"""Of strokes counted from the left cylinder's power stroke, with which a run begins."""

_FUEL_PER_TDC_KG_M = 1.2e-3
"""Of the Newcastle engine's left charge, the right one and the load as they are: 0.8 mm a mg."""

_FIRES_BY_STROKE = (False, True, True, False)
"""Of the strokes of Table 3.1: which end with a combustion."""

_SLOPE_STEP = 0.005
_POWER_SHARE, _FUEL_SHARE, _FUEL_STEPS = 2.0e-3, 1.0e-3, 8
"""How exactly a run begins at its target power; an engine takes a second to settle once."""
_LOAD_BY_POWER, _FUEL_BY_LOAD = 0.6, 1.3
"""Exponents at one dead centre, for the guesses: a two-stroke's from a third to its full power."""

_LOW_BEFORE_SPARK_S = 0.2e-3

_FOUR_STROKE_BEGINS = 2
"""Row of Table 3.1 with which a run begins: the left cylinder's power stroke."""

_LEAD_TICKS = 2
"""From mid-stroke to spark it is 5 ms in a power stroke, and injection takes 1.4 ms of them."""

_SPARK_AHEAD_S = 2.5e-3
"""Planned earlier, the spark would keep the error of a prediction from far away."""


def is_detailed(scenario: Scenario) -> bool:
    """Tell whether the plant is one of the compiled engines."""
    return scenario.plant.model in DETAILED_MODELS


def prototype_of(scenario: Scenario) -> str:
    """Return the engine: unless it is named, one that has such a model."""
    plant = scenario.plant
    named = "prototype" in plant.model_fields_set
    return plant.prototype if named else engine_with(plant.model)


def fill(scenario: Scenario, tree: dict[str, Any]) -> None:
    """Give prototype, injector, loads, set point, spark and preset, each unless it is given.

    Raises: ConfigError when the engine cannot run on what is given
    """
    plant = scenario.plant.model_copy(update={"prototype": tree["plant"]["prototype"]})
    from plant.engines.detailed.settle import calibration_of

    c = calibration_of(plant)
    load = c.machine.load_coefficient_n_s_m
    if plant.load_coefficient_n_s_m is not None:
        load = plant.load_coefficient_n_s_m
    tree["plant"]["load_coefficient_n_s_m"] = load
    _fill_injectors(scenario, tree, c.heat.injector_kg_s)
    control = tree["controller"]
    _give(control["supervisory"], "load_coefficient_n_s_m", load)
    _give(control["limits"], "tdc_m", plant.believed().position_limit_m)
    _give(control["open_loop"], "fuel_kg", c.heat.energy_j / c.heat.heating_value_j_kg)
    if "force_n" not in scenario.controller.start.model_fields_set:
        control["start"] |= {"force_n": c.machine.start_force_n, "constant_force": True}
    fires = _FIRES.get((c.cycle.kind, c.cycle.fires))
    if fires is None and control["stroke_map"]["kind"] == "auto":
        control["stroke_map"]["kind"] = "sensitivities"
    if fires is not None:
        _fill_unfired(scenario, control, fires, c)
    _fill_load(scenario, c, control)
    here = _fill_preset(c, control)
    if c.cycle.kind == "four-stroke" and c.cycle.fires == "both":
        _fill_cycle(scenario, tree, c, here)
    if scenario.controller.timing.valves == "controller":
        _fill_valves(scenario, tree, c, here)
    if c.cycle.kind == "speed":
        return
    spark_m = c.left.length_m - c.cycle.ignition_from_head_m
    _fill_timing(scenario, control["timing"], here.spark_before_s, spark_m)


def _fill_load(scenario: Scenario, c: Calibration, control: dict[str, Any]) -> None:
    """Give load and fuel with which the settled engine delivers a target power at its set point."""
    preset, target_w = control["preset"], scenario.controller.supervisory.target_power_w
    if target_w is None or control["name"] == "open-loop" or preset["fuel_kg"] is not None:
        return
    from plant.engines.detailed.settle import settle

    nominal_kg = c.heat.energy_j / c.heat.heating_value_j_kg
    load = c.machine.load_coefficient_n_s_m
    nominal = settle(c, nominal_kg, load)
    _give(control, "tdc_ref_m", nominal.tdc_m)
    running = Running(c, control["tdc_ref_m"], nominal_kg, load)
    given = check(ControllerConfig, control, scenario.name)
    guess = load * (target_w / nominal.power_w) ** _LOAD_BY_POWER
    found = start_load(
        given,
        scenario.plant.believed(),
        scenario.loop.period_ns * 1e-9,
        guess,
        running.at,
        _POWER_SHARE,
    )
    load = found.load_n_s_m
    fuel_kg = running.at(load).fuel_kg
    preset |= {"load_coefficient_n_s_m": load, "fuel_kg": fuel_kg, "limit": found.limit}


class Running:
    """A detailed engine settled at one dead centre, by its load."""

    def __init__(self, c: Calibration, tdc_m: float, fuel_kg: float, load_n_s_m: float) -> None:
        self._calibration = c
        self._tdc_m = tdc_m
        self._near = fuel_kg, load_n_s_m
        self._known: dict[float, Steady] = {}

    def at(self, load_n_s_m: float) -> Steady:
        """Return its settled running.

        Raises: ConfigError where there is none
        """
        if load_n_s_m not in self._known:
            self._known[load_n_s_m] = self._settled(load_n_s_m)
        return self._known[load_n_s_m]

    def _settled(self, load_n_s_m: float) -> Steady:
        """Settle on the fuel that reaches the dead centre, looked for from that of a load near."""
        from plant.engines.detailed.settle import EngineStopsError, settle

        def error(fuel_kg: float) -> float:
            try:
                return settle(self._calibration, fuel_kg, load_n_s_m).tdc_m - self._tdc_m
            except EngineStopsError:
                return -self._tdc_m

        fuel_kg, load = self._near
        guess_kg = fuel_kg * (load_n_s_m / load) ** _FUEL_BY_LOAD
        fuel_kg = secant(error, guess_kg, steps=_FUEL_STEPS, relative=_FUEL_SHARE)
        here = settle(self._calibration, fuel_kg, load_n_s_m)
        self._near = fuel_kg, load_n_s_m
        return Steady(fuel_kg, here.v_mid_m_s, here.stroke_s, here.power_w)


def _fill_preset(c: Calibration, control: dict[str, Any]) -> Settled:
    """Give the settled motion that the run begins with, and return it."""
    from plant.engines.detailed.settle import settle

    preset = control["preset"]
    load = preset["load_coefficient_n_s_m"]
    if load is None:
        load = control["supervisory"]["load_coefficient_n_s_m"]
    open_loop = control["name"] == "open-loop"
    nominal = c.heat.energy_j / c.heat.heating_value_j_kg
    _give(preset, "fuel_kg", control["open_loop"]["fuel_kg"] if open_loop else nominal)
    here = settle(c, preset["fuel_kg"], load)
    _give(preset, "v_mid_m_s", here.v_mid_m_s)
    _give(preset, "stroke_s", here.stroke_s)
    _give(preset, "power_w", here.power_w)
    _give(control, "tdc_ref_m", here.tdc_m)
    if preset["fuel_per_speed_kg_s_m"] is None and c.cycle.kind != "speed":
        more = settle(c, preset["fuel_kg"] * (1.0 + _SLOPE_STEP), load)
        slope = _SLOPE_STEP * preset["fuel_kg"] / (more.v_mid_m_s - here.v_mid_m_s)
        preset["fuel_per_speed_kg_s_m"] = slope
    return here


def _give(tree: dict[str, Any], key: str, value: float) -> None:
    if tree[key] is None:
        tree[key] = value


def _fill_unfired(
    scenario: Scenario, control: dict[str, Any], fires: tuple[bool, ...], c: Calibration
) -> None:
    """Fire some of the strokes, on fixed fuel or by the law that knows of the others.

    Raises: ConfigError
    """
    model = f"model {scenario.plant.model} with engine {c.name}"
    cycles = c.cycle.kind == "four-stroke" and c.cycle.fires == "both"
    accepted = ("open-loop", "cycle") if cycles else ("open-loop",)
    if "name" in scenario.controller.model_fields_set and control["name"] not in accepted:
        raise ConfigError(
            f"{scenario.name}: controller.name {control['name']}: {model} is run by "
            f"{' or '.join(accepted)} alone"
        )
    if scenario.begins != "settled" and not cycles:
        raise ConfigError(f"{scenario.name}: begins: {model} begins settled alone")
    if control["name"] not in accepted:
        control["name"] = "open-loop" if scenario.begins == "settled" else "cycle"
    first = _FOUR_STROKE_BEGINS if scenario.begins == "settled" else 0
    if cycles:
        fires = tuple(_FIRES_BY_STROKE[(n + first) % 4] for n in range(4))
    wanted: dict[str, Any] = {"fires": fires, "spark_ahead_s": _SPARK_AHEAD_S}
    if c.cycle.kind == "four-stroke":
        wanted["injection_lead_ticks"] = _LEAD_TICKS
    given = scenario.controller.timing.model_fields_set
    control["timing"] |= {key: value for key, value in wanted.items() if key not in given}


def _fill_cycle(scenario: Scenario, tree: dict[str, Any], c: Calibration, here: Settled) -> None:
    """Let the controller drive a four-stroke engine's machine, as its programme would."""
    control, cycle = tree["controller"], c.cycle
    if control["name"] == "open-loop" and scenario.controller.cycle.drive == "programme":
        return
    tree["plant"]["drive"] = "commands"
    begins = _FOUR_STROKE_BEGINS
    order = [(stroke - begins) % 4 for stroke in range(4)]
    wanted: dict[str, Any] = {
        "drive": "controller",
        "dead_centres_m": tuple(here.ends_m[n] for n in order),
        "v_mid_m_s": tuple(here.speeds_m_s[n] for n in order),
        "fuel_per_tdc_kg_m": _FUEL_PER_TDC_KG_M,
        "first_stroke": begins if scenario.begins == "settled" else 0,
    }
    wanted |= {f"motor_{n}_n": getattr(cycle, f"motor_{n}_n") for n in (1, 2, 3, 4)}
    given = scenario.controller.cycle.model_fields_set
    control["cycle"] |= {key: value for key, value in wanted.items() if key not in given}


def _fill_valves(scenario: Scenario, tree: dict[str, Any], c: Calibration, here: Settled) -> None:
    """Take the plant's programme off, and tell the controller where its valves are to move.

    Raises: ConfigError when the engine has no valve lines, or one chamber without exhaust
    """
    if c.breathing.ports or c.cycle.kind == "speed" or c.cycle.fires == "left":
        raise no_valves(scenario, f"engine {c.name}")
    tree["plant"]["valves"]["moved_by"] = "lines"
    actuators = scenario.plant.valves
    wanted: dict[str, Any] = {
        "cycle": "four-stroke" if c.cycle.kind == "four-stroke" else "two-stroke",
        "opening_delay_s": actuators.opening_s,
        "closing_delay_s": actuators.closing_s,
    }
    if c.cycle.kind == "four-stroke":
        first = _FOUR_STROKE_BEGINS if scenario.begins == "settled" else 0
        lasts_s = tuple(here.strokes_s[(n + first - _FOUR_STROKE_BEGINS) % 4] for n in range(4))
        wanted |= {"first_stroke": first, "stroke_s": lasts_s}
    else:
        for key in ("exhaust_opens_m", "exhaust_closes_m", "intake_opens_m", "intake_closes_m"):
            wanted[key] = getattr(c.cycle, key)
    given = scenario.controller.valves.model_fields_set
    tree["controller"]["valves"] |= {k: v for k, v in wanted.items() if k not in given}


def no_valves(scenario: Scenario, what: str) -> ConfigError:
    """Return the refusal of a controller that is to move the valves of what has none."""
    return ConfigError(
        f'{scenario.name}: controller.timing.valves = "controller": {what} has no valves for it to '
        "move; accepted: programme"
    )


def _fill_injectors(scenario: Scenario, tree: dict[str, Any], flow_kg_s: float) -> None:
    """Fit injectors that let a whole charge through between mid-stroke and spark."""
    if "static_flow_kg_s" not in scenario.plant.injector.model_fields_set:
        tree["plant"]["injector"]["static_flow_kg_s"] = flow_kg_s
    if "static_flow_kg_s" not in scenario.controller.injector.model_fields_set:
        tree["controller"]["injector"]["static_flow_kg_s"] = flow_kg_s


def _fill_timing(
    scenario: Scenario, tree: dict[str, Any], spark_before_s: float, spark_m: float
) -> None:
    """Place the spark where the settled engine has it, and end the injection before it."""
    given = scenario.controller.timing.model_fields_set
    if "spark_advance_s" not in given:
        tree["spark_advance_s"] = spark_before_s
        if "spark_position_m" not in given:
            tree["spark_position_m"] = spark_m
    if "injection_lead_ticks" not in given:
        tree["injection_lead_ticks"] = _LEAD_TICKS
    for key in ("injection_margin_s", "trim_margin_s"):
        if key not in given:
            tree[key] = tree["spark_advance_s"] + _LOW_BEFORE_SPARK_S
