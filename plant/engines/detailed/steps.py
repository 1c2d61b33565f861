"""One step of the motion, compiled: Runge-Kutta, and a linearly implicit one for open valves.

With a valve open, the pressure in a small volume follows the manifold's in some 10 us. Explicit
steps have to be that short; an implicit one need not. Its Jacobian is the flows' dependence on the
pressure of the gas, of rank one a cylinder, so that there is nothing to factorise; and as its
vectors keep the balances of mass and energy, so does the step.
"""

from __future__ import annotations

import math

from plant.engines.detailed import layout as at
from plant.engines.detailed.compiler import compiled
from plant.engines.detailed.kernel import rates
from plant.engines.detailed.types import Array

_STABLE = 2.4
_NEAR = 0.005
"""Pressures this close, as a share, are near enough to their balance for an implicit step."""
_TRIAL, _RESULT, _RATES, _K, _G = 4, 5, 7, 8, 12
_W_U = at.CURRENT
WORK_ROWS = 14
"""Rows of the scratch space: slopes of Runge-Kutta 0 to 3, trial, result, slope at an event, rates,
stages of the implicit step 8 to 11, and its Jacobian's vectors 12 and 13."""

# ROS34PW2 of Rang and Angermann (2005): order 3 with any Jacobian, L-stable.
_GAMMA = 4.3586652150845900e-01
_A21, _A31, _A32 = 8.7173304301691801e-01, 8.4457060015369423e-01, -1.1299064236484185e-01
_C21 = -8.7173304301691801e-01
_C31, _C32 = -9.0338057013044082e-01, 5.4180672388095326e-02
_C41, _C42, _C43 = 2.4212380706095346e-01, -1.2232505839045147e00, 5.4526025533510214e-01
_B3 = 1.5452602553351020e00


@compiled
def one_step(p: Array, d: Array, y: Array, work: Array, t: float, h: float, implicit: bool) -> None:
    """Step from y with slope work[0] by h; the result is work[5]."""
    if implicit:
        rosenbrock(p, d, y, work, t, h)
    else:
        rk4(p, d, y, work, t, h)


@compiled
def rk4(p: Array, d: Array, y: Array, work: Array, t: float, h: float) -> None:
    """The classical step."""
    k1, k2, k3, k4, trial, result = work[0], work[1], work[2], work[3], work[4], work[5]
    for n in range(at.N_Y):
        trial[n] = y[n] + 0.5 * h * k1[n]
    rates(p, d, trial, k2, t + 0.5 * h)
    for n in range(at.N_Y):
        trial[n] = y[n] + 0.5 * h * k2[n]
    rates(p, d, trial, k3, t + 0.5 * h)
    for n in range(at.N_Y):
        trial[n] = y[n] + h * k3[n]
    rates(p, d, trial, k4, t + h)
    for n in range(at.N_Y):
        result[n] = y[n] + h / 6.0 * (k1[n] + 2.0 * (k2[n] + k3[n]) + k4[n])


@compiled
def rosenbrock(p: Array, d: Array, y: Array, work: Array, t: float, h: float) -> None:
    """K_i = h f(y + sum a_ij K_j) + h J sum c_ij K_j, with (1 - h gamma J) on the left side."""
    k1, k2, k3, k4 = work[_K], work[_K + 1], work[_K + 2], work[_K + 3]
    trial, result, f = work[_TRIAL], work[_RESULT], work[_RATES]
    stage(work, work[0], k1, h, 0.0, 0.0, 0.0)
    for n in range(at.N_Y):
        trial[n] = y[n] + _A21 * k1[n]
    rates(p, d, trial, f, t + _A21 * h)
    stage(work, f, k2, h, _C21, 0.0, 0.0)
    for n in range(at.N_Y):
        trial[n] = y[n] + _A31 * k1[n] + _A32 * k2[n]
    rates(p, d, trial, f, t + (_A31 + _A32) * h)
    stage(work, f, k3, h, _C31, _C32, 0.0)
    for n in range(at.N_Y):
        trial[n] = y[n] + k3[n]
    rates(p, d, trial, f, t + h)
    stage(work, f, k4, h, _C41, _C42, _C43)
    for n in range(at.N_Y):
        result[n] = y[n] + _C41 * k1[n] + _C42 * k2[n] + _B3 * k3[n] + _GAMMA * k4[n]


@compiled
def stage(work: Array, f: Array, k: Array, h: float, c1: float, c2: float, c3: float) -> None:
    """One stage: J = sum of g w^T over the cylinders, so that its inverse is a division."""
    for n in range(at.N_Y):
        k[n] = h * f[n]
    for c in range(2):
        u, g = at.U + at.GAS_STRIDE * c, work[_G + c]
        if g[u] == 0.0:
            continue
        w_u, w_x = g[_W_U], g[at.X]
        q = c1 * (w_u * work[_K, u] + w_x * work[_K, at.X])
        q += c2 * (w_u * work[_K + 1, u] + w_x * work[_K + 1, at.X])
        q += c3 * (w_u * work[_K + 2, u] + w_x * work[_K + 2, at.X])
        right = w_u * k[u] + w_x * k[at.X] + h * w_u * g[u] * q
        part = h * (q + _GAMMA * right / (1.0 - h * _GAMMA * w_u * g[u]))
        s = at.SUM + at.SUM_STRIDE * c
        k[u] += part * g[u]
        k[u + 1] += part * g[u + 1]
        k[s + at.H_IN] += part * g[s + at.H_IN]
        k[s + at.M_IN] += part * g[s + at.M_IN]
        k[s + at.H_EX] += part * g[s + at.H_EX]
        k[s + at.M_EX] += part * g[s + at.M_EX]


