"""Machine: fuel once a stroke, and the linear machine's own braking inside the stroke.

The generator's load coefficient is a command that acts from the next tick, so the braking force
c v can be modulated within a stroke: in every tick the c that ends this stroke at its set point,
z(dead centre; c) = X_ref, within limits about the load that the supervisory layer wants. The fuel
is set as if that load held throughout, so that the machine's part dies out as the fuel takes over.

Where commands are delayed further, the orders that are on their way brake first: each moves the end
by its part of the work int v^2 dt that is left, and the new one has the rest.
"""

from __future__ import annotations

import math
from typing import ClassVar, Final, final

from mypy_extensions import i64

from controller.motion import load_estimate
from controller.motion.charge import AS_BELIEVED, UNALIGNED, Charge, Learning, first_fuel
from controller.motion.deadbeat import fuel_after
from controller.motion.law import Demand, Law, Trim, View
from controller.motion.load_estimate import (
    AS_COMMANDED,
    UNKNOWN,
    LoadEstimate,
    LoadEstimation,
)
from controller.motion.work import NO_WORK, Work, learnt_of
from hil.config.controller import ControllerConfig
from hil.rounding import nearest
from hil.values import Value, replace

_STEP: Final = 0.03


@final
class MachineState(Value):
    """Load, charge, orders [N s/m], this stroke's work, the load for its fuel.

    ordered_n_s_m: the newest order first, the last one acted until the sample of this tick; 0: none
    watched_ns: the tick of the newest one
    """

    __slots__ = ("load", "charge", "ordered_n_s_m", "watched_ns", "work", "fuel_for_n_s_m")

    def __init__(
        self, load: LoadEstimate, charge: Charge, ordered_n_s_m: tuple[float, ...],
        watched_ns: i64 = -1, work: Work = NO_WORK, fuel_for_n_s_m: float = 0.0,
    ) -> None:  # fmt: skip
        self.load = load
        self.charge = charge
        self.ordered_n_s_m = ordered_n_s_m
        self.watched_ns = watched_ns
        self.work = work
        self.fuel_for_n_s_m = fuel_for_n_s_m


