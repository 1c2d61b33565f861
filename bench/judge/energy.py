"""What gas and machine delivered, from the plant's log: work, energy, mean powers.

Electric: a four-stroke engine's own drive pushes and brakes; as in Table 4.3 its power counts by
its size, P_e = P_i - P_f - P_c (thesis eqs. 4.1, 4.2). The terminal power is the signed one, as
sensed.

Indicated: W = integral p dV of both cylinders over whole cycles, p_mi = W / (charges A S), S the
stroke. Between two ticks p V^n is constant with the n that both have, exact on the adiabats of the
fast models; where a dead centre lies between them, each side goes on with the n of its neighbours,
so that a charge that burns at once does its work behind it and none before.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.judge.strokes import Floats, Strokes, whole_cycles
from hil.config.detailed import of_plant
from hil.config.engine.models import DETAILED_MODELS
from hil.config.resolved import Resolved
from hil.config.scenario import Scenario
from hil.log import Log, Span

_SAME = 1.0e-6
"""Share by which a generator's power may differ from c v^2, as both are logged."""

_STILL: Final = 1.0e-9
_STEEPEST: Final = 4.0
"""Beyond this exponent the pressure changes without the volume: then its mean counts."""

_LEAST_GAP_M: Final = 1e-6
_MOST_BEYOND: Final = 3.0


class Electric(NamedTuple):
    """Energy of the run [J], and mean powers [W]; None without a tick to tell them from.

    brake_fuel_kg_j: fuel by electric energy, over whole cycles; None where there are none, or the
    machine took more
    """

    energy_j: float
    power_w: float | None
    terminal_w: float | None
    brake_fuel_kg_j: float | None = None


def read_electric(log: Log, scenario: Scenario, strokes: Strokes, simulated_s: float) -> Electric:
    """Take the means over the whole run, or over the whole cycles where strokes are not all alike.

    Parameters: strokes : all of the run; simulated_s : how long it is
    """
    whole = whole_cycles(strokes, len(scenario.controller.timing.fires))
    cycles = _span_of(whole)
    span = Span() if all(scenario.controller.timing.fires) else cycles
    sums, ticks, total, every = np.zeros(2), 0, 0.0, 0
    in_cycles = np.zeros(2)
    for t_ns, net, signed in _powers(log, driven=scenario.plant.model == "four-stroke"):
        chosen = (t_ns >= span.start_ns) & (t_ns < span.end_ns)
        cycling = (t_ns >= cycles.start_ns) & (t_ns < cycles.end_ns)
        in_cycles += net[cycling].sum(), np.count_nonzero(cycling)
        sums += net[chosen].sum(), signed[chosen].sum()
        ticks, total, every = ticks + int(chosen.sum()), total + float(net.sum()), every + len(net)
    if not ticks:
        return Electric(0.0, None, None)
    power_w, terminal_w = sums / ticks
    fuel = _brake_fuel(whole, *in_cycles)
    return Electric(total / every * simulated_s, float(power_w), float(terminal_w), fuel)


def _span_of(whole: Strokes) -> Span:
    """The time of whole cycles; one that is cut short would count for more than it is."""
    if len(whole.t_ns) < 2:
        return Span()
    return Span(int(whole.t_ns[0]), int(whole.t_ns[-1]))


def _brake_fuel(whole: Strokes, power_w: float, ticks: float) -> float | None:
    """Fuel by the electric energy that it came to [kg/J]: of the charges that drove the strokes."""
    if len(whole.t_ns) < 2 or power_w <= 0.0:
        return None
    lasted_s = float(whole.t_ns[-1] - whole.t_ns[0]) * 1e-9
    return float(whole.fuel_kg[:-1].sum()) / (power_w / ticks * lasted_s)


def _powers(log: Log, *, driven: bool) -> Iterator[tuple[NDArray[np.int64], Floats, Floats]]:
    """Yield instants, P_e, and the signed power, block by block."""
    for block in log.blocks("/sensor"):
        signed = block["electric_power_w"].astype(np.float64)
        net = signed - np.abs(signed) * _drives(log, block, signed) if driven else signed
        yield block["t_ns"].astype(np.int64), net, signed


def _drives(log: Log, block: NDArray[Any], power_w: Floats) -> NDArray[np.bool_]:
    """Tell in which ticks the drive acted: a generator's power is c v^2."""
    truth = log.array("/truth", Span(int(block["t_ns"][0]), int(block["t_ns"][-1])))
    rows = truth[np.searchsorted(truth["tick"], block["tick"])]
    braked: Floats = rows["load_coefficient_n_s_m"] * rows["v_m_s"] ** 2
    return np.abs(power_w - braked) > _SAME * np.abs(braked)


class Cylinder(NamedTuple):
    """One cylinder: its area, its length at mid-stroke, and +1 or -1, by which x adds to it."""

    area_m2: float
    length_m: float
    sign: float
    pressure: str


class Indicated(NamedTuple):
    """Mean indicated power [W] and effective pressure [Pa], fuel by indicated work [kg/J]."""

    power_w: float | None
    mean_pa: float | None
    fuel_kg_j: float | None


NOTHING: Final = Indicated(None, None, None)


def cylinders_of(scenario: Resolved) -> tuple[Cylinder, ...]:
    """The cylinders in which a charge burns."""
    names = (("p_left_pa", 1.0), ("p_right_pa", -1.0))
    if scenario.plant.model not in DETAILED_MODELS:
        engine = scenario.plant.resolved_prototype()
        return tuple(Cylinder(engine.area_m2, engine.half_stroke_m, s, p) for p, s in names)
    c = of_plant(scenario.plant)
    burning = (c.left,) if c.cycle.fires == "left" else (c.left, c.right)
    return tuple(
        Cylinder(side.pistons * np.pi * side.bore_m**2 / 4.0, side.length_m, sign, pressure)
        for side, (pressure, sign) in zip(burning, names, strict=False)
    )


