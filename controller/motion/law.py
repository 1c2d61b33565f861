"""What a piston-motion law is, what it is told, and what it may ask for.

Once a stroke, at mid-stroke, a law gives the fuel that burns at the dead centre ahead: the TDC of
the stroke before and the mid-stroke velocity of this one are known then. A law may also have a part
that runs every tick while generating: it watches, trims the fuel that is still to flow, and may
modulate the load. Laws without such a part are called once a stroke and cost nothing in between.
"""

from __future__ import annotations

from typing import ClassVar, Final, Generic, TypeVar, final

from mypy_extensions import i64, mypyc_attr

from controller.knowledge import OperatingPoint
from controller.motion.maps.stroke_map import StrokeMap
from controller.observe.estimate import Motion, Passed
from hil.config.controller import ControllerConfig
from hil.values import Value


@final
class View(Value):
    """One tick as a law sees it; `motion` and `passed` are of this tick's sample.

    tdc_ref_m, load_n_s_m, point: set point, load coefficient that is commanded, their steady state
    power_w: electric power at the sample, nan when this tick brought none
    burnt_kg: fuel commanded for the last combustion at the left and at the right head
    fuel_min_kg, fuel_max_kg: what may be asked for
    stroke_map: what may be believed of a stroke, None when the steady state tells nothing
    lag: strokes by which what is asked for burns after the dead centre ahead
    enclosed_kg: with a lag, what was asked for before and burns at the dead centre ahead
    """

    __slots__ = (
        "dt_s", "motion", "passed", "tdc_ref_m", "load_n_s_m", "point", "power_w", "burnt_kg",
        "fuel_min_kg", "fuel_max_kg", "stroke_map", "lag", "enclosed_kg",
    )  # fmt: skip

    def __init__(
        self, dt_s: float, motion: Motion, passed: Passed, tdc_ref_m: float, load_n_s_m: float,
        point: OperatingPoint, power_w: float, burnt_kg: tuple[float, float], fuel_min_kg: float,
        fuel_max_kg: float, stroke_map: StrokeMap | None, lag: i64 = 0, enclosed_kg: float = 0.0,
    ) -> None:  # fmt: skip
        self.dt_s = dt_s
        self.motion = motion
        self.passed = passed
        self.tdc_ref_m = tdc_ref_m
        self.load_n_s_m = load_n_s_m
        self.point = point
        self.power_w = power_w
        self.burnt_kg = burnt_kg
        self.fuel_min_kg = fuel_min_kg
        self.fuel_max_kg = fuel_max_kg
        self.stroke_map = stroke_map
        self.lag = lag
        self.enclosed_kg = enclosed_kg

    @property
    def fuel_side(self) -> i64:
        """Head at which the fuel burns that is asked for: 0 left, 1 right."""
        ahead = self.motion.side_ahead
        return ahead if self.lag == 0 else 1 - ahead

    @property
    def believed(self) -> StrokeMap:
        """The stroke's map, for laws that are refused without one."""
        assert self.stroke_map is not None, "checked when the law was chosen"
        return self.stroke_map

    def burnt_at(self, side: i64) -> float:
        """Fuel commanded for the last combustion at a head [kg]."""
        return self.burnt_kg[0] if side == 0 else self.burnt_kg[1]

    def limited_kg(self, fuel_kg: float) -> float:
        """The fuel within what may be asked for [kg]."""
        return min(max(fuel_kg, self.fuel_min_kg), self.fuel_max_kg)


@final
class Demand(Value):
    """The fuel that a law asks for, its velocity reference, and the terms of its loops."""

    __slots__ = (
        "fuel_kg", "v_ref_m_s", "outer_p_m_s", "outer_i_m_s", "inner_p_kg", "inner_i_kg",
    )  # fmt: skip

    def __init__(
        self, fuel_kg: float, v_ref_m_s: float = 0.0, outer_p_m_s: float = 0.0,
        outer_i_m_s: float = 0.0, inner_p_kg: float = 0.0, inner_i_kg: float = 0.0,
    ) -> None:  # fmt: skip
        self.fuel_kg = fuel_kg
        self.v_ref_m_s = v_ref_m_s
        self.outer_p_m_s = outer_p_m_s
        self.outer_i_m_s = outer_i_m_s
        self.inner_p_kg = inner_p_kg
        self.inner_i_kg = inner_i_kg

    def of(self, fuel_kg: float) -> Demand:
        """The same terms, another fuel."""
        return Demand(
            fuel_kg, self.v_ref_m_s, self.outer_p_m_s, self.outer_i_m_s, self.inner_p_kg,
            self.inner_i_kg,
        )  # fmt: skip


NO_DEMAND: Final = Demand(0.0)


@final
class Trim(Value):
    """A correction within a stroke: None leaves fuel or load as they are."""

    __slots__ = ("fuel_kg", "load_n_s_m")

    def __init__(self, fuel_kg: float | None = None, load_n_s_m: float | None = None) -> None:
        self.fuel_kg = fuel_kg
        self.load_n_s_m = load_n_s_m


NO_TRIM: Final = Trim()

StateT = TypeVar("StateT")


@mypyc_attr(allow_interpreted_subclasses=True)
class Law(Generic[StateT]):
    """A law for one configuration: what it begins with, and its step; its state is a value.

    A law derives from this, and its state is immutable: all that it remembers is in there.

    name: what chooses it; parameters: keys of its configuration, below `controller.`, that shape
    it and may be tuned
    needs_map: whether it refuses to work without a stroke's map
    needs_driven: whether it is for engines of which the machine drives some strokes
    needs_force: whether it follows the force within a stroke, which not every map tells
    watches: whether it has a `watch`, which then runs in every tick while generating
    """

    name: ClassVar[str] = ""
    parameters: ClassVar[tuple[str, ...]] = ()
    needs_map: ClassVar[bool] = False
    needs_driven: ClassVar[bool] = False
    needs_force: ClassVar[bool] = False

    def __init__(self, config: ControllerConfig) -> None:
        self.config = config
        self.watches: bool = type(self).watch is not Law.watch

    def initial(self) -> StateT:
        """The state of a run's beginning."""
        raise NotImplementedError

    def step(self, state: StateT, view: View) -> tuple[StateT, Demand]:
        """The fuel for the combustion at the end of this stroke; called at mid-stroke."""
        raise NotImplementedError

    def watch(self, state: StateT, view: View, planned_kg: float) -> tuple[StateT, Trim]:
        """Look at a tick; `planned_kg` for the dead centre ahead is 0 before mid-stroke [kg]."""
        return state, NO_TRIM

    def load_of(self, state: StateT, load_n_s_m: float) -> float:
        """The load coefficient that it believes to act where this one is commanded [N s/m]."""
        return load_n_s_m

    def taken_over(self, view: View) -> StateT:
        """The state with which it goes on from another law while the engine runs."""
        return self.initial()

    def restarted(self, state: StateT) -> StateT:
        """What is kept of the state when the engine has been restarted; here nothing."""
        return self.initial()
