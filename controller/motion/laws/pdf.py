"""Pseudo-derivative feedback with load feed-forward, all of it through the stroke's own map.

m_fuel = q(c, X) / share,  q the charge that takes the next stroke from X to the set point

The load c that is fed forward is the commanded one, times its scale from electric power and
velocity where that is asked for; X, the dead centre ahead, is predicted from the motion and fed
back undifferentiated by its own error (hence pseudo-derivative, Mikalsen and Roskilly); the
integral of what is left sits in the shares (`charge`). Fuel is trimmed until it has flowed.
"""

from __future__ import annotations

from typing import ClassVar, final

from controller.motion import load_estimate
from controller.motion.charge import (
    AS_BELIEVED,
    UNALIGNED,
    Charge,
    Learning,
    first_fuel,
    look_back,
)
from controller.motion.deadbeat import fuel_after, rest_of_stroke
from controller.motion.law import NO_TRIM, Demand, Law, Trim, View
from controller.motion.load_estimate import (
    AS_COMMANDED,
    NO_DRIFT,
    UNKNOWN,
    LoadDrift,
    LoadEstimate,
    LoadEstimation,
)
from controller.motion.work import NO_WORK, Work, learnt_of
from hil.config.controller import ControllerConfig
from hil.values import Value


@final
class PdfState(Value):
    """Load, charge, the braking of this stroke, and the load that the fuel was set for.

    end_m: dead centre predicted when the fuel was set last, 0 before
    drift: of the load, from stroke to stroke
    """

    __slots__ = ("load", "charge", "work", "fuel_for_n_s_m", "end_m", "drift")

    def __init__(
        self, load: LoadEstimate = AS_COMMANDED, charge: Charge = AS_BELIEVED,
        work: Work = NO_WORK, fuel_for_n_s_m: float = 0.0, end_m: float = 0.0,
        drift: LoadDrift = NO_DRIFT,
    ) -> None:  # fmt: skip
        self.load = load
        self.charge = charge
        self.work = work
        self.fuel_for_n_s_m = fuel_for_n_s_m
        self.end_m = end_m
        self.drift = drift


@final
class Pdf(Law[PdfState]):
    """Feed-forward and feedback through the map, trimmed in every tick."""

    name: ClassVar[str] = "pdf"
    parameters: ClassVar[tuple[str, ...]] = ("learning.gain", "learning.inertia_gain")
    needs_map: ClassVar[bool] = True

    def __init__(self, config: ControllerConfig) -> None:
        super().__init__(config)
        self.learning = Learning(config.learning, config.quiet)
        self.estimation = LoadEstimation(config.load_estimate)
        self.measures = config.pdf.load_from == "power"

    def initial(self) -> PdfState:
        """Load and charge as commanded."""
        return PdfState()

    def step(self, state: PdfState, view: View) -> tuple[PdfState, Demand]:
        """The steady fuel for the load, until the watch trims it in the same tick."""
        demand = Demand(first_fuel(state.charge, view), view.point.v_mid_m_s)
        return PdfState(state.load, state.charge, state.work, drift=state.drift), demand

    def watch(self, state: PdfState, view: View, planned_kg: float) -> tuple[PdfState, Trim]:
        """Measure the load, learn at the dead centre, trim the fuel while it can be trimmed."""
        load, learnt = state.load, state.charge
        if self.measures and view.power_w == view.power_w:
            load = load_estimate.update(
                self.estimation, load, view.power_w, view.motion.v_m_s, view.load_n_s_m
            )
        elif not view.passed.dead_centre and planned_kg == 0.0:
            return state, NO_TRIM
        c, drift = view.load_n_s_m * load.scale, state.drift
        if view.passed.dead_centre:
            return self._learnt(state, load, c, view), NO_TRIM
        work = state.work.after(c, view.motion.v_m_s)
        settled = planned_kg == 0.0 or not learnt.known
        if settled or abs(c - state.fuel_for_n_s_m) <= self.estimation.retrim * c:
            after = PdfState(load, learnt, work, state.fuel_for_n_s_m, state.end_m, drift)
            return after, NO_TRIM
        end_m, left_s = rest_of_stroke(view, learnt, c)
        left = left_s / view.believed.stroke_s
        if drift.lasting != 0.0:
            end_m, _ = rest_of_stroke(view, learnt, c + 0.5 * left * drift.lasting)
        ahead = c + (left + 0.5) * drift.lasting  # in the middle of the stroke to come
        fuel_kg = fuel_after(view, learnt, ahead, end_m, planned_kg)
        return PdfState(load, learnt, work, c, end_m, drift), Trim(fuel_kg)

    def _learnt(self, state: PdfState, load: LoadEstimate, c: float, view: View) -> PdfState:
        """At the dead centre: learn from the stroke behind, and from how far it was foreseen."""
        motion, before = view.motion, state.charge
        if self.measures and not load.is_sure:
            return PdfState(load, before)
        learnt = learnt_of(self.learning, before, load, state.work, view)
        if before.known and learnt is not before and state.end_m > 0.0:
            wrong_m = motion.tdc_m - state.end_m - learnt.ahead_m
            learnt = look_back(self.learning, learnt, wrong_m)
        work = Work(motion.tdc_m, motion.dc_t_ns, load.scale)
        return PdfState(load, learnt, work, drift=state.drift.after(c))

    def load_of(self, state: PdfState, load_n_s_m: float) -> float:
        """The commanded one by its scale."""
        return load_n_s_m * state.load.scale

    def taken_over(self, view: View) -> PdfState:
        """It knows nothing of the load yet, and aligns the shares with the fuel in force."""
        return PdfState(UNKNOWN, UNALIGNED)

    def restarted(self, state: PdfState) -> PdfState:
        """Keep what was learnt; the stroke under way teaches nothing."""
        return PdfState(state.load, state.charge)
