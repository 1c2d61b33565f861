"""Several laws on the same load steps at four moments, beside the physical bound."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, get_args

from bench.judge.response import Response
from bench.progress import Advance, counted, unseen
from bench.run import scenarios
from bench.run.offline import Course, simulate
from bench.run.resolve import resolve
from bench.studies.bound import Informed, LoadChange, step_bound, stroke_end
from controller.motion.choice import check_name
from controller.motion.laws import LAWS
from hil.config.load import build, with_override
from hil.config.resolved import Resolved
from hil.config.scenario import Scenario
from hil.errors import ConfigError
from plant.engines.fast.constants import constants_of
from plant.engines.fast.limit_cycle import fuel_for_tdc

MOMENTS = {"a": (0, 0.25), "b": (0, 0.75), "c": (1, 0.25), "d": (1, 0.75)}
"""Strokes after the event's own, and fraction of the stroke (thesis Fig 6.11)."""

FAST_MODELS = ("harmonic", "rectangular", "nonlinear")
NO_CONTROL = "open-loop"
AFTER_S = 0.6
EVENT_S = 0.2

Tree = dict[str, Any]


class Cell(NamedTuple):
    """One law on one load step: its strokes after it, or why there are none."""

    law: str
    load: float
    moment: str
    response: Response
    fuel_mg: tuple[float, ...]
    note: str = ""


class Comparison(NamedTuple):
    """All that is drawn and told; the bounds are None for a model that has none."""

    scenario: Resolved
    event: str
    loads: tuple[float, ...]
    laws: tuple[str, ...]
    cells: dict[tuple[str, float, str], Cell]
    bounds: dict[tuple[float, str, str], Response]


def laws_of(text: str | None) -> tuple[str, ...]:
    """Names separated by commas; None for all that control.

    Raises: ConfigError for one that is no law
    """
    if text is None:
        return tuple(name for name in LAWS if name != NO_CONTROL)
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    for name in names or ("",):
        check_name(name, "--controllers")
    return names


def compare(
    name: str, laws: Sequence[str], changes: Sequence[tuple[str, Any]] = (),
    advance: Advance = unseen,
) -> Comparison:  # fmt: skip
    """Run every law at every moment, on the scenario's load step and on the opposite one.

    Parameters: advance : is told of each run, of which there are `count_of`

    Raises: ConfigError when the scenario has no load step, or cannot begin
    """
    tree = scenarios.tree_of(name)
    for key, value in changes:
        tree = with_override(tree, key, value)
    event, load = _load_step(build(tree, name))
    tree = _shortened(tree, event)
    base = resolve(build(tree, name))
    loads = (load, 2.0 - load)
    shown = (*laws, NO_CONTROL)
    every = [(law, value, moment) for law in shown for value in loads for moment in MOMENTS]
    cells = {each: _cell(tree, base, event, *each) for each in counted(every, advance)}
    return Comparison(base, event, loads, shown, cells, _bounds(base, loads))


def count_of(laws: Sequence[str]) -> int:
    """Return how many runs a comparison takes: the uncontrolled engine is run with the laws."""
    return (len(laws) + 1) * 2 * len(MOMENTS)


def _load_step(scenario: Scenario) -> tuple[str, float]:
    """The scenario's load step."""
    events = scenario.events.items()
    steps = [(name, e.number("value")) for name, e in events if e.kind == "load-scale"]
    if len(steps) != 1 or steps[0][1] in (0.0, 1.0):
        raise ConfigError(f"{scenario.name}: compare needs a scenario with one load step")
    return steps[0]


def _shortened(tree: Tree, event: str) -> Tree:
    """Begin settled, the step early, and end when all is over."""
    tree = {**tree, "expect": {}, "begins": "settled"}
    tree = with_override(tree, "run.duration_s", EVENT_S + AFTER_S + 0.1)
    tree = with_override(tree, "loop.clock", "lockstep")
    return with_override(tree, f"events.{event}.at_s", EVENT_S)


