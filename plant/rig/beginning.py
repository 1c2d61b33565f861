"""Where a run begins: at rest, or in the settled limit cycle at the left dead centre."""

from __future__ import annotations

from hil.errors import ConfigError
from hil.wire.latch import RELEASED
from hil.wire.messages import GENERATOR, VALVES
from hil.wire.pulses import lines_for
from plant.engines.machine import IDLE, MachineOrder
from plant.engines.protocol import (
    AT_DEAD_CENTRE,
    BY_SPARK,
    NO_CHARGE,
    OF_ITS_OWN,
    Charge,
    Motion,
    Stop,
)
from plant.rig import air, charges, disturbances, indicator
from plant.rig.actuation import Actuation, with_ports, with_valves
from plant.rig.disturbances import Disturbances, Held
from plant.rig.events import MISFIRE, Event
from plant.rig.orders import obey
from plant.rig.params import PlantParams
from plant.rig.port import begun
from plant.rig.state import DeadCentre, PlantState, Stroke
from plant.rig.stroke import begin_at_once, expect, next_stroke, put
from plant.rig.valves import SHUT


def initial_state(
    p: PlantParams, fuel_kg: float | None = None, load_coefficient_n_s_m: float | None = None,
    stroke_s: float = 0.0,
) -> tuple[PlantState, tuple[Event, ...]]:  # fmt: skip
    """Begin at rest when `fuel_kg` is None, else in the settled motion on that fuel.

    Parameters: stroke_s : duration of a stroke of that motion, by which intake ports begin settled
    Returns: the state at t = 0, and the events of that instant
    Raises: ConfigError when the engine cannot begin so
    """
    c = load_coefficient_n_s_m
    load = p.engine.load_coefficient_n_s_m if c is None else c
    if fuel_kg is None:
        s = _at(p, p.engine.begin(None, load))
        return (s.but(pulses=with_valves(s.pulses, SHUT)) if p.valves.by_lines else s), ()
    s, events = _settled(p, fuel_kg, load)
    if p.injector.wall is not None:
        ports = begun(p.config.injector.film_kg or 0.0, fuel_kg, stroke_s * 1e9)
        s = s.but(pulses=with_ports(s.pulses, ports))
    return s, events


def _at(p: PlantParams, motion: Motion) -> PlantState:
    """Begin with that motion, the machine off, no dead centre behind."""
    return PlantState(
        tick=0,
        motion=motion,
        stroke=Stroke(0, 1, 0, 0.0, NO_CHARGE),
        machine=IDLE,
        pulses=Actuation(lines_for(VALVES[0] + p.engine.valves)),
        disturbances=Disturbances(),
        dead_centre=DeadCentre(0, 0, 0.0, 0.0, 1.0),
        lit=NO_CHARGE,
        stale=0,
        latch=RELEASED,
        contacts=0,
        waiting=(),
        manifold=air.still(p.intake, 1.0),
        instruments=indicator.begun(p.config.winding),
    )


def _settled(
    p: PlantParams, fuel_kg: float, load_n_s_m: float
) -> tuple[PlantState, tuple[Event, ...]]:
    """Begin at the left dead centre of the settled motion, `fuel_kg` burning there at t = 0."""
    own = p.engine.ignition == AT_DEAD_CENTRE
    if own and not p.fuel_min_kg <= fuel_kg <= p.fuel_max_kg:
        low, high = p.fuel_min_kg * 1e6, p.fuel_max_kg * 1e6
        raise ConfigError(f"initial fuel {fuel_kg * 1e6:g} mg is outside {low:.3f} to {high:.3f}")
    charge = charges.of_air(p, Charge(fuel_kg, 1.0))
    if p.engine.ignition == OF_ITS_OWN:
        d = disturbances.preview(p.edges, p.events, Disturbances(), 0)
        charge = Charge(fuel_kg, charges.efficiency(p, d.efficiency, 1))
    s = _at(p, p.engine.begin(charge, load_n_s_m))
    s = s.but(machine=obey(p, MachineOrder(GENERATOR, 0.0, load_n_s_m), 1.0))
    if p.engine.ignition == AT_DEAD_CENTRE:
        events: list[Event] = []
        return _fired(p, s, fuel_kg, events), tuple(events)
    s = next_stroke(s, 1, 1, 0, s.x_m, charge)
    if p.engine.ignition == BY_SPARK:  # what begins at t = 0 acts from the next dead centre on
        return s, ()
    d, taken = disturbances.start_stroke(p.edges, s.disturbances, 0, 0.0)
    later = [edge for edge in taken if edge.fraction > 0.0]
    duration = p.engine.stroke_s(s.motion, s.machine, 0, 0) if later else 0.0
    return s.but(disturbances=put(d, list(taken), duration)), ()


def _fired(p: PlantParams, s: PlantState, fuel_kg: float, events: list[Event]) -> PlantState:
    """Burn the first charge, with disturbances acting there already."""
    d, taken = disturbances.start_stroke(p.edges, s.disturbances, 0, 0.0)
    s = s.but(disturbances=d)
    s = begin_at_once(p, s, taken, 0, Held(s.x_m, 0.0), events)
    d, cause = disturbances.take_misfire(s.disturbances)
    if cause:
        events.append(Event(0, MISFIRE, f"{charges.SIDES[charges.LEFT]}: forced, no {cause}"))
    burnt = Charge(fuel_kg, charges.efficiency(p, d.efficiency, 1))
    charge = NO_CHARGE if cause else charges.of_air(p, burnt)
    s = next_stroke(s.but(disturbances=d), 1, 1, 0, s.x_m, charge)
    stop = Stop(0.0, s.x_m, 0.0, 1, 0, compressed=True, burnt=None)
    s = s.but(motion=p.engine.turn(s.motion, s.machine, charge, stop))
    return expect(p, s, taken, 0, 0.0)
