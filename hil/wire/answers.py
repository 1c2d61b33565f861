"""How a command is answered, declared once: to the one who asked, in one JSON object."""

from __future__ import annotations

import json
from typing import Final, NamedTuple

from hil.wire.quantities import printable

MAX_BYTES: Final = 4096
"""No answer is longer."""

MAX_WAITING: Final = 64
"""Commands not yet taken; beyond it more are refused, but for a stop."""

STOPS: Final = ("stop", "emergency-stop")
"""Commands that no queue is before, and that everybody may give."""

_MAX_CHARS: Final = 500


class CommandAnswer(NamedTuple):
    """What has become of a command.

    process: who answers
    taken: whether it was taken; else it was refused
    tick: of that process, in which it was
    text: how the process is now, or why it was refused and what is accepted
    """

    process: str
    taken: bool
    tick: int
    text: str


def write(answer: CommandAnswer) -> bytes:
    """Return an answer as it is sent."""
    return json.dumps(answer._replace(text=answer.text[:_MAX_CHARS])._asdict()).encode()


def read(raw: bytes) -> CommandAnswer | None:
    """Read an answer from its bytes; None when it is none."""
    if len(raw) > MAX_BYTES:
        return None
    try:
        table = json.loads(raw.decode("utf-8"))
        answer = CommandAnswer(**table)
    except (ValueError, TypeError, RecursionError):
        return None
    kinds = (str, bool, int, str)
    if any(type(value) is not kind for value, kind in zip(answer, kinds, strict=True)):
        return None
    return answer._replace(process=printable(answer.process), text=printable(answer.text))
