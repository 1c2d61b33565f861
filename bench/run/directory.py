"""The directory of a run: where it is, and that nothing in it is lost by accident."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from hil.errors import ConfigError
from hil.files import Output


class RunFiles(NamedTuple):
    """What a run writes into its directory."""

    directory: Path

    @property
    def plant_log(self) -> Path:
        """Log of the plant process."""
        return self.directory / "plant.mcap"

    @property
    def controller_log(self) -> Path:
        """Log of the controller process."""
        return self.directory / "controller.mcap"

    @property
    def scenario(self) -> Path:
        """The resolved configuration that both processes read."""
        return self.directory / "scenario.json"

    @property
    def summary(self) -> Path:
        """Verdict and figures, for programs."""
        return self.directory / "summary.json"

    @property
    def report(self) -> Path:
        """Figures and pictures, for people."""
        return self.directory / "report.html"

    def errors_of(self, process: str) -> Path:
        """Everything that a process wrote to its standard error, if it wrote anything."""
        return self.directory / f"{process}.stderr"

    def existing(self) -> list[Path]:
        """Return the files of an earlier run that are there."""
        written = (
            self.plant_log,
            self.controller_log,
            self.scenario,
            self.summary,
            self.report,
            *(self.errors_of(name) for name in ("plant", "controller", "loop")),
        )
        return [path for path in written if path.exists()]


def prepare(name: str, out: Path | None, *, force: bool) -> RunFiles:
    """Make the directory of a new run.

    Without `out` it is runs/NAME-DATE-TIME. An earlier run is replaced only by force; files that
    no run writes stay where they are in any case.

    Raises: ConfigError when the directory holds an earlier run or cannot be made
    """
    directory = fresh(name) if out is None else out
    files = RunFiles(directory)
    earlier = files.existing()
    if earlier and not force:
        raise ConfigError(
            f"--out {directory}: holds an earlier run ({earlier[0].name}); accepted is another "
            "directory, or --force to replace it"
        )
    make_directory("--out", directory)
    for path in earlier:
        path.unlink()
    return files


def opened(run: Path) -> RunFiles:
    """Return the files of a finished run, named by its directory or by a file in it.

    Raises: ConfigError when the directory holds no run
    """
    directory = directory_of(run)
    files = RunFiles(directory)
    for needed in (files.scenario, files.plant_log, files.controller_log):
        if not needed.is_file():
            raise ConfigError(f"{run}: no finished run: {needed.name} is missing")
    return files


def directory_of(run: Path) -> Path:
    """Return the directory of a run that is named by itself or by a file in it."""
    return run.parent if run.is_file() else run


def logs_of(log: Path) -> list[Path]:
    """Return the log that is named, or of a run's directory both.

    Raises: ConfigError when there is none in the directory
    """
    if not log.is_dir():
        return [log]
    files = RunFiles(log)
    found = [path for path in (files.plant_log, files.controller_log) if path.is_file()]
    if not found:
        raise ConfigError(f"{log}: no log in this directory; accepted is an .mcap file, or a run")
    return found


def claim(option: str, directory: Path, names: Sequence[str], *, force: bool) -> list[Output]:
    """Make a directory for results before the work begins; return the files that go into it.

    Raises: ConfigError naming the option when one is there already, or cannot be made
    """
    make_directory(option, directory)
    files = [Output(option, directory / name, force) for name in names]
    for file in files:
        file.check()
    return files


def check_directory(option: str, path: Path) -> None:
    """Refuse a directory in which no file could be made after the work; nothing is left behind.

    Raises: ConfigError naming the option
    """
    there = next(p for p in (path.absolute(), *path.absolute().parents) if p.exists())
    try:
        tempfile.TemporaryFile(dir=there).close()
    except OSError as error:
        raise ConfigError(f"{option} {path}: {error.strerror}") from None


def make_directory(option: str, path: Path) -> None:
    """Make a directory for results before the work begins.

    Raises: ConfigError naming the option when no file can be made in it
    """
    check_directory(option, path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{option} {path}: {error.strerror}") from None


def fresh(name: str) -> Path:
    """Return a directory for results that does not exist yet."""
    base = Path("runs") / f"{name}-{time.strftime('%Y%m%d-%H%M%S')}"
    directory, number = base, 2
    while directory.exists():
        directory = base.with_name(f"{base.name}-{number}")
        number += 1
    return directory
