"""What an export has written, and by which rule."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any, NamedTuple

from hil.errors import MissingExtraError


class Exported(NamedTuple):
    """One file that was written."""

    path: Path
    messages: int


class Outcome(NamedTuple):
    """What was written, and which topics were left out, with the reason."""

    files: list[Exported]
    skipped: list[str]


def library(name: str, purpose: str) -> Any:  # noqa: ANN401
    """Import an optional library.

    Raises: MissingExtraError
    """
    try:
        return importlib.import_module(name)
    except ImportError:
        raise MissingExtraError(name.partition(".")[0], "export", purpose) from None
