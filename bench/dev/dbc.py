"""The DBC file of the messages on the wire."""

from __future__ import annotations

from collections import OrderedDict
from typing import Any

from hil.errors import MissingExtraError
from hil.wire.fields import LAYOUTS, Layout

CYCLE_MS = 1
"""Nominal cycle time; the loop's rate is configurable, a DBC file's is not."""


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
