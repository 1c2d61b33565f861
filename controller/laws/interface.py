"""Piston-motion laws behind one interface (level 3): once a stroke, at mid-stroke, the fuel.

The TDC of the stroke before and the mid-stroke velocity of this one are known then, and the fuel
asked for burns at the dead centre that ends this stroke.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from controller.knowledge import OperatingPoint
from hil.config.controller import ControllerConfig


class StrokeFacts(NamedTuple):
    """What a law is told at mid-stroke."""

    tdc_ref_m: float
    tdc_m: float
    v_mid_m_s: float
    point: OperatingPoint
    fuel_min_kg: float
    fuel_max_kg: float


class Demand(NamedTuple):
    """What a law wants, and why: fuel, velocity reference, terms of the loops."""

    fuel_kg: float
    v_ref_m_s: float = 0.0
    outer_p_m_s: float = 0.0
    outer_i_m_s: float = 0.0
    inner_p_kg: float = 0.0
    inner_i_kg: float = 0.0


NO_DEMAND = Demand(0.0)


class Law(NamedTuple):
    """A law is its initial state and its step; its state is an immutable value."""

    name: str
    initial: Any
    step: Callable[[ControllerConfig, Any, StrokeFacts], tuple[Any, Demand]]
