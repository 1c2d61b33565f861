"""Right-hand side of the engine, compiled: eqs. 3.1, 3.4, 3.5, 3.12 to 3.18, App. I 21.

Internal energy and mass are the states of a gas, not pressure: what flows out of one balance then
flows into another with the same weights in every Runge-Kutta stage, and both sums are kept.
"""

from __future__ import annotations

import math

from plant.engines.detailed import layout as at
from plant.engines.detailed.compiler import compiled
from plant.engines.detailed.gas import flow, heat_release, heat_to_wall
from plant.engines.detailed.machine import machine_force
from plant.engines.detailed.types import Array

_CREEP_M_S = 1.0e-6
"""Below this the root of eq. 3.4 is a straight line: its slope at rest would be infinite."""


@compiled
def pressure(p: Array, y: Array, c: int) -> float:
    """Pressure p = (gamma - 1) U / V of a cylinder     (thesis eqs. 3.6, 3.8)."""
    b = at.CYL_P + c * at.CYL_P_STRIDE
    gap = p[b + at.LENGTH] + p[b + at.SIGN] * y[at.X]
    return float((p[at.GAMMA] - 1.0) * y[at.U + at.GAS_STRIDE * c] / (p[b + at.AREA] * gap))


@compiled
def case_pressure(p: Array, y: Array, c: int) -> float:
    """Pressure of the pump under a piston; its volume shrinks as the cylinder's grows."""
    sign = p[at.CYL_P + c * at.CYL_P_STRIDE + at.SIGN]
    volume = p[at.CASE_VOLUME] - sign * p[at.CASE_AREA] * y[at.X]
    return float((p[at.GAMMA] - 1.0) * y[at.CASE_U + at.GAS_STRIDE * c] / volume)


@compiled
def case_temperature(p: Array, y: Array, c: int) -> float:
    """Temperature T = (gamma - 1) U / (m R) of a pump."""
    k = at.GAS_STRIDE * c
    return float((p[at.GAMMA] - 1.0) * y[at.CASE_U + k] / (y[at.CASE_M + k] * p[at.R_GAS]))


@compiled
def exchange(
    p: Array, cda: float, p1: float, t1: float, p2: float, t2: float
) -> tuple[float, float]:
    """Mass and enthalpy flow from 1 to 2, negative when it goes the other way."""
    c_p = p[at.GAMMA] / (p[at.GAMMA] - 1.0) * p[at.R_GAS]
    if p1 >= p2:
        mdot = flow(p, cda, p1, t1, p2)
        return mdot, mdot * c_p * t1
    mdot = flow(p, cda, p2, t2, p1)
    return -mdot, -mdot * c_p * t2


@compiled
def cylinder(p: Array, d: Array, y: Array, out: Array, t: float, c: int) -> float:
    """First law and mass of one cylinder; returns its pressure.

    dU/dt = -p dV/dt + Q_c' - Q_ht' + sum of m' h     (thesis eqs. 3.5, 3.14)

    What passes the rings goes under the piston: into the pump (App. I eq. 15), or the air.
    """
    b, e = at.CYL_P + c * at.CYL_P_STRIDE, at.CYL + c * at.CYL_STRIDE
    u, m, s = at.U + at.GAS_STRIDE * c, at.M + at.GAS_STRIDE * c, at.SUM + at.SUM_STRIDE * c
    gap = p[b + at.LENGTH] + p[b + at.SIGN] * y[at.X]
    volume = p[b + at.AREA] * gap
    p_gas = (p[at.GAMMA] - 1.0) * y[u] / volume
    t_gas = p_gas * volume / (y[m] * p[at.R_GAS])
    work = p_gas * p[b + at.AREA] * p[b + at.SIGN] * y[at.V]
    burnt = heat_release(p, d[e + at.Q_IN], t - d[e + at.SPARK_T])
    wall = heat_to_wall(p, c, d[at.HEAT], volume, gap, p_gas, t_gas)
    m_leak = h_leak = m_in = h_in = m_ex = h_ex = 0.0
    p_below, t_below, p_up, t_up = p[at.P_AMBIENT], p[at.T_AMBIENT], p[b + at.P_IN], p[b + at.T_IN]
    if p[at.PUMP] != 0.0:
        p_below = p_up = case_pressure(p, y, c)
        t_below = t_up = case_temperature(p, y, c)
    if p[b + at.CDA_LEAK] > 0.0:
        m_leak, h_leak = exchange(p, p[b + at.CDA_LEAK], p_gas, t_gas, p_below, t_below)
    if d[e + at.INTAKE] != 0.0:
        m_in, h_in = exchange(p, p[b + at.CDA_IN], p_up, t_up, p_gas, t_gas)
    if d[e + at.EXHAUST] != 0.0:
        m_ex, h_ex = exchange(p, p[b + at.CDA_EX], p_gas, t_gas, p[b + at.P_EX], p[b + at.T_EX])
    out[u] = burnt - wall - work + h_in - h_ex - h_leak
    out[m] = m_in - m_ex - m_leak
    out[s + at.Q_FUEL] = burnt
    out[s + at.Q_WALL] = wall
    out[s + at.W_GAS] = work
    out[s + at.H_IN] = h_in
    out[s + at.H_EX] = h_ex
    out[s + at.H_LEAK] = h_leak
    out[s + at.M_IN] = m_in
    out[s + at.M_EX] = m_ex
    out[s + at.M_LEAK] = m_leak
    return float(p_gas)


