"""Ports that play a recorded turn back to a loop and catch what it puts."""

from __future__ import annotations

from typing import final

from mypy_extensions import i64

from bench.logs.replay.turn import Turn
from hil.pacing import Pacer, Slot
from hil.ports import CommandSource, Link, Recorder, StatusSink

_NO_TIMES: tuple[int, ...] = (0,)
_NO_BATCHES: tuple[bytes, ...] = ()


@final
class Tape(Pacer):
    """What was there in a turn: its times, batches and command; the clock of the replay too.

    alive: whether the peer was there, as far as it mattered; sent: the newest batch of the loop
    """

    def __init__(self, period_ns: int, patience_ns: int) -> None:
        super().__init__(period_ns, patience_ns)
        self.alive = True
        self.sent = b""
        self.command: tuple[str, bytes] | None = None
        self._slot = Slot(0, 0, 0, 0)
        self._times: tuple[int, ...] = _NO_TIMES
        self._batches: tuple[bytes, ...] = _NO_BATCHES
        self._next_time: i64 = 0
        self._next_batch: i64 = 0

    def load(self, turn: Turn) -> None:
        """Have a turn ready: what is asked for now is what was there then."""
        self._times, self._batches, self.command = turn.times_ns, turn.batches, turn.command
        self._next_time = self._next_batch = 0
        # No answer in time, and none due yet: only then did the peer's presence count.
        self.alive = turn.used_tick != -1

    def load_slot(self, turn: Turn) -> None:
        """Have the slot of the plant's turn ready; sending is all that asks for the time."""
        woke_ns = turn.times_ns[0]
        self._slot = Slot(turn.tick, turn.scheduled_ns, woke_ns, turn.tick - turn.first_tick)
        self._next_time = 1

    def wait(self, tick: i64) -> Slot:
        """Return the recorded slot."""
        return self._slot

    def now_ns(self) -> i64:
        """Return the next recorded time."""
        place = self._next_time
        self._next_time = place + 1
        return self._times[place]

    def batch(self) -> bytes | None:
        """Return the next batch of this turn."""
        place = self._next_batch
        if place >= len(self._batches):
            return None
        self._next_batch = place + 1
        return self._batches[place]


@final
class TapeLink(Link):
    """What came then comes now; what is sent last is on its way when the replay stops here."""

    def __init__(self, tape: Tape) -> None:
        self._tape = tape

    def send(self, batch: bytes, /) -> None:
        """Keep the newest batch."""
        self._tape.sent = batch

    def receive(self) -> bytes | None:
        """Return the next batch of this turn."""
        return self._tape.batch()

    def wait(self, timeout_ns: i64, /) -> bytes | None:
        """Return the next batch of this turn at once."""
        return self._tape.batch()

    def peer_alive(self) -> bool:
        """Whether the peer was there, as far as it mattered."""
        return self._tape.alive

    def wait_for_peer(self, timeout_s: float, /) -> None:
        """Return at once."""

    def close(self) -> None:
        """Nothing to give back."""


@final
class TapeCommands(CommandSource):
    """The command of the turn, if there was one."""

    def __init__(self, tape: Tape) -> None:
        self._tape = tape

    def poll(self) -> tuple[str, bytes] | None:
        """Return it, once."""
        command, self._tape.command = self._tape.command, None
        return command


@final
class Unseen(StatusSink):
    """Nobody looks at a replay."""

    def publish(self, status: object, /) -> None:
        """Forget the status."""


@final
class Catch(Recorder):
    """The records that the loop puts in a turn."""

    def __init__(self) -> None:
        self._records: list[bytes] = []

    def put(self, data: bytes, /) -> None:
        """Keep them."""
        self._records.append(data)

    def taken(self) -> bytes:
        """Return and forget what the loop has put."""
        records, self._records = self._records, []
        return records[0] if len(records) == 1 else b"".join(records)
