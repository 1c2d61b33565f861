"""The CAN link on any bus that python-can knows: adapters, and buses inside a process.

Apart from the other adapters since python-can brings with it whatever its log writers can use.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Final

import can

from drivers.can.errors import ERROR_FLAG
from drivers.can.frames import Notice, Notices, Received, Wanted
from drivers.can.virtual.records import REMOTE
from hil.errors import ConfigError, LinkError
from hil.wire.codec import iter_frames

_SEND_TIMEOUT_S: Final = 0.05


class PythonCanFrames:
    """A node of any bus that python-can knows.

    Raises: ConfigError when python-can does not know or cannot open it
    """

    def __init__(self, interface: str, channel: str, wanted: Wanted, bitrate_bit_s: int) -> None:
        self.name = f"{interface}:{channel}"
        self.stamps = False  # many adapters have a clock of their own
        filters: list[can.typechecking.CanFilter] = [
            {"can_id": can_id, "can_mask": 0x7FF, "extended": False}
            for can_id in (*wanted.data, wanted.remote)
        ]
        self._wanted = {*wanted.data, wanted.remote | REMOTE}
        self._notices = Notices()
        self._full = self._errors = 0
        try:
            self._bus = can.Bus(
                channel, interface, ignore_config=True, bitrate=bitrate_bit_s, can_filters=filters
            )
        except (can.CanError, OSError, ValueError, ImportError, NotImplementedError) as error:
            raise ConfigError(f"--bus {self.name}: {error}") from None
        self._closed = False

    def send(self, batch: bytes, deadline_ns: int, /) -> None:
        """Send frame by frame; a frame for which there is no room until then is counted.

        Raises: LinkError when the bus is closed
        """
        if self._closed:
            raise LinkError(f"{self.name}: cannot send: the bus is closed")
        for can_id, word in iter_frames(batch):
            left_s = max((deadline_ns - time.monotonic_ns()) * 1e-9, 0.0)
            data = word.to_bytes(8, "little")
            self._send(can.Message(arbitration_id=can_id, is_extended_id=False, data=data), left_s)

    def _send(self, message: can.Message, timeout_s: float) -> None:
        try:
            self._bus.send(message, timeout_s)
        except can.CanOperationError:
            self._full += 1

    def ask(self, can_id: int, /) -> None:
        """Send a remote frame."""
        asking = can.Message(
            arbitration_id=can_id, is_extended_id=False, is_remote_frame=True, dlc=8
        )
        self._send(asking, _SEND_TIMEOUT_S)

    def receive(self) -> list[Received]:
        """Return all frames that have come, oldest first."""
        received: list[Received] = []
        try:
            while not self._closed and (message := self._bus.recv(0)) is not None:
                self._take(message, received)
        except can.CanOperationError:
            self._errors += 1
        return received

    def _take(self, message: can.Message, received: list[Received]) -> None:
        if message.is_error_frame:
            self._notices.add(message.arbitration_id | ERROR_FLAG, bytes(message.data))
        elif message.dlc == 8 and not message.is_extended_id and not message.is_fd:
            can_id = message.arbitration_id | (REMOTE if message.is_remote_frame else 0)
            if can_id in self._wanted:
                word = int.from_bytes(message.data, "little")
                received.append((can_id, word, round(message.timestamp * 1e9)))

    def settle(self) -> None:
        """Return at once: a wire reaches whoever is on it."""

    def notices(self) -> list[Notice]:
        """Return what the bus reported since the last time."""
        return self._notices.take()

    def counters(self) -> Mapping[str, int]:
        """Return error frames, failed reads and frames that could not be sent in time."""
        return {
            "bus_errors": self._notices.count,
            "errors": self._errors,
            "send_full": self._full,
        }

    def close(self) -> None:
        """Leave the bus; a second call does nothing."""
        if not self._closed:
            self._closed = True
            self._bus.shutdown()
