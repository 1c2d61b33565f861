"""Fixed steps with located events, compiled.

A step ends early at what is due: an edge given from outside, a position of the programme, a dead
centre, a contact. Nothing is allocated: the caller brings the arrays.
"""

from __future__ import annotations

import math

import numpy as np

from plant.engines.detailed import layout as at
from plant.engines.detailed.compiler import compiled
from plant.engines.detailed.kernel import pressure, rates
from plant.engines.detailed.programme import enter_stroke, perform
from plant.engines.detailed.steps import WORK_ROWS, one_step, plan_step
from plant.engines.detailed.types import Array

_ITERATIONS = 12
_NEAR_M = 1.0e-13
_NEAR_M_S = 1.0e-11
_BREAK_AWAY_N = 0.05
_MOST_STEPS_IN_PLACE = 200


@compiled
def locate(
    p: Array,
    d: Array,
    y: Array,
    work: Array,
    t: float,
    h: float,
    index: int,
    target: float,
    implicit: bool,
) -> float:
    """Part of the step h after which y[index] equals target; leaves the state there in work[5].

    Newton's method on the step itself, kept inside a shrinking bracket.
    """
    low, high = 0.0, h
    near = _NEAR_M if index == at.X else _NEAR_M_S
    start = y[index] - target
    end = work[5, index] - target
    s = h * min(max(start / (start - end), 0.0), 1.0) if start != end else 0.5 * h
    for _ in range(_ITERATIONS):
        one_step(p, d, y, work, t, s, implicit)
        error = work[5, index] - target
        if abs(error) < near:
            break
        if (error > 0.0) == (start > 0.0):
            low = s
        else:
            high = s
        rates(p, d, work[5], work[6], t + s)
        slope = work[6, index]
        s = s - error / slope if slope != 0.0 else low
        if not low < s < high:
            s = 0.5 * (low + high)
    return s


@compiled
def pressure_rate(p: Array, y: Array, slope: Array, c: int) -> float:
    """dp/dt = (gamma - 1) U'/V - p V'/V     (thesis eq. 3.12)."""
    b = at.CYL_P + c * at.CYL_P_STRIDE
    gap = p[b + at.LENGTH] + p[b + at.SIGN] * y[at.X]
    rate = (p[at.GAMMA] - 1.0) * slope[at.U + at.GAS_STRIDE * c] / (p[b + at.AREA] * gap)
    return float(rate - pressure(p, y, c) * p[b + at.SIGN] * y[at.V] / gap)


@compiled
def watch_peaks(p: Array, d: Array, y: Array, k1: Array, t: float, h: float) -> None:
    """Keep each cylinder's greatest pressure: the top of the cubic through two steps' ends."""
    for c in range(2):
        e = at.CYL + c * at.CYL_STRIDE
        p_gas = pressure(p, y, c)
        rate = pressure_rate(p, y, k1, c)
        old, old_rate = d[e + at.P_OLD], d[e + at.DP_OLD]
        best = p_gas
        if old_rate > 0.0 and rate < 0.0 and h > 0.0:
            best = max(best, cubic_top(old, old_rate, p_gas, rate, h))
        if best > d[e + at.P_MAX]:
            d[e + at.P_MAX] = best
            d[e + at.P_MAX_T], d[e + at.P_MAX_X] = t, y[at.X]
        d[e + at.RISE_MAX] = max(d[e + at.RISE_MAX], rate)
        d[e + at.P_OLD] = p_gas
        d[e + at.DP_OLD] = rate
    d[at.V_MAX] = max(d[at.V_MAX], abs(y[at.V]))


@compiled
def cubic_top(f0: float, g0: float, f1: float, g1: float, h: float) -> float:
    """Maximum of the cubic with values f and slopes g at the ends of h; g0 > 0 > g1."""
    d = (f1 - f0) / h
    c2 = (3.0 * d - 2.0 * g0 - g1) / h
    c3 = (g0 + g1 - 2.0 * d) / (h * h)
    root = math.sqrt(max(c2 * c2 - 3.0 * c3 * g0, 0.0))
    s = g0 / (root - c2) if root - c2 > 0.0 else 0.5 * h
    s = min(max(s, 0.0), h)
    return f0 + s * (g0 + s * (c2 + c3 * s))


