"""Whether an order still reaches the injection: what takes time from mid-stroke on.

At mid-stroke the fuel is known. Until the dead centre ahead, half a stroke later:

    the sample that shows the middle        up to 1 tick
    the answer to it acts                   1 tick and the command's delay
    the injector opens                      its dead time
    a charge flows, larger by a quarter     1.25 m / flow
    the line is low before the dead centre  controller.timing.trim_margin_s

What is left is spent on resending: the injection opens `injection_lead_ticks` after the sample.
The table that follows for our engines is in docs/control.md, "Rates and delays".
"""

from __future__ import annotations

from typing import Any, Final, final

from hil.config.scenario import Scenario
from hil.errors import ConfigError
from hil.values import Value

_MOST_LEAD: Final = 3
"""Two frames may be lost, and the injection opens in time."""


_CHARGE: Final = 1.25
"""Of the steady charge: as much as a load step of a fifth asks for."""


@final
class Budget(Value):
    """Times in seconds: a tick, mid-stroke to dead centre, and injection with all that it needs."""

    __slots__ = ("tick_s", "half_stroke_s", "injection_s")

    def __init__(self, tick_s: float, half_stroke_s: float, injection_s: float) -> None:
        self.tick_s = tick_s
        self.half_stroke_s = half_stroke_s
        self.injection_s = injection_s

    @property
    def lead_ticks(self) -> int:
        """Ticks after the sample by which the injection may open at the latest; below 1: none."""
        return int((self.half_stroke_s - self.injection_s) / self.tick_s - 1.0)


def fit(scenario: Scenario, tree: dict[str, Any]) -> None:
    """Give the controller the delay of its commands, and a lead that leaves time for a charge.

    Parameters: tree : the scenario with all else filled in
    A run that expects nothing and delays nothing may be of any rate: links are measured so.

    Raises: ConfigError for a rate and a delay with which no charge could flow in time
    """
    controller = tree["controller"]
    timing, given = controller["timing"], scenario.controller.timing.model_fields_set
    acts = 1 + scenario.plant.command_delay_ticks
    if "act_ticks" not in given:
        timing["act_ticks"] = acts
    if not all(timing["fires"]):
        return
    budget = budget_of(controller, scenario.loop.rate_hz)
    if budget.lead_ticks < acts and (scenario.expect or acts > 1):
        raise ConfigError(_refusal(scenario, budget, acts))
    if "injection_lead_ticks" not in given:
        lead = min(timing["injection_lead_ticks"], _MOST_LEAD, budget.lead_ticks)
        timing["injection_lead_ticks"] = max(lead, timing["act_ticks"], 1)


def budget_of(controller: dict[str, Any], rate_hz: float) -> Budget:
    """The budget of a controller whose preset is known, at a rate."""
    timing, injector, preset = controller["timing"], controller["injector"], controller["preset"]
    charge_s = _CHARGE * preset["fuel_kg"] / injector["static_flow_kg_s"]
    injection_s = injector["dead_time_s"] + charge_s + timing["trim_margin_s"]
    return Budget(1.0 / rate_hz, 0.5 * preset["stroke_s"], injection_s)


def _refusal(scenario: Scenario, budget: Budget, acts: int) -> str:
    """Name what does not fit, and what would."""
    needed_s = (1 + acts) * budget.tick_s + budget.injection_s
    most = budget.lead_ticks - 1
    return (
        f"{scenario.name}: loop.rate_hz {scenario.loop.rate_hz:g} with plant.command_delay_ticks"
        f" {acts - 1} on model {scenario.plant.model}: from mid-stroke to the dead centre are"
        f" {1e3 * budget.half_stroke_s:.1f} ms, and an order with its injection takes"
        f" {1e3 * needed_s:.1f} ms; accepted at this rate: "
        + (f"a delay up to {most}" if most >= 0 else "none, since no answer comes in time")
    )