@final
class MachineLaw(Law[MachineState]):
    """Fuel and braking, in every tick."""

    name: ClassVar[str] = "machine"
    parameters: ClassVar[tuple[str, ...]] = (
        "machine.gain", "machine.begin_s", "machine.release_s",
    )  # fmt: skip
    needs_map: ClassVar[bool] = True

    def __init__(self, config: ControllerConfig) -> None:
        super().__init__(config)
        self.learning = Learning(config.learning, config.quiet)
        self.estimation = LoadEstimation(config.load_estimate)
        self.gain, self.least, self.most = (
            config.machine.gain, config.machine.least, config.machine.most,
        )  # fmt: skip
        self.begin_s, self.release_s = config.machine.begin_s, config.machine.release_s
        self.act_ticks = config.timing.act_ticks
        self.no_orders: tuple[float, ...] = (0.0,) * (self.act_ticks + 1)

    def initial(self) -> MachineState:
        """Load and charge as commanded."""
        return MachineState(AS_COMMANDED, AS_BELIEVED, self.no_orders)

    def step(self, state: MachineState, view: View) -> tuple[MachineState, Demand]:
        """The steady fuel for the load, until the watch trims it in the same tick."""
        demand = Demand(first_fuel(state.charge, view), view.point.v_mid_m_s)
        after = MachineState(
            state.load, state.charge, state.ordered_n_s_m, state.watched_ns, state.work
        )
        return after, demand

    def watch(
        self, state: MachineState, view: View, planned_kg: float
    ) -> tuple[MachineState, Trim]:
        """Measure the load, order the braking, trim the fuel; learn at the dead centre."""
        base, v, t_ns = view.load_n_s_m, view.motion.v_m_s, view.motion.t_ns
        state = _after_gap(state, view)
        orders = state.ordered_n_s_m
        acting, load = orders[-1] or base, state.load
        if view.power_w == view.power_w:
            load = load_estimate.update(self.estimation, load, view.power_w, v, acting)
        learnt = state.charge
        if view.passed.dead_centre:
            learnt = learnt_of(self.learning, learnt, load, state.work, view)
            work = Work(view.motion.tdc_m, view.motion.dc_t_ns, load.scale)
            after = MachineState(load, learnt, _with(orders, base), t_ns, work)
            return after, Trim(load_n_s_m=base)
        work = state.work.after(acting * load.scale, v)
        order, end_m = self._braking(state, load, view)
        c, fuel_for, trim = base * load.scale, state.fuel_for_n_s_m, Trim(None, order)
        settled = planned_kg == 0.0 or not learnt.known
        if not settled and abs(c - fuel_for) > self.estimation.retrim * c:
            fuel_for, trim = c, Trim(fuel_after(view, learnt, c, end_m, planned_kg), order)
        after = MachineState(load, learnt, _with(orders, order), t_ns, work, fuel_for)
        return after, trim

    def _braking(self, state: MachineState, load: LoadEstimate, view: View) -> tuple[float, float]:
        """The load to order, and where the stroke ends with it; free before the limits bind."""
        motion, base, scale = view.motion, view.load_n_s_m, max(load.scale, 0.05)
        q = state.charge.effective_kg(view, motion.side)
        if q <= 0.0 or not state.work.start_m:
            return base, view.tdc_ref_m
        free = base * scale
        c0 = min(max(state.ordered_n_s_m[0] * scale, 0.2 * free), 5.0 * free)
        believed = state.charge.map_of(view)
        end0, left_s = believed.travel(q, c0, motion.z_m, motion.speed_m_s, motion.tau_s)
        # What was wrong from mid-stroke on last time is wrong in proportion to the way left.
        wrong_m = state.charge.ahead_m * min(2.0 * left_s / believed.stroke_s, 1.0)
        end0 += wrong_m
        waits_s = float(self.act_ticks - 1) * view.dt_s
        if left_s < self.release_s + waits_s or motion.tau_s < self.begin_s:
            return base, end0
        c1 = c0 * (1.0 + _STEP)
        end1, _ = believed.travel(q, c1, motion.z_m, motion.speed_m_s, motion.tau_s)
        slope = (end1 + wrong_m - end0) / (c0 * _STEP)
        if slope >= -1e-12:
            return base, end0
        if waits_s > 0.0:
            rate = math.pi / believed.stroke_s
            ahead_n_s_m, share = self._on_their_way(state, view, c0, scale, left_s, rate)
            end0 += slope * ahead_n_s_m
            slope *= share
        wanted = c0 + self.gain * (view.tdc_ref_m - end0) / slope
        c = min(max(wanted, self.least * base), self.most * base)
        return min(c / scale, self.most * base), end0 + slope * (c - c0)

    def _on_their_way(
        self, state: MachineState, view: View, c0: float, scale: float, left_s: float, rate: float
    ) -> tuple[float, float]:
        """What the orders that act before a new one exceed c0 by, weighted with their work [N s/m].

        Returns: that, and the part of the work that is left to the new order
        """
        whole = left = _work_of(left_s, rate)
        excess = 0.0
        for k in range(self.act_ticks - 1):
            after = _work_of(left_s - float(k + 1) * view.dt_s, rate)
            order = state.ordered_n_s_m[self.act_ticks - 1 - k] or view.load_n_s_m
            excess += (left - after) / whole * (order * scale - c0)
            left = after
        return excess, left / whole

    def load_of(self, state: MachineState, load_n_s_m: float) -> float:
        """The last order by its scale."""
        return (state.ordered_n_s_m[0] or load_n_s_m) * state.load.scale

    def taken_over(self, view: View) -> MachineState:
        """It knows nothing of the load yet, and aligns the shares with the fuel in force."""
        return MachineState(UNKNOWN, UNALIGNED, self.no_orders)

    def restarted(self, state: MachineState) -> MachineState:
        """Keep what was learnt; the stroke under way teaches nothing."""
        return MachineState(state.load, state.charge, self.no_orders)


def _with(orders: tuple[float, ...], newest: float) -> tuple[float, ...]:
    """The orders with one more, the oldest left out."""
    return (newest, *orders[:-1])


def _after_gap(state: MachineState, view: View) -> MachineState:
    """The state with the orders of the ticks that brought no sample: the load was left alone."""
    if state.watched_ns < 0:
        return state
    orders, since_s = state.ordered_n_s_m, float(view.motion.t_ns - state.watched_ns) * 1e-9
    missed = min(nearest(since_s / view.dt_s) - 1, len(orders))
    if missed <= 0:
        return state
    for _ in range(missed):
        orders = _with(orders, view.load_n_s_m)
    return replace(state, ordered_n_s_m=orders)


def _work_of(left_s: float, rate: float) -> float:
    """The integral of sin^2 over the end of a stroke: that of v^2, but for a factor [s]."""
    left_s = max(left_s, 0.0)
    return 0.5 * left_s - 0.25 * math.sin(2.0 * rate * left_s) / rate
