"""From single frames back to batches: which frames on the bus belong to one tick of the sender.

A tick begins with its head, which tells how many frames follow. What is sent exactly once a tick
has the same E2E counter as its head, and so finds its tick though the head is lost or comes later.
Frames that are repeated or too late are strays: they travel with the batch that ends next, in the
order of arrival, and the decoder judges and counts them; they make no batch of their own while
others come.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Final

from drivers.can.frames import HeadPlace, Received
from hil.wire.codec import pack_frame
from hil.wire.e2e import MAX_DELTA, counter_marks, is_intact
from hil.wire.fields import LAYOUTS, layout_of
from hil.wire.messages import ControllerTick, PlantTick

HEADS: Final = {"plant": PlantTick, "controller": ControllerTick}
MAX_FRAMES: Final = 16
"""Frames of one batch; a sender that babbles fills several."""

_COUNTER: Final = 0xF00
_TICKS: Final = 1 << 32
_OLD: Final = _TICKS // 2
_RESTARTED_NS: Final = 1_000_000_000
"""After so long without a new tick a sender may count from any."""


def _place(name: str, layout_name: str) -> tuple[int, int]:
    """Shift and mask of a field of the head."""
    layout = layout_of(HEADS[layout_name])
    placed = next(p for p in layout.fields if p.name == name)
    return placed.start_bit, (1 << placed.signal.bits) - 1


def head_place(sender: str) -> HeadPlace:
    """Return where a sender's head tells how many frames its tick has."""
    return HeadPlace(layout_of(HEADS[sender]).can_id, *_place("frame_count", sender))


class Assembler:
    """Collects the frames of one sender.

    Parameters: quiet_ns : a tick that lacks frames is over when nothing came for so long [ns]
    """

    __slots__ = ("_before", "_count_at", "_count_mask", "_counter", "_frames", "_head_id",
                 "_incomplete", "_last", "_marks", "_missing", "_newest_ns", "_once", "_own",
                 "_ready", "_strays", "_tick", "_tick_at", "quiet_ns")  # fmt: skip

    def __init__(self, sender: str, quiet_ns: int) -> None:
        head = layout_of(HEADS[sender])
        ours = [layout for layout in LAYOUTS.values() if layout.sender == sender]
        self.quiet_ns = quiet_ns
        self._head_id = head.can_id
        self._once = frozenset(layout.can_id for layout in ours if layout.per_tick == 1)
        self._marks = {layout.can_id: counter_marks(layout.data_ids) for layout in ours}
        self._tick_at = _place("tick", sender)[0]
        self._count_at, self._count_mask = _place("frame_count", sender)
        self._ready: deque[bytes] = deque()
        self._incomplete = self._strays = 0
        self.forget()

    def forget(self) -> None:
        """Drop what has been collected and know of no tick."""
        self._ready.clear()
        self._frames: list[bytes] = []  # in the order of their arrival, strays among them
        self._last: list[bytes] = []  # the frames of the last batch
        self._own = 0  # frames of the tick in progress
        self._missing = -1  # frames still to come; -1 without a head
        self._tick = -1  # of the newest head
        self._counter = self._before = -1  # of the tick in progress, and of the one before
        self._newest_ns = 0

    @property
    def idle(self) -> bool:
        """Whether no frame waits here, and no batch."""
        return not (self._frames or self._ready)

    def whole(self, frames: Sequence[Received], now_ns: int) -> bytes | None:
        """Return the batch of frames that are the next tick, all of it, head first; else None.

        The common case in short: what it lets through, `push` would put into the same batch.
        """
        can_id, head, _ = frames[0]
        if can_id != self._head_id or self._frames or self._ready:
            return None
        tick, counter = head >> self._tick_at & (_TICKS - 1), head & _COUNTER
        if tick != self._tick + 1 or len(frames) != head >> self._count_at & self._count_mask:
            return None
        packed: list[bytes] = []
        for can_id, word, _ in frames:
            frame = pack_frame(can_id, word)
            if can_id in self._once:
                fits = word & _COUNTER == counter
            else:
                fits = can_id in self._marks and frame not in self._last
            if not fits or frame in packed:
                return None
            packed.append(frame)
        self._tick, self._before, self._newest_ns, self._last = tick, counter >> 8, now_ns, packed
        return b"".join(packed)

    def push(self, can_id: int, word: int, now_ns: int) -> None:
        """Take one frame of the sender; frames of others are passed over."""
        marks = self._marks.get(can_id)
        if marks is None:
            return
        frame = pack_frame(can_id, word)
        twice = frame in self._frames or frame in self._last
        if twice or (
            can_id in self._once
            and is_intact(word, marks)
            and not self._place_in(can_id, word, now_ns)
        ):
            self._strays += 1
        else:
            self._newest_ns = now_ns
            self._own += 1
            if self._missing > 0:
                self._missing -= 1
        self._frames.append(frame)
        if self._missing == 0 or len(self._frames) >= MAX_FRAMES:
            self._end()

    def _place_in(self, can_id: int, word: int, now_ns: int) -> bool:
        """Whether a frame that is sent once a tick is of this tick or begins the next."""
        counter = word >> 8 & 0xF
        if now_ns - self._newest_ns > _RESTARTED_NS:
            self._tick = self._before = -1
        if can_id == self._head_id:
            return self._begins(word, counter)
        return self._belongs(counter)

    def _begins(self, word: int, counter: int) -> bool:
        """Open the tick of a head; false when it is of a tick that is over."""
        tick = word >> self._tick_at & (_TICKS - 1)
        if self._tick >= 0 and not 0 < (tick - self._tick) % _TICKS < _OLD:
            return False
        if self._own and (self._missing >= 0 or self._counter not in {-1, counter}):
            self._end()
        self._tick = tick
        self._counter = counter
        # The head itself is taken off when it is put in; what came before it counts too.
        self._missing = max((word >> self._count_at & self._count_mask) - self._own, 1)
        return True

    def _belongs(self, counter: int) -> bool:
        """Put a body into the tick in progress, or begin the next; false when it is too late."""
        known = self._counter if self._counter >= 0 else self._before
        delta = (counter - known) & 0xF
        if known < 0 or (delta == 0 and self._counter >= 0):
            self._counter = counter
            return True
        if not 0 < delta <= MAX_DELTA:
            return False
        if self._counter >= 0:
            self._end()
        self._counter = counter
        return True

    def _end(self) -> None:
        """Make a batch of what has come."""
        if self._missing and self._own:
            self._incomplete += 1
        self._ready.append(b"".join(self._frames))
        self._last = self._frames
        self._frames = []
        self._own, self._missing = 0, -1
        if self._counter >= 0:
            self._before, self._counter = self._counter, -1

    def pop(self, now_ns: int) -> bytes | None:
        """Return the oldest batch that is complete, or has been quiet for too long."""
        if self._ready:
            return self._ready.popleft()
        if not self._own or now_ns - self._newest_ns < self.quiet_ns:
            return None
        self._end()
        return self._ready.popleft()

    def rest(self) -> bytes | None:
        """Return strays that no tick has come for."""
        if self._own or not self._frames:
            return None
        batch, self._frames = b"".join(self._frames), []
        return batch

    @property
    def counters(self) -> Mapping[str, int]:
        """Batches that lacked frames, and frames that came twice or too late."""
        return {"incomplete": self._incomplete, "strays": self._strays}
