"""The choice of a law: found by its name, refused where it cannot work."""

from __future__ import annotations

from controller.motion.laws import LAWS
from controller.motion.maps.stroke_map import StrokeMap
from hil.config.scenario import Scenario
from hil.errors import ConfigError


def refusal(name: str, stroke_map: StrokeMap | None) -> str:
    """Tell why a law cannot work; an empty string when it can."""
    law = LAWS.get(name)
    if law is None:
        return f"law = {name!r}: accepted: {', '.join(LAWS)}"
    if law.needs_map and stroke_map is None:
        return f"controller {name}: the preset is no steady state from which a stroke can be told"
    if law.needs_fit and stroke_map is not None and not stroke_map.fits:
        return (
            f"controller {name}: follows the force within a stroke, and the preset is the steady"
            " state of an engine of another kind (accepted: harmonic, rectangular)"
        )
    return ""


def check_name(name: str, where: str) -> None:
    """Refuse a name that no law has; `where` is what gave it.

    Raises: ConfigError
    """
    if name not in LAWS:
        raise ConfigError(f"{where} = {name!r}: accepted: {', '.join(LAWS)}")


def check_names(scenario: Scenario) -> None:
    """Refuse a scenario that names a law that there is not.

    Raises: ConfigError
    """
    check_name(scenario.controller.name, f"{scenario.name}: controller.name")
    for name, event in scenario.events.items():
        law = event.command.text("law")
        if law is not None:
            check_name(law, f"{scenario.name}: events.{name}.law")


def check(name: str, stroke_map: StrokeMap | None) -> None:
    """Refuse a law that there is not, or that cannot work.

    Raises: ConfigError
    """
    reason = refusal(name, stroke_map)
    if reason:
        raise ConfigError(reason)
