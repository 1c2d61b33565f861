"""The choice of a law: found by its name, refused where it cannot work."""

from __future__ import annotations

from controller.motion.law import Law
from controller.motion.laws import LAWS
from controller.motion.stroke_map import StrokeMap
from hil.errors import ConfigError


def refusal(name: str, stroke_map: StrokeMap | None) -> str:
    """Tell why a law cannot work; an empty string when it can."""
    law = LAWS.get(name)
    if law is None:
        return f"controller {name}: no such law; accepted: {', '.join(LAWS)}"
    if law.needs_map and stroke_map is None:
        return f"controller {name}: the preset is no steady state from which a stroke can be told"
    if law.needs_fit and stroke_map is not None and not stroke_map.fits:
        return (
            f"controller {name}: follows the force within a stroke, and the preset is the steady"
            " state of an engine of another kind (accepted: harmonic, rectangular)"
        )
    return ""


def chosen(name: str, stroke_map: StrokeMap | None) -> Law:
    """Return the law that a configuration names.

    Raises: ConfigError when there is none, or it cannot work
    """
    reason = refusal(name, stroke_map)
    if reason:
        raise ConfigError(reason)
    return LAWS[name]
