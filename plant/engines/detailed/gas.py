"""Gas: flow through a restriction, heat to the wall, heat release; compiled."""

from __future__ import annotations

import math

from plant.engines.detailed import layout as at
from plant.engines.detailed.compiler import compiled
from plant.engines.detailed.types import Array


@compiled
def flow(p: Array, cda: float, p_up: float, t_up: float, p_down: float) -> float:
    """Mass flow through C_d A from p_up to p_down <= p_up     (thesis eq. 3.15, corrected).

    Below a small pressure difference the root goes over into a cubic of the same value and slope,
    as flow at low Reynolds numbers does; a bare root has no bounded derivative there.
    """
    r = p_down / p_up
    scale = cda * p_up / math.sqrt(p[at.R_GAS] * t_up)
    if r <= p[at.CRITICAL]:
        return float(scale * p[at.CHOKED])
    z = (1.0 - r) / p[at.SMALL]
    if z < 1.0:
        return float(scale * z * (p[at.CUBIC_1] + p[at.CUBIC_3] * z * z))
    w = math.exp(math.log(r) / p[at.GAMMA])
    return float(scale * p[at.SUBSONIC] * math.sqrt(w * (w - r)))


@compiled
def heat_to_wall(
    p: Array, c: int, heat: float, volume: float, gap: float, p_gas: float, t_gas: float
) -> float:
    """Q' = h A_cyl (T - T_w), h by Hohenberg     (thesis eqs. 3.17, 3.18)."""
    b = at.CYL_P + c * at.CYL_P_STRIDE
    wall = p[b + at.WALL]
    if wall == 0.0:
        return 0.0
    logs = 0.4 * math.log(p_gas * p_gas / t_gas) - 0.06 * math.log(volume)
    area = p[b + at.END_AREA] + p[b + at.PERIMETER] * gap
    return float(wall * heat * math.exp(logs) * area * (t_gas - p[b + at.T_WALL]))


@compiled
def heat_release(p: Array, q_in: float, tau: float) -> float:
    """Q' = Q_in a (b+1)/C_d u^b exp(-a u^(b+1)), u = tau/C_d     (thesis eq. 3.21, corrected)."""
    if tau <= 0.0 or tau > p[at.BURNT_S]:
        return 0.0
    a, b, burn = p[at.WIEBE_A], p[at.WIEBE_B], p[at.BURN_S]
    u = tau / burn
    power = u * u if b == 2.0 else u**b
    exponent = a * power * u
    return float(q_in * a * (b + 1.0) / burn * power * math.exp(-exponent))
