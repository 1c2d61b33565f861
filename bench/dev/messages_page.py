"""docs/messages.md: every frame on the wire, from the declarations in hil/wire/messages.py."""

from __future__ import annotations

from hil.wire import messages, terms
from hil.wire.fields import LAYOUTS, Layout, Placed

FRAME_BITS_MIN, FRAME_BITS_MAX = 111, 135
"""A classic frame of 8 bytes with its interframe space, without and with the most stuff bits."""


def page() -> str:
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
    return "\n".join([*lines, *_handshake(), *_bus_load(), ""])


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


def _handshake() -> list[str]:
    """What is told before the first tick."""
    ids = " and ".join(f"0x{can_id:X} from the {side}" for side, can_id in terms.CAN_IDS.items())
    rows = [
        f"| {number} | {term.key} | {'number' if term.is_number else 'hash'} | {term.meaning} |"
        for number, term in enumerate(terms.DECLARED)
    ]
    return [
        "## Before the first tick", "",
        f"Each side tells its terms, one frame a term: {ids}.",
        "Bits 0 to 7 are a CRC, 8 to 11 the number of the term, 12 to 15 how many there are,",
        "16 to 47 the value: the number itself, or a hash (32 bits of BLAKE2b) of the name or the",
        "figures. On a bus the plant asks with its own until the controller's are there; one that",
        "answers ticks and tells no terms is taken and told as an event, `peer-without-terms`. On",
        "the other links they stand beside a process's presence. Where they differ both sides say",
        "so in one line and end with exit code 2.", "",
        "| term | key | value | meaning |", "|---|---|---|---|", *rows, "",
    ]  # fmt: skip


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
