"""Whether what the protection is to watch is measured at all."""

from __future__ import annotations

from hil.config.resolved import Resolved
from hil.errors import ConfigError


def check_protection(scenario: Resolved) -> None:
    """Refuse a limit of something that the plant does not tell.

    Raises: ConfigError naming the limit, and the switch that it needs
    """
    given, plant = scenario.controller.protection, scenario.plant
    if given.needs_pressure and not plant.indicator.on:
        name = next(
            key
            for key in ("peak_pa", "knock_w_m2", "fired_ratio")
            if getattr(given, key) is not None
        )
        raise ConfigError(_refusal(scenario.name, name, "plant.indicator.on"))
    if given.winding_k is not None and not plant.winding.on:
        raise ConfigError(_refusal(scenario.name, "winding_k", "plant.winding.on"))


def _refusal(scenario: str, limit: str, switch: str) -> str:
    return (
        f"{scenario}: controller.protection.{limit}: the plant does not tell what it is held"
        f" against; accepted with {switch} = true"
    )
