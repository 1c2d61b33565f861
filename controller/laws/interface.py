"""Piston-motion laws behind one interface (level 3): once a stroke, at mid-stroke, the fuel.

The TDC of the stroke before and the mid-stroke velocity of this one are known then, and the fuel
asked for burns at the dead centre that ends this stroke. A law may also have a part that runs
every tick while generating: it watches, trims the fuel that is still to flow, and may modulate
the load. Laws without such a part are called once a stroke and cost nothing in between.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from controller.estimate import Motion, Passed
from controller.knowledge import OperatingPoint
from controller.laws.engine_map import EngineMap
from hil.config.controller import ControllerConfig


class StrokeFacts(NamedTuple):
    """What a law is told at mid-stroke.

    load_n_s_m: load coefficient that is commanded
    side: head that the piston approaches, 0 left, 1 right; the fuel asked for burns there
    burnt_kg: fuel commanded for the last combustion at the left and at the right head
    model: what model-based laws believe of a stroke, None when the steady state tells nothing
    """

    tdc_ref_m: float
    tdc_m: float
    v_mid_m_s: float
    point: OperatingPoint
    fuel_min_kg: float
    fuel_max_kg: float
    load_n_s_m: float = 0.0
    side: int = 0
    burnt_kg: tuple[float, float] = (0.0, 0.0)
    model: EngineMap | None = None


class TickFacts(NamedTuple):
    """What a law is told in every tick; `motion` and `passed` are of this tick's sample.

    tau_s: time since the last dead centre
    power_w: electric power at the sample, nan when this tick brought none
    planned_kg: fuel that is planned for the dead centre ahead, 0 before mid-stroke
    """

    dt_s: float
    motion: Motion
    passed: Passed
    tau_s: float
    tdc_ref_m: float
    load_n_s_m: float
    power_w: float
    planned_kg: float
    burnt_kg: tuple[float, float]
    fuel_min_kg: float
    fuel_max_kg: float
    model: EngineMap


class Demand(NamedTuple):
    """What a law wants, and why: fuel, velocity reference, terms of the loops."""

    fuel_kg: float
    v_ref_m_s: float = 0.0
    outer_p_m_s: float = 0.0
    outer_i_m_s: float = 0.0
    inner_p_kg: float = 0.0
    inner_i_kg: float = 0.0


NO_DEMAND = Demand(0.0)


class Trim(NamedTuple):
    """What a law wants within a stroke: None leaves fuel or load as they are."""

    fuel_kg: float | None = None
    load_n_s_m: float | None = None


NO_TRIM = Trim()


class Handover(NamedTuple):
    """What a law that takes over is told, so that its first fuel is the one in force."""

    tdc_ref_m: float
    tdc_m: float
    v_mid_m_s: float
    point: OperatingPoint
    burnt_kg: tuple[float, float]


Step = Callable[[ControllerConfig, Any, StrokeFacts], tuple[Any, Demand]]
Watch = Callable[[ControllerConfig, Any, TickFacts], tuple[Any, Trim]]


class Law(NamedTuple):
    """A law is its initial state and its step; its state is an immutable value.

    watch: the part that runs every tick while generating, None when there is none
    take_over: the state with which the law goes on from another one while the engine runs
    after_restart: what is kept of the state when the engine has been restarted; None: nothing
    needs_model: whether it refuses to work without an `EngineMap`
    needs_fit: whether it refuses one that meets the steady state in part only
    """

    name: str
    initial: Any
    step: Step
    watch: Watch | None = None
    take_over: Callable[[ControllerConfig, Handover], Any] | None = None
    after_restart: Callable[[Any], Any] | None = None
    needs_model: bool = False
    needs_fit: bool = False

    def taken_over(self, config: ControllerConfig, handover: Handover) -> Any:  # noqa: ANN401
        """The state to go on with, the initial one where a law remembers nothing."""
        return self.initial if self.take_over is None else self.take_over(config, handover)

    def restarted(self, state: Any) -> Any:  # noqa: ANN401
        """The state after a restart of the engine."""
        return self.initial if self.after_restart is None else self.after_restart(state)
