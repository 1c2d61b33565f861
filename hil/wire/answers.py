"""How a command is answered, declared once: to the one who asked, in one JSON object."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Final, NamedTuple

from hil.wire.quantities import Scalar, printable

MAX_BYTES: Final = 16_384
"""No answer is longer."""

MAX_WAITING: Final = 64
"""Commands not yet taken; beyond it more are refused, but for a stop."""

STOPS: Final = ("stop", "emergency-stop")
"""Commands that no queue is before, and that everybody may give."""

_MAX_CHARS: Final = 500
_NO_VALUES: Final[Mapping[str, Scalar | None]] = {}


class CommandAnswer(NamedTuple):
    """What has become of a command.

    process: who answers
    taken: whether it was taken; else it was refused
    tick: of that process, in which it was
    text: how the process is now, or why it was refused and what is accepted
    values: of parameters, by their keys, where they were asked for
    """

    process: str
    taken: bool
    tick: int
    text: str
    values: Mapping[str, Scalar | None] = _NO_VALUES


def write(answer: CommandAnswer) -> bytes:
    """Return an answer as it is sent."""
    told = answer._replace(text=answer.text[:_MAX_CHARS])._asdict()
    if not answer.values:
        del told["values"]
    return json.dumps(told).encode()


def read(raw: bytes) -> CommandAnswer | None:
    """Read an answer from its bytes; None when it is none."""
    if len(raw) > MAX_BYTES:
        return None
    try:
        table = json.loads(raw.decode("utf-8"))
        answer = CommandAnswer(**table)
    except (ValueError, TypeError, RecursionError):
        return None
    kinds = (str, bool, int, str, dict)
    answer = answer._replace(values=answer.values or {})
    if any(type(value) is not kind for value, kind in zip(answer, kinds, strict=True)):
        return None
    values = {printable(k): v for k, v in answer.values.items() if _is_scalar(v)}
    return CommandAnswer(
        printable(answer.process), answer.taken, answer.tick, printable(answer.text), values
    )


def _is_scalar(value: object) -> bool:
    return value is None or isinstance(value, float | int | str)
