"""What becomes of a charge: whether it burns, and what the engine is told of it."""

from __future__ import annotations

import math
from typing import Final

from mypy_extensions import i64

from hil.randoms import EFFICIENCY, INJECTOR, normal_pair, uniform
from hil.rounding import nearest
from plant.engines.protocol import BY_SPARK, NO_CHARGE, Charge, Motion, Stop
from plant.rig import actuation, disturbances
from plant.rig.actuation import Actuation
from plant.rig.events import MISFIRE, Event
from plant.rig.ignition import place_m, strike_ns
from plant.rig.params import PlantParams
from plant.rig.port import SETTLED, crossing_share, worked_out
from plant.rig.state import PlantState

_LEAST_WEIGHT: Final = 1e-3

LEFT: Final = 0
RIGHT: Final = 1
SIDES: Final = ("left", "right")

_BY_POSITION: Final = -1
"""Of a valve that no line has moved yet, or of an engine without valve lines."""
_OPEN: Final = 1


def efficiency(p: PlantParams, bounds: tuple[float, float] | None, index: int) -> float:
    """Draw the efficiency of the combustion at dead centre `index`; 1 when undisturbed.

    Parameters: bounds : of an event, None where none acts and those of the parameters count
    """
    if bounds is None:
        given = p.config.disturbance
        bounds = (given.efficiency_low, given.efficiency_high)
        if bounds[0] == bounds[1]:
            return bounds[0]
    low, high = bounds
    memory = p.config.disturbance.efficiency_memory
    if memory == 0.0:
        return low + (high - low) * uniform(p.seed, EFFICIENCY, index)
    return low + (high - low) * _correlated(p.seed, memory, index)


def _correlated(seed: int, memory: float, index: int) -> float:
    """A number in [0, 1] that remembers: z_k = sqrt(1 - r^2) sum r^j e_(k - 2j), by its definition.

    A cylinder burns at every other dead centre. z has the variance of e, and the correlation r with
    that of the cycle before, but where it is cut off at the ends.
    """
    z, weight = 0.0, math.sqrt(1.0 - memory * memory)
    while index >= 0 and weight > _LEAST_WEIGHT:
        z += weight * (2.0 * uniform(seed, EFFICIENCY, index) - 1.0)
        weight, index = weight * memory, index - 2
    return 0.5 + 0.5 * min(max(z, -1.0), 1.0)


def metered_kg(p: PlantParams, fuel_kg: float, number: int, t_ns: float) -> float:
    """What an injection has been worth, with the injector's scatter and drift [kg]."""
    given = p.config.injector
    if fuel_kg <= 0.0 or (given.scatter == 0.0 and given.drift_1_s == 0.0):
        return fuel_kg
    drifted = 1.0 + given.drift_1_s * t_ns * 1e-9
    scattered = 1.0 + given.scatter * normal_pair(p.seed, INJECTOR, number)[0]
    return max(fuel_kg * drifted * scattered, 0.0)


def at_dead_centre(
    p: PlantParams, s: PlantState, stop: Stop, number: int, events: list[Event]
) -> tuple[PlantState, Charge]:
    """Decide on the charge of the head that the piston is at, then scavenge it."""
    side = RIGHT if s.stroke.direction > 0 else LEFT
    if p.engine.ignition == BY_SPARK:
        return _lit(p, s, stop, side, events)
    pulses = actuation.advance(s.pulses, p.injector, stop.t_ns)
    ended = Motion(stop.x_m, 0.0, stop.lasted_s, True, 0, None)
    pulses = placed(p, s, s.pulses, pulses, s.motion, ended, stop.t_ns)
    fuel_kg = actuation.fuel_until(pulses, p.injector, side, stop.t_ns)
    fuel_kg = metered_kg(p, fuel_kg, number, stop.t_ns)
    spark_ns = pulses.spark_ns[side]
    d, cause = disturbances.take_misfire(disturbances.burnt_out(p.events, s.disturbances))
    reason = (
        f"forced, no {cause}"
        if cause
        else _objection(
            p, s, fuel_kg, spark_ns, stop, pulses.spark_m[side] * (1.0 if side == RIGHT else -1.0)
        )
    )
    air_kg = trapped_kg(p, s)
    reason = reason or p.intake.objection(air_kg, fuel_kg)
    goes_on = p.engine.every_stroke and s.stroke.charge.fuel_kg > 0.0
    if reason and (cause or fuel_kg > 0.0 or spark_ns >= 0 or goes_on):
        events.append(Event(nearest(stop.t_ns), MISFIRE, f"{SIDES[side]}: {reason}"))
    pulses = actuation.scavenge(pulses, p.injector, side, stop.t_ns)
    s = s.but(pulses=pulses, disturbances=d)
    if reason:
        return s, NO_CHARGE
    burnt_kg, ratio = p.intake.burnt_kg(air_kg, fuel_kg), p.intake.lambda_of(air_kg, fuel_kg)
    eta = efficiency(p, d.efficiency, number)
    if p.ignition.lead_s and stop.burnt is None:
        eta *= p.ignition.work_of(stop.t_ns - float(spark_ns))
    return s, Charge(burnt_kg, eta, ratio)


