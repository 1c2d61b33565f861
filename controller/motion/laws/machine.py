"""Machine: fuel once a stroke, and the linear machine's own braking inside the stroke.

The generator's load coefficient is a command that acts from the next tick, so the braking force
c v can be modulated within a stroke: in every tick the c that ends this stroke at its set point,
z(dead centre; c) = X_ref, within limits about the load that the supervisory layer wants. The fuel
is set as if that load held throughout, so that the machine's part dies out as the fuel takes over.
"""

from __future__ import annotations

from typing import ClassVar, Final, final

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
from hil.values import Value

_STEP: Final = 0.03


@final
class MachineState(Value):
    """Load, charge, the two last orders [N s/m], this stroke's work, the load for its fuel."""

    __slots__ = ("load", "charge", "ordered_n_s_m", "before_n_s_m", "work", "fuel_for_n_s_m")

    def __init__(
        self, load: LoadEstimate = AS_COMMANDED, charge: Charge = AS_BELIEVED,
        ordered_n_s_m: float = 0.0, before_n_s_m: float = 0.0, work: Work = NO_WORK,
        fuel_for_n_s_m: float = 0.0,
    ) -> None:  # fmt: skip
        self.load = load
        self.charge = charge
        self.ordered_n_s_m = ordered_n_s_m
        self.before_n_s_m = before_n_s_m
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

    def initial(self) -> MachineState:
        """Load and charge as commanded."""
        return MachineState()

    def step(self, state: MachineState, view: View) -> tuple[MachineState, Demand]:
        """The steady fuel for the load, until the watch trims it in the same tick."""
        demand = Demand(first_fuel(state.charge, view), view.point.v_mid_m_s)
        after = MachineState(
            state.load, state.charge, state.ordered_n_s_m, state.before_n_s_m, state.work
        )
        return after, demand

    def watch(
        self, state: MachineState, view: View, planned_kg: float
    ) -> tuple[MachineState, Trim]:
        """Measure the load, order the braking, trim the fuel; learn at the dead centre."""
        base, v = view.load_n_s_m, view.motion.v_m_s
        acting, load = state.before_n_s_m or base, state.load
        if view.power_w == view.power_w:
            load = load_estimate.update(self.estimation, load, view.power_w, v, acting)
        before, learnt = state.ordered_n_s_m or base, state.charge
        if view.passed.dead_centre:
            learnt = learnt_of(self.learning, learnt, load, state.work, view)
            work = Work(view.motion.tdc_m, view.motion.dc_t_ns, load.scale)
            return MachineState(load, learnt, base, before, work), Trim(load_n_s_m=base)
        work = state.work.after(acting * load.scale, v)
        order, end_m = self._braking(state, load, view)
        c, fuel_for, trim = base * load.scale, state.fuel_for_n_s_m, Trim(None, order)
        settled = planned_kg == 0.0 or not learnt.known
        if not settled and abs(c - fuel_for) > self.estimation.retrim * c:
            fuel_for, trim = c, Trim(fuel_after(view, learnt, c, end_m, planned_kg), order)
        return MachineState(load, learnt, order, before, work, fuel_for), trim

    def _braking(self, state: MachineState, load: LoadEstimate, view: View) -> tuple[float, float]:
        """The load to order, and where the stroke ends with it; free before the limits bind."""
        motion, base, scale = view.motion, view.load_n_s_m, max(load.scale, 0.05)
        q = state.charge.effective_kg(view, motion.side)
        if q <= 0.0 or not state.work.start_m:
            return base, view.tdc_ref_m
        free = base * scale
        c0 = min(max(state.ordered_n_s_m * scale, 0.2 * free), 5.0 * free)
        believed = state.charge.map_of(view)
        end0, left_s = believed.travel(q, c0, motion.z_m, motion.speed_m_s, motion.tau_s)
        # What was wrong from mid-stroke on last time is wrong in proportion to the way left.
        wrong_m = state.charge.ahead_m * min(2.0 * left_s / believed.stroke_s, 1.0)
        end0 += wrong_m
        if left_s < self.release_s or motion.tau_s < self.begin_s:
            return base, end0
        c1 = c0 * (1.0 + _STEP)
        end1, _ = believed.travel(q, c1, motion.z_m, motion.speed_m_s, motion.tau_s)
        slope = (end1 + wrong_m - end0) / (c0 * _STEP)
        if slope >= -1e-12:
            return base, end0
        wanted = c0 + self.gain * (view.tdc_ref_m - end0) / slope
        c = min(max(wanted, self.least * base), self.most * base)
        return min(c / scale, self.most * base), end0 + slope * (c - c0)

    def load_of(self, state: MachineState, load_n_s_m: float) -> float:
        """The last order by its scale."""
        return (state.ordered_n_s_m or load_n_s_m) * state.load.scale

    def taken_over(self, view: View) -> MachineState:
        """It knows nothing of the load yet, and aligns the shares with the fuel in force."""
        return MachineState(UNKNOWN, UNALIGNED)

    def restarted(self, state: MachineState) -> MachineState:
        """Keep what was learnt; the stroke under way teaches nothing."""
        return MachineState(state.load, state.charge)
