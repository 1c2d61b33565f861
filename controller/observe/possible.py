"""What is possible of an engine: how fast its piston changes its speed, how long it takes."""

from __future__ import annotations

import math
from typing import Final, final

from mypy_extensions import i64

from hil.config.prototypes import Prototype
from hil.values import Value

DWELL: Final = 0.24
DWELL_UNFIRED: Final = 1.25
"""Part of a stroke for which the piston may be slow; a stroke without compression takes longer."""


@final
class Possible(Value):
    """What is possible, of an engine at its operating point.

    reach_m: amplitude; a_m_s2: greatest acceleration of a sine of it in a stroke's time
    dwell_ns, still_ns, overdue_ns: how long the piston may be slow about a dead centre, slow or at
        rest though the machine pushes, and without a dead centre
    patience_ns: how long samples may be refused; force_n: greatest one in motoring
    """

    __slots__ = (
        "period_ns", "reach_m", "a_m_s2", "dwell_ns", "still_ns", "overdue_ns", "patience_ns",
        "force_n",
    )  # fmt: skip

    def __init__(
        self, period_ns: i64, reach_m: float, a_m_s2: float, dwell_ns: i64, still_ns: i64,
        overdue_ns: i64, patience_ns: i64, force_n: float,
    ) -> None:  # fmt: skip
        self.period_ns = period_ns
        self.reach_m = reach_m
        self.a_m_s2 = a_m_s2
        self.dwell_ns = dwell_ns
        self.still_ns = still_ns
        self.overdue_ns = overdue_ns
        self.patience_ns = patience_ns
        self.force_n = force_n

    def acceleration(self, x1_m: float, x2_m: float) -> float:
        """Most that air springs, charge and machine give between two positions [m/s2].

        a0 (1.2 + 12 xi^6), twice what any model of any engine has shown
        """
        xi = max(abs(x1_m), abs(x2_m)) / self.reach_m
        square = xi * xi
        return self.a_m_s2 * (1.2 + 12.0 * square * square * square)


def possible_of(
    engine: Prototype, reach_m: float, stroke_s: float, period_ns: int, stale_s: float,
    every_stroke_fires: bool, force_n: float,
) -> Possible:  # fmt: skip
    """What is possible of an engine that runs to `reach_m` with strokes of that duration.

    a0 = X (pi / T)^2, of the shorter of a steady stroke and one of the air springs alone
    """
    unfired_s = math.pi * math.sqrt(engine.moving_mass_kg / engine.rest_stiffness_n_m)
    omega = math.pi / min(stroke_s, unfired_s)
    dwell_s = (DWELL if every_stroke_fires else DWELL_UNFIRED) * stroke_s
    overdue_s = max(2.0 * unfired_s, 2.5 * stroke_s)
    return Possible(
        period_ns, reach_m, reach_m * omega * omega, round(dwell_s * 1e9),
        round(max(unfired_s, 2.0 * dwell_s) * 1e9), round(overdue_s * 1e9),
        round(stale_s * 1e9) // period_ns * period_ns, force_n,
    )  # fmt: skip