@compiled
def take(y: Array, work: Array) -> None:
    """Make the result of the step the state."""
    for n in range(at.N_Y):
        y[n] = work[5, n]


@compiled
def wake(p: Array, d: Array, y: Array, programme: Array, k1: Array) -> bool:
    """A resting piston moves when the forces on it exceed the machine's friction."""
    force = k1[at.W_FRICTION]
    k1[at.W_FRICTION] = 0.0
    if abs(force) <= p[at.F_MACHINE] + _BREAK_AWAY_N:
        return False
    d[at.DIRECTION] = 1.0 if force > 0.0 else -1.0
    d[at.DC_T], d[at.DC_X] = d[at.T], y[at.X]
    enter_stroke(p, d, y, programme, False)
    return True


@compiled
def advance(
    p: Array,
    d: Array,
    y: Array,
    programme: Array,
    work: Array,
    record: Array,
    t_end: float,
    stop: bool,
) -> int:
    """Move on to t_end, or with `stop` to the first dead centre or contact.

    Parameters: work : (WORK_ROWS, N_Y) scratch
        record : (rows, N_REC), one row a dead centre, in a ring
    Returns: TIME_UP, DEAD_CENTRE or CONTACT; FAILED when time does not get on
    """
    h_last = 0.0
    in_place = 0
    while d[at.T] < t_end:
        t = d[at.T]
        rates(p, d, y, work[0], t)
        if d[at.DIRECTION] == 0.0 and wake(p, d, y, programme, work[0]):
            continue
        watch_peaks(p, d, y, work[0], t, h_last)
        h, implicit = plan_step(p, d, y, work, min(p[at.STEP_S], t_end - t))
        if t + 1.5 * h >= t_end > t + h:
            h = 0.5 * (t_end - t)
        one_step(p, d, y, work, t, h, implicit)
        what, spent = settle(p, d, y, programme, work, t, h, implicit)
        at_end = spent == h and t_end - t == h
        take(y, work)
        d[at.T] = t_end if at_end else t + spent
        h_last = spent
        in_place = 0 if d[at.T] > t else in_place + 1
        if in_place > _MOST_STEPS_IN_PLACE or not math.isfinite(y[at.X]):
            return at.FAILED
        if what == at.TIME_UP:
            continue
        rows = d[at.ROWS]
        happen(p, d, y, programme, record, work, what)
        h_last = 0.0
        if stop and d[at.ROWS] != rows:
            return at.DEAD_CENTRE if what == at.DEAD_CENTRE else at.CONTACT
    return at.TIME_UP


@compiled
def settle(
    p: Array,
    d: Array,
    y: Array,
    programme: Array,
    work: Array,
    t: float,
    h: float,
    implicit: bool,
) -> tuple[int, float]:
    """Find what ends this step, and shorten the step to it.

    Returns: TIME_UP, AT_POSITION, DEAD_CENTRE or CONTACT; time spent
    """
    direction = d[at.DIRECTION]
    if direction == 0.0:
        return at.TIME_UP, h
    what, spent = at.TIME_UP, h
    if work[5, at.V] * direction <= 0.0:
        spent = locate(p, d, y, work, t, h, at.V, 0.0, implicit)
        what = at.DEAD_CENTRE
    target = due_position(d, programme)
    if (work[5, at.X] - target) * direction >= 0.0:
        spent = locate(p, d, y, work, t, spent, at.X, target, implicit)
        what = at.AT_POSITION
    wall = contact_position(p, direction)
    if (work[5, at.X] - wall) * direction >= 0.0:
        spent = locate(p, d, y, work, t, spent, at.X, wall, implicit)
        what = at.CONTACT
    return what, spent


@compiled
def due_position(d: Array, programme: Array) -> float:
    """Position of the next entry of this stroke, or one that is never reached."""
    row, k = int(d[at.PHASE]), int(d[at.NEXT])
    if k >= programme.shape[1] or programme[row, k, 1] == 0.0 or lingers(d):
        return float(at.NEVER * d[at.DIRECTION])
    return float(programme[row, k, 0])


