"""The choice of a law: found by its name, refused where it cannot work."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from controller.motion.law import Law
from controller.motion.laws import LAWS
from controller.motion.laws.open_loop import OpenLoop
from controller.motion.maps.stroke_map import StrokeMap
from controller.motion.own import OwnLaw, make_own, own_source
from hil import brought
from hil.config.controller import ControllerConfig
from hil.config.scenario import Scenario
from hil.errors import ConfigError
from hil.nearest import did_you_mean, listed


def make_laws(config: ControllerConfig) -> dict[str, Law[Any]]:
    """Make every law that a run may use: ours, and the one that its user has brought.

    Raises: ConfigError when that one cannot be made, or has the name of one of ours
    """
    own = make_own(config)
    for name in own.keys() & LAWS.keys():
        raise ConfigError(f"controller.own: {name!r} is a law of ours; accepted is another name")
    return {**made_of(config), **own}


def made_of(config: ControllerConfig) -> dict[str, Law[Any]]:
    """Make the laws that are ours."""
    return {name: law(config) for name, law in LAWS.items()}


def remade(laws: Mapping[str, Law[Any]], config: ControllerConfig) -> dict[str, Law[Any]]:
    """Make the laws of a run anew by another configuration; its user's own is not loaded again.

    Raises: ConfigError for settings that it does not accept
    """
    own = {name: law.remade(config) for name, law in laws.items() if isinstance(law, OwnLaw)}
    return {**made_of(config), **own}


def watches(name: str) -> bool:
    """Tell whether a law looks at every tick, and so knows all of a stroke.

    Raises: ConfigError when its file cannot be loaded
    """
    if name in LAWS:
        return LAWS[name].watch is not LAWS[OpenLoop.name].watch
    source = own_source(ControllerConfig(name=name))
    return source is not None and callable(getattr(source[0], "watch", None))


def refusal(name: str, laws: Mapping[str, Law[Any]], stroke_map: StrokeMap | None) -> str:
    """Tell why a law cannot work; an empty string when it can."""
    law = laws.get(name)
    if law is None:
        return f"law = {name!r}: accepted: {listed(name, laws)}"
    if law.needs_map and stroke_map is None:
        return (
            f"controller {name}: no map of a stroke: the preset is no steady state of the kind"
            " controller.stroke_map.kind, or its sensitivities were not given (hil engine"
            " sensitivities)"
        )
    if law.needs_driven and all(law.config.timing.fires):
        return f"controller {name}: for engines with driven strokes, and here every stroke fires"
    if law.needs_force and stroke_map is not None and not stroke_map.tells_force:
        return (
            f"controller {name}: follows the force within a stroke, which a map of sensitivities"
            " does not tell (accepted kinds: linear, gas-law)"
        )
    return ""


def check_name(name: str, where: str) -> None:
    """Refuse a name that no law has; `where` is what gave it. A file's name is one.

    Raises: ConfigError
    """
    if name not in LAWS and not brought.is_brought(brought.LAWS, name):
        raise ConfigError(
            f"{where} = {name!r}: accepted: {', '.join(LAWS)}, or a file ending in .py"
            f"{did_you_mean(name, LAWS)}"
        )


def check_names(scenario: Scenario) -> None:
    """Refuse a scenario that names a law that there is not.

    Raises: ConfigError
    """
    own = scenario.controller.own.name
    if scenario.controller.name != own:
        check_name(scenario.controller.name, f"{scenario.name}: controller.name")
    for name, event in scenario.events.items():
        law = event.command.text("law")
        if law is not None and law != own:
            check_name(law, f"{scenario.name}: events.{name}.law")


def check(name: str, laws: Mapping[str, Law[Any]], stroke_map: StrokeMap | None) -> None:
    """Refuse a law that there is not, or that cannot work.

    Raises: ConfigError
    """
    reason = refusal(name, laws, stroke_map)
    if reason:
        raise ConfigError(reason)
