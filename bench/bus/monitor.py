"""`hil bus list` and `hil bus monitor`: what buses there are, and what goes over one of them."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from hil.errors import ConfigError, RunError
from hil.wire.codec import Decoder, pack_frame
from hil.wire.fields import LAYOUTS, layout_of

if TYPE_CHECKING:
    import can
    from rich.console import Console, RenderableType

_REFRESH_S: Final = 0.1
_WAIT_S: Final = 0.1


class Seen(NamedTuple):
    """The newest of one kind of frame: how many came, at what period, and its values."""

    frames: int
    period_s: float
    t_s: float
    verdict: str
    values: str


def parse_bus(text: str) -> tuple[str, str]:
    """Split INTERFACE:CHANNEL.

    Raises: ConfigError when it is something else
    """
    interface, colon, channel = text.partition(":")
    if not (interface and colon and channel):
        raise ConfigError(
            f"bus {text!r}: accepted is INTERFACE:CHANNEL, as in zenoh:can0, socketcan:vcan0"
        )
    return interface, channel


def open_bus(text: str) -> can.BusABC:
    """Open a bus to listen to.

    Raises: ConfigError when python-can does not know or cannot open it
    """
    import can

    interface, channel = parse_bus(text)
    try:
        return can.Bus(channel, interface, ignore_config=True)
    except (can.CanError, OSError, ValueError, ImportError, NotImplementedError) as error:
        raise ConfigError(f"bus {text}: {error}") from None


def list_buses() -> int:
    """Print the buses that a run could join, and those that are open."""
    import can
    from rich.console import Console

    from bench.measure.machine import can_bus
    from drivers.can.virtual.directory import channels

    console = Console(highlight=False)
    open_now = channels()
    for channel, nodes in open_now.items():
        console.print(f"zenoh:{channel}   open, {nodes} node{'s' if nodes > 1 else ''}")
    if not open_now:
        console.print("zenoh:can0   virtual, on this machine; nobody is on it")
    found = can.detect_available_configs(["socketcan"])
    for config in found:
        console.print(f"socketcan:{config['channel']}   kernel interface")
    if not found:
        console.print(f"socketcan: {can_bus().text}", soft_wrap=True)
    return 0


class Judge:
    """Decodes what goes over a bus, both directions, and says what became of each frame."""

    def __init__(self) -> None:
        self._decoders = {"plant": Decoder("plant"), "controller": Decoder("controller")}

    def judge(self, message: can.Message) -> tuple[str, str, str]:
        """Return (name, verdict, values) of a frame."""
        if message.is_error_frame:
            return "error frame", "error", bytes(message.data).hex(" ")
        layout = LAYOUTS.get(message.arbitration_id)
        if layout is None or message.is_extended_id or message.is_fd:
            return f"0x{message.arbitration_id:X}", "not ours", bytes(message.data).hex(" ")
        if message.is_remote_frame:
            return layout.name, "asked for", ""
        decoder = self._decoders[layout.sender]
        before = decoder.counts()
        word = int.from_bytes(message.data.ljust(8, b"\0")[:8], "little")
        decoded = decoder.decode(pack_frame(layout.can_id, word))
        after = decoder.counts()
        if decoded:
            return layout.name, "ok", _values(decoded[0])
        verdict = next(n for n in after._fields if getattr(after, n) > getattr(before, n))
        return layout.name, verdict, bytes(message.data).hex(" ")


def _values(message: Any) -> str:  # noqa: ANN401
    """The values of a message with their units, without those that were not sent."""
    parts = []
    for placed in layout_of(type(message)).fields:
        value = getattr(message, placed.name)
        if not math.isnan(value):
            named = placed.signal.values.get(value) if isinstance(value, int) else None
            shown = named or (f"{value:.6g}" if isinstance(value, float) else str(value))
            parts.append(f"{placed.name}={shown}")
    return " ".join(parts)


def monitor(text: str, seconds: float | None, count: int | None, *, every: bool) -> int:
    """Show the frames of a bus until the time or the number is up, or Ctrl-C.

    Parameters: every : a line for each frame, rather than a table of the newest
    Raises: RunError when nothing came in the time given
    """
    from rich.console import Console

    console = Console(highlight=False)
    with open_bus(text) as bus:
        frames = _frames(bus, seconds, count)
        lines = every or not console.is_terminal
        seen = _print_lines(console, frames) if lines else _show_table(console, text, frames)
    if not seen:
        raise RunError(f"bus {text}: no frame in {seconds:g} s")
    return 0


def _frames(bus: can.BusABC, seconds: float | None, count: int | None) -> Iterator[Any]:
    """Yield messages, and None where a while nothing came."""
    end_s = None if seconds is None else time.monotonic() + seconds
    left = count
    while (end_s is None or time.monotonic() < end_s) and left != 0:
        message = bus.recv(_WAIT_S)
        yield message
        if message is not None and left is not None:
            left -= 1


def _print_lines(console: Console, frames: Iterator[Any]) -> int:
    judge, seen = Judge(), 0
    for message in frames:
        if message is not None:
            seen += 1
            name, verdict, values = judge.judge(message)
            line = f"{message.timestamp:.6f} {message.arbitration_id:03X} {name} {verdict} {values}"
            console.print(line.rstrip(), soft_wrap=True, markup=False)
    return seen


def _show_table(console: Console, text: str, frames: Iterator[Any]) -> int:
    from rich.live import Live

    judge, rows, drawn_s = Judge(), dict[str, Seen](), 0.0
    with Live(console=console, auto_refresh=False) as live:
        for message in frames:
            if message is not None:
                _take(rows, judge, message)
            if time.monotonic() - drawn_s > _REFRESH_S:
                drawn_s = time.monotonic()
                live.update(_table(text, rows), refresh=True)
        live.update(_table(text, rows), refresh=True)
    return len(rows)


def _take(rows: dict[str, Seen], judge: Judge, message: can.Message) -> None:
    """Put a frame into the table."""
    name, verdict, values = judge.judge(message)
    before = rows.get(name)
    t_s = message.timestamp
    period_s = t_s - before.t_s if before else 0.0
    rows[name] = Seen(before.frames + 1 if before else 1, period_s, t_s, verdict, values)


def _table(text: str, rows: dict[str, Seen]) -> RenderableType:
    from rich.table import Table
    from rich.text import Text

    table = Table(title=text, box=None, title_justify="left", header_style="dim")
    for column in ("frame", "count", "ms", "verdict", "values"):
        table.add_column(column, no_wrap=True)
    for name, seen in sorted(rows.items()):
        colour = "green" if seen.verdict in {"ok", "asked for"} else "red"
        table.add_row(
            name, str(seen.frames), f"{seen.period_s * 1e3:.3f}",
            Text(seen.verdict, style=colour), Text(seen.values),
        )  # fmt: skip
    return table
