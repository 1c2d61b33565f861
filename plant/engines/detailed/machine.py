"""The linear machine, compiled: load constant, equivalent circuit, dq model, speed servo."""

from __future__ import annotations

import math

from plant.engines.detailed import layout as at
from plant.engines.detailed.compiler import compiled
from plant.engines.detailed.types import Array


@compiled
def machine_force(p: Array, d: Array, y: Array, out: Array, other: float) -> float:
    """Force of the machine as its kind has it; what it converts goes into the sums.

    Parameters: other : sum of all other forces, which a servo makes up for [N]
    """
    v = y[at.V]
    limit = p[at.PEAK_FORCE]
    motor = min(max(d[at.FORCE], -limit), limit)
    if d[at.SPEED_REF] != 0.0:
        motor = min(max(servo_force(p, d, y, other), -limit), limit)
    load = d[at.LOAD] * d[at.LOAD_SCALE]
    out[at.CURRENT] = out[at.CHARGE] = out[at.Q_COPPER] = out[at.W_TERMINAL] = 0.0
    brake = -load * v
    if p[at.MACHINE] == at.CIRCUIT:
        brake = circuit_force(p, y, out, load) if load > 0.0 else 0.0
    elif p[at.MACHINE] == at.DQ:
        force = dq_force(p, y, out, motor + brake)
        motor, brake = (0.0, force) if load > 0.0 else (force, 0.0)
    out[at.W_GENERATED] = -brake * v
    out[at.W_MOTORED] = motor * v
    out[at.P_MOTOR] = abs(motor * v)
    return float(brake + motor)


@compiled
def servo_force(p: Array, d: Array, y: Array, other: float) -> float:
    """Force that brings the piston to its speed with a limited acceleration (thesis Table 4.1)."""
    wanted = p[at.SERVO] * (d[at.SPEED_REF] - y[at.V])
    most = p[at.SERVO_A]
    return float(p[at.MASS] * min(max(wanted, -most), most) - other)


@compiled
def circuit_force(p: Array, y: Array, out: Array, load: float) -> float:
    """Force -K i of a circuit  L i' = K_e v - R i - q/C, q' = i     (thesis eqs. 3.51 to 3.54).

    The load sets the resistance, R = R_S + R_L = K_A K_e / C_e (3.56), no less than R_S; K is
    constant, or K cos(pi x / tau) of one coil (3.50).
    """
    shape = 1.0
    if p[at.POLE_PITCH] > 0.0:
        shape = math.cos(math.pi * y[at.X] / p[at.POLE_PITCH])
    i = y[at.CURRENT]
    own = p[at.RESISTANCE]
    total = max(p[at.K_FORCE] * p[at.K_EMF] / load, own)
    drop = total * i + p[at.INV_CAPACITANCE] * y[at.CHARGE]
    out[at.CURRENT] = (p[at.K_EMF] * shape * y[at.V] - drop) / p[at.INDUCTANCE]
    out[at.CHARGE] = i
    out[at.Q_COPPER] = total * i * i
    if own > 0.0:
        out[at.Q_COPPER] = own * i * i
        out[at.W_TERMINAL] = -(total - own) * i * i
    return float(-p[at.K_FORCE] * shape * i)


@compiled
def dq_force(p: Array, y: Array, out: Array, wanted: float) -> float:
    """Thrust K_A i_q of a three-phase synchronous machine     (App. I eqs. 22 to 24).

    v_q = R i_q + L i_q' + w (L i_d + psi), v_d = R i_d + L i_d' - w L i_q, w = pi v / tau. With the
    factor 2/3 of eq. 22 the power is 3/2 (v_d i_d + v_q i_q), so that K_A = 3/2 psi pi / tau. The
    regulators make up for the back-EMF and hold i_q = wanted / K_A, i_d = 0, as far as the supply's
    voltage goes; what is missing is taken from both voltages in proportion.
    """
    i_q, i_d = y[at.CURRENT], y[at.CHARGE]
    ohm, henry, k = p[at.RESISTANCE], p[at.INDUCTANCE], p[at.K_FORCE]
    w = math.pi * y[at.V] / p[at.POLE_PITCH]
    back_q = w * henry * i_d + k / 1.5 * y[at.V]
    back_d = -w * henry * i_q
    v_q = ohm * i_q + back_q + henry * p[at.REGULATOR] * (wanted / k - i_q)
    v_d = ohm * i_d + back_d - henry * p[at.REGULATOR] * i_d
    size = math.sqrt(v_q * v_q + v_d * v_d)
    if size > p[at.SUPPLY]:
        v_q *= p[at.SUPPLY] / size
        v_d *= p[at.SUPPLY] / size
    out[at.CURRENT] = (v_q - ohm * i_q - back_q) / henry
    out[at.CHARGE] = (v_d - ohm * i_d - back_d) / henry
    out[at.Q_COPPER] = 1.5 * ohm * (i_q * i_q + i_d * i_d)
    out[at.W_TERMINAL] = 1.5 * (v_q * i_q + v_d * i_d)
    return float(k * i_q)