@compiled
def contact_position(p: Array, direction: float) -> float:
    """Where the piston touches the head it moves to."""
    b = at.CYL_P if direction < 0.0 else at.CYL_P + at.CYL_P_STRIDE
    return float(direction * (p[b + at.LENGTH] - p[at.CONTACT_GAP]))


@compiled
def happen(
    p: Array, d: Array, y: Array, programme: Array, record: Array, work: Array, what: int
) -> None:
    """Do what the step has ended for."""
    if what == at.AT_POSITION:
        row, k = int(d[at.PHASE]), int(d[at.NEXT])
        perform(p, d, y, int(programme[row, k, 1]), programme[row, k, 2])
        d[at.NEXT] += 1.0
        return
    if what == at.CONTACT:
        d[at.CONTACTS] += 1.0
        back = -p[at.RESTITUTION] * y[at.V]
        y[at.W_FRICTION] += 0.5 * p[at.MASS] * (y[at.V] ** 2 - back**2)
        y[at.V] = back
    else:
        y[at.V] = 0.0
    if lingers(d):
        d[at.DIRECTION] = -d[at.DIRECTION]
        return
    write_row(p, d, y, record)
    d[at.V_MAX] = 0.0
    d[at.DC_NUMBER] += 1.0
    stroke = abs(y[at.X] - d[at.DC_X])
    lasted = d[at.T] - d[at.DC_T]
    if lasted > 0.0:
        d[at.HEAT] = p[at.HOHENBERG] * (stroke / lasted + 1.4) ** 0.8
    d[at.DC_T], d[at.DC_X] = d[at.T], y[at.X]
    turn(p, d, y, programme, work[0])


@compiled
def lingers(d: Array) -> bool:
    """Whether the piston still moves the old way although its new stroke has begun.

    After a four-stroke power stroke the gas pushes on until the exhaust valve, open since the dead
    centre, has let it out.
    """
    return bool((int(d[at.PHASE]) % 2 == 0) != (d[at.DIRECTION] > 0.0))


@compiled
def turn(p: Array, d: Array, y: Array, programme: Array, slope: Array) -> None:
    """Reverse, or stay where the forces do not exceed the machine's friction."""
    c = 1 if d[at.DIRECTION] > 0.0 else 0
    other = at.CYL + (1 - c) * at.CYL_STRIDE
    d[other + at.CYCLE_P], d[other + at.CYCLE_X] = d[other + at.P_MAX], d[other + at.P_MAX_X]
    d[other + at.CYCLE_RISE] = d[other + at.RISE_MAX]
    d[other + at.P_MAX] = d[other + at.RISE_MAX] = 0.0
    onward = -d[at.DIRECTION]
    d[at.DIRECTION] = onward
    enter_stroke(p, d, y, programme, True)
    d[at.DIRECTION] = 0.0
    rates(p, d, y, slope, d[at.T])
    force = slope[at.W_FRICTION] * onward
    if y[at.V] != 0.0 or force > p[at.F_MACHINE] + _BREAK_AWAY_N:
        d[at.DIRECTION] = onward
    elif force < -p[at.F_MACHINE] - _BREAK_AWAY_N:
        d[at.DIRECTION] = -onward


@compiled
def write_row(p: Array, d: Array, y: Array, record: Array) -> None:
    """Keep what this stroke was."""
    row = record[int(d[at.ROWS]) % record.shape[0]]
    row[at.REC_T], row[at.REC_X] = d[at.T], y[at.X]
    row[at.REC_PHASE], row[at.REC_V_MAX] = d[at.PHASE], d[at.V_MAX]
    row[at.REC_P_LEFT] = d[at.CYL + at.P_MAX]
    row[at.REC_P_RIGHT] = d[at.CYL + at.CYL_STRIDE + at.P_MAX]
    for n in range(at.N_Y):
        row[at.REC_SUMS + n] = y[n]
    d[at.ROWS] += 1.0


def scratch() -> Array:
    """Work space for `advance`."""
    return np.zeros((WORK_ROWS, at.N_Y))