def placed(
    p: PlantParams, s: PlantState, before: Actuation, after: Actuation, motion: Motion,
    ended: Motion, end_ns: float,
) -> Actuation:  # fmt: skip
    """The lines with when a spark between two motions strikes, and where the piston is there.

    Nothing is left to the spark of a charge that has caught fire by itself.

    Parameters: motion, ended : of one stroke; end_ns : when the second one is
    """
    if after.spark_ns is before.spark_ns:
        return after
    for side in (LEFT, RIGHT):
        spark_ns = after.spark_ns[side]
        if spark_ns != before.spark_ns[side] and spark_ns >= 0:
            if side == side_ahead(s) and disturbances.is_alight(p.events, s.disturbances):
                after = actuation.with_sparks(
                    after, actuation.with_spark(after.spark_ns, side, before.spark_ns[side])
                )
                continue
            after = delayed(p, after, side)
            spark_ns = after.spark_ns[side]
            lasts_s = ended.tau_s - motion.tau_s
            since_s = lasts_s - (end_ns - float(spark_ns)) * 1e-9
            at_m = place_m(motion.x_m, motion.v_m_s, ended.x_m, ended.v_m_s, lasts_s, since_s)
            after = actuation.with_place(after, side, at_m)
    return after


def delayed(p: PlantParams, pulses: Actuation, side: int) -> Actuation:
    """The lines with a spark that strikes behind the edge of its line."""
    edge_ns = pulses.spark_ns[side]
    spark_ns = strike_ns(p.config.ignition.jitter_s, p.seed, side, edge_ns)
    if spark_ns == edge_ns:
        return pulses
    return actuation.with_sparks(pulses, actuation.with_spark(pulses.spark_ns, side, spark_ns))


def side_ahead(s: PlantState) -> int:
    """Return the side of the head that the piston moves to."""
    return RIGHT if s.stroke.direction > 0 else LEFT


def of_air(p: PlantParams, charge: Charge) -> Charge:
    """A charge that burns before anything is known of the throttle: with that wide open."""
    air_kg = p.intake.full_pa * p.intake.air_kg_pa
    ratio = p.intake.lambda_of(air_kg, charge.fuel_kg)
    return Charge(charge.fuel_kg, charge.efficiency, ratio)


def trapped_kg(p: PlantParams, s: PlantState) -> float:
    """Air of the charge ahead: what was in the manifold when its compression began [kg]."""
    given = p.config.disturbance
    p_pa = s.manifold.pressure_pa(s.stroke.start_ns) * given.manifold_scale
    colder = p.intake.kelvin / (p.intake.kelvin + given.intake_warmer_k)
    return p_pa * p.intake.air_kg_pa * colder


def _lit(
    p: PlantParams, s: PlantState, stop: Stop, side: int, events: list[Event]
) -> tuple[PlantState, Charge]:
    """Return the charge that a spark has lit; what was not lit leaves with the exhaust."""
    t_ns, pulses, charge = nearest(stop.t_ns), s.pulses, s.lit
    if charge.fuel_kg == 0.0 and pulses.spark_ns[side] < 0:
        fuel = actuation.fuel_until(pulses, p.injector, side, float(t_ns))
        if fuel > 0.0:
            events.append(Event(t_ns, MISFIRE, f"{SIDES[side]}: no spark"))
    pulses = actuation.scavenge(pulses, p.injector, side, float(t_ns))
    return s.but(pulses=pulses, lit=NO_CHARGE), charge


def _objection(
    p: PlantParams, s: PlantState, fuel_kg: float, spark_ns: i64, stop: Stop, spark_m: float
) -> str:
    """Tell why a charge does not burn at the dead centre; an empty string when it does."""
    reason = _objection_to_fuel(p, fuel_kg)
    if fuel_kg > 0.0 and not stop.compressed:
        reason = "no compression"
    if reason:
        return reason
    if spark_ns < 0:
        return "no spark"
    if stop.burnt is not None:
        return "" if stop.burnt else "not burnt by the unit"
    if spark_ns < s.stroke.start_ns or float(spark_ns) > stop.t_ns:  # behind a dead centre
        return "late spark"
    early_ns = stop.t_ns - float(spark_ns)
    if early_ns > p.spark_window_ns:
        return f"early spark ({early_ns * 1e-6:.3f} ms before the dead centre)"
    return p.ignition.objection(spark_m)


def _objection_to_fuel(p: PlantParams, fuel_kg: float) -> str:
    if fuel_kg <= 0.0:
        return "no fuel"
    if not p.fuel_min_kg <= fuel_kg <= p.fuel_max_kg:
        return f"fuel out of range ({fuel_kg * 1e6:.4f} mg)"
    return ""


