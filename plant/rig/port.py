"""Port injection: a film on the wall, vapour that waits, and the intake that closes.

    dm_film/dt = X m_inj' - m_film / tau,    m_vapour' = (1 - X) m_inj' + m_film / tau

solved exactly while the flow does not change. What is vapour when the intake closes is the charge.
"""

from __future__ import annotations

import math
from typing import Final, final

from mypy_extensions import i64

from hil.config.charge.injection import InjectorConfig
from hil.values import Value

_HALVINGS: Final = 40


@final
class Wall(Value):
    """Share X of the fuel that wets the wall, its time constant [ns], and where the intake closes.

    closes_m: in the direction of motion, from mid-stroke
    """

    __slots__ = ("share", "tau_ns", "closes_m")

    def __init__(self, share: float, tau_ns: float, closes_m: float) -> None:
        self.share = share
        self.tau_ns = tau_ns
        self.closes_m = closes_m


@final
class Port(Value):
    """An intake port at an instant: film, vapour that waits, and what the cylinder has taken in.

    stroke: number of the stroke in which its intake has closed last
    """

    __slots__ = ("t_ns", "film_kg", "vapour_kg", "charge_kg", "stroke")

    def __init__(
        self, t_ns: float = 0.0, film_kg: float = 0.0, vapour_kg: float = 0.0,
        charge_kg: float = 0.0, stroke: i64 = -1,
    ) -> None:  # fmt: skip
        self.t_ns = t_ns
        self.film_kg = film_kg
        self.vapour_kg = vapour_kg
        self.charge_kg = charge_kg
        self.stroke = stroke


DRY: Final = Port()
SETTLED: Final[i64] = -2
"""Stroke of a port that is still to be worked out."""


def wall_of(config: InjectorConfig, half_stroke_m: float) -> Wall | None:
    """Flatten the part of section `injector` that is of a port; None without one."""
    if config.kind != "port":
        return None
    closes_m = half_stroke_m - config.intake_closes_m
    return Wall(config.film_share, config.film_time_s * 1e9, closes_m)


def later(
    wall: Wall, port: Port, flow_kg_s: float, from_ns: float, to_ns: float, until_ns: float
) -> Port:
    """The port at a later instant, with fuel flowing from one instant to another."""
    start_ns = min(max(from_ns, port.t_ns), until_ns)
    end_ns = min(max(to_ns, start_ns), until_ns)
    film_kg = _film(wall, port.film_kg, 0.0, start_ns - port.t_ns)
    film_kg = _film(wall, film_kg, flow_kg_s, end_ns - start_ns)
    film_kg = _film(wall, film_kg, 0.0, until_ns - end_ns)
    fed_kg = flow_kg_s * (end_ns - start_ns) * 1e-9
    vapour_kg = port.vapour_kg + fed_kg + (port.film_kg - film_kg)
    return Port(until_ns, film_kg, vapour_kg, port.charge_kg, port.stroke)


def _film(wall: Wall, film_kg: float, flow_kg_s: float, lasts_ns: float) -> float:
    """Mass of the film after a time of even flow [kg]."""
    even_kg = wall.share * flow_kg_s * wall.tau_ns * 1e-9
    return even_kg + (film_kg - even_kg) * math.exp(-lasts_ns / wall.tau_ns)


def shut(port: Port, stroke: i64) -> Port:
    """Close the intake: all vapour is in the cylinder."""
    return Port(port.t_ns, port.film_kg, 0.0, port.charge_kg + port.vapour_kg, stroke)


def emptied(port: Port) -> Port:
    """Let the charge leave with the exhaust."""
    return Port(port.t_ns, port.film_kg, port.vapour_kg, 0.0, port.stroke)


def begun(film_kg: float, charge_kg: float, stroke_ns: float) -> tuple[Port, Port]:
    """Both ports of a settled motion at the left dead centre, before the first intake closes.

    They are worked out where it does: that of the left cylinder has closed a stroke before.
    """
    return Port(-stroke_ns, film_kg, 0.0, 0.0, SETTLED), Port(0.0, film_kg, 0.0, charge_kg, SETTLED)


def worked_out(wall: Wall, port: Port, shut_ns: float, stroke: i64) -> Port:
    """A port that has begun settled, at the first closing."""
    at = Port(shut_ns + port.t_ns, port.film_kg, 0.0, port.charge_kg, stroke)
    return later(wall, at, 0.0, shut_ns, shut_ns, shut_ns)


def crossing_share(
    z0: float, v0: float, z1: float, v1: float, lasts_s: float, at_m: float
) -> float:
    """Which part of a time has passed when the piston is at a position between two known ones.

    By the cubic through both positions and velocities.
    """
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        s = 0.5 * (low + high)
        r = 1.0 - s
        z = r * r * ((1.0 + 2.0 * s) * z0 + s * lasts_s * v0)
        z += s * s * ((1.0 + 2.0 * r) * z1 - r * lasts_s * v1)
        if z < at_m:
            low = s
        else:
            high = s
    return high
