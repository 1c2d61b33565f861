"""The work of a charge by when it is lit: the detailed engine's heat release on a fast engine.

Heat dQ released at the volume V, whether before or after the dead centre, has done the work
dQ (1 - (V/Ve)^(gamma-1)) when the charge has expanded to Ve (eq. 3.12 along an isentrope).
So of a combustion that releases x_b(t), by Wiebe's function (eq. 3.19),

    W / Q = integral of (1 - (V(t)/Ve)^(gamma-1)) dx_b,    V(t) = A (L - X cos(omega t))

Ve is the volume at mid-stroke, from where on nothing more is gained.
"""

from __future__ import annotations

import math
from typing import Final, final

from hil.values import Value

WIEBE_A: Final = 5.0
WIEBE_B: Final = 2.0
_PARTS: Final = 400
_OCTANE: Final = 95.0
_ATM: Final = 101_325.0
_END_GAS: Final = 0.95
"""Share burnt beyond which what is left cannot knock."""


@final
class Compression(Value):
    """A settled stroke about its dead centre, and the charge at mid-stroke.

    heat_j: what burns; burn_s: how long
    """

    __slots__ = (
        "tdc_m",
        "half_m",
        "area_m2",
        "omega",
        "gamma",
        "p0_pa",
        "t0_k",
        "heat_j",
        "burn_s",
    )

    def __init__(
        self, tdc_m: float, half_m: float, area_m2: float, omega: float, gamma: float,
        p0_pa: float, t0_k: float, heat_j: float, burn_s: float,
    ) -> None:  # fmt: skip
        self.tdc_m = tdc_m
        self.half_m = half_m
        self.area_m2 = area_m2
        self.omega = omega
        self.gamma = gamma
        self.p0_pa = p0_pa
        self.t0_k = t0_k
        self.heat_j = heat_j
        self.burn_s = burn_s

    def share(self, t_s: float) -> float:
        """Volume as a share of that at mid-stroke, so long after the dead centre."""
        return 1.0 - self.tdc_m / self.half_m * math.cos(self.omega * t_s)

    def position_m(self, lead_s: float) -> float:
        """Distance from mid-stroke, so long before the dead centre [m]."""
        return self.tdc_m * math.cos(self.omega * lead_s)


def burnt(share: float) -> float:
    """Share of the heat that is released after a share of the burn's duration (eq. 3.19)."""
    return 1.0 - math.exp(-WIEBE_A * math.pow(max(share, 0.0), WIEBE_B + 1.0))


def work(c: Compression, lead_s: float) -> float:
    """Share of the heat that becomes work, of a charge lit so long before the dead centre."""
    total, before = 0.0, 0.0
    for part in range(_PARTS):
        now = burnt((part + 1) / _PARTS)
        volume = c.share((part + 0.5) / _PARTS * c.burn_s - lead_s)
        total += (now - before) * max(1.0 - math.pow(volume, c.gamma - 1.0), 0.0)
        before = now
    return total / before


def peak(c: Compression, lead_s: float) -> tuple[float, float]:
    """Peak pressure [Pa], and the knock integral of the gas that is still to burn.

    p V^gamma grows by (gamma - 1) V^(gamma-1) dQ. Knock where the integral of dt / tau reaches 1
    before the burn ends, tau = 17.68 ms (ON/100)^3.402 (p/atm)^-1.7 exp(3800 K / T)
    (Livengood and Wu; Douglas and Eyzat).
    """
    gamma, volume0 = c.gamma, c.area_m2 * c.half_m
    step_s, before, strength = c.burn_s / _PARTS, 0.0, c.p0_pa
    highest, knock = 0.0, 0.0
    for part in range(-_PARTS, _PARTS):
        t = (part + 0.5) * step_s - lead_s
        volume = c.share(t)
        if part >= 0:
            now = burnt((part + 1) / _PARTS)
            heat_j = c.heat_j * (now - before)
            strength += (gamma - 1.0) * math.pow(volume, gamma - 1.0) * heat_j / volume0
            before = now
        p = strength * math.pow(volume, -gamma)
        highest = max(highest, p)
        if before < _END_GAS:
            unburnt_k = c.t0_k * math.pow(p / c.p0_pa, (gamma - 1.0) / gamma)
            delay_s = 17.68e-3 * math.pow(_OCTANE / 100.0, 3.402)
            delay_s *= math.pow(p / _ATM, -1.7) * math.exp(3800.0 / unburnt_k)
            knock += step_s / delay_s
    return highest, knock


def best_lead(c: Compression, longest_s: float, step_s: float = 1e-4) -> float:
    """The lead with the most work, on a grid [s]."""
    leads = [n * step_s for n in range(int(longest_s / step_s) + 1)]
    return max(leads, key=lambda lead: work(c, lead))


def knock_limited_lead(c: Compression, longest_s: float, step_s: float = 1e-4) -> float:
    """The longest lead without knock, on a grid; 0 where every one knocks [s]."""
    lead_s = 0.0
    while lead_s + step_s <= longest_s and peak(c, lead_s + step_s)[1] < 1.0:
        lead_s += step_s
    return lead_s


def factors(c: Compression, planned_s: float, leads_s: tuple[float, ...]) -> tuple[float, ...]:
    """Work by that of the planned lead, exactly 1 there."""
    planned = work(c, planned_s)
    return tuple([work(c, lead) / planned for lead in leads_s])
