"""What a piston-motion law is, what it is told, and what it may ask for.

Once a stroke, at mid-stroke, a law gives the fuel that burns at the dead centre ahead: the TDC of
the stroke before and the mid-stroke velocity of this one are known then. A law may also have a part
that runs every tick while generating: it watches, trims the fuel that is still to flow, and may
modulate the load. Laws without such a part are called once a stroke and cost nothing in between.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, final

from controller.knowledge import OperatingPoint
from controller.motion.stroke_map import StrokeMap
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
    """

    __slots__ = (
        "dt_s", "motion", "passed", "tdc_ref_m", "load_n_s_m", "point", "power_w", "burnt_kg",
        "fuel_min_kg", "fuel_max_kg", "stroke_map",
    )  # fmt: skip

    def __init__(
        self, dt_s: float, motion: Motion, passed: Passed, tdc_ref_m: float, load_n_s_m: float,
        point: OperatingPoint, power_w: float, burnt_kg: tuple[float, float], fuel_min_kg: float,
        fuel_max_kg: float, stroke_map: StrokeMap | None,
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

    @property
    def believed(self) -> StrokeMap:
        """The stroke's map, for laws that are refused without one."""
        assert self.stroke_map is not None, "checked when the law was chosen"
        return self.stroke_map

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


NO_DEMAND: Final = Demand(0.0)


@final
class Trim(Value):
    """A correction within a stroke: None leaves fuel or load as they are."""

    __slots__ = ("fuel_kg", "load_n_s_m")

    def __init__(self, fuel_kg: float | None = None, load_n_s_m: float | None = None) -> None:
        self.fuel_kg = fuel_kg
        self.load_n_s_m = load_n_s_m


NO_TRIM: Final = Trim()

Step = Callable[[ControllerConfig, Any, View], tuple[Any, Demand]]
Watch = Callable[[ControllerConfig, Any, View, float], tuple[Any, Trim]]
"""Its last argument is the fuel planned for the dead centre ahead, 0 before mid-stroke [kg]."""


@final
class Law(Value):
    """A law is its initial state and its step; its state is an immutable value.

    watch: the part that runs every tick while generating, None when there is none
    parameters: keys of its configuration, below `controller.`, that shape it and may be tuned
    take_over: the state with which the law goes on from another one while the engine runs
    after_restart: what is kept of the state when the engine has been restarted; None: nothing
    needs_map: whether it refuses to work without a stroke's map
    needs_fit: whether it refuses one that meets the steady state in part only
    """

    __slots__ = (
        "name", "initial", "step", "watch", "parameters", "take_over", "after_restart",
        "needs_map", "needs_fit",
    )  # fmt: skip

    def __init__(
        self, name: str, initial: Any, step: Step, watch: Watch | None = None,  # noqa: ANN401
        parameters: tuple[str, ...] = (),
        take_over: Callable[[ControllerConfig, View], Any] | None = None,
        after_restart: Callable[[Any], Any] | None = None,
        needs_map: bool = False, needs_fit: bool = False,
    ) -> None:  # fmt: skip
        self.name = name
        self.initial = initial
        self.step = step
        self.watch = watch
        self.parameters = parameters
        self.take_over = take_over
        self.after_restart = after_restart
        self.needs_map = needs_map
        self.needs_fit = needs_fit

    def taken_over(self, config: ControllerConfig, view: View) -> Any:  # noqa: ANN401
        """The state to go on with, the initial one where a law remembers nothing."""
        return self.initial if self.take_over is None else self.take_over(config, view)

    def restarted(self, state: Any) -> Any:  # noqa: ANN401
        """The state after a restart of the engine."""
        return self.initial if self.after_restart is None else self.after_restart(state)
