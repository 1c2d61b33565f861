"""Requests about parameters on the command key: to change some, to check a change, to tell values.

{"kind": "set", "controller.cascade.outer.kp": 41.0, "plant.sensors.noise_x_m": 1e-5}
{"kind": "check", ...} is answered as a set is, and changes nothing
{"kind": "get", "keys": "controller.cascade.*", "after": "controller.cascade.inner.kp"}

Each process takes the keys that are its own. What a key accepts is in hil/names/parameters.py.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from hil.errors import ConfigError
from hil.wire.commands import BY_KIND, CONTROLLER, MAX_BYTES, PLANT, OperatorCommand
from hil.wire.quantities import Scalar, shown

SET, CHECK, GET = "set", "check", "get"
KINDS: Final = (SET, CHECK, GET)
AT_TICK: Final = "at_tick"
"""Of a set: not before this tick, so that both processes change in the same one."""

MOST_VALUES: Final = 64
"""No answer to a get has more."""

_MOST_TICK: Final = 1 << 53
_MOST_CHARS: Final = 200
_NO_VALUES: Final[Mapping[str, Scalar | None]] = {}


class ChangeRequest(NamedTuple):
    """One request, of which `values` are those of one process.

    keys, after: of a get: which ones, and behind which one to begin
    """

    kind: str
    origin: str
    values: Mapping[str, Scalar | None] = _NO_VALUES
    at_tick: int = 0
    keys: str = ""
    after: str = ""


def encode(kind: str, values: Mapping[str, object], at_tick: int = 0) -> dict[str, object]:
    """Return a request as a table, as the command key carries it."""
    return {"kind": kind, **values, **({AT_TICK: at_tick} if at_tick else {})}


def parameters_of(command: OperatorCommand) -> dict[str, Scalar]:
    """Return the parameters that a command of another kind changes, by their keys."""
    own = {field.name: field.parameter for field in BY_KIND[command.kind].fields}
    return {own[name]: value for name, value in command.fields.items() if own[name]}


def is_one(raw: bytes) -> bool:
    """Whether bytes may be such a request, told at little cost."""
    return len(raw) <= MAX_BYTES and any(f'"{kind}"'.encode() in raw for kind in KINDS)


def parse(raw: bytes, origin: str, side: str) -> ChangeRequest | None:
    """Read a request, as far as it is for this side.

    Returns: None when it is no such request, or none of it is for this side; what is for nobody
        the controller refuses

    Raises: ConfigError with one line that says what is wrong
    """
    table = _table(raw)
    kind = table.pop("kind", None)
    if kind not in KINDS:
        return None
    if kind == GET:
        keys, after = (_text(table, name, origin) for name in ("keys", "after"))
        _refuse_rest(table, origin)
        return ChangeRequest(kind, origin, keys=keys, after=after)
    at_tick = table.pop(AT_TICK, 0)
    if type(at_tick) is not int or not 0 <= at_tick <= _MOST_TICK:
        raise ConfigError(f"command from {origin}: {AT_TICK} = {shown(at_tick)}: accepted: a tick")
    own = {key: value for key, value in table.items() if key.startswith(f"{side}.")}
    if side == CONTROLLER:
        others = {key: v for key, v in table.items() if not key.startswith(f"{PLANT}.")}
        own = {key: value for key, value in others.items() if value is None or _is_scalar(value)}
        _refuse_rest({key: v for key, v in others.items() if key not in own}, origin)
        if not table:
            raise ConfigError(f"command from {origin}: a {kind} needs KEY: VALUE")
    return ChangeRequest(kind, origin, own, at_tick) if own else None


def _refuse_rest(table: Mapping[str, object], origin: str) -> None:
    for key, value in table.items():
        raise ConfigError(f"command from {origin}: {shown(key)} = {shown(value)}: not accepted")


def _is_scalar(value: object) -> bool:
    return isinstance(value, float | int | str)


def _text(table: dict[str, Any], name: str, origin: str) -> str:
    value = table.pop(name, "")
    if not isinstance(value, str) or len(value) > _MOST_CHARS:
        raise ConfigError(f"command from {origin}: {name}: accepted is a text")
    return value


def _table(raw: bytes) -> dict[str, Any]:
    """The JSON object of some bytes; empty when they are something else."""
    if not is_one(raw):
        return {}
    try:
        table = json.loads(raw.decode("utf-8"))
    except (ValueError, RecursionError):
        return {}
    return table if isinstance(table, dict) else {}
