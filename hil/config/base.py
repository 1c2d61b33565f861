"""The common ground of all configuration sections: immutable, and an unknown key is an error."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, ClassVar, Final, TypeVar

from pydantic import BaseModel, ConfigDict, Field, GetCoreSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from hil.errors import ConfigError
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
        inner = value
        if rest:
            below = getattr(section, head)
            table = isinstance(below, dict)
            inner = {**below, rest: value} if table else with_leaves(below, {rest: value})
        section = section.model_copy(update={head: inner})
    return section


def value_of(config: Section, key: str) -> Any:  # noqa: ANN401
    """Return the value of a key in a section, which may be the whole scenario.

    Raises: ConfigError for a setting that a user's own law or engine does not have
    """
    found: Any = config
    for part in key.split("."):
        if isinstance(found, dict) and part not in found:
            raise ConfigError(f"{key}: unknown; accepted here: {', '.join(found) or 'nothing'}")
        found = found[part] if isinstance(found, dict) else getattr(found, part)
    return found


class OneOf:
    """Annotates a string that is one of names declared elsewhere, as `Literal` does for its own.

    Parameters: other : tells of a name that is none of them whether it is accepted all the same
    """

    def __init__(self, names: Iterable[str], other: Callable[[str], bool] | None = None) -> None:
        self.names = tuple(names)
        self._other = other

    def __get_pydantic_core_schema__(
        self, _source: type, _handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Return what pydantic checks and describes by."""
        if self._other is None:
            return core_schema.literal_schema(list(self.names))
        return core_schema.no_info_after_validator_function(self.checked, core_schema.str_schema())

    def checked(self, name: str) -> str:
        """Return an accepted name.

        Raises: PydanticCustomError, as that of a `Literal` is
        """
        if name in self.names or (self._other is not None and self._other(name)):
            return name
        *others, last = map(repr, self.names)
        expected = f"{', '.join(others)} or {last}"
        raise PydanticCustomError(
            "literal_error", "Input should be {expected}", {"expected": expected}
        )
