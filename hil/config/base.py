"""The common ground of all configuration sections: immutable, and an unknown key is an error."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from hil.errors import ConfigError
from hil.wire.quantities import Number

Tree = dict[str, Any]


class Section(BaseModel):
    """A table of the configuration file."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def ranged(number: Number) -> Any:  # noqa: ANN401
    """Return the constraint of a key of the configuration that means what a command's field does.

    For `Annotated[float, ranged(number)]`.
    """
    return Field(ge=number.low, le=number.high)


class OneOf:
    """Annotates a string that is one of names declared elsewhere, as `Literal` does for its own."""

    def __init__(self, names: Iterable[str]) -> None:
        self._names = list(names)

    def __get_pydantic_core_schema__(
        self, _source: type, _handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Return what pydantic checks and describes by."""
        return core_schema.literal_schema(self._names)


def read_toml(path: Path) -> Tree:
    """Read a TOML file.

    Raises: ConfigError when it is missing, unreadable or no TOML
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror or error}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not a TOML file: {error}") from None