def read_indicated(log: Log, scenario: Resolved, strokes: Strokes) -> Indicated:
    """Take the work of the whole cycles of a run.

    Parameters: strokes : all of the run
    Returns: nothing where no charge has burnt, or the engine's pressures are not all known
    """
    whole = whole_cycles(strokes, len(scenario.controller.timing.fires))
    burnt_kg = whole.fuel_kg[:-1]
    if len(whole.t_ns) < 2 or not np.any(burnt_kg > 0.0) or scenario.plant.model == "fmu":
        return NOTHING
    cylinders = cylinders_of(scenario)
    start_ns, end_ns = int(whole.t_ns[0]), int(whole.t_ns[-1])
    work_j = sum(
        _work_j(rows, cylinder, start_ns, end_ns)
        for rows in _states(
            log, Span(start_ns - _margin_ns(scenario), end_ns + _margin_ns(scenario))
        )
        for cylinder in cylinders
    )
    swept_m3 = cylinders[0].area_m2 * float(np.mean(np.abs(np.diff(whole.x_m))))
    charges = int(np.count_nonzero(burnt_kg > 0.0))
    power_w = work_j / ((end_ns - start_ns) * 1e-9)
    fuel = float(burnt_kg.sum()) / work_j if work_j > 0.0 else None
    return Indicated(power_w, work_j / (charges * swept_m3), fuel)


def _margin_ns(scenario: Resolved) -> int:
    """So far beyond its ends a span is read, that every pair of ticks has neighbours."""
    return 3 * scenario.loop.period_ns


def _states(log: Log, span: Span) -> Iterator[NDArray[Any]]:
    """Yield pressures, positions and dead centres, block by block; blocks share three ticks."""
    carried = None
    for block in log.blocks("/sensor", span):
        truth = log.array("/truth", Span(int(block["t_ns"][0]), int(block["t_ns"][-1]) + 1))
        rows = truth[np.searchsorted(truth["tick"], block["tick"])]
        columns = [rows[name].astype(np.float64) for name in ("t_ns", "x_m", "dc_t_ns", "dc_x_m")]
        columns += [block[name].astype(np.float64) for name in ("p_left_pa", "p_right_pa")]
        here = np.stack([*columns, rows["dc_index"].astype(np.float64)])
        joined = here if carried is None else np.concatenate([carried, here], axis=1)
        carried = joined[:, -3:]
        yield joined


def _work_j(rows: NDArray[Any], c: Cylinder, start_ns: int, end_ns: int) -> float:
    """Work of one cylinder's gas between two dead centres, of the pairs inside a block [J].

    The first and the last pair belong to the blocks beside it; the first block may be one row.
    """
    if rows.shape[1] < 2:
        return 0.0
    t_ns, x, dc_t_ns, dc_x = rows[:4]
    p = rows[4 if c.pressure == "p_left_pa" else 5]
    volume = _volume(c, x)
    n = _exponents(p, volume)
    plain = _polytropic(p[:-1], volume[:-1], p[1:], volume[1:], n)
    turned = np.flatnonzero(np.diff(rows[6]) > 0.0)
    turned = turned[(turned > 0) & (turned < len(plain) - 1)]
    inside = (t_ns[:-1] >= start_ns) & (t_ns[1:] <= end_ns)
    inside[turned] = False
    inside[0] = inside[-1] = False
    total = float(plain[inside].sum())
    at = turned + 1
    v_dc = _volume(c, dc_x[at])
    before, after = _half(p, volume, n, turned, v_dc, -1), _half(p, volume, n, turned, v_dc, 1)
    total += float(before[(dc_t_ns[at] > start_ns) & (dc_t_ns[at] <= end_ns)].sum())
    return total + float(after[(dc_t_ns[at] >= start_ns) & (dc_t_ns[at] < end_ns)].sum())


def _volume(c: Cylinder, x: Floats) -> Floats:
    """Volume above the piston, which at a head has still a micrometre [m^3]."""
    return c.area_m2 * np.maximum(c.length_m + c.sign * x, _LEAST_GAP_M)


def _half(
    p: Floats, volume: Floats, n: Floats, pairs: NDArray[np.intp], v_dc: Floats, way: int
) -> Floats:
    """Work from a tick to the dead centre behind it, or from there to the next tick."""
    tick = pairs if way < 0 else pairs + 1
    exponent = np.clip(n[pairs + way], 0.0, _MOST_BEYOND)
    p_dc = p[tick] * (volume[tick] / v_dc) ** exponent
    found = _polytropic(p[tick], volume[tick], p_dc, v_dc, exponent)
    return found if way < 0 else -found


def _exponents(p: Floats, volume: Floats) -> Floats:
    """The n with which p V^n is the same at both ticks of a pair; 0 where the volume is."""
    ratio = np.log(volume[1:] / volume[:-1])
    ratio[np.abs(ratio) < _STILL] = np.inf
    found: Floats = -np.log(p[1:] / p[:-1]) / ratio
    return found


def _polytropic(p1: Floats, v1: Floats, p2: Floats, v2: Floats, n: Floats) -> Floats:
    """W = (p2 V2 - p1 V1) / (1 - n), and the mean pressure's where n says nothing."""
    usual = (np.abs(n) < _STEEPEST) & (np.abs(n - 1.0) > 1e-6)
    exact = (p2 * v2 - p1 * v1) / np.where(usual, 1.0 - n, 1.0)
    return np.where(usual, exact, 0.5 * (p1 + p2) * (v2 - v1))
