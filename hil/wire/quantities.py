"""Kinds of fields that a command may have, each with its range and its one reader."""

from __future__ import annotations

import re
from typing import Final, NamedTuple

Scalar = float | int | str

_MAX_SHOWN: Final = 60


class FieldError(ValueError):
    """What is wrong with one field of a command; the line begins with the field's name."""


class Number(NamedTuple):
    """A field that is a number from `low` to `high`, ends included.

    default: what holds when it is not given; None: it must be, unless it is `optional`
    parameter: the key of the configuration that it changes in a running controller
    """

    name: str
    unit: str
    low: float
    high: float
    meaning: str
    default: float | None = None
    optional: bool = False
    parameter: str = ""
    whole: bool = False

    @property
    def accepted(self) -> str:
        """The range in words."""
        whole = "a whole number from " if self.whole else ""
        return f"{whole}{self.low:g} to {self.high:g}"

    def read(self, value: object) -> Scalar:
        """Check a value.

        Raises: ValueError when it is no number of the range
        """
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError
        if not self.low <= value <= self.high or (self.whole and value != int(value)):
            raise ValueError
        return int(value) if self.whole else float(value)


class Choice(NamedTuple):
    """A field that is one of some names."""

    name: str
    names: tuple[str, ...]
    meaning: str
    default: str | None = None
    optional: bool = False
    parameter: str = ""
    unit: str = ""

    @property
    def accepted(self) -> str:
        """The names."""
        return ", ".join(self.names)

    def read(self, value: object) -> Scalar:
        """Check a value.

        Raises: ValueError when it is none of the names
        """
        if not isinstance(value, str) or value not in self.names:
            raise ValueError
        return value


class Name(NamedTuple):
    """A field that is the name of something declared elsewhere, or a line; `form` in words."""

    name: str
    meaning: str
    default: str | None = None
    optional: bool = False
    parameter: str = ""
    unit: str = ""
    pattern: str = r"^[a-z][a-z0-9-]{0,39}$"
    form: str = "a name of a to z, 0 to 9 and -"

    @property
    def accepted(self) -> str:
        """Its form in words."""
        return self.form

    def read(self, value: object) -> Scalar:
        """Check a value.

        Raises: ValueError when it is no name
        """
        if not isinstance(value, str) or re.fullmatch(self.pattern[1:-1], value) is None:
            raise ValueError
        return value


LINE: Final = Name(
    "text", "what it says", pattern=r"^[^\x00-\x1f\x7f-\x9f]{1,80}$",
    form="a line of 1 to 80 characters",
)  # fmt: skip

Field = Number | Choice | Name


def value_of(field: Field, given: object) -> Scalar | None:
    """Return one field's value, its default when it was not given.

    Raises: FieldError with a line that says what is accepted
    """
    if given is None:
        if field.default is None and not field.optional:
            raise FieldError(f"{field.name} is missing; accepted: {field.accepted}")
        return field.default
    try:
        return field.read(given)
    except ValueError:
        raise FieldError(f"{field.name} = {shown(given)}; accepted: {field.accepted}") from None


def shown(value: object) -> str:
    """Return a value on part of a line."""
    try:
        text = ascii(value)
    except RecursionError:
        return "..."
    return text if len(text) <= _MAX_SHOWN else f"{text[:_MAX_SHOWN]}..."


def printable(text: str) -> str:
    """Return a text of somebody else's without what a terminal would act on."""
    return "".join(c if c.isprintable() else "?" for c in text)
