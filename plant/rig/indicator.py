"""What the plant measures once a stroke: the pressure of each cylinder's cycle; and the winding.

A cylinder's cycle ends at its bottom dead centre, that of the other one: greatest pressure, where
it was, and the steepest rise between two readings an interval apart. Fast engines burn at once, so
readings are taken on either side of the dead centre, too. Engines in full watch their own.
"""

from __future__ import annotations

import math
from typing import Final, final

from hil.config.hardware import WindingConfig
from hil.values import Value
from plant.engines.machine import Machine
from plant.engines.protocol import Engine, Motion

NOT_YET: Final = -1.0


@final
class Reading(Value):
    """A cylinder's cycle so far, and its newest reading; `t_ns` below nought before the first."""

    __slots__ = ("p_peak_pa", "x_peak_m", "rise_pa_s", "p_pa", "t_ns")

    def __init__(
        self, p_peak_pa: float = 0.0, x_peak_m: float = 0.0, rise_pa_s: float = 0.0,
        p_pa: float = 0.0, t_ns: float = NOT_YET,
    ) -> None:  # fmt: skip
        self.p_peak_pa = p_peak_pa
        self.x_peak_m = x_peak_m
        self.rise_pa_s = rise_pa_s
        self.p_pa = p_pa
        self.t_ns = t_ns

    def with_next(self, p_pa: float, x_m: float, t_ns: float, interval_ns: float) -> Reading:
        """The cycle with one reading more."""
        if self.t_ns < 0.0:
            return Reading(p_pa, x_m, 0.0, p_pa, t_ns)
        rise = (p_pa - self.p_pa) / max(t_ns - self.t_ns, interval_ns) * 1e9
        top, where = self.p_peak_pa, self.x_peak_m
        if p_pa > top:
            top, where = p_pa, x_m
        return Reading(top, where, max(self.rise_pa_s, rise), p_pa, t_ns)


@final
class Cycle(Value):
    """A finished cycle of a cylinder: greatest pressure, where it was, steepest rise."""

    __slots__ = ("side", "p_peak_pa", "x_peak_m", "rise_pa_s")

    def __init__(self, side: int, p_peak_pa: float, x_peak_m: float, rise_pa_s: float) -> None:
        self.side = side
        self.p_peak_pa = p_peak_pa
        self.x_peak_m = x_peak_m
        self.rise_pa_s = rise_pa_s


@final
class Instruments(Value):
    """Both cylinders' cycles, those that wait to be told, and the winding.

    copper_w: heat of the winding in the last tick
    """

    __slots__ = ("left", "right", "told", "winding_k", "copper_w")

    def __init__(
        self, left: Reading, right: Reading, told: tuple[Cycle, ...] = (), winding_k: float = 0.0,
        copper_w: float = 0.0,
    ) -> None:  # fmt: skip
        self.left = left
        self.right = right
        self.told = told
        self.winding_k = winding_k
        self.copper_w = copper_w


_UNREAD: Final = Reading()
UNUSED: Final = Instruments(_UNREAD, _UNREAD)


def begun(config: WindingConfig) -> Instruments:
    """The instruments at the start of a run."""
    kelvin = config.ambient_k if config.begin_k is None else config.begin_k
    return Instruments(_UNREAD, _UNREAD, (), kelvin)


def read(
    i: Instruments,
    engine: Engine,
    motion: Motion,
    machine: Machine,
    t_ns: float,
    interval_ns: float,
) -> Instruments:
    """Take a reading of both pressures."""
    sensed, x = engine.sensed(motion, machine), motion.x_m
    left = i.left.with_next(sensed.p_left_pa, x, t_ns, interval_ns)
    right = i.right.with_next(sensed.p_right_pa, x, t_ns, interval_ns)
    return Instruments(left, right, i.told, i.winding_k, i.copper_w)


def ended(i: Instruments, engine: Engine, motion: Motion, side: int) -> Instruments:
    """End the cycle of the cylinder that is at its bottom dead centre."""
    reading = i.left if side == 0 else i.right
    own = engine.cycle(motion, side)
    cycle = Cycle(side, reading.p_peak_pa, reading.x_peak_m, reading.rise_pa_s)
    if own is not None:
        cycle = Cycle(side, own[0], own[1], own[2])
    told = (*i.told, cycle) if cycle.p_peak_pa > 0.0 else i.told
    afresh = Reading(reading.p_pa, motion.x_m, 0.0, reading.p_pa, reading.t_ns)
    left, right = (afresh, i.right) if side == 0 else (i.left, afresh)
    return Instruments(left, right, told, i.winding_k, i.copper_w)


def after_telling(i: Instruments) -> Instruments:
    """The instruments once the sample of a tick has told of the oldest cycle."""
    return Instruments(i.left, i.right, i.told[1:], i.winding_k, i.copper_w)


def warmed(
    i: Instruments, config: WindingConfig, machine: Machine, v_m_s: tuple[float, float], dt_s: float
) -> Instruments:
    """Let the winding warm up through a tick, with the mean of its heat at both ends.

    T -> T_end + (T - T_end) exp(-dt G / C), T_end = T_ambient + P / G, P = (F / K)^2
    """
    c, force = machine.load_coefficient_n_s_m, machine.force_n
    before_n, after_n = force - c * v_m_s[0], force - c * v_m_s[1]
    squared = 0.5 * (before_n * before_n + after_n * after_n)
    copper_w = squared / (config.force_n_sqrt_w * config.force_n_sqrt_w)
    end_k = config.ambient_k + copper_w / config.cooling_w_k
    kept = math.exp(-dt_s * config.cooling_w_k / config.heat_capacity_j_k)
    return Instruments(i.left, i.right, i.told, end_k + (i.winding_k - end_k) * kept, copper_w)
