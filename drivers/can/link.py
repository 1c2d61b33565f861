"""The link over a CAN bus: a batch goes out frame by frame, and comes back together.

Whether the peer is there is told by the processes' own session where they share one, and by the
bus alone otherwise: the plant asks with a remote frame of the controller's head, which a link
answers with one of the plant's head, and a CAN controller with the frame itself.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from drivers.blocking import Blocking
from drivers.can.assembly import HEADS, Assembler, head_place
from drivers.can.frames import FramePort, Notice, Received, Wanted, ZenohFrames
from drivers.can.meeting import PATIENCE_NS, Meeting, Presence
from drivers.can.socket import SocketFrames, open_socket
from drivers.can.virtual.records import REMOTE
from drivers.can.virtual.transmitter import Medium
from drivers.polling import LockstepPolling, RealTimePolling
from drivers.zenoh.config import Role
from drivers.zenoh.node import PEER
from hil.config.process import LinkConfig
from hil.errors import ConfigError, LinkError
from hil.ports import Link
from hil.wire.fields import LAYOUTS, layout_of
from hil.wire.terms import CAN_IDS, Terms

_LOCKSTEP_QUIET_NS: Final = 20_000_000
_LOCKSTEP_PATIENCE_US: Final = 100_000
_QUIET_PERIODS: Final = 4  # a tick is over when nothing came for a quarter of a period
_SEND_PERIODS: Final = 2  # a full queue is tried for half a period
_SILENCE_NS: Final = 1_000_000_000
_ASK_NS: Final = 20_000_000
_PEER_POLL_S: Final = 2e-3
_LINGER_S: Final = 0.1


def wanted_by(side: Role) -> Wanted:
    """Return which frames a side takes from the bus: the peer's, and its own from somebody else."""
    peer = PEER[side]
    data = tuple(x.can_id for x in LAYOUTS.values() if x.sender == peer)
    own = layout_of(HEADS[side]).can_id
    return Wanted((*data, *CAN_IDS.values(), own), own)


def open_port(side: Role, config: LinkConfig, *, lockstep: bool) -> FramePort:
    """Open the bus that --bus names.

    Raises: ConfigError when there is none or it does not open
    """
    interface, channel = config.bus_parts()
    wanted = wanted_by(side)
    if interface == "zenoh":
        timed = Medium(config.bitrate_bit_s, config.bitrate_bit_s, 0.0, 0, 0.0)
        patience_us = _LOCKSTEP_PATIENCE_US if lockstep else 0
        return ZenohFrames(channel, wanted, timed if config.wire_timing else None, patience_us)
    if interface == "socketcan":
        head = head_place(PEER[side])
        return SocketFrames(open_socket(channel, wanted), channel, time.sleep, head)
    from drivers.can.python import PythonCanFrames  # noqa: PLC0415 - takes 0.1 s and more

    return PythonCanFrames(interface, channel, wanted, config.bitrate_bit_s)


class Times(NamedTuple):
    """The clocks of the link: for its own deadlines, and the one of the bus's time stamps [ns]."""

    now_ns: Callable[[], int] = time.monotonic_ns
    wall_ns: Callable[[], int] = time.time_ns


_SYSTEM: Final = Times()


