"""The common ground of all configuration sections: immutable, and an unknown key is an error."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, ClassVar, Final, TypeVar

from pydantic import BaseModel, ConfigDict, Field, GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from hil.errors import ConfigError
from hil.files import read_regular
from hil.wire.quantities import Number

Tree = dict[str, Any]


LIVE: Final[dict[str, Any]] = {"live": True}
FIXED: Final[dict[str, Any]] = {"live": False}
"""For `json_schema_extra` of a key of which its section says otherwise."""


class Section(BaseModel):
    """A table of the configuration file.

    live: whether a running engine takes changes of its keys
    unit: of its numbers whose name does not end with one
    """

    live: ClassVar[bool] = False
    unit: ClassVar[str] = "1"

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Tunable(Section):
    """A table of which a running engine takes changes."""

    live: ClassVar[bool] = True


def ranged(number: Number) -> Any:  # noqa: ANN401
    """Return the constraint of a key of the configuration that means what a command's field does.

    For `Annotated[float, ranged(number)]`.
    """
    return Field(ge=number.low, le=number.high)


_SectionT = TypeVar("_SectionT", bound=Section)


def with_leaves(section: _SectionT, changes: Mapping[str, Any]) -> _SectionT:
    """Return a section in which some keys, as dotted paths, have other values: unchecked.

    For changes whose range was checked before: a model of a hundred keys is not built for one.
    """
    for path, value in changes.items():
        head, _, rest = path.partition(".")
        inner = with_leaves(getattr(section, head), {rest: value}) if rest else value
        section = section.model_copy(update={head: inner})
    return section


class OneOf:
    """Annotates a string that is one of names declared elsewhere, as `Literal` does for its own."""

    def __init__(self, names: Iterable[str]) -> None:
        self.names = tuple(names)

    def __get_pydantic_core_schema__(
        self, _source: type, _handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Return what pydantic checks and describes by."""
        return core_schema.literal_schema(list(self.names))


def read_toml(path: Path) -> Tree:
    """Read a TOML file; a byte order mark in front of it, which some editors write, is none of it.

    Raises: ConfigError when it is missing, no regular file, unreadable or no TOML
    """
    try:
        return parse_toml(read_regular(path).decode("utf-8-sig"))
    except ValueError as error:
        raise ConfigError(f"{path}: not a TOML file: {error}") from None


def parse_toml(text: str) -> Tree:
    """Read TOML.

    Raises: ValueError with what is wrong
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise
    except ValueError:  # of `int`
        raise ValueError("a number of more digits than a program reads") from None
    except RecursionError:
        raise ValueError("values nested too deep") from None