def _cell(tree: Tree, base: Resolved, event: str, law: str, load: float, moment: str) -> Cell:
    """One law, one step."""
    strokes, fraction = MOMENTS[moment]
    stroke_s = base.controller.preset.stroke_s
    settings = {
        "controller.name": law,
        f"events.{event}.value": load,
        f"events.{event}.at_s": EVENT_S + strokes * stroke_s,
        f"events.{event}.at_stroke_fraction": fraction,
    }
    if law == NO_CONTROL:
        settings["controller.open_loop.fuel_kg"] = base.controller.preset.fuel_kg
    for key, value in settings.items():
        tree = with_override(tree, key, value)
    try:
        scenario = resolve(build(tree, base.name))
        course = simulate(scenario)
    except ConfigError as error:
        return Cell(law, load, moment, Response((), ()), (), str(error))
    return read_off(course, law, load, moment, scenario.controller.tdc_ref_m * 1e3)


def read_off(course: Course, law: str, load: float, moment: str, ref_mm: float) -> Cell:
    """Errors and fuels from the load step on."""
    step_ns = next((e.t_ns for e in course.events if e.code == "disturbance"), 0)
    after = [dc for dc in course.dead_centres if step_ns < dc.t_ns <= step_ns + AFTER_S * 1e9]
    faults = sorted({e.code for e in course.events if e.code in ("contact", "misfire")})
    response = Response(
        tuple((dc.t_ns - step_ns) * 1e-9 for dc in after),
        tuple(abs(dc.x_m) * 1e3 - ref_mm for dc in after),
    )
    fuels = tuple(dc.fuel_kg * 1e6 for dc in after)
    return Cell(law, load, moment, response, fuels, ", ".join(faults))


def _bounds(base: Resolved, loads: Sequence[float]) -> dict[tuple[float, str, str], Response]:
    """The bound with full and with mid-stroke knowledge, for the models that have one."""
    find = bound_of(base)
    found = {}
    for load in loads:
        for moment, (_, fraction) in MOMENTS.items():
            for knowledge in get_args(Informed):
                try:
                    if find is not None:
                        found[load, moment, knowledge] = find(load, fraction, knowledge)
                except ConfigError:
                    continue
    return found


def bound_of(base: Resolved) -> Callable[[float, float, Informed], Response] | None:
    """The function from load, moment in the stroke and knowledge to the bound of an engine."""
    plant, controller = base.plant, base.controller
    ref_m = controller.tdc_ref_m
    nominal = controller.supervisory.load_coefficient_n_s_m
    if plant.model in FAST_MODELS:
        engine = constants_of(plant.resolved_prototype(), plant.model)
        return lambda load, part, known: step_bound(engine, ref_m, nominal, load, part, known)
    if plant.model != "two-stroke":
        return None
    from bench.studies import bound_detailed
    from plant.engines.detailed.settle import calibration_of

    calibration, fuel_kg = calibration_of(plant), controller.preset.fuel_kg
    advance_s = controller.timing.spark_advance_s
    return lambda load, part, known: bound_detailed.step_bound(
        calibration, ref_m, fuel_kg, nominal, load, part, known, advance_s=advance_s
    )


def least_sigma_mm(base: Resolved, efficiency: tuple[float, float]) -> float | None:
    """The least scatter that any law leaves under uniform efficiencies: |dX/deta| sigma_eta [mm].

    None on an engine of which no stroke can be worked out by itself.
    """
    plant, controller = base.plant, base.controller
    if plant.model not in FAST_MODELS:
        return None
    constants = constants_of(plant.resolved_prototype(), plant.model)
    ref_m, load = controller.tdc_ref_m, controller.supervisory.load_coefficient_n_s_m
    fuel_kg, loads = fuel_for_tdc(constants, ref_m, load), (LoadChange(0.0, load),)
    low, high = efficiency
    mean = 0.5 * (low + high)
    ends = [stroke_end(constants, ref_m, fuel_kg, loads, eta / mean).tdc_m for eta in efficiency]
    return 1e3 * abs(ends[1] - ends[0]) / math.sqrt(12.0)


def excess(cell: Cell, bound: Response | None) -> float:
    """How far a peak is above the bound, as a share; nan without one."""
    if bound is None or not cell.response.errors_mm:
        return math.nan
    return cell.response.peak_mm / bound.peak_mm - 1.0
