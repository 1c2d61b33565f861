"""What every command and status channel has in common, and the channels inside one process."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Final

from hil.errors import ConfigError
from hil.ports import CommandSource, StatusSink
from hil.wire import commands, status
from hil.wire.answers import MAX_WAITING, STOPS
from hil.wire.quantities import printable

MAX_ORIGIN_CHARS: Final = 64
STOP: Final = b'{"kind": "stop"}'
_SHORT: Final = 80


def clip_command(raw: bytes) -> bytes:
    """Cut an oversized command; what is left is no JSON, so it is refused where it is parsed."""
    return raw if len(raw) <= commands.MAX_BYTES else raw[: commands.MAX_BYTES] + b"..."


def origin_text(raw: bytes) -> str:
    """Return who a sender says it is, fit for a log line: short and printable."""
    text = raw[: 4 * MAX_ORIGIN_CHARS].decode("utf-8", "replace")[:MAX_ORIGIN_CHARS]
    return printable(text) or "unnamed"


def is_stop(raw: bytes) -> bool:
    """Whether a command is one to stop, told at no cost from almost anything else."""
    if len(raw) > _SHORT or b"stop" not in raw:
        return False
    try:
        command = commands.parse(raw, "")
    except ConfigError:
        return False
    return command is not None and command.kind in STOPS


class MemoryCommands(CommandSource):
    """A command source inside one process: `submit` is the sender's side."""

    __slots__ = ("_waiting",)

    def __init__(self) -> None:
        self._waiting: deque[tuple[str, bytes]] = deque(maxlen=MAX_WAITING)

    def submit(self, origin: str, command: Mapping[str, object]) -> None:
        """Hand over a command."""
        self._waiting.append((origin_text(origin.encode()), clip_command(commands.encode(command))))

    def poll(self) -> tuple[str, bytes] | None:
        """Return (origin, raw command) of the oldest command not yet taken, or None."""
        return self._waiting.popleft() if self._waiting else None


def _ignore(_status: Mapping[str, object]) -> None:
    """Take no notice."""


class MemoryStatus(StatusSink):
    """A status sink inside one process: keeps the newest and shows it to `on_publish`."""

    __slots__ = ("newest", "on_publish")

    def __init__(self) -> None:
        self.newest: Mapping[str, object] = {}
        self.on_publish: Callable[[Mapping[str, object]], None] = _ignore

    def publish(self, told: Mapping[str, object], /) -> None:
        """Publish; never blocks."""
        self.newest = {k: status.finite_or_none(v) for k, v in told.items()}
        self.on_publish(self.newest)
