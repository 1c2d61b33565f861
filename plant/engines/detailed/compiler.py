"""The compiler behind the step: one decorator, typed, cached, and named when it is missing."""

from __future__ import annotations

import os
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar, cast

from hil.errors import MissingExtraError

try:
    import numba
except ImportError:
    raise MissingExtraError("numba", "detailed", "the detailed engine") from None

_SOURCES = (
    "compiler", "layout", "types", "gas", "machine", "kernel", "programme", "steps", "solver",
)  # fmt: skip
_OPTIONS: dict[str, Any] = {"cache": True, "error_model": "numpy", "_nrt": False}
_F = TypeVar("_F", bound=Callable[..., Any])


def _cache_directory() -> Path:
    """One directory for each state of the sources that are compiled.

    The compiler's own cache looks at the file of a function, not at those that it calls.
    """
    digest = sha256(numba.__version__.encode())
    for name in _SOURCES:
        digest.update((Path(__file__).parent / f"{name}.py").read_bytes())
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(os.environ.get("NUMBA_CACHE_DIR") or home) / "fpeg-hil" / digest.hexdigest()[:16]


vars(numba.config)["CACHE_DIR"] = str(_cache_directory())


def compiled(function: _F) -> _F:
    """Compile to machine code at the first call; later processes load it from the cache.

    IEEE arithmetic is kept as written, so that two runs give the same bits. Nothing is allocated,
    so nothing is counted: atomic counts of who holds a row took three quarters of the time.
    """
    return cast(_F, numba.njit(**_OPTIONS)(function))