@compiled
def pump(p: Array, d: Array, y: Array, out: Array, c: int) -> float:
    """Gas under a piston: adiabatic (App. I eq. 21), reed inlet, what the cylinder takes and leaks.

    Returns: its pressure
    """
    k, s = at.GAS_STRIDE * c, at.SUM + at.SUM_STRIDE * c
    sign = p[at.CYL_P + c * at.CYL_P_STRIDE + at.SIGN]
    p_case = case_pressure(p, y, c)
    work = -p_case * p[at.CASE_AREA] * sign * y[at.V]
    m_in = h_in = 0.0
    if p_case < p[at.P_AMBIENT]:
        t_case = case_temperature(p, y, c)
        m_in, h_in = exchange(p, p[at.CASE_REED], p[at.P_AMBIENT], p[at.T_AMBIENT], p_case, t_case)
    out[at.CASE_U + k] = h_in - out[s + at.H_IN] + out[s + at.H_LEAK] - work
    out[at.CASE_M + k] = m_in - out[s + at.M_IN] + out[s + at.M_LEAK]
    out[at.H_REED] += h_in
    out[at.M_REED] += m_in
    out[at.W_CASE] += work
    return p_case


@compiled
def ring_friction(p: Array, c: int, v: float, p_gas: float) -> float:
    """Size of f A_f sqrt|v| [1 - B_f (E - th0)/th0] (1 + K_v p/p0) d/d0     (thesis eq. 3.4)."""
    speed = abs(v)
    root = math.sqrt(speed) if speed > _CREEP_M_S else speed / math.sqrt(_CREEP_M_S)
    ring = p[at.CYL_P + c * at.CYL_P_STRIDE + at.RING]
    return float(ring * root * (1.0 + p[at.RING_PRESSURE] * p_gas))


@compiled
def rates(p: Array, d: Array, y: Array, out: Array, t: float) -> None:
    """Write dy/dt into `out`; m x'' = sum of the forces     (thesis eq. 3.1, App. I 1)."""
    for k in range(at.CASE_U, at.CURRENT):
        out[k] = 0.0
    out[at.H_REED] = out[at.M_REED] = out[at.W_CASE] = 0.0
    p_left = cylinder(p, d, y, out, t, 0)
    p_right = cylinder(p, d, y, out, t, 1)
    force = p_left * p[at.CYL_P + at.AREA]
    force -= p_right * p[at.CYL_P + at.CYL_P_STRIDE + at.AREA]
    if p[at.PUMP] != 0.0:
        force -= p[at.CASE_AREA] * (pump(p, d, y, out, 0) - pump(p, d, y, out, 1))
    force += p[at.P_AMBIENT] * (p[at.CYL_P + at.CYL_P_STRIDE + at.AREA] - p[at.CYL_P + at.AREA])
    force -= p[at.SPRING] * (y[at.X] - p[at.SPRING_X])
    v, direction = y[at.V], d[at.DIRECTION]
    friction = p[at.F_MACHINE]
    friction += ring_friction(p, 0, v, p_left) + ring_friction(p, 1, v, p_right)
    force += machine_force(p, d, y, out, force - direction * friction)
    out[at.X] = v
    out[at.V] = (force - direction * friction) / p[at.MASS]
    out[at.W_FRICTION] = direction * friction * v
    if direction == 0.0:
        out[at.X] = out[at.V] = 0.0
        out[at.W_FRICTION] = force


@compiled
def electric_power(p: Array, d: Array, y: Array, out: Array) -> float:
    """What the machine delivers [W], at its terminals where it has a winding, else on the mover."""
    if d[at.SPEED_REF] != 0.0:  # a servo's force is what all others leave to it
        rates(p, d, y, out, d[at.T])
    elif p[at.MACHINE] == at.LOAD_CONSTANT:
        return float((d[at.LOAD] * d[at.LOAD_SCALE] * y[at.V] - d[at.FORCE]) * y[at.V])
    else:
        machine_force(p, d, y, out, 0.0)
    if p[at.MACHINE] == at.DQ or p[at.RESISTANCE] > 0.0:
        return float(-out[at.W_TERMINAL])
    return float(out[at.W_GENERATED] - out[at.W_MOTORED])
