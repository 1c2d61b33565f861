"""The programme of a cycle: what valves, spark and machine do at which position of which stroke.

A row a stroke; even rows move to the right. An entry is (position, action, value); positions of a
row come in the order in which the piston reaches them.
"""

from __future__ import annotations

from plant.engines.detailed import layout as at
from plant.engines.detailed.compiler import compiled
from plant.engines.detailed.types import Array


@compiled
def perform(p: Array, d: Array, y: Array, code: int, value: float) -> None:
    """Carry out one action."""
    c, action = code // at.BY_CYLINDER, code % at.BY_CYLINDER
    e = at.CYL + c * at.CYL_STRIDE
    if at.OPEN_INTAKE <= action <= at.CLOSE_EXHAUST:
        move_valve(d, e, action)
    elif action == at.IGNITE and d[at.ENERGY] > 0.0:
        d[e + at.SPARK_T] = d[at.T]
        d[e + at.Q_IN] = d[at.ENERGY] * value
    elif action == at.MOTOR:
        d[at.FORCE] = value * d[at.DIRECTION]
        d[at.LOAD] = 0.0
        if p[at.MACHINE] == at.CIRCUIT:  # which a motoring machine is not part of
            y[at.CURRENT] = y[at.CHARGE] = 0.0
    elif action == at.GENERATE:
        d[at.FORCE] = 0.0
        d[at.LOAD] = value
    elif action == at.HOLD_SPEED:
        d[at.SPEED_REF] = value


@compiled
def move_valve(d: Array, e: int, action: int) -> None:
    """Open or close a valve of the cylinder at e, unless it follows a TTL line."""
    valve, closes = (action - at.OPEN_INTAKE) // 2, (action - at.OPEN_INTAKE) % 2
    if d[e + at.INTAKE_LINE + valve] == 0.0:
        d[e + at.INTAKE + valve] = 1.0 - closes


@compiled
def enter_stroke(p: Array, d: Array, y: Array, programme: Array, advance_phase: bool) -> None:
    """Take the row of the stroke that begins; what lies behind the piston already is done at once.

    A spark behind the piston is not: its stroke is over.
    """
    rows = programme.shape[0]
    direction = d[at.DIRECTION]
    row = int(d[at.PHASE])
    if advance_phase:
        row = (row + 1) % rows
    if (row % 2 == 0) != (direction > 0.0):
        row = (row + 1) % rows
    d[at.PHASE] = float(row)
    k = 0
    while k < programme.shape[1] and programme[row, k, 1] != 0.0:
        if (programme[row, k, 0] - y[at.X]) * direction > 0.0:
            break
        code = int(programme[row, k, 1])
        if code % at.BY_CYLINDER != at.IGNITE:
            perform(p, d, y, code, programme[row, k, 2])
        k += 1
    d[at.NEXT] = float(k)
