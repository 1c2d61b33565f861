"""Operator commands: checked where they enter, logged with their origin."""

from __future__ import annotations

import json
from typing import NamedTuple

from controller.motion.laws import LAWS
from hil.config.plant import FAULT_KINDS
from hil.errors import ConfigError

KINDS = ("start", "stop", "set-point", "law")
LAW_NAMES = tuple(LAWS)
_NUMBERS = {"tdc_ref_m": (0.001, 0.05), "target_power_w": (0.0, 10_000.0)}


class OperatorCommand(NamedTuple):
    """One accepted command; numbers that were not given are None."""

    kind: str
    tdc_ref_m: float | None = None
    target_power_w: float | None = None
    origin: str = "scenario"
    law: str | None = None

    def describe(self) -> str:
        """What was commanded, in one line."""
        numbers = {"tdc_ref_m": self.tdc_ref_m, "target_power_w": self.target_power_w}
        words = [f"{name}={value:g}" for name, value in numbers.items() if value is not None]
        law = [] if self.law is None else [f"law={self.law}"]
        return " ".join([self.kind, *words, *law, f"from {self.origin}"])


def parse(raw: bytes, origin: str) -> OperatorCommand | None:
    """Read a command from its JSON form, as in {"kind": "set-point", "tdc_ref_m": 0.015}.

    Returns: the command; None for a fault, which the plant reads from the same key

    Raises: ConfigError that names what is wrong and what is accepted
    """
    try:
        fields = json.loads(raw)
    except (ValueError, RecursionError):
        raise ConfigError(f"command from {origin}: not JSON") from None
    kind = fields.get("kind") if isinstance(fields, dict) else None
    if kind in FAULT_KINDS:
        return None
    if not isinstance(fields, dict) or kind not in KINDS:
        accepted = ", ".join((*KINDS, *FAULT_KINDS))
        raise ConfigError(f"command from {origin}: kind must be one of {accepted}")
    unknown = set(fields) - {"kind", "law", *_NUMBERS}
    if unknown:
        raise ConfigError(
            f"command from {origin}: unknown key {sorted(unknown)[0]!r};"
            f" accepted: kind, law, {', '.join(_NUMBERS)}"
        )
    numbers = {key: _number(fields, key, origin) for key in _NUMBERS}
    given = any(value is not None for value in numbers.values())
    if given != (fields["kind"] == "set-point"):
        raise ConfigError(
            f"command from {origin}: {', '.join(_NUMBERS)} belong to set-point, and only there"
        )
    return OperatorCommand(fields["kind"], origin=origin, law=_law(fields, origin), **numbers)


def _law(fields: dict[str, object], origin: str) -> str | None:
    """The law's name, which belongs to `law` and only there."""
    name = fields.get("law")
    if (fields["kind"] == "law") != (name is not None):
        raise ConfigError(f"command from {origin}: law belongs to kind law, and only there")
    if name is None:
        return None
    if name not in LAW_NAMES:
        raise ConfigError(
            f"command from {origin}: law = {name!r}; accepted: {', '.join(LAW_NAMES)}"
        )
    return str(name)


def _number(fields: dict[str, object], key: str, origin: str) -> float | None:
    """One optional number within its range."""
    value = fields.get(key)
    if value is None:
        return None
    low, high = _NUMBERS[key]
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise ConfigError(
            f"command from {origin}: {key} = {value!r}; accepted: {low:g} to {high:g}"
        )
    return float(value)
