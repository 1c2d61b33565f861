"""`zenoh` as an interface of python-can: a virtual CAN bus between processes of one machine.

can.Bus(interface="zenoh", channel="can0")

Every process that opens the channel is a node of the bus; nothing has to be started before it, and
the bus is gone with its last node. Without `timing` frames arrive as soon as they can; with it
they wait for the wire as on a bus of that bit rate, the lowest identifier first.
"""

from __future__ import annotations

import os
import time
from collections import deque
from typing import Any, Final

import can

from drivers.can.virtual.directory import channels
from drivers.can.virtual.messages import from_message, to_message
from drivers.can.virtual.records import ERROR, FD, HEAD, Frame, pack_frame, unpack_frames
from drivers.can.virtual.segment import Segment
from drivers.can.virtual.transmitter import ERROR_PASSIVE, Medium, Transmitter, open_wire
from hil.errors import HilError

_YIELDS: Final = 200
_NAP_S: Final = 1e-4
_LONG_NAP_S: Final = 1e-3
_BITRATES: Final = (10_000, 8_000_000)


class ZenohBus(can.BusABC):
    """A node of a virtual CAN bus.

    Parameters: receive_own_messages : whether what this node sends comes back to it
        fd : whether FD frames are sent and received
        timing : whether frames take as long as on a wire of `bitrate` and arbitrate for it;
            give it to all nodes of a channel, or to none
        error_rate : share of this node's frames that an error hits; they are sent again, and
            a node with too many errors goes off the bus (`seed` makes it repeatable)
        restart_s : time after which a node comes back by itself, 0 never
    Raises: CanInitializationError when the channel does not open
    """

    def __init__(
        self,
        channel: can.typechecking.Channel = "can0",
        can_filters: can.typechecking.CanFilters | None = None,
        *,
        receive_own_messages: bool = False,
        fd: bool = False,
        bitrate: int = 1_000_000,
        data_bitrate: int | None = None,
        timing: bool = False,
        error_rate: float = 0.0,
        seed: int = 0,
        restart_s: float = 0.0,
        **kwargs: Any,  # noqa: ANN401
    ) -> None:
        medium = _medium(bitrate, data_bitrate, error_rate, seed, restart_s, timing=timing)
        try:
            self._segment = Segment(str(channel))
        except HilError as error:
            raise can.CanInitializationError(str(error)) from None
        self.channel = str(channel)
        self.channel_info = f"zenoh channel {channel}"
        self._can_protocol = can.CanProtocol.CAN_FD if fd else can.CanProtocol.CAN_20
        self._fd = fd
        self._own = receive_own_messages
        self._listens_only = False
        self._inbox: deque[tuple[Frame, bool]] = deque()
        self._transmitter: Transmitter | None = None
        if timing:
            self._transmitter = self._open_transmitter(medium)
        super().__init__(channel=channel, can_filters=can_filters, **kwargs)

    def _open_transmitter(self, medium: Medium) -> Transmitter:
        try:
            wire = open_wire(self._segment, medium.bitrate_bit_s)
        except HilError as error:
            self._segment.close()
            raise can.CanInitializationError(str(error)) from None
        return Transmitter(wire, medium, self._publish, self._report)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a message; with `timing` it is queued, for at most `timeout` seconds when full.

        Raises: CanOperationError when the bus is closed, off, listening only or full
        """
        self._check_open()
        if self.state is can.BusState.ERROR:
            raise can.CanOperationError(f"{self.channel_info}: this node is off the bus")
        if self._listens_only:
            raise can.CanOperationError(f"{self.channel_info}: this node only listens")
        if msg.is_fd and not self._fd:
            raise can.CanOperationError(f"{self.channel_info}: opened without fd=True")
        frame = from_message(msg, time.time_ns())
        self._segment.greet()
        if self._transmitter is None:
            self._publish(frame)
        elif not self._transmitter.put(frame, timeout or 0.0):
            raise can.CanOperationError(f"{self.channel_info}: transmit queue full")

    def _publish(self, frame: Frame) -> None:
        """Put a frame on the cable and, where wanted, into one's own inbox."""
        try:
            self._segment.publish(pack_frame(frame))
        except HilError as error:
            raise can.CanOperationError(str(error)) from None
        if self._own and not frame.can_id & ERROR:
            self._inbox.append((frame, False))

    def _report(self, frame: Frame) -> None:
        """Give this node an error frame of its own controller."""
        self._inbox.append((frame, True))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        end_s = None if timeout is None else time.monotonic() + timeout
        tries = 0
        while True:
            self._check_open()
            if (message := self._next()) is not None:
                return message, False
            if end_s is not None and time.monotonic() >= end_s:
                return None, False
            tries += 1
            if tries < _YIELDS:
                os.sched_yield()
            else:
                time.sleep(_NAP_S if tries < 10 * _YIELDS else _LONG_NAP_S)

    def _next(self) -> can.Message | None:
        """Return the oldest message that this node can understand."""
        while True:
            try:
                frame, is_rx = self._inbox.popleft()
            except IndexError:
                payload = self._segment.poll()
                if payload is None:
                    return None
                self._inbox.extend((frame, True) for frame in unpack_frames(payload, HEAD.size))
                continue
            if self._fd or not frame.flags & FD:
                return to_message(frame, self.channel, is_rx=is_rx)

    @property
    def state(self) -> can.BusState:
        """ACTIVE, PASSIVE (many errors, or only listening) or ERROR (off the bus)."""
        if self._transmitter is not None:
            if self._transmitter.is_off:
                return can.BusState.ERROR
            if self._transmitter.errors >= ERROR_PASSIVE:
                return can.BusState.PASSIVE
        return can.BusState.PASSIVE if self._listens_only else can.BusState.ACTIVE

    @state.setter
    def state(self, new_state: can.BusState) -> None:
        """ACTIVE comes back to the bus, PASSIVE only listens, ERROR leaves the bus (timing)."""
        if new_state is can.BusState.ERROR:
            if self._transmitter is None:
                raise NotImplementedError("only a bus with timing can be left")
            self._transmitter.leave()
        elif new_state is can.BusState.ACTIVE and self._transmitter is not None:
            self._transmitter.restart()
        self._listens_only = new_state is can.BusState.PASSIVE

    @property
    def overruns(self) -> int:
        """Messages of other nodes that came faster than they were taken, and were lost."""
        return self._segment.overruns

    @property
    def error_count(self) -> int:
        """Transmit error counter."""
        return 0 if self._transmitter is None else self._transmitter.errors

    def flush_tx_buffer(self) -> None:
        """Discard what waits to be sent."""
        if self._transmitter is not None:
            self._transmitter.flush()

    def shutdown(self) -> None:
        """Leave the bus; a second call does nothing."""
        if self._is_shutdown:
            return
        super().shutdown()
        if self._transmitter is not None:
            self._transmitter.stop()
        self._segment.close()

    def _check_open(self) -> None:
        if self._is_shutdown:
            raise can.CanOperationError(f"{self.channel_info}: the bus is shut down")

    @staticmethod
    def _detect_available_configs() -> list[can.typechecking.AutoDetectedConfig]:
        return [{"interface": "zenoh", "channel": channel} for channel in channels()]


def _medium(
    bitrate: int,
    data_bitrate: int | None,
    error_rate: float,
    seed: int,
    restart_s: float,
    *,
    timing: bool,
) -> Medium:
    """Check what describes the medium.

    Raises: ValueError naming argument, value and range
    """
    fast = bitrate if data_bitrate is None else data_bitrate
    ranges = {
        "bitrate": (bitrate, *_BITRATES),
        "data_bitrate": (fast, *_BITRATES),
        "error_rate": (error_rate, 0.0, 1.0),
        "restart_s": (restart_s, 0.0, 3600.0),
    }
    for name, (value, low, high) in ranges.items():
        if not low <= float(value) <= high:
            raise ValueError(f"{name} = {value!r}: accepted {low:g} to {high:g}")
    if (error_rate or restart_s) and not timing:
        raise ValueError("error_rate and restart_s need timing=True")
    return Medium(int(bitrate), int(fast), float(error_rate), int(seed), float(restart_s))
