"""From a calibration to the arrays of the compiled step, and an engine that can be run."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hil.config.detailed import Calibration
from hil.config.detailed.parts import Side
from hil.errors import RunError
from plant.engines.detailed import layout as at
from plant.engines.detailed.cycles import programme_of
from plant.engines.detailed.programme import enter_stroke
from plant.engines.detailed.solver import advance, scratch
from plant.engines.detailed.types import Array

RECORD_ROWS = 4096


class Engine(NamedTuple):
    """What does not change in a run: constants, programme, energy of a charge."""

    calibration: Calibration
    p: Array
    programme: Array
    energy_j: float


class Motion(NamedTuple):
    """The engine's whole state: integrated quantities, discrete ones, rows of finished strokes."""

    y: Array
    d: Array
    record: Array


def engine_of(
    c: Calibration, *, throttle: float = 1.0, self_timed: bool = True, programmed: bool = True
) -> Engine:
    """Make the arrays of an engine.

    Parameters: throttle : scales the charge's energy and the intake's opening
        self_timed : whether sparks and machine follow the programme, or come from outside
        programmed : whether the machine of a four-stroke engine does, whatever the sparks do
    """
    p = np.zeros(at.N_P)
    _gas(c, p)
    _mechanics(c, p)
    _machine(c, p)
    for number, side in enumerate((c.left, c.right)):
        _side(c, side, p, number, throttle)
    return Engine(
        c,
        p,
        programme_of(c, self_timed=self_timed, programmed=programmed),
        c.heat.energy_j * throttle,
    )


def _gas(c: Calibration, p: Array) -> None:
    gamma = c.gas.gamma
    p[at.GAMMA], p[at.R_GAS] = gamma, c.gas.gas_constant_j_kg_k
    p[at.P_AMBIENT], p[at.T_AMBIENT] = c.gas.ambient_pa, c.gas.ambient_k
    p[at.CRITICAL] = (2.0 / (gamma + 1.0)) ** (gamma / (gamma - 1.0))
    p[at.CHOKED] = gamma**0.5 * (2.0 / (gamma + 1.0)) ** ((gamma + 1.0) / (2.0 * (gamma - 1.0)))
    p[at.SUBSONIC] = math.sqrt(2.0 * gamma / (gamma - 1.0))
    small = c.running.small_pressure_ratio
    p[at.SMALL] = small
    value, slope = _subsonic(gamma, small)
    p[at.CUBIC_1] = 0.5 * (3.0 * value - small * slope)
    p[at.CUBIC_3] = 0.5 * (small * slope - value)
    heat = c.heat
    p[at.HOHENBERG] = 130.0 * heat.hohenberg * 1.0e5**-0.8
    p[at.WIEBE_A], p[at.WIEBE_B], p[at.BURN_S] = heat.wiebe_a, heat.wiebe_b, heat.burn_s
    p[at.BURNT_S] = heat.burn_s * (60.0 / heat.wiebe_a) ** (1.0 / (heat.wiebe_b + 1.0))


def _subsonic(gamma: float, z: float) -> tuple[float, float]:
    """Value and slope of the bracket of eq. 3.15 at p_d/p_u = 1 - z."""
    r = 1.0 - z
    inner = r ** (2.0 / gamma) - r ** ((gamma + 1.0) / gamma)
    value = math.sqrt(2.0 * gamma / (gamma - 1.0) * inner)
    d_inner = (gamma + 1.0) / gamma * r ** (1.0 / gamma) - 2.0 / gamma * r ** (2.0 / gamma - 1.0)
    return value, gamma / (gamma - 1.0) * d_inner / value


def _mechanics(c: Calibration, p: Array) -> None:
    p[at.MASS] = c.mover.mass_kg
    p[at.CONTACT_GAP], p[at.RESTITUTION] = c.mover.contact_gap_m, c.mover.restitution
    friction = c.friction
    warmth = (friction.oil_c - friction.oil_reference_c) / friction.oil_reference_c
    for number, side in enumerate((c.left, c.right)):
        size = side.bore_m / friction.bore_reference_m * side.rings * side.pistons
        ring = friction.f * friction.a_f * (1.0 - friction.b_f * warmth) * size
        p[at.CYL_P + number * at.CYL_P_STRIDE + at.RING] = ring
    p[at.RING_PRESSURE] = friction.k_v / friction.p_reference_pa
    p[at.F_MACHINE] = friction.machine_n
    p[at.STEP_S] = c.running.step_s
    if c.mover.spring is not None:
        p[at.SPRING], p[at.SPRING_X] = c.mover.spring.stiffness_n_m, c.mover.spring.relaxed_x_m
    if c.pump is not None:
        p[at.PUMP] = 1.0
        p[at.CASE_VOLUME], p[at.CASE_AREA] = c.pump.volume_m3, c.pump.area_m2
        p[at.CASE_REED] = c.pump.reed_m2


def _machine(c: Calibration, p: Array) -> None:
    p[at.PEAK_FORCE] = c.machine.peak_force_n
    p[at.SERVO], p[at.SERVO_A] = 1.0 / c.cycle.servo_s, c.cycle.acceleration_m_s2
    circuit, dq = c.machine.circuit, c.machine.dq
    if c.machine.flux is not None:
        circuit = c.machine.flux.circuit
    if circuit is not None:
        p[at.MACHINE] = at.CIRCUIT
        p[at.K_FORCE], p[at.K_EMF] = circuit.thrust_n_a, circuit.emf_v_s_m
        p[at.RESISTANCE], p[at.INDUCTANCE] = circuit.resistance_ohm, circuit.inductance_h
        p[at.INV_CAPACITANCE] = 1.0 / circuit.capacitance_f if circuit.capacitance_f else 0.0
        p[at.POLE_PITCH] = circuit.pole_pitch_m or 0.0
    elif dq is not None:
        p[at.MACHINE] = at.DQ
        p[at.K_FORCE], p[at.RESISTANCE] = dq.thrust_n_a, dq.resistance_ohm
        p[at.INDUCTANCE], p[at.POLE_PITCH] = dq.inductance_h, dq.pole_pitch_m
        p[at.REGULATOR], p[at.SUPPLY] = 1.0 / dq.regulator_s, dq.supply_v


