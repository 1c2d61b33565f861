"""When an intake closes: by the piston's position, or by a valve's own move."""

from __future__ import annotations

import math
from typing import Final

from plant.engines.protocol import BY_SPARK, Motion
from plant.rig import actuation, port
from plant.rig.actuation import Actuation
from plant.rig.charges import LEFT, RIGHT
from plant.rig.params import PlantParams
from plant.rig.port import Wall, crossing_share
from plant.rig.state import PlantState

BY_POSITION: Final = -1
"""Of a valve that no line has moved yet, or of an engine without valve lines."""
OPEN: Final = 1


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
    level = pulses.valves.levels[2 * side] if p.valves.by_lines else BY_POSITION
    way = float(s.stroke.direction)
    z, z_after = way * s.motion.x_m, way * after.x_m
    if level == OPEN or (level == BY_POSITION and z_after < wall.closes_m):
        return pulses
    shut_ns = now_ns
    if level == BY_POSITION and z < wall.closes_m:
        v, v_after = way * s.motion.v_m_s, way * after.v_m_s
        shut_ns += 1e9 * lasts_s * crossing_share(z, v, z_after, v_after, lasts_s, wall.closes_m)
    if p.engine.ignition != BY_SPARK:  # which stops at every edge
        pulses = actuation.advance(pulses, p.injector, shut_ns)
    return actuation.shut(pulses, p.injector, side, shut_ns, s.stroke.number)


def settled(p: PlantParams, s: PlantState, wall: Wall, fuel_kg: float) -> Actuation:
    """Both ports at t = 0 of a settled motion that begins at the left dead centre.

    The right intake will close as the piston passes on, z = -X cos(pi t / T); the left one has
    closed a stroke before that.
    """
    stroke_s = p.engine.stroke_s(s.motion, s.machine, 0, 0)
    share = -wall.closes_m / max(abs(s.stroke.start_x_m), 1e-6)
    closes_ns = 1e9 * stroke_s / math.pi * math.acos(min(max(share, -1.0), 1.0))
    film_kg = p.config.injector.film_kg or 0.0
    left = port.settled(wall, film_kg, closes_ns - 1e9 * stroke_s, 0.0)
    right = port.settled(wall, film_kg, closes_ns, fuel_kg)
    return actuation.with_ports(s.pulses, (left, right))
