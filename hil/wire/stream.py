"""One message on its way in one direction; hil/wire/frames has one for each that is declared."""

from __future__ import annotations

from typing import Final, Generic, NoReturn, TypeVar

from mypy_extensions import i16, i64

from hil.errors import CodecError
from hil.wire.e2e import crc8
from hil.wire.fields import refusal

ROUND: Final = 6755399441055744.0
"""2^52 + 2^51: adding it to a number below 2^51 and taking it off rounds half to even."""

MessageT = TypeVar("MessageT")


class Stream(Generic[MessageT]):
    """A message's codec, its counter, and its last value.

    Words are signed, as machine code has them. `bare` is one without counter, CRC of the payload
    included: while a payload repeats, as commands and pulses do, it is not decoded again.

    counter, bare: of the last frame, -1 before the first (which no bare word is)
    message: what `bare` says, None when it is out of range
    """

    __slots__ = ("bare", "can_id", "counter", "marks", "message")

    def __init__(self, can_id: i16, marks: tuple[int, ...]) -> None:
        self.can_id = can_id
        self.marks = marks
        self.counter: i64 = -1
        self.bare: i64 = -1
        self.message: MessageT | None = None

    def receive(self, word: i64) -> bool:
        """Take a frame that is intact and has the counter that is due; false for any other."""
        counter = self.counter + 1 & 0xF
        bare = word ^ self.marks[counter]
        if bare == self.bare and self.message is not None:
            self.counter = counter
            return True
        if crc8(bare) != bare & 0xFFF:
            return False
        self.counter, self.bare = counter, bare
        self.message = self.unpack(bare)
        return True

    def take(self, counter: i64, bare: i64) -> None:
        """Go on from a frame that was received."""
        self.counter, self.bare = counter, bare
        self.message = self.unpack(bare)

    def pack(self, message: MessageT) -> i64:
        """Return the bare word of a message.

        Raises: CodecError when a value does not fit its signal, is nan or infinite
        """
        raise NotImplementedError

    def unpack(self, word: i64) -> MessageT | None:
        """Return the message of a bare word, None when a value is out of range."""
        raise NotImplementedError


def refuse(message: object, field: str) -> NoReturn:
    """Raise the CodecError of a value that does not fit its signal."""
    raise CodecError(refusal(message, field))
