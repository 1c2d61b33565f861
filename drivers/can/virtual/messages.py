"""Frames of the virtual bus as messages of python-can and back."""

from __future__ import annotations

from typing import Final

import can

from drivers.can.virtual.records import BRS, ERROR, ESI, EXTENDED, FD, REMOTE, Frame

_STANDARD: Final = 0x7FF
_EXTENDED: Final = 0x1FFFFFFF


def from_message(message: can.Message, t_ns: int) -> Frame:
    """Return a python-can message as a frame.

    Raises: ValueError when the message is none that a bus could carry
    """
    message._check()  # noqa: SLF001  # the library's own check has no public name
    can_id = message.arbitration_id
    if message.is_extended_id:
        can_id |= EXTENDED
    if message.is_remote_frame:
        can_id |= REMOTE
    if message.is_error_frame:
        can_id |= ERROR
    flags = 0
    if message.is_fd:
        flags = FD | BRS * message.bitrate_switch | ESI * message.error_state_indicator
    return Frame(can_id, flags, message.dlc, bytes(message.data), t_ns)


def to_message(frame: Frame, channel: str, *, is_rx: bool) -> can.Message:
    """Return a frame as a python-can message of its own."""
    can_id, flags, length, data, t_ns = frame
    extended = bool(can_id & EXTENDED)
    return can.Message(
        timestamp=t_ns * 1e-9,
        arbitration_id=can_id & (_EXTENDED if extended else _STANDARD),
        is_extended_id=extended,
        is_remote_frame=bool(can_id & REMOTE),
        is_error_frame=bool(can_id & ERROR),
        channel=channel,
        dlc=length,
        data=bytearray(data),
        is_fd=bool(flags & FD),
        is_rx=is_rx,
        bitrate_switch=bool(flags & BRS),
        error_state_indicator=bool(flags & ESI),
    )
