"""What a stroke's map answers: from any point of a stroke where it ends, when, and on what charge.

All in the direction of motion: position z [m] from mid-stroke, velocity v [m/s], tau [s] since the
stroke's dead centre, q [kg] the effective fuel that burns in it, c [N s/m] the load coefficient.
"""

from __future__ import annotations

from typing import Final, final

from mypy_extensions import mypyc_attr

from hil.roots import secant
from hil.values import Value

_LEAST_KG: Final = 0.1e-6
_CLOSE_KG: Final = 3e-10


@final
class Prediction(Value):
    """Velocity a tick on [m/s], and how it moves with the load [m2/(N s2)] and the charge."""

    __slots__ = ("v_m_s", "by_load", "by_charge")

    def __init__(self, v_m_s: float, by_load: float, by_charge: float) -> None:
        self.v_m_s = v_m_s
        self.by_load = by_load
        self.by_charge = by_charge


@mypyc_attr(allow_interpreted_subclasses=True)
class StrokeMap:
    """A maker fulfils the first seven; their inverses are the same for all.

    One that knows no forces, only how strokes end, has no `predict`: then `tells_force` is false.

    m: moving mass [kg]; stroke_s: duration of a steady stroke [s]
    speed: actual mid-stroke speed over that of the map, in the steady state
    hardens: whether the force changes so much within a tick that the map has to tell dead centres
    """

    def __init__(
        self, m: float, stroke_s: float, speed: float = 1.0, hardens: bool = False,
        tells_force: bool = True,
    ) -> None:  # fmt: skip
        self.m = m
        self.stroke_s = stroke_s
        self.speed = speed
        self.hardens = hardens
        self.tells_force = tells_force

    def travel(self, q: float, c: float, z: float, v: float, tau: float) -> tuple[float, float]:
        """Where and when the stroke under way ends: (distance [m], seconds from now)."""
        raise NotImplementedError

    def reach(self, q: float, c: float, z: float, v: float, tau: float, position_m: float) -> float:
        """Seconds until the piston is at a position ahead, or at its dead centre before it."""
        raise NotImplementedError

    def pass_mid(self, q: float, c: float, start_m: float) -> tuple[float, float]:
        """Speed [m/s] at mid-stroke, and when [s], of a stroke from the distance `start_m`."""
        raise NotImplementedError

    def speed_at(self, q: float, c: float, start_m: float, tau: float) -> float:
        """Velocity so long after the dead centre at the distance `start_m` [m/s]."""
        raise NotImplementedError

    def predict(
        self, q: float, c: float, dt: float, z0: float, v0: float, z1: float, v1: float, tau: float
    ) -> Prediction:
        """Predict the velocity at the end of dt, between two positions that are known.

        Parameters: v0 : velocity at z0 to begin with; v1 : about what is measured at z1; tau : at
        the end of dt
        """
        raise NotImplementedError

    def with_mass(self, m: float) -> StrokeMap:
        """The map of another moving mass over the same springs."""
        raise NotImplementedError

    def end_of(self, q: float, c: float, start_m: float) -> float:
        """Distance at which a whole stroke from the distance `start_m` ends [m]."""
        return self.travel(q, c, -start_m, 0.0, 0.0)[0]

    def charge_for(self, c: float, start_m: float, target_m: float, guess_kg: float) -> float:
        """The effective fuel that ends the next stroke at the target [kg].

        By the secant rule; where more fuel seems to end it sooner, the last that did not.
        """
        q0 = max(guess_kg, _LEAST_KG)
        e0 = self.end_of(q0, c, start_m) - target_m
        q1 = q0 * 1.02
        for _ in range(8):
            e1 = self.end_of(q1, c, start_m) - target_m
            slope = (e1 - e0) / (q1 - q0)
            if slope <= 0.0:
                return q0
            q0, e0 = q1, e1
            q1 = min(max(q1 - e1 / slope, 0.3 * q1), 3.0 * q1)
            if abs(q1 - q0) < _CLOSE_KG:
                break
        return q1

    def load_behind(self, q: float, start_m: float, v_mid: float, guess_n_s_m: float) -> float:
        """The load coefficient that explains a mid-stroke speed [N s/m]."""
        return secant(
            lambda c: self.pass_mid(q, c, start_m)[0] - v_mid, max(guess_n_s_m, 1.0),
            steps=5, relative=1e-4,
        )  # fmt: skip

    def load_of_cycle(self, q: float, tdc_m: float, guess_n_s_m: float) -> float:
        """The load coefficient under which strokes on that fuel end where they begin [N s/m]."""
        return secant(
            lambda c: self.end_of(q, c, tdc_m) - tdc_m, max(guess_n_s_m, 1.0),
            steps=6, relative=1e-5,
        )  # fmt: skip
