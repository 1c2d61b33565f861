"""The programmes of the cycles: rows of (position, action, value) from a calibration."""

from __future__ import annotations

import numpy as np

from hil.config.detailed import Calibration
from plant.engines.detailed import layout as at
from plant.engines.detailed.types import Array

Entry = tuple[float, int, float]
_LEFT, _RIGHT = 0, 1
_FROM_THE_START = at.NEVER


def programme_of(c: Calibration, *, self_timed: bool, programmed: bool = True) -> Array:
    """Programme of a cycle, shape (strokes, entries, 3); an action of 0 ends a row.

    Parameters: programmed : whether it moves the machine of a four-stroke engine
    """
    kinds = {"two-stroke": _two_stroke, "four-stroke": _four_stroke, "motoring": _motoring,
             "speed": _speed}  # fmt: skip
    if c.cycle.kind == "four-stroke" and c.cycle.fires == "left":
        rows = _single_four_stroke(c, self_timed)
    else:
        rows = kinds[c.cycle.kind](c, self_timed)
    if not programmed:
        rows = [[entry for entry in row if entry[1] not in (at.MOTOR, at.GENERATE)] for row in rows]
    table = np.zeros((len(rows), max(len(row) for row in rows) + 1, 3))
    for number, row in enumerate(rows):
        ordered = sorted(row, reverse=number % 2 == 1)
        table[number, : len(row)] = ordered
    return table


def _at(c: Calibration, cylinder: int, gap_m: float) -> float:
    """Position at which that cylinder's piston is `gap_m` from its head."""
    return gap_m - c.left.length_m if cylinder == _LEFT else c.right.length_m - gap_m


def _entry(
    c: Calibration, cylinder: int, gap_m: float | None, action: int, value: float = 1.0
) -> list[Entry]:
    if gap_m is None:
        return []
    return [(_at(c, cylinder, gap_m), action + at.BY_CYLINDER * cylinder, value)]


def _at_once(row: int, action: int, value: float) -> Entry:
    """An entry behind every start of that row."""
    return (-_FROM_THE_START if row % 2 == 0 else _FROM_THE_START, action, value)


def _expansion(c: Calibration, cylinder: int) -> list[Entry]:
    cycle = c.cycle
    return [
        *_entry(c, cylinder, cycle.exhaust_opens_m, at.OPEN_EXHAUST),
        *_entry(c, cylinder, cycle.intake_opens_m, at.OPEN_INTAKE),
    ]


def _compression(c: Calibration, cylinder: int, spark: bool) -> list[Entry]:
    cycle = c.cycle
    entries = [
        *_entry(c, cylinder, cycle.intake_closes_m, at.CLOSE_INTAKE),
        *_entry(c, cylinder, cycle.exhaust_closes_m, at.CLOSE_EXHAUST),
    ]
    if spark:
        entries += _entry(c, cylinder, cycle.ignition_from_head_m, at.IGNITE)
    return entries


def _two_stroke(c: Calibration, self_timed: bool) -> list[list[Entry]]:
    rows: list[list[Entry]] = []
    for opening, closing in ((_LEFT, _RIGHT), (_RIGHT, _LEFT)):
        rows.append(_expansion(c, opening) + _compression(c, closing, self_timed))
    if c.cycle.fires == "left":
        return [_expansion(c, _LEFT), _compression(c, _LEFT, self_timed)]
    return rows


def _motoring(c: Calibration, self_timed: bool) -> list[list[Entry]]:
    rows = _two_stroke(c, False)
    if self_timed:
        for number, row in enumerate(rows):
            row.append(_at_once(number, at.MOTOR, c.cycle.start_force_n))
    return rows


def _speed(c: Calibration, self_timed: bool) -> list[list[Entry]]:
    """Hold a speed up to where it can still be turned round, then the opposite one (Table 4.1)."""
    cycle, rows = c.cycle, _two_stroke(c, False)
    turn = cycle.turn_at_m - cycle.speed_m_s**2 / (2.0 * cycle.acceleration_m_s2)
    for number, row in enumerate(rows):
        sign = 1.0 - 2.0 * number
        row.append(_at_once(number, at.HOLD_SPEED, sign * cycle.speed_m_s))
        row.append((sign * turn, at.HOLD_SPEED, -sign * cycle.speed_m_s))
    return rows


def _single_four_stroke(c: Calibration, self_timed: bool) -> list[list[Entry]]:
    """Intake driven by the machine, compression by the spring, power, exhaust by the spring.

    Motor 1 drives the intake to switch_1; the generator takes from the power stroke, and from the
    exhaust stroke beyond switch_4, where the spring would drive the piston onto the head.
    """
    cycle, load = c.cycle, c.machine.load_coefficient_n_s_m
    rows: list[list[Entry]] = [
        [
            _at_once(0, at.MOTOR, cycle.motor_1_n),
            (cycle.switch_1_m, at.MOTOR, cycle.motor_2_n),
            _at_once(0, at.CLOSE_EXHAUST, 1.0),
            _at_once(0, at.OPEN_INTAKE, 1.0),
        ],
        [_at_once(1, at.MOTOR, cycle.motor_3_n), _at_once(1, at.CLOSE_INTAKE, 1.0)],
        [_at_once(2, at.GENERATE, load)],
        [
            _at_once(3, at.GENERATE, load),
            _at_once(3, at.OPEN_EXHAUST, 1.0),
            (cycle.switch_4_m, at.MOTOR, cycle.motor_4_n),
        ],
    ]
    if self_timed:
        rows[1] += _entry(c, _LEFT, cycle.ignition_from_head_m, at.IGNITE)
    return rows


def _four_stroke(c: Calibration, self_timed: bool) -> list[list[Entry]]:
    """Table 3.1: left takes in, compresses, works, exhausts; the right one a stroke behind.

    Machine: motor 1, then motor 2 from switch_1; motor 3; generator; generator, then motor 4 from
    switch_4 (Table 4.2). Valves change at the dead centres that begin and end their stroke.
    """
    cycle, load = c.cycle, c.machine.load_coefficient_n_s_m
    left, right = 0, at.BY_CYLINDER
    rows: list[list[Entry]] = [
        [(cycle.switch_1_m, at.MOTOR, cycle.motor_2_n), _at_once(0, at.MOTOR, cycle.motor_1_n)],
        [_at_once(1, at.MOTOR, cycle.motor_3_n)],
        [_at_once(2, at.GENERATE, load)],
        [(cycle.switch_4_m, at.MOTOR, cycle.motor_4_n), _at_once(3, at.GENERATE, load)],
    ]
    valves = {
        0: (left + at.CLOSE_EXHAUST, left + at.OPEN_INTAKE, right + at.OPEN_EXHAUST),
        1: (left + at.CLOSE_INTAKE, right + at.CLOSE_EXHAUST, right + at.OPEN_INTAKE),
        2: (right + at.CLOSE_INTAKE,),
        3: (left + at.OPEN_EXHAUST,),
    }
    for number, codes in valves.items():
        rows[number] += [_at_once(number, code, 1.0) for code in codes]
    if self_timed:
        rows[1] += _entry(c, _LEFT, cycle.ignition_from_head_m, at.IGNITE)
        rows[2] += _entry(c, _RIGHT, cycle.ignition_from_head_m, at.IGNITE)
    return rows