@compiled
def flow_slope(p: Array, z: float) -> float:
    """Slope of the bracket of eq. 3.15 at p_d/p_u = 1 - |z|, that of its cubic next to z = 0."""
    s = abs(z) / p[at.SMALL]
    if s < 1.0:
        return float((p[at.CUBIC_1] + 3.0 * p[at.CUBIC_3] * s * s) / p[at.SMALL])
    return float(1.0 / math.sqrt(2.0 * abs(z)))


@compiled
def linearise(p: Array, d: Array, y: Array, work: Array, c: int) -> float:
    """Write how the rates of a cylinder depend on its pressure through its open valves.

    J = g w^T: g sums the effects of each valve's flow times d m'/dp, w = dp/dy with
    dp/dU = (gamma - 1)/V and dp/dx = -p/gap; w stands in g where valves have no effect
    Returns: how far the pressures are apart, as a share of the greater one, at worst
    """
    b, e = at.CYL_P + c * at.CYL_P_STRIDE, at.CYL + c * at.CYL_STRIDE
    u, s, g = at.U + at.GAS_STRIDE * c, at.SUM + at.SUM_STRIDE * c, work[_G + c]
    g[u] = g[u + 1] = 0.0
    gap = p[b + at.LENGTH] + p[b + at.SIGN] * y[at.X]
    volume = p[b + at.AREA] * gap
    p_gas = (p[at.GAMMA] - 1.0) * y[u] / volume
    g[_W_U], g[at.X] = (p[at.GAMMA] - 1.0) / volume, -p_gas * p[b + at.SIGN] / gap
    t_gas = p_gas * volume / (y[u + 1] * p[at.R_GAS])
    c_p = p[at.GAMMA] / (p[at.GAMMA] - 1.0) * p[at.R_GAS]
    apart = 0.0
    for valve in range(2):
        h_sum = s + (at.H_IN if valve == 0 else at.H_EX)
        m_sum = s + (at.M_IN if valve == 0 else at.M_EX)
        g[h_sum] = g[m_sum] = 0.0
        if d[e + at.INTAKE + valve] == 0.0:
            continue
        p_far = p[b + (at.P_IN if valve == 0 else at.P_EX)]
        t_up = p[b + (at.T_IN if valve == 0 else at.T_EX)] if p_far > p_gas else t_gas
        z = (p_gas - p_far) / max(p_gas, p_far)
        apart = max(apart, abs(z))
        cda = p[b + (at.CDA_IN if valve == 0 else at.CDA_EX)]
        slope = cda * flow_slope(p, z) / math.sqrt(p[at.R_GAS] * t_up)
        g[u] -= slope * c_p * t_up
        g[u + 1] -= slope
        sign = -1.0 if valve == 0 else 1.0
        g[h_sum] = sign * slope * c_p * t_up
        g[m_sum] = sign * slope
    return apart


@compiled
def plan_step(p: Array, d: Array, y: Array, work: Array, h: float) -> tuple[float, bool]:
    """Length of the next step, at most h, and whether it is implicit.

    While pressures are far apart the flow is not stiff yet, but soon will be: short explicit steps.
    """
    h = h / max(math.ceil(machine_rate(p, d) * h / _STABLE), 1)
    fastest = valve_rate(p, d, y)
    if fastest * h <= _STABLE:
        return h, False
    if p[at.PUMP] == 0.0:
        apart = max(linearise(p, d, y, work, 0), linearise(p, d, y, work, 1))
        if apart < _NEAR:
            return h, True
    return h / math.ceil(fastest * h / _STABLE), False


@compiled
def machine_rate(p: Array, d: Array) -> float:
    """Fastest rate of the machine's circuit or regulators [1/s]."""
    fastest = 0.0
    load = d[at.LOAD] * d[at.LOAD_SCALE]
    if p[at.MACHINE] == at.CIRCUIT and load > 0.0:
        ohm = max(p[at.K_FORCE] * p[at.K_EMF] / load, p[at.RESISTANCE])
        fastest = ohm / p[at.INDUCTANCE]
        fastest = max(fastest, math.sqrt(p[at.INV_CAPACITANCE] / p[at.INDUCTANCE]))
    elif p[at.MACHINE] == at.DQ:
        fastest = max(p[at.REGULATOR], p[at.RESISTANCE] / p[at.INDUCTANCE])
    if d[at.SPEED_REF] != 0.0:
        fastest = max(fastest, p[at.SERVO])
    return float(fastest)


@compiled
def valve_rate(p: Array, d: Array, y: Array) -> float:
    """Rate at which a small difference of pressures dies out through open valves [1/s].

    lambda = gamma C_d A sqrt(R T) f'(0) / V
    """
    fastest = 0.0
    for c in range(2):
        e, b = at.CYL + c * at.CYL_STRIDE, at.CYL_P + c * at.CYL_P_STRIDE
        cda = d[e + at.INTAKE] * p[b + at.CDA_IN] + d[e + at.EXHAUST] * p[b + at.CDA_EX]
        if cda > 0.0:
            gap = p[b + at.LENGTH] + p[b + at.SIGN] * y[at.X]
            rt = (p[at.GAMMA] - 1.0) * y[at.U + at.GAS_STRIDE * c] / y[at.M + at.GAS_STRIDE * c]
            rate = p[at.GAMMA] * cda * math.sqrt(rt) * p[at.CUBIC_1] / p[at.SMALL]
            fastest = max(fastest, rate / (p[b + at.AREA] * gap))
    return fastest
