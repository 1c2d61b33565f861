"""Where each quantity stands in the arrays that the compiled step works on.

y: what is integrated; d: what changes at events; p: what is constant in a run.
Cylinder 0 is the left one, 1 the right; quantities of a cylinder stand at base + stride * cylinder.
"""

from __future__ import annotations

from typing import Final

# --- y: motion, gas, circuit ---------------------------------------------------------------
X, V = 0, 1
U, M, GAS_STRIDE = 2, 3, 2
"""Internal energy [J] and mass [kg] of the gas: 2, 3 left cylinder, 4, 5 right."""
CASE_U, CASE_M = 6, 7
"""The same of the scavenging pumps: 6, 7 under the left piston, 8, 9 under the right."""
CURRENT, CHARGE = 10, 11
"""Of a circuit, current and charge; of a dq machine, i_q and i_d [A]."""

# --- y: integrals, for the balances (per cylinder, then of the whole engine) ------------------
SUM, SUM_STRIDE = 12, 9
Q_FUEL, Q_WALL, W_GAS, H_IN, H_EX, H_LEAK, M_IN, M_EX, M_LEAK = range(9)
(W_GENERATED, W_MOTORED, W_FRICTION, H_REED, M_REED, W_CASE, P_MOTOR, Q_COPPER, W_TERMINAL) = range(
    30, 39
)
"""P_MOTOR: size of the motor's power, driving or braking (thesis eq. 4.2); Q_COPPER: heat of the
winding, with a circuit whose resistances are one also of its load; W_TERMINAL: what a dq machine
takes from its supply, and less than nothing where a circuit feeds its load."""
N_Y: Final = 39

# --- d: events and orders ------------------------------------------------------------------
(
    T,  # time since the start of the run [s]
    DIRECTION,  # +1, -1, or 0 at rest
    PHASE,  # row of the programme
    NEXT,  # next entry of that row
    HEAT,  # 130 hk 1e5^-0.8 (v_p + 1.4)^0.8, renewed at dead centres (eq. 3.18)
    LOAD,  # load coefficient in force [N s/m]
    FORCE,  # machine force in force [N]
    DC_NUMBER,
    DC_T,
    DC_X,
    V_MAX,  # greatest speed since the last dead centre
    CONTACTS,
    ROWS,  # rows of the record that have been written
    ENERGY,  # energy that the next ignition by position releases [J]
    LOAD_SCALE,
    SPEED_REF,  # speed that a servo holds [m/s]; 0: the machine gives a force
) = range(16)
CYL, CYL_STRIDE = 16, 15
(
    INTAKE,  # 1 open
    EXHAUST,
    SPARK_T,  # start of the heat release; NEVER when there is none
    Q_IN,  # its energy [J]
    P_MAX,  # greatest pressure since the cylinder's last bottom dead centre
    P_OLD,  # pressure and its rate at the start of the step before
    DP_OLD,
    P_MAX_T,
    INTAKE_LINE,  # 1: this valve follows its TTL line, no longer the piston
    EXHAUST_LINE,
    P_MAX_X,  # position at the greatest pressure
    RISE_MAX,  # steepest rise of the pressure since the cylinder's last bottom dead centre [Pa/s]
    CYCLE_P,  # of the cycle that ended there: greatest pressure, its position, steepest rise
    CYCLE_X,
    CYCLE_RISE,
) = range(15)
N_D: Final = CYL + 2 * CYL_STRIDE
NEVER: Final = 1.0e30
LOAD_CONSTANT, CIRCUIT, DQ = range(3)
"""Kinds of linear machine: eq. 3.56, eq. 3.54, App. I eqs. 22 and 23."""

# --- p: constants --------------------------------------------------------------------------
(
    GAMMA,
    R_GAS,
    MASS,
    P_AMBIENT,
    T_AMBIENT,
    HOHENBERG,  # 130 hk 1e5^-0.8
    RING_PRESSURE,  # K_v / p_0 [1/Pa]
    F_MACHINE,  # F_fm [N]
    WIEBE_A,
    WIEBE_B,
    BURN_S,
    STEP_S,
    CRITICAL,  # [2/(gamma+1)]^(gamma/(gamma-1))
    CHOKED,  # gamma^0.5 (2/(gamma+1))^((gamma+1)/(2(gamma-1)))
    SUBSONIC,  # sqrt(2 gamma/(gamma-1))
    SMALL,  # pressure differences below this share of p_u flow as a cubic, not as a root
    CUBIC_1,
    CUBIC_3,
    PUMP,  # 1: scavenging pumps under the pistons
    CASE_VOLUME,  # of a pump at mid-stroke [m3]
    CASE_AREA,
    CASE_REED,  # C_d A of its inlet [m2]
    MACHINE,  # what kind of linear machine
    K_FORCE,
    K_EMF,
    RESISTANCE,  # of a phase of the dq machine; of a circuit's machine, 0: not parted from the load
    INDUCTANCE,
    INV_CAPACITANCE,
    POLE_PITCH,  # of a circuit, 0: thrust constant everywhere; else K cos(pi x / tau) (3.50, 3.51)
    REGULATOR,  # 1 / time constant of the current regulators [1/s]
    SUPPLY,  # greatest phase voltage [V]
    SPRING,  # stiffness of a mechanical spring [N/m]
    SPRING_X,  # where it is relaxed
    SERVO,  # how fast a servo corrects its speed [1/s]
    SERVO_A,  # its greatest acceleration [m/s2]
    CONTACT_GAP,
    RESTITUTION,
    PEAK_FORCE,
    BURNT_S,  # after this, exp(-60) of the charge is left
) = range(39)
CYL_P, CYL_P_STRIDE = 39, 15
(
    SIGN,  # gap = LENGTH + SIGN x
    AREA,
    LENGTH,
    END_AREA,  # piston crown and head [m2]
    PERIMETER,
    T_WALL,
    CDA_IN,
    CDA_EX,
    CDA_LEAK,
    P_IN,
    T_IN,
    P_EX,
    T_EX,
    WALL,  # share of the wall that takes up heat; 0 for an adiabatic gas
    RING,  # f A_f (1 - B_f (E - theta0)/theta0) d/d0 (eq. 3.4)
) = range(15)
N_P: Final = CYL_P + 2 * CYL_P_STRIDE

# --- the programme: what happens at which position of which stroke -------------------------
(
    DO_NOTHING,
    OPEN_INTAKE,
    CLOSE_INTAKE,
    OPEN_EXHAUST,
    CLOSE_EXHAUST,
    IGNITE,
    MOTOR,
    GENERATE,
    HOLD_SPEED,
) = range(9)
"""Actions on a cylinder are the code + 100 * cylinder."""
BY_CYLINDER: Final = 100

# --- the record: one row a dead centre -----------------------------------------------------
(REC_T, REC_X, REC_PHASE, REC_V_MAX, REC_P_LEFT, REC_P_RIGHT, REC_SUMS) = range(7)
N_REC: Final = REC_SUMS + N_Y
TIME_UP, DEAD_CENTRE, CONTACT, AT_POSITION, FAILED = range(5)
"""What ends a step."""
