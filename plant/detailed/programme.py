"""The programme of a cycle: what valves, spark and machine do at which position of which stroke.

A row a stroke; even rows move to the right. An entry is (position, action, value); positions of a
row come in the order in which the piston reaches them.
"""

from __future__ import annotations

from plant.detailed import layout as at
from plant.detailed.compiler import compiled
from plant.detailed.types import Array


@compiled
def perform(p: Array, d: Array, y: Array, code: int, value: float) -> None:
    """Carry out one action."""
    c, action = code // at.BY_CYLINDER, code % at.BY_CYLINDER
    e = at.CYL + c * at.CYL_STRIDE
    if action in (at.OPEN_INTAKE, at.CLOSE_INTAKE):
        d[e + at.INTAKE] = 1.0 if action == at.OPEN_INTAKE else 0.0
    elif action in (at.OPEN_EXHAUST, at.CLOSE_EXHAUST):
        d[e + at.EXHAUST] = 1.0 if action == at.OPEN_EXHAUST else 0.0
    elif action == at.IGNITE and d[at.ENERGY] > 0.0:
        d[e + at.SPARK_T] = d[at.T]
        d[e + at.Q_IN] = d[at.ENERGY] * value
    elif action == at.MOTOR:
        d[at.FORCE] = value * d[at.DIRECTION]
        d[at.LOAD] = 0.0
        y[at.CURRENT] = y[at.CHARGE] = 0.0
    elif action == at.GENERATE:
        d[at.FORCE] = 0.0
        d[at.LOAD] = value


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
