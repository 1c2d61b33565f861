"""One message on its way in one direction; hil/wire/frames has one for each that is declared."""

from __future__ import annotations

from typing import Generic, NoReturn, TypeVar

from mypy_extensions import i16, i64

from hil.errors import CodecError
from hil.wire.fields import refusal

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

    def pack(self, message: MessageT) -> i64:
        """Return the bare word of a message.

        Raises: CodecError when a value does not fit its signal, is nan or infinite
        """
        raise NotImplementedError

    def take(self, counter: i64, word: i64) -> bool:
        """Go on from a bare word if its CRC is right."""
        raise NotImplementedError


def refuse(message: object, field: str) -> NoReturn:
    """Raise the CodecError of a value that does not fit its signal."""
    raise CodecError(refusal(message, field))
