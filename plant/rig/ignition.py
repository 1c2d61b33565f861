"""Whether a spark lights its charge, and what the moment makes of its work."""

from __future__ import annotations

import math
from typing import final

from mypy_extensions import i64

from hil.config.charge.ignition import IgnitionConfig
from hil.config.prototypes import Prototype
from hil.randoms import SPARK, normal_pair
from hil.rounding import nearest
from hil.values import Value


@final
class Ignition(Value):
    """Where compression is enough, and the map of the work; an empty one: always the same.

    from_m: distance from mid-stroke from which on a charge catches fire
    lead_s, factor: time from spark to dead centre, rising, and work by that of the planned one
    """

    __slots__ = ("from_m", "least_pa", "lead_s", "factor")

    def __init__(
        self, from_m: float, least_pa: float, lead_s: tuple[float, ...], factor: tuple[float, ...]
    ) -> None:
        self.from_m = from_m
        self.least_pa = least_pa
        self.lead_s = lead_s
        self.factor = factor

    def work_of(self, lead_ns: float) -> float:
        """Work by that of a spark where it was planned; between two points in proportion."""
        leads, lead = self.lead_s, lead_ns * 1e-9
        if not leads:
            return 1.0
        for n in range(len(leads) - 1):
            if lead <= leads[n + 1]:
                part = max(lead - leads[n], 0.0) / (leads[n + 1] - leads[n])
                return self.factor[n] + part * (self.factor[n + 1] - self.factor[n])
        return self.factor[-1]

    def objection(self, position_m: float) -> str:
        """Why a spark at that distance from mid-stroke lights nothing; empty where it does."""
        if position_m >= self.from_m:
            return ""
        least_bar = self.least_pa * 1e-5
        return f"early spark (at {position_m * 1e3:.2f} mm, short of {least_bar:.3g} bar)"


def ignition_of(config: IgnitionConfig, engine: Prototype) -> Ignition:
    """Flatten section `ignition`:  p0 (L / (L - z))^gamma = p_least."""
    share = math.pow(max(engine.p0_pa / config.least_pa, 0.0), 1.0 / engine.gamma)
    from_m = engine.half_stroke_m * (1.0 - share)
    if config.work == "constant":
        return Ignition(from_m, config.least_pa, (), ())
    return Ignition(from_m, config.least_pa, config.lead_s, config.factor)


def strike_ns(jitter_s: float, seed: int, side: int, edge_ns: i64) -> i64:
    """When a spark strikes whose line rises at an instant: |z| jitter later, z standard normal.

    The draw belongs to that instant, so that a run has the same however it came there.
    """
    if jitter_s == 0.0:
        return edge_ns
    z = normal_pair(seed, SPARK, edge_ns)[side]
    return edge_ns + nearest(abs(z) * jitter_s * 1e9)


def place_m(x0: float, v0: float, x1: float, v1: float, lasts_s: float, after_s: float) -> float:
    """Position so long after the first of two known motions: the cubic through both [m]."""
    if lasts_s <= 0.0:
        return x1
    s = min(max(after_s / lasts_s, 0.0), 1.0)
    r = 1.0 - s
    first = r * r * ((1.0 + 2.0 * s) * x0 + s * lasts_s * v0)
    return first + s * s * ((1.0 + 2.0 * r) * x1 - r * lasts_s * v1)