class CanLink(Link):
    """One end of the link.

    Parameters: presence : the session on which the processes of a bench know each other; terms :
        what this side holds to
    """

    def __init__(
        self, port: FramePort, presence: Presence, period_ns: int, times: Times = _SYSTEM,
        terms: Terms | None = None,
    ) -> None:  # fmt: skip
        self._now_ns, self._wall_ns = times
        self._port = port
        self._presence = presence
        self._side = presence.role
        self._peer = PEER[presence.role]
        self._head = layout_of(HEADS[self._side]).can_id
        self._peer_head = layout_of(HEADS[self._peer]).can_id
        lockstep = presence.lockstep
        quiet_ns = _LOCKSTEP_QUIET_NS if lockstep else period_ns // _QUIET_PERIODS
        self._assembler = Assembler(self._peer, quiet_ns)
        self._meeting = Meeting(self._side, port.name, terms)
        self._patience_ns = _LOCKSTEP_QUIET_NS if lockstep else period_ns // _SEND_PERIODS
        in_lockstep = LockstepPolling(self.receive) if lockstep else None
        self._polling = in_lockstep or self._in_real_time(period_ns, quiet_ns)
        self._wakes = isinstance(self._polling, Blocking)
        self._sent = self._received = self._frames = 0
        self._heard_ns = self._first_heard_ns = 0
        self._second_ns = -_SILENCE_NS
        self._met = self._closed = False
        self.arrived_ns = 0
        """When the newest frame came, by the bus's own clock [ns]."""

    def _in_real_time(self, period_ns: int, quiet_ns: int) -> RealTimePolling | Blocking:
        """A port that the kernel can wake for is waited for there, any other one is polled."""
        if isinstance(self._port, SocketFrames):
            return Blocking(self.receive, self._port.descriptor, quiet_ns)
        return RealTimePolling(self.receive, period_ns)

    def send(self, batch: bytes, /) -> None:
        """Send one tick's frames in their order.

        Raises: LinkError when the bus is closed or gone
        """
        self._port.send(batch, self._now_ns() + self._patience_ns)
        self._sent += 1

    def receive(self) -> bytes | None:
        """Return the oldest batch that is complete or lacks frames that will not come any more."""
        if self._closed:
            return None
        frames = self._drain(now_ns := self._now_ns())
        batch = self._assembler.whole(frames, now_ns) if frames else None
        if batch is None:
            self._push(frames, now_ns)
            batch = self._assembler.pop(now_ns)
        if batch is not None:
            self._received += 1
        return batch

    def _drain(self, now_ns: int) -> list[Received]:
        """Return what has come from the bus."""
        frames = self._port.receive()
        if frames:
            frames = self._meeting.sifted(frames)
            if self._meeting.is_asked:
                self._tell_terms(now_ns)
        if frames:
            self._frames += len(frames)
            self._heard_ns, self.arrived_ns = now_ns, frames[-1][2]
        return frames

    def _tell_terms(self, now_ns: int) -> None:
        """Tell this side's terms, if it has any."""
        self._meeting.is_asked = False
        own = self._meeting.own
        if own:
            self._port.send(own, now_ns + self._patience_ns)

    def _push(self, frames: list[Received], now_ns: int) -> None:
        """Let the assembler sort what has come."""
        if not frames:
            return
        push = self._assembler.push
        # A time stamp of this machine tells how long a frame has waited to be read.
        stamps = self._port.stamps
        behind_ns = self._wall_ns() - now_ns if stamps else 0
        for can_id, word, t_ns in frames:
            if can_id & REMOTE:
                if self._side == "controller":
                    self._port.ask(self._peer_head)
                continue
            arrived_ns = t_ns - behind_ns
            fresh = stamps and now_ns - _SILENCE_NS < arrived_ns < now_ns
            push(can_id, word, arrived_ns if fresh else now_ns)

    def wait(self, timeout_ns: int, /) -> bytes | None:
        """Like `receive`, but wait for at most this long [ns]."""
        if timeout_ns <= 0 or self._closed:
            return self.receive()
        # The kernel wakes at once for what has come already: looking before would be one too many.
        if not (self._wakes and self._assembler.idle):
            batch = self.receive()
            if batch is not None:
                return batch
        batch = self._polling.wait(timeout_ns)
        return self.rest() if batch is None else batch

    def rest(self) -> bytes | None:
        """Return frames that came twice or too late and travelled with no batch so far."""
        return self._assembler.rest()

    def peer_alive(self) -> bool:
        """Whether the peer takes part: by the session where it was seen there, else by the bus."""
        if self._is_present():
            return True
        if self._met:
            return False
        return self._now_ns() - self._heard_ns < _SILENCE_NS

    def _is_present(self) -> bool:
        """Whether the session knows the peer by now."""
        present = self._peer in self._presence.alive()
        self._met = self._met or present
        return present

    def wait_for_peer(self, timeout_s: float) -> None:
        """Return when the peer takes part and fits.

        Raises: LinkError when it does not within the time, or this side is there already;
            ConfigError naming what does not fit
        """
        begin_ns = self._now_ns()
        end_ns, ask_ns = begin_ns + round(timeout_s * 1e9), begin_ns
        while not (self._is_present() and self._presence.is_met()):
            now_ns = self._now_ns()
            self._push(self._drain(now_ns), now_ns)
            self._meeting.refuse_second()
            if self._heard_ns >= begin_ns and not self._met and self._is_known(now_ns):
                break
            if now_ns > end_ns:
                raise LinkError(f"no {self._peer} on {self._port.name} after {timeout_s:g} s")
            if self._side == "plant" and now_ns >= ask_ns:
                self._tell_terms(now_ns)
                self._port.ask(self._peer_head)
                ask_ns = now_ns + _ASK_NS
            time.sleep(_PEER_POLL_S)
        if self._side == "plant":
            self._assembler.forget()  # the answer to the question is none to a sample
        self._port.settle()
        self._presence.ready()

    def _is_known(self, now_ns: int) -> bool:
        """Whether a peer that is heard fits, or has had its time to tell its terms.

        Raises: ConfigError naming what does not fit
        """
        try:
            if self._meeting.fits():
                return True
        except ConfigError:
            self._tell_terms(now_ns)
            time.sleep(_LINGER_S)  # for the frames to leave
            raise
        self._first_heard_ns = self._first_heard_ns or now_ns
        if now_ns - self._first_heard_ns < PATIENCE_NS:
            return False
        text = f"the {self._peer} on {self._port.name} tells no terms: nothing says that it fits"
        self._presence.note("peer-without-terms", text)
        return True

    def reports(self) -> bool:
        """Whether its bus reports errors of its own: it does."""
        return True

    def notices(self) -> list[Notice]:
        """Return (code, text) of what the bus and the session reported since the last time."""
        if self._meeting.has_second:
            self._meeting.has_second = False
            self._tell_of_second()
        found, more = self._port.notices(), self._presence.notices()
        return [*found, *more] if more else found

    def _tell_of_second(self) -> None:
        """Tell as an event that somebody else sends what only this side sends; now and then."""
        now_ns = self._now_ns()
        if now_ns - self._second_ns > _SILENCE_NS:
            self._second_ns = now_ns
            what = f"a second {self._side}"
            self._presence.note(f"second-{self._side}", f"{what} sends on {self._port.name}")

    def counters(self) -> Mapping[str, int]:
        """Return batches sent and received, frames, and what the bus and the assembly counted."""
        return {
            "sent": self._sent,
            "received": self._received,
            "frames_received": self._frames,
            **self._assembler.counters,
            **self._port.counters(),
        }

    def close(self) -> None:
        """Leave the bus; a second call does nothing."""
        if not self._closed:
            self._closed = True
            self._port.close()
