"""Python that a user brings: a file of his own, or a package that he has installed.

A file is loaded under a name made of its hash, so that a run is of one text and no other; nothing
is loaded that the user has not named on this machine. The source goes into the log, to be read.
"""

from __future__ import annotations

import hashlib
import sys
import traceback
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from pydantic import BaseModel, ValidationError

from hil.errors import ConfigError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

SUFFIX: Final = ".py"
LAWS: Final = "fpeg_hil.laws"
ENGINES: Final = "fpeg_hil.engines"
"""The entry points by which an installed package offers laws and engines."""


class Brought(NamedTuple):
    """A module of a user's: its name for people, its file, the hash and text of it."""

    name: str
    path: Path
    sha256: str
    text: str
    module: ModuleType


def name_of(file: str) -> str:
    """Return the name by which a file's law or engine is known: `./my_law.py` is `my-law`."""
    return Path(file).stem.replace("_", "-").lower()


def load_file(file: str, sha256: str = "") -> Brought:
    """Load a file, once.

    Parameters: sha256 : the only hash that is accepted; empty for any
    Raises: ConfigError naming file and line when it cannot be read, is another one, or fails
    """
    path = Path(file)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{file}: {error.strerror or error}") from None
    digest = hashlib.sha256(data).hexdigest()
    if sha256 and digest != sha256:
        raise ConfigError(f"{file}: is another file than the one of the run (SHA-256 {sha256})")
    return _load(str(path.resolve()), digest)


@cache
def _load(file: str, digest: str) -> Brought:
    path = Path(file)
    try:
        text = path.read_text("utf-8")
        code = compile(text, file, "exec")
    except (SyntaxError, ValueError) as error:
        line = getattr(error, "lineno", None)
        at = f" line {line}" if line else ""
        raise ConfigError(f"{file}{at}: {getattr(error, 'msg', error)}") from None
    module = ModuleType(f"fpeg_hil_brought_{digest[:12]}")
    module.__file__ = file
    sys.modules[module.__name__] = module
    try:
        exec(code, module.__dict__)
    except Exception as error:
        del sys.modules[module.__name__]
        raise ConfigError(told(error, file)) from None
    return Brought(name_of(file), path, digest, text, module)


def told(error: BaseException, file: str) -> str:
    """Return one line about what went wrong in a user's file, and where in it."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == file]
    at = f" line {lines[-1]}" if lines else ""
    return f"{file}{at}: {type(error).__name__}: {error}".splitlines()[0]


def class_with(brought: Brought, methods: Sequence[str]) -> Any:  # noqa: ANN401
    """Return the one class of a file that has these methods.

    Raises: ConfigError when there is none, or more than one
    """
    own = brought.module.__name__
    found = [
        one for one in vars(brought.module).values()
        if isinstance(one, type) and one.__module__ == own
        and all(callable(getattr(one, method, None)) for method in methods)
    ]  # fmt: skip
    if len(found) != 1:
        names = ", ".join(one.__name__ for one in found) or "none"
        raise ConfigError(
            f"{brought.path}: accepted is one class with {' and '.join(methods)}; found: {names}"
        )
    return found[0]


@cache
def installed(group: str) -> dict[str, EntryPoint]:
    """Return what the installed packages offer under an entry point's group, by name."""
    from importlib.metadata import entry_points  # noqa: PLC0415 - a twentieth of a second

    return {point.name: point for point in entry_points(group=group)}


def _offered(group: str, name: str) -> EntryPoint:
    """Return the entry point of that name.

    Raises: ConfigError when no installed package has it
    """
    point = installed(group).get(name)
    if point is None:
        known = ", ".join(installed(group)) or "none"
        raise ConfigError(f"{group}: no installed package offers {name!r}; offered: {known}")
    return point


def source_file(group: str, name: str, file: str = "") -> Path:
    """Return the file that a law or an engine comes from: its own, or that of its package.

    Raises: ConfigError when no installed package offers it
    """
    if file:
        return Path(file)
    found = find_spec(_offered(group, name).module)
    return Path((found.origin if found is not None else None) or "")


def load_installed(group: str, name: str, sha256: str = "") -> tuple[Any, Brought]:
    """Return what an installed package offers by that name, and the file that it comes from.

    Raises: ConfigError when it cannot be loaded, or is of another file than the run's
    """
    point = _offered(group, name)
    try:
        offered = point.load()
    except Exception as error:
        raise ConfigError(f"{group} {name}: {type(error).__name__}: {error}") from None
    module = sys.modules[offered.__module__]
    path = Path(module.__file__ or "")
    data = path.read_bytes()
    digest = hashlib.sha256(data).hexdigest()
    if sha256 and digest != sha256:
        raise ConfigError(f"{group} {name}: {path} is another file than the run's ({sha256})")
    return offered, Brought(name, path, digest, data.decode("utf-8", "replace"), module)


def is_brought(group: str, name: str) -> bool:
    """Tell whether a name is a file's, or is of an installed package."""
    return name.endswith(SUFFIX) or name in installed(group)


def settings_of(kind: Any, given: Mapping[str, Any], where: str, path: Path) -> BaseModel | None:  # noqa: ANN401
    """Return a class's own settings, whole; None for one that declares none.

    Parameters: where : the section that they are of, as in controller.own.settings
    Raises: ConfigError naming the key
    """
    model = getattr(kind, "Settings", None)
    if model is None:
        if given:
            raise ConfigError(f"{where}: {path} declares no Settings; accepted: nothing")
        return None
    known = ", ".join(model.model_fields)
    for key in given.keys() - model.model_fields.keys():
        raise ConfigError(f"{where}.{key}: unknown; {path} has: {known}")
    try:
        found: BaseModel = model.model_validate(dict(given))
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join((where, *map(str, first["loc"])))
        raise ConfigError(f"{key} = {first['input']!r}: {first['msg']}") from None
    return found


def make(kind: Any, brought: Brought, *arguments: Any) -> Any:  # noqa: ANN401
    """Make one of a user's class; what is None is not given to it.

    Raises: ConfigError naming file and line when it fails
    """
    try:
        return kind(*(one for one in arguments if one is not None))
    except Exception as error:
        raise ConfigError(told(error, str(brought.path.resolve()))) from None
