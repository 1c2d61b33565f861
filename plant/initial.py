"""Where a run begins: at rest, or in the settled limit cycle at the left dead centre."""

from __future__ import annotations

from hil.errors import ConfigError
from hil.messages import GENERATOR
from plant.actuation import PulseTable
from plant.combustion import Stroke
from plant.disturbances import Disturbances, Held
from plant.events import Event
from plant.limit_cycle import limit_cycle
from plant.machine import IDLE, MachineOrder, obey
from plant.models import path_of
from plant.params import PlantParams
from plant.state import DeadCentre, PlantState
from plant.stroke import first_stroke


def rest_state(p: PlantParams) -> PlantState:
    """Begin at rest at mid-stroke, the machine off, no dead centre behind."""
    stroke = Stroke(0, 1, 0, 0.0)
    return PlantState(
        tick=0,
        x_m=0.0,
        v_m_s=0.0,
        tau_s=0.0,
        moving=False,
        path=path_of(p.engine, stroke, 0.0, 0.0, x=0.0, v=0.0, tau=0.0),
        stroke=stroke,
        machine=IDLE,
        pulses=PulseTable(),
        disturbances=Disturbances(),
        dead_centre=DeadCentre(0, 0, 0.0, 0.0, 1.0),
        stale=0,
        contacts=0,
    )


def settled_state(
    p: PlantParams, fuel_kg: float, load_coefficient_n_s_m: float | None = None
) -> tuple[PlantState, tuple[Event, ...]]:
    """Begin at the left dead centre of the settled motion, `fuel_kg` burning there at t = 0.

    Raises: ConfigError when the fuel is out of range or no settled motion stays inside the stroke
    """
    c = p.load_coefficient_n_s_m if load_coefficient_n_s_m is None else load_coefficient_n_s_m
    if not p.fuel_min_kg <= fuel_kg <= p.fuel_max_kg:
        low, high = p.fuel_min_kg * 1e6, p.fuel_max_kg * 1e6
        raise ConfigError(f"initial fuel {fuel_kg * 1e6:g} mg is outside {low:.3f} to {high:.3f}")
    tdc_m = limit_cycle(p.engine, fuel_kg, c).tdc_m
    if tdc_m >= p.engine.contact_m:
        raise ConfigError(f"settled motion of {tdc_m * 1e3:.3f} mm strikes the head")
    order = MachineOrder(GENERATOR, 0.0, c)
    s = rest_state(p)._replace(x_m=-tdc_m, machine=obey(p, order, 1.0), moving=True)
    events: list[Event] = []
    return first_stroke(p, s, fuel_kg, Held(-tdc_m, 0.0), events), tuple(events)


def initial_state(
    p: PlantParams, fuel_kg: float | None = None, load_coefficient_n_s_m: float | None = None
) -> tuple[PlantState, tuple[Event, ...]]:
    """Begin at rest when `fuel_kg` is None, else in the settled motion on that fuel.

    Returns: the state at t = 0, and the events of that instant
    """
    if p.detailed is not None:
        return p.detailed.initial(p, rest_state(p), fuel_kg, load_coefficient_n_s_m), ()
    if fuel_kg is None:
        return rest_state(p), ()
    return settled_state(p, fuel_kg, load_coefficient_n_s_m)
