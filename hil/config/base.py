"""The common ground of all configuration sections: immutable, and an unknown key is an error."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, ClassVar, Final, TypeVar

from pydantic import BaseModel, ConfigDict, Field, GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from hil.wire.quantities import Number

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

    model_config = ConfigDict(defer_build=True, frozen=True, extra="forbid", allow_inf_nan=False)


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
