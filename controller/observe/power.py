"""The mean electric power of a stroke, from readings that come every few ticks.

P ~ v^2 is nought at a dead centre and a parabola about it. Between two readings, h apart, the
energy is that of a trapezoid, and P t / 3 between a dead centre and a reading t from it. What
trapezoids leave out of a curve is h^2 / 12 times the fall of its slope (Euler, Maclaurin), and that
slope is 2 P / t.
"""

from __future__ import annotations

import math
from typing import Final, final

from mypy_extensions import i64, mypyc_attr

from hil.values import Value


@final
@mypyc_attr(acyclic=True, free_list_len=1)
class Metering(Value):
    """Energy since the last dead centre, up to the newest reading.

    t_ns, power_w: of that reading, or the dead centre itself; gap_s: between the last two readings
    begun_ns: the dead centre, -1 before the first; mean_w: of the last whole stroke, None before
    """

    __slots__ = ("t_ns", "power_w", "energy_j", "begun_ns", "mean_w", "gap_s")

    def __init__(
        self, t_ns: i64 = -1, power_w: float = 0.0, energy_j: float = 0.0, begun_ns: i64 = -1,
        mean_w: float | None = None, gap_s: float = 0.0,
    ) -> None:  # fmt: skip
        self.t_ns = t_ns
        self.power_w = power_w
        self.energy_j = energy_j
        self.begun_ns = begun_ns
        self.mean_w = mean_w
        self.gap_s = gap_s


_NEAREST: Final = 0.25

UNMETERED: Final = Metering()


def read(metering: Metering, t_ns: i64, power_w: float) -> Metering:
    """Take a reading; nan is none."""
    if math.isnan(power_w):
        return metering
    energy_j, gap_s = metering.energy_j, metering.gap_s
    if metering.t_ns >= 0:
        dt_s = float(t_ns - metering.t_ns) * 1e-9
        if metering.t_ns == metering.begun_ns:
            energy_j += _to_dead_centre(power_w, dt_s, gap_s)
        else:
            energy_j += 0.5 * (metering.power_w + power_w) * dt_s
            gap_s = dt_s
    return Metering(t_ns, power_w, energy_j, metering.begun_ns, metering.mean_w, gap_s)


def ended(metering: Metering, dc_t_ns: i64) -> Metering:
    """End a stroke at its dead centre, which lies between the newest reading and the next."""
    begun_ns = metering.begun_ns
    mean_w: float | None = None
    if 0 <= begun_ns < dc_t_ns:
        rest_s = float(dc_t_ns - metering.t_ns) * 1e-9
        energy_j = metering.energy_j + _to_dead_centre(metering.power_w, rest_s, metering.gap_s)
        mean_w = energy_j / (float(dc_t_ns - begun_ns) * 1e-9)
    return Metering(dc_t_ns, 0.0, 0.0, dc_t_ns, mean_w, metering.gap_s)


def _to_dead_centre(power_w: float, dt_s: float, gap_s: float) -> float:
    """Energy between a reading and a dead centre, and what the trapezoids beyond it leave out.

    So near to the dead centre that the resolution of the power would tell, the slope is not
    believed.
    """
    return power_w * (dt_s / 3.0 + gap_s * gap_s / (6.0 * max(dt_s, _NEAREST * gap_s, 1e-6)))
