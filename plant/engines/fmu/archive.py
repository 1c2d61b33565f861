"""The file of a unit: that it can be read, run on this machine, and is the one that was meant."""

from __future__ import annotations

import hashlib
import zipfile
import zlib
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

from hil.errors import ConfigError, MissingExtraError
from hil.files import read_regular
from plant.engines.fmu.contract import ORIGIN

_VERSIONS = ("2", "3")


class Archive(NamedTuple):
    """A unit's file and what it says of itself."""

    path: Path
    description: Any
    sha256: str

    @property
    def version(self) -> int:
        """Major version of the standard."""
        return int(self.description.fmiVersion.partition(".")[0])

    @property
    def own(self) -> tuple[str, str] | None:
        """Model and prototype of a unit that this project exported, else None."""
        if self.description.generationTool != ORIGIN:
            return None
        model, _, prototype = str(self.description.modelName).partition(".")
        return model, prototype


def library() -> Any:  # noqa: ANN401
    """Return FMPy.

    Raises: MissingExtraError
    """
    try:
        import fmpy  # noqa: PLC0415  # only who uses a unit needs its library
    except ImportError:
        raise MissingExtraError("FMPy", "fmu", "a Functional Mock-up Unit as plant") from None
    return fmpy


def open_archive(path: Path, sha256: str = "") -> Archive:
    """Read the description of a unit and check that it can run here.

    Raises: ConfigError when it cannot, or is another one than `sha256` says
    """
    fmpy = library()
    try:
        data = read_regular(path)
        digest = hashlib.sha256(data).hexdigest()
        with zipfile.ZipFile(BytesIO(data)) as archive:
            entries = archive.namelist()
            damaged = archive.testzip()
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError) as error:
        raise ConfigError(f"{path}: no Functional Mock-up Unit (not a ZIP file: {error})") from None
    if damaged is not None:
        raise ConfigError(f"{path}: {damaged}: the checksum (CRC) does not match")
    if sha256 and digest != sha256:
        raise ConfigError(f"{path}: is another file than the one of the run (SHA-256 {sha256})")
    try:
        description = fmpy.read_model_description(str(path), validate=False)
    except Exception as error:  # whatever the parser meets
        line = str(error).partition("\n")[0]
        raise ConfigError(f"{path}: no Functional Mock-up Unit: {line}") from None
    _check(fmpy, path, description, entries)
    return Archive(path, description, digest)


def _check(fmpy: Any, path: Path, description: Any, entries: list[str]) -> None:  # noqa: ANN401
    version = description.fmiVersion
    if version.partition(".")[0] not in _VERSIONS:
        raise ConfigError(f"{path}: is of FMI {version}; accepted: 2.0 and 3.0")
    unit = description.coSimulation
    if unit is None:
        raise ConfigError(f"{path}: has no co-simulation; accepted: a unit for co-simulation")
    folder = fmpy.platform if version.startswith("2") else fmpy.platform_tuple
    binary = f"binaries/{folder}/{unit.modelIdentifier}{fmpy.sharedLibraryExtension}"
    if binary not in entries:
        parts = [e.split("/")[1] for e in entries if e.startswith("binaries/") and e.count("/") > 1]
        there = ", ".join(sorted({part for part in parts if part})) or "none"
        raise ConfigError(f"{path}: has no binary for {folder} ({binary}); it has: {there}")
