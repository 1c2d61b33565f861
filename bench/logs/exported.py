"""What an export has written, and by which rule."""

from __future__ import annotations

import importlib
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, NamedTuple

from hil.errors import MissingExtraError
from hil.files import check_output, output


class Exported(NamedTuple):
    """One file that was written."""

    path: Path
    messages: int


class Outcome(NamedTuple):
    """What was written, and which topics were left out, with the reason."""

    files: list[Exported]
    skipped: list[str]


class Rule(NamedTuple):
    """How the files of an export are written: over others by force, over the log never."""

    force: bool
    inputs: tuple[Path, ...]

    def check(self, path: Path) -> None:
        """Refuse a file before the work."""
        check_output("--out", path, force=self.force, inputs=self.inputs)

    def output(self, path: Path) -> AbstractContextManager[Path]:
        """Give the name to write to."""
        return output("--out", path, force=self.force, inputs=self.inputs)


def library(name: str, purpose: str) -> Any:  # noqa: ANN401
    """Import an optional library.

    Raises: MissingExtraError
    """
    try:
        return importlib.import_module(name)
    except ImportError:
        raise MissingExtraError(name.partition(".")[0], "export", purpose) from None
