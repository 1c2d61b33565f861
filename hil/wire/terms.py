"""What plant and controller must agree on before the first tick, declared once: the handshake.

Each side tells its terms, one frame a term: on the bus in frames of its own, elsewhere beside its
presence. A frame is a word as that of any message, with the CRC of the same kind:

    bits 0-7 CRC, 8-11 which term, 12-15 how many terms, 16-47 value

The value of a number is the number; that of a name, or of figures, is a hash of 32 bits.
"""

from __future__ import annotations

from collections.abc import Iterable
from hashlib import blake2b
from typing import Final, NamedTuple

from hil.errors import CodecError
from hil.wire.codec import FRAME, frames_of
from hil.wire.e2e import crc_of
from hil.wire.fields import LAYOUTS

VERSION: Final = 1
"""Of the wire; it grows when a frame changes its meaning."""

CAN_IDS: Final = {"plant": 0x0F0, "controller": 0x0F1}
_SEAL: Final = 0xA5
_MASK: Final = 0xFFFFFFFF


class Term(NamedTuple):
    """One thing to agree on; a number is compared as it is, anything else by its hash."""

    key: str
    meaning: str
    is_number: bool = False


DECLARED: Final = (
    Term("version of the wire", "1; grows when a frame changes its meaning", is_number=True),
    Term("frames", "identifiers, fields, scales and ranges of all messages"),
    Term("loop.rate_hz", "ticks a second", is_number=True),
    Term("loop.clock", "real time or lockstep"),
    Term("link.zenoh.engine", "name of the pair"),
    Term("plant.prototype", "the engine"),
    Term("plant.model", "its model"),
    Term("begins", "in what motion a run begins"),
    Term("plant.engine", "figures of the engine"),
)

Terms = tuple[str | int, ...]
"""What one side holds to, in the order of the declaration."""


def fingerprint(text: str) -> int:
    """Return the 32 bits that stand for a text."""
    return int.from_bytes(blake2b(text.encode(), digest_size=4).digest(), "little")


def frames_text() -> str:
    """Return what the declarations of all messages say, as a text to compare."""
    return "\n".join(f"{can_id:#x} {layout.fields!r}" for can_id, layout in LAYOUTS.items())


def values_of(terms: Terms) -> tuple[int, ...]:
    """Return the values as they are told."""
    return tuple(term if isinstance(term, int) else fingerprint(term) for term in terms)


def encode(sender: str, terms: Terms) -> bytes:
    """Return the frames in which a side tells its terms."""
    values = values_of(terms)
    words = (
        number << 8 | len(values) << 12 | (value & _MASK) << 16
        for number, value in enumerate(values)
    )
    can_id = CAN_IDS[sender]
    return b"".join(FRAME.pack(can_id, word | crc_of(word) ^ _SEAL) for word in words)


class Gathered:
    """The terms of the other side as they come, frame by frame and in any order."""

    def __init__(self, sender: str) -> None:
        self._can_id = CAN_IDS[sender]
        self._values: dict[int, int] = {}
        self._count = 0

    def take(self, can_id: int, word: int) -> bool:
        """Take a frame; returns whether it was one of these, damaged ones included."""
        if can_id != self._can_id:
            return False
        if (word & 0xFF) == crc_of(word & ~0xFF) ^ _SEAL:
            self._count = word >> 12 & 0xF
            self._values[word >> 8 & 0xF] = word >> 16 & _MASK
        return True

    @property
    def values(self) -> tuple[int, ...] | None:
        """All of them, None while some are missing."""
        if not self._count or any(number not in self._values for number in range(self._count)):
            return None
        return tuple(self._values[number] for number in range(self._count))


def decode(sender: str, batch: bytes) -> tuple[int, ...] | None:
    """Return the values that frames tell, None when they are not all there."""
    gathered = Gathered(sender)
    try:
        for can_id, word in frames_of(batch):
            gathered.take(can_id, word)
    except CodecError:
        return None
    return gathered.values


def differences(ours: Terms, theirs: tuple[int, ...], known: Iterable[str] = ()) -> list[str]:
    """Return in what the two differ, as `key = here, there`.

    Parameters: known : names that the other side's hash may stand for
    """
    names = {fingerprint(name): name for name in known}
    told = []
    for number, (term, our, value) in enumerate(zip(DECLARED, ours, values_of(ours), strict=True)):
        their = theirs[number] if number < len(theirs) else None
        if their == value:
            continue
        there = "nothing" if their is None else str(their) if term.is_number else names.get(their)
        if "\n" in str(our) or len(str(our)) > 60:
            told.append(f"{term.key} (fingerprint {value:08x} here, {their or 0:08x} there)")
        else:
            told.append(f"{term.key} = {our} here, {there or 'another one'} there")
    return told
