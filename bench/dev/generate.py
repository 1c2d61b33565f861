"""Everything that follows from hil/wire/messages.py and is checked in: the DBC file and its table.

python -m bench.dev.generate            write hil/wire/fpeg.dbc and docs/messages.md
python -m bench.dev.generate --check    fail when either has drifted
"""

from __future__ import annotations

import argparse
import sys
from collections import OrderedDict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from hil import compiled
from hil.errors import MissingExtraError
from hil.wire import messages
from hil.wire.fields import LAYOUTS, Layout, Placed

ROOT = compiled.root()
DBC = ROOT / "hil" / "wire" / "fpeg.dbc"
TABLE = ROOT / "docs" / "messages.md"

CYCLE_MS = 1
"""Nominal cycle time; the loop's rate is configurable, a DBC file's is not."""

FRAME_BITS_MIN, FRAME_BITS_MAX = 111, 135
"""A classic frame of 8 bytes with its interframe space, without and with the most stuff bits."""


def dbc_text() -> str:
    """Return the DBC file.

    Raises: MissingExtraError without cantools
    """
    try:
        from cantools.database import Database
        from cantools.database.can import Message, Node
    except ImportError:
        raise MissingExtraError("cantools", "desk", "the DBC file") from None
    nodes = [
        Node("plant", comment="Engine model, or the engine's sensors"),
        Node("controller", comment="Engine controller"),
    ]
    frames = [
        Message(
            frame_id=layout.can_id,
            name=layout.name,
            length=8,
            signals=_dbc_signals(layout),
            comment=layout.comment,
            senders=[layout.sender],
            cycle_time=CYCLE_MS,
            is_extended_frame=False,
            strict=True,
        )
        for layout in LAYOUTS.values()
    ]
    database = Database(messages=frames, nodes=nodes, version="1")
    return str(database.as_dbc_string()).replace("\r\n", "\n")


def _dbc_signals(layout: Layout) -> list[Any]:
    """CRC, counter, and the declared signals."""
    from cantools.database.can import Signal
    from cantools.database.conversion import BaseConversion

    selector = next((placed.name for placed in layout.fields if placed.signal.selects), None)
    signals = [
        Signal(
            "e2e_crc", 0, 8, minimum=0, maximum=255, comment="AUTOSAR E2E profile 2: CRC-8H2F",
            receivers=[layout.receiver],
        ),
        Signal(
            "e2e_counter", 8, 4, minimum=0, maximum=15, comment="AUTOSAR E2E profile 2: counter",
            receivers=[layout.receiver],
        ),
    ]  # fmt: skip
    for placed in layout.fields:
        signal = placed.signal
        low, high = signal.raw_range
        signals.append(
            Signal(
                placed.name,
                placed.start_bit,
                signal.bits,
                is_signed=signal.signed,
                conversion=BaseConversion.factory(
                    scale=signal.scale, offset=0, choices=OrderedDict(signal.values) or None
                ),
                minimum=low * signal.scale,
                maximum=high * signal.scale,
                unit=signal.unit or None,
                comment=layout.field_comments[placed.name],
                receivers=[layout.receiver],
                is_multiplexer=signal.selects,
                multiplexer_ids=None if signal.only_when is None else [signal.only_when],
                multiplexer_signal=None if signal.only_when is None else selector,
            )
        )
    return signals


def table_text() -> str:
    """Return docs/messages.md."""
    lines = [
        "# Messages on the wire",
        "",
        "Generated from `hil/wire/messages.py` by `python -m bench.dev.generate`; do not edit.",
        "",
        "Every frame is a classic CAN frame with a standard identifier and 8 bytes, read as one",
        "little-endian word: bits 0 to 7 CRC-8 (0x2F) and bits 8 to 11 counter of AUTOSAR E2E",
        "profile 2, then the signals. The value is raw times scale.",
        "",
    ]
    for layout in LAYOUTS.values():
        lines += _table_of(layout)
    return "\n".join([*lines, *_bus_load(), ""])


def _table_of(layout: Layout) -> list[str]:
    """Section of one message."""
    head = f"## {layout.name} (0x{layout.can_id:X}, {layout.sender} to {layout.receiver})"
    rows = [_row(placed, layout.field_comments[placed.name]) for placed in layout.fields]
    data_ids = " ".join(f"{value:02X}" for value in layout.data_ids)
    return [
        head, "", layout.comment, "",
        "| signal | bits | type | scale | unit | range | meaning |",
        "|---|---|---|---|---|---|---|",
        *rows, "", f"E2E data identifiers by counter: `{data_ids}`", "",
    ]  # fmt: skip


def _row(placed: Placed, comment: str) -> str:
    """One signal's row."""
    signal = placed.signal
    low, high = (raw * signal.scale for raw in signal.raw_range)
    bits = f"{placed.start_bit} to {placed.start_bit + signal.bits - 1}"
    if signal.values:
        comment += ": " + ", ".join(f"{raw} {name}" for raw, name in signal.values.items())
    return (
        f"| `{placed.name}` | {bits} | {signal.kind} | {signal.scale:g} | {signal.unit} |"
        f" {low:g} to {high:g} | {comment} |"
    )


def frames_per_tick() -> dict[str, int]:
    """Most frames of one tick, by sender."""
    senders = {layout.sender for layout in LAYOUTS.values()}
    return {
        sender: sum(x.per_tick for x in LAYOUTS.values() if x.sender == sender)
        for sender in sorted(senders)
    }


def _bus_load() -> list[str]:
    """The last section: how much of a bus one tick takes."""
    counts = frames_per_tick()
    total = sum(counts.values())
    share = 100 * FRAME_BITS_MAX * total * 1000 / 1e6
    return [
        "## Bus load",
        "",
        f"A frame takes {FRAME_BITS_MIN} to {FRAME_BITS_MAX} bits, stuff bits and interframe space"
        " included. One tick has at the most"
        f" {' and '.join(f'{n} frames from the {s}' for s, n in counts.items())}:"
        f" {share:.0f} % of 1 Mbit/s at 1 kHz in the worst case.",
        "",
        "Lines by channel of `Pulse`: "
        + ", ".join(f"{number} {name}" for number, name in messages.CHANNELS.items())
        + ".",
    ]


def drifted(outputs: Iterable[tuple[Path, str]]) -> list[Path]:
    """Files whose text is not what follows from the declarations."""
    return [
        path
        for path, text in outputs
        if not path.exists() or path.read_text(encoding="utf-8") != text
    ]


def main() -> int:
    """Write both files, or check them."""
    parser = argparse.ArgumentParser(prog="python -m bench.dev.generate")
    parser.add_argument("--check", action="store_true")
    outputs = ((DBC, dbc_text()), (TABLE, table_text()))
    if parser.parse_args().check:
        for path in drifted(outputs):
            print(
                f"{path.relative_to(ROOT)} has drifted from hil/wire/messages.py", file=sys.stderr
            )
        return 1 if drifted(outputs) else 0
    for path, text in outputs:
        path.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
