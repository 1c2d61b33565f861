"""When an intake closes: by the piston's position, or by a valve's own move."""

from __future__ import annotations

from typing import Final

from plant.engines.protocol import BY_SPARK, Motion
from plant.rig import actuation
from plant.rig.actuation import Actuation
from plant.rig.charges import LEFT, RIGHT
from plant.rig.params import PlantParams
from plant.rig.port import SETTLED, crossing_share, worked_out
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
    if pulses.ports[side].stroke == SETTLED:
        left, right = (worked_out(wall, one, shut_ns, s.stroke.number) for one in pulses.ports)
        return actuation.with_ports(pulses, (left, right))
    if p.engine.ignition != BY_SPARK:  # which stops at every edge
        pulses = actuation.advance(pulses, p.injector, shut_ns)
    return actuation.shut(pulses, p.injector, side, shut_ns, s.stroke.number)
