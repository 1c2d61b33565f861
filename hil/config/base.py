"""The common ground of all configuration sections: immutable, and an unknown key is an error."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from hil.wire.quantities import Number


class Section(BaseModel):
    """A table of the configuration file."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def ranged(number: Number) -> Any:  # noqa: ANN401
    """Return the constraint of a key of the configuration that means what a command's field does.

    For `Annotated[float, ranged(number)]`.
    """
    return Field(ge=number.low, le=number.high)
