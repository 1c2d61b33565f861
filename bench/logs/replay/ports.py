"""Ports that play a recorded turn back to a loop and catch what it puts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from bench.logs.replay.turns import Turn
from hil.pacing import Slot


class Player:
    """All ports of a loop in one: clock, link, commands and status of a turn, and its records."""

    def __init__(self, period_ns: int, patience_ns: int) -> None:
        self.period_ns = period_ns
        self.patience_ns = patience_ns
        self.put_records: list[bytes] = []
        self.put = self.put_records.append
        self.sent = b""
        self._times: Iterator[int] = iter(())
        self.batches: Iterator[bytes] = iter(())
        self._command: tuple[str, bytes] | None = None
        self._slot = Slot(0, 0, 0, 0)
        self.alive = True

    def load(self, turn: Turn) -> None:
        """Have a turn ready: what is asked for now is what was there then."""
        self._times = iter(turn.times_ns)
        self.batches = iter(turn.batches)
        self._command = turn.command
        # No answer in time, and none due yet: only then did the peer's presence count.
        self.alive = turn.used_tick != -1

    def load_slot(self, turn: Turn) -> None:
        """Have the slot of the plant's turn ready; sending is all that asks for the time."""
        woke_ns, sent_ns = turn.times_ns
        self._slot = Slot(turn.tick, turn.scheduled_ns, woke_ns, turn.tick - turn.first_tick)
        self._times = iter((sent_ns,))

    def taken(self) -> bytes:
        """Return and forget what the loop has put."""
        data = self.put_records[0] if len(self.put_records) == 1 else b"".join(self.put_records)
        self.put_records.clear()
        return data

    def start(self, tick: int = 0) -> None:
        """Nothing to start: the times are on the tape."""

    def wait(self, tick: int) -> Slot:
        """Return the recorded slot."""
        return self._slot

    def now_ns(self) -> int:
        """Return the next recorded time."""
        return next(self._times)

    def poll(self) -> tuple[str, bytes] | None:
        """Return the command of this turn, if there was one."""
        command, self._command = self._command, None
        return command

    def answer(self, is_taken: bool, tick: int, text: str, /) -> None:
        """Nobody waits for an answer any more."""

    def publish(self, status: Mapping[str, object], /) -> None:
        """Forget the status: nobody looks at a replay."""


class PlayerLink:
    """The link of a player: what came then comes now, and what is sent stays in the records."""

    def __init__(self, player: Player) -> None:
        self._player = player

    def send(self, batch: bytes, /) -> None:
        """Keep the newest batch: it is on its way when the replay stops here."""
        self._player.sent = batch

    def receive(self) -> bytes | None:
        """Return the next batch of this turn."""
        return next(self._player.batches, None)

    def wait(self, _timeout_ns: int, /) -> bytes | None:
        """Return the next batch of this turn at once."""
        return self.receive()

    def peer_alive(self) -> bool:
        """Whether the peer was there, as far as it mattered."""
        return self._player.alive

    def wait_for_peer(self, _timeout_s: float) -> None:
        """Return at once."""

    def counters(self) -> Mapping[str, int]:
        """Return nothing: there is no wire."""
        return {}

    def close(self) -> None:
        """Nothing to give back."""
