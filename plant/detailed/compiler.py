"""The compiler behind the step: one decorator, typed, cached, and named when it is missing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from hil.errors import MissingExtraError

try:
    from numba import njit
except ImportError:
    raise MissingExtraError("numba", "detailed", "the detailed engine") from None

_F = TypeVar("_F", bound=Callable[..., Any])


def compiled(function: _F) -> _F:
    """Compile to machine code at the first call; later processes load it from the cache.

    IEEE arithmetic is kept as written, so that two runs give the same bits.
    """
    return cast(_F, njit(cache=True, error_model="numpy")(function))