def catch_fire(
    p: PlantParams, s: PlantState, event: int, t_ns: i64, events: list[Event]
) -> PlantState:
    """Let the charge ahead light itself, if there is one and compression is enough."""
    side = side_ahead(s)
    way = 1.0 if side == RIGHT else -1.0
    sparks = actuation.with_spark(s.pulses.spark_ns, side, t_ns)
    if p.engine.ignition == BY_SPARK:
        if actuation.fuel_until(s.pulses, p.injector, side, float(t_ns)) < p.fuel_min_kg:
            return s
        lit = light(p, s, side, t_ns, events, by_itself=True)
        return lit if lit is s else lit.but(pulses=actuation.with_sparks(lit.pulses, sparks))
    if s.pulses.spark_ns[side] >= s.stroke.start_ns or p.ignition.objection(way * s.motion.x_m):
        return s
    pulses = actuation.with_place(actuation.with_sparks(s.pulses, sparks), side, s.motion.x_m)
    return s.but(pulses=pulses, disturbances=disturbances.alight(s.disturbances, event))


def spark(p: PlantParams, s: PlantState, side: int, events: list[Event]) -> PlantState:
    """Light the charge of a side at its spark, unless it burns already."""
    if s.lit.fuel_kg > 0.0 and side == side_ahead(s):
        return s
    return light(p, s, side, delayed(p, s.pulses, side).spark_ns[side], events)


def light(
    p: PlantParams, s: PlantState, side: int, t_ns: i64, events: list[Event],
    by_itself: bool = False,
) -> PlantState:  # fmt: skip
    """Light the charge of a side, or say why it does not burn; nothing if it was to by itself."""
    fuel = actuation.fuel_until(s.pulses, p.injector, side, float(t_ns))
    fuel = metered_kg(p, fuel, s.dead_centre.number + 1, float(t_ns))
    d, cause = disturbances.take_misfire(s.disturbances)
    eta = efficiency(p, d.efficiency, s.dead_centre.number + 1)
    motion, lit = s.motion, s.lit
    reason = f"forced, no {cause}" if cause else _objection_to_spark(p, s, side, fuel)
    if not reason:
        motion, reason = p.engine.light(motion, side, t_ns, eta * fuel)
    if reason and by_itself:
        return s
    if reason:
        events.append(Event(t_ns, MISFIRE, f"{SIDES[side]}: {reason}"))
    else:
        lit = Charge(fuel, eta, p.intake.lambda_of(trapped_kg(p, s), fuel))
    pulses = actuation.scavenge(s.pulses, p.injector, side, float(t_ns))
    # This spark stays known, so that its charge does not count as unlit.
    pulses = actuation.with_sparks(pulses, s.pulses.spark_ns)
    return s.but(motion=motion, pulses=pulses, disturbances=d, lit=lit)


def _objection_to_spark(p: PlantParams, s: PlantState, side: int, fuel: float) -> str:
    """Tell why a charge does not burn at its spark; an empty string when it does."""
    late = (side == RIGHT) != (s.stroke.direction > 0)
    return _objection_to_fuel(p, fuel) or ("late spark" if late else "")


def taken_in(
    p: PlantParams, s: PlantState, after: Motion, now_ns: float, lasts_s: float
) -> Actuation:
    """Close the intake of the cylinder ahead, if it closes on the way to the motion after.

    Parameters: now_ns, lasts_s : when the state's own motion is, and how long the way takes
    Returns: the lines as they stood then, or as they are
    """
    pulses, wall = s.pulses, p.injector.wall
    side = RIGHT if s.stroke.direction > 0 else LEFT
    if wall is None or pulses.ports[side].stroke == s.stroke.number:
        return pulses
    level = pulses.valves.levels[2 * side] if p.valves.by_lines else _BY_POSITION
    way = float(s.stroke.direction)
    z, z_after = way * s.motion.x_m, way * after.x_m
    if level == _OPEN or (level == _BY_POSITION and z_after < wall.closes_m):
        return pulses
    shut_ns = now_ns
    if level == _BY_POSITION and z < wall.closes_m:
        v, v_after = way * s.motion.v_m_s, way * after.v_m_s
        shut_ns += 1e9 * lasts_s * crossing_share(z, v, z_after, v_after, lasts_s, wall.closes_m)
    if pulses.ports[side].stroke == SETTLED:
        left, right = (worked_out(wall, one, shut_ns, s.stroke.number) for one in pulses.ports)
        return actuation.with_ports(pulses, (left, right))
    if p.engine.ignition != BY_SPARK:  # which stops at every edge
        pulses = actuation.advance(pulses, p.injector, shut_ns)
    return actuation.shut(pulses, p.injector, side, shut_ns, s.stroke.number)