def _side(c: Calibration, side: Side, p: Array, number: int, throttle: float) -> None:
    b = at.CYL_P + number * at.CYL_P_STRIDE
    area = side.pistons * math.pi * side.bore_m**2 / 4.0
    p[b + at.SIGN] = 1.0 - 2.0 * number
    p[b + at.AREA], p[b + at.LENGTH] = area, side.length_m
    crowns_and_heads = 2.0 / side.pistons
    p[b + at.END_AREA] = crowns_and_heads * area
    p[b + at.PERIMETER] = side.pistons * math.pi * side.bore_m
    p[b + at.T_WALL], p[b + at.WALL] = side.wall_k, side.walls
    p[b + at.CDA_LEAK] = side.leak_m2
    air = c.breathing
    p[b + at.CDA_IN] = throttle * air.discharge * math.pi * air.intake_diameter_m * air.lift_m
    p[b + at.CDA_EX] = air.discharge * math.pi * air.exhaust_diameter_m * air.lift_m
    p[b + at.P_IN], p[b + at.T_IN] = air.intake_pa, air.intake_k
    p[b + at.P_EX], p[b + at.T_EX] = air.exhaust_pa, air.exhaust_k


def at_rest(engine: Engine, x_m: float = 0.0) -> Motion:
    """At rest at x, the gas as filled at mid-stroke, machine and spark off."""
    y, d = np.zeros(at.N_Y), np.zeros(at.N_D)
    c, p = engine.calibration, engine.p
    y[at.X] = x_m
    for number, side in enumerate((c.left, c.right)):
        _fill(p, y, number, side.fill_pa, side.fill_k)
        d[at.CYL + number * at.CYL_STRIDE + at.SPARK_T] = at.NEVER
        if c.pump is not None:
            _fill_case(p, y, number)
    d[at.HEAT] = p[at.HOHENBERG] * 1.4**0.8
    d[at.LOAD_SCALE] = 1.0
    d[at.ENERGY] = engine.energy_j
    d[at.DC_X] = x_m
    return Motion(y, d, np.zeros((RECORD_ROWS, at.N_REC)))


def _fill(p: Array, y: Array, number: int, p_pa: float, t_k: float) -> None:
    b, k = at.CYL_P + number * at.CYL_P_STRIDE, at.GAS_STRIDE * number
    volume = p[b + at.AREA] * (p[b + at.LENGTH] + p[b + at.SIGN] * y[at.X])
    y[at.U + k] = p_pa * volume / (p[at.GAMMA] - 1.0)
    y[at.M + k] = p_pa * volume / (p[at.R_GAS] * t_k)


def _fill_case(p: Array, y: Array, number: int) -> None:
    sign, k = 1.0 - 2.0 * number, at.GAS_STRIDE * number
    volume = p[at.CASE_VOLUME] - sign * p[at.CASE_AREA] * y[at.X]
    y[at.CASE_U + k] = p[at.P_AMBIENT] * volume / (p[at.GAMMA] - 1.0)
    y[at.CASE_M + k] = p[at.P_AMBIENT] * volume / (p[at.R_GAS] * p[at.T_AMBIENT])


def running(engine: Engine) -> Motion:
    """Near the settled motion: at the left dead centre, the charge in the left cylinder alight."""
    r = engine.calibration.running
    motion = at_rest(engine, r.start_x_m)
    y, d = motion.y, motion.d
    _fill(engine.p, y, 0, r.start_left_pa, r.start_left_k)
    _fill(engine.p, y, 1, r.start_right_pa, r.start_right_k)
    cycle = engine.calibration.cycle
    if cycle.kind == "four-stroke":
        d[at.PHASE] = 2.0
    elif cycle.fires == "both":
        d[at.CYL + at.CYL_STRIDE + at.INTAKE] = d[at.CYL + at.CYL_STRIDE + at.EXHAUST] = 1.0
    if cycle.kind != "speed":
        d[at.CYL + at.SPARK_T], d[at.CYL + at.Q_IN] = -r.start_spark_s, engine.energy_j
        d[at.LOAD] = engine.calibration.machine.load_coefficient_n_s_m
    begin(engine, motion, 1)
    d[at.HEAT] = engine.p[at.HOHENBERG] * (2.0 + 1.4) ** 0.8
    return motion


def begin(engine: Engine, motion: Motion, direction: int) -> None:
    """Let the piston set off in a direction, at the first row of the programme that fits."""
    motion.d[at.DIRECTION] = float(direction)
    enter_stroke(engine.p, motion.d, motion.y, engine.programme, False)


def run_for(engine: Engine, motion: Motion, seconds: float) -> Motion:
    """Move on, in place; returns the same motion."""
    y, d, record = motion
    end = d[at.T] + seconds
    if advance(engine.p, d, y, engine.programme, scratch(), record, end, False) == at.FAILED:
        raise RunError(f"{engine.calibration.name}: the motion cannot be followed at {d[at.T]:g} s")
    return motion


def strokes(motion: Motion) -> Array:
    """The rows of the record in order of time, shape (strokes, N_REC)."""
    count = int(motion.d[at.ROWS])
    if count <= RECORD_ROWS:
        return motion.record[:count]
    return np.roll(motion.record, -(count % RECORD_ROWS), axis=0)
