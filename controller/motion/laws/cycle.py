"""Four-stroke: the fuel of each cylinder by what its power stroke of the cycle before came to.

m_s <- m_s + g (dm/dX) (X_ref - X_s)

X_s is the dead centre that the power stroke of side s has ended with where that compresses the
other charge; where it ends with an exhaust, at which the machine stops the mover, the speed at
mid-stroke tells instead, by dm/dv. Motored strokes in between make each cycle begin alike, so that
an error is gone two cycles after a load step, however large the charge that it took. An engine
that fires in every stroke has no such pause: there half the steady fuel per metre does.
"""

from __future__ import annotations

from typing import ClassVar, Final, final

from mypy_extensions import i64

from controller.motion.law import NO_TRIM, Demand, Law, Trim, View
from hil.values import Value


@final
class CycleState(Value):
    """What either cylinder is given beyond the steady fuel [kg], and the stroke last judged."""

    __slots__ = ("left_kg", "right_kg", "stroke")

    def __init__(self, left_kg: float = 0.0, right_kg: float = 0.0, stroke: i64 = -1) -> None:
        self.left_kg = left_kg
        self.right_kg = right_kg
        self.stroke = stroke


_STEADY: Final = CycleState()


@final
class CycleLaw(Law[CycleState]):
    """Watches power strokes end, and asks once for each charge."""

    name: ClassVar[str] = "cycle"
    needs_driven: ClassVar[bool] = True
    parameters: ClassVar[tuple[str, ...]] = ("cycle.gain",)

    def initial(self) -> CycleState:
        """The operating point."""
        return _STEADY

    def step(self, state: CycleState, view: View) -> tuple[CycleState, Demand]:
        """Fuel for the combustion at the end of this stroke."""
        beyond_kg = state.left_kg if view.motion.side_ahead == 0 else state.right_kg
        return state, Demand(view.limited_kg(view.point.fuel_kg + beyond_kg))

    def watch(self, state: CycleState, view: View, planned_kg: float) -> tuple[CycleState, Trim]:
        """Judge a power stroke where it ends."""
        motion, cycle = view.motion, self.config.cycle
        if not view.passed.dead_centre or motion.stroke == state.stroke:
            return state, NO_TRIM
        fires = self.config.timing.fires
        ended = motion.stroke - 1
        if ended < 1 or not fires[(ended - 1) % len(fires)]:
            return state, NO_TRIM
        if fires[ended % len(fires)]:
            slope = cycle.fuel_per_tdc_kg_m or 0.5 * view.point.fuel_kg / view.tdc_ref_m
            more_kg = slope * (view.tdc_ref_m - motion.tdc_m)
        else:
            stroke = int(ended + cycle.first_stroke) % 4
            more_kg = view.point.fuel_per_speed_kg_s_m * (
                cycle.v_mid_m_s[stroke] - motion.v_mid_m_s
            )
        more_kg *= cycle.gain
        if motion.side == 1:  # driven by the left charge
            kept_kg = self._kept(state.left_kg + more_kg, view)
            return CycleState(kept_kg, state.right_kg, motion.stroke), NO_TRIM
        kept_kg = self._kept(state.right_kg + more_kg, view)
        return CycleState(state.left_kg, kept_kg, motion.stroke), NO_TRIM

    def _kept(self, beyond_kg: float, view: View) -> float:
        """What is kept: no more than may be asked for."""
        return view.limited_kg(view.point.fuel_kg + beyond_kg) - view.point.fuel_kg
