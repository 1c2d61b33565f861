"""What the machine delivered: energy and mean power, from the plant's log.

A four-stroke engine's own drive pushes and brakes; as in Table 4.3 its power counts by its size,
P_e = P_i - P_f - P_c (thesis eqs. 4.1, 4.2). The terminal power is the signed one, as sensed.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.judge.strokes import Floats, Strokes, whole_cycles
from hil.config.scenario import Scenario
from hil.log import Log, Span

_SAME = 1.0e-6
"""Share by which a generator's power may differ from c v^2, as both are logged."""


class Electric(NamedTuple):
    """Energy of the run [J], and mean powers [W]; None without a tick to tell them from."""

    energy_j: float
    power_w: float | None
    terminal_w: float | None


def read_electric(log: Log, scenario: Scenario, strokes: Strokes, simulated_s: float) -> Electric:
    """Take the means over the whole run, or over the whole cycles where strokes are not all alike.

    Parameters: strokes : all of the run; simulated_s : how long it is
    """
    span = _span(scenario, strokes)
    sums, ticks, total, every = np.zeros(2), 0, 0.0, 0
    for t_ns, net, signed in _powers(log, driven=scenario.plant.model == "four-stroke"):
        chosen = (t_ns >= span.start_ns) & (t_ns < span.end_ns)
        sums += net[chosen].sum(), signed[chosen].sum()
        ticks, total, every = ticks + int(chosen.sum()), total + float(net.sum()), every + len(net)
    if not ticks:
        return Electric(0.0, None, None)
    power_w, terminal_w = sums / ticks
    return Electric(total / every * simulated_s, float(power_w), float(terminal_w))


def _span(scenario: Scenario, strokes: Strokes) -> Span:
    """The time to take means over; a cycle cut short would count for more than it is."""
    fires = scenario.controller.timing.fires
    whole = whole_cycles(strokes, len(fires))
    if all(fires) or len(whole.t_ns) < 2:
        return Span()
    return Span(int(whole.t_ns[0]), int(whole.t_ns[-1]))


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
