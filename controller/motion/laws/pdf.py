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
    NOTHING_FORESEEN,
    UNALIGNED,
    Charge,
    Forecast,
    Learning,
    first_fuel,
)
from controller.motion.deadbeat import at_dead_centre, fuel_after, rest_of_stroke
from controller.motion.law import NO_TRIM, Demand, Law, Trim, View
from controller.motion.load_estimate import (
    AS_COMMANDED,
    UNKNOWN,
    LoadEstimate,
    LoadEstimation,
)
from hil.config.controller import ControllerConfig
from hil.values import Value


@final
class PdfState(Value):
    """Load, charge, what is foreseen of this stroke, and the load that the fuel was set for.

    end_m: dead centre predicted when the fuel was set last, 0 before
    """

    __slots__ = ("load", "charge", "forecast", "fuel_for_n_s_m", "end_m")

    def __init__(
        self, load: LoadEstimate = AS_COMMANDED, charge: Charge = AS_BELIEVED,
        forecast: Forecast = NOTHING_FORESEEN, fuel_for_n_s_m: float = 0.0, end_m: float = 0.0,
    ) -> None:  # fmt: skip
        self.load = load
        self.charge = charge
        self.forecast = forecast
        self.fuel_for_n_s_m = fuel_for_n_s_m
        self.end_m = end_m


@final
class Pdf(Law[PdfState]):
    """Feed-forward and feedback through the map, trimmed in every tick."""

    name: ClassVar[str] = "pdf"
    parameters: ClassVar[tuple[str, ...]] = ("learning.gain", "learning.inertia_gain")
    needs_map: ClassVar[bool] = True

    def __init__(self, config: ControllerConfig) -> None:
        super().__init__(config)
        self.learning = Learning(config.learning)
        self.estimation = LoadEstimation(config.load_estimate)
        self.measures = config.pdf.load_from == "power"

    def initial(self) -> PdfState:
        """Load and charge as commanded."""
        return PdfState()

    def step(self, state: PdfState, view: View) -> tuple[PdfState, Demand]:
        """The steady fuel for the load, until the watch trims it in the same tick."""
        demand = Demand(first_fuel(state.charge, view), view.point.v_mid_m_s)
        return PdfState(state.load, state.charge, state.forecast), demand

    def watch(self, state: PdfState, view: View, planned_kg: float) -> tuple[PdfState, Trim]:
        """Measure the load, learn at the dead centre, trim the fuel while it can be trimmed."""
        load, learnt = state.load, state.charge
        if self.measures and view.power_w == view.power_w:
            load = load_estimate.update(
                self.estimation, load, view.power_w, view.motion.v_m_s, view.load_n_s_m
            )
        elif not view.passed.dead_centre and planned_kg == 0.0:
            return state, NO_TRIM
        c = view.load_n_s_m * load.scale
        if view.passed.dead_centre:
            if self.measures and not load.is_sure:
                return PdfState(load, learnt), NO_TRIM
            learnt, forecast = at_dead_centre(
                self.learning, learnt, state.forecast, view, c, state.end_m
            )
            return PdfState(load, learnt, forecast), NO_TRIM
        settled = planned_kg == 0.0 or not learnt.known
        if settled or abs(c - state.fuel_for_n_s_m) <= self.estimation.retrim * c:
            after = PdfState(load, learnt, state.forecast, state.fuel_for_n_s_m, state.end_m)
            return after, NO_TRIM
        end_m, _ = rest_of_stroke(view, learnt, c)
        fuel_kg = fuel_after(view, learnt, c, end_m, planned_kg)
        return PdfState(load, learnt, state.forecast, c, end_m), Trim(fuel_kg)

    def load_of(self, state: PdfState, load_n_s_m: float) -> float:
        """The commanded one by its scale."""
        return load_n_s_m * state.load.scale

    def taken_over(self, view: View) -> PdfState:
        """It knows nothing of the load yet, and aligns the shares with the fuel in force."""
        return PdfState(UNKNOWN, UNALIGNED)

    def restarted(self, state: PdfState) -> PdfState:
        """Keep what was learnt; the stroke under way teaches nothing."""
        return PdfState(state.load, state.charge)
