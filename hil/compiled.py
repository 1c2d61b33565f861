"""Compiled twins of the modules that run in every tick, in use only while they match the sources.

`hil compile` has mypyc turn those modules into C: the same source, the same arithmetic, the same
bits, at a fraction of the time. What it builds lies in a directory named by a hash of the sources,
of all that they import of ours (its types are compiled in), and of the Python it is for. Once one
is edited that name is another, and everything is interpreted until `hil compile` is run again:
`edited` says which one it was.

HIL_COMPILED : a directory to look in instead of ~/.cache/fpeg-hil/compiled; `off` for none
"""

from __future__ import annotations

import ast
import importlib.machinery
import importlib.util
import json
import os
import sys
from collections.abc import Sequence
from hashlib import blake2b
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Final

GROUP: Final = "fpeg_hil"
"""mypyc puts the code of each package into one library, `<group>_<package>__mypyc`."""

MADE_OF: Final = "made_of.json"
"""Beside what was compiled: the directory of its sources, and the digest of each."""

PATTERNS: Final = (
    "hil/wire/messages.py", "hil/wire/frames/*.py", "hil/wire/stream.py", "hil/wire/codec.py",
    "hil/wire/e2e.py", "hil/wire/pulses.py",
    "hil/log/packing.py", "hil/pacing.py", "hil/exchange.py", "hil/values.py", "hil/roots.py",
    "hil/rounding.py", "hil/ports.py", "hil/randoms.py",
    "plant/*.py", "plant/rig/*.py", "plant/engines/*.py", "plant/engines/*/model.py",
    "plant/engines/fast/*.py", "controller/**/*.py",
    "drivers/memory_link.py", "drivers/recorder/ring.py", "drivers/recorder/index.py",
    "drivers/polling.py", "drivers/can/assembly.py", "bench/run/offline.py",
    "bench/logs/replay/turn.py", "bench/logs/replay/ports.py", "bench/logs/replay/loops.py",
    "bench/logs/replay/walk.py",
)  # fmt: skip
_START_UP: Final = ("__init__.py", "main.py", "build.py", "follow.py", "commands.py")
"""Not worth it: read once, or no more than a wait and a turn."""

_PACKAGES: Final = ("hil", "plant", "controller", "drivers")
_SUFFIX: Final = importlib.machinery.EXTENSION_SUFFIXES[0]


def sources(root: Path) -> list[Path]:
    """Return the files to compile, relative to the directory that holds the packages."""
    found = {path.relative_to(root) for pattern in PATTERNS for path in root.glob(pattern)}
    return sorted(path for path in found if path.name not in _START_UP)


def digests(root: Path) -> dict[str, str]:
    """Return the digest of each file that what is compiled depends on, by its path in `root`."""
    base = str(root)
    known = [path for package in _PACKAGES for path in _modules_below(base, package)]
    bench = [str(path) for path in sources(root) if path.parts[0] == "bench"]
    made_of = {}
    for path in (*known, *bench, "bench/dev/compile.py"):
        with open(f"{base}/{path}", "rb") as file:  # noqa: PTH123 - at the start of every command
            made_of[path] = blake2b(file.read(), digest_size=10).hexdigest()
    return made_of


def _modules_below(base: str, folder: str) -> list[str]:
    """Paths from `base` of all modules below a folder of it, in a fixed order."""
    found, inner = [], []
    with os.scandir(f"{base}/{folder}") as entries:
        for entry in entries:
            if entry.name.endswith(".py"):
                found.append(f"{folder}/{entry.name}")
            elif entry.is_dir():
                inner.append(f"{folder}/{entry.name}")
    return sorted(found) + [path for each in sorted(inner) for path in _modules_below(base, each)]


def key_of(root: Path) -> str:
    """Return the name under which what these sources compile to is kept."""
    return _key(digests(root))


def _key(made_of: dict[str, str]) -> str:
    return blake2b(f"{_SUFFIX} {made_of}".encode(), digest_size=10).hexdigest()


def root() -> Path:
    """Return the directory that holds the packages."""
    return Path(__file__).resolve().parent.parent


def base() -> Path | None:
    """Return where compiled modules are kept; None when they are switched off."""
    told = os.environ.get("HIL_COMPILED")
    if told and told.lower() == "off":
        return None
    if told:
        return Path(told)
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "fpeg-hil" / "compiled"


class _Finder:
    """Finds the compiled twin of a module before the import system looks for its source."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory

    def find_spec(
        self, name: str, _path: Sequence[str] | None, _target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the spec of a compiled module; None for any other."""
        file = self._directory / f"{name.replace('.', '/')}{_SUFFIX}"
        return importlib.util.spec_from_file_location(name, file) if file.is_file() else None


def use() -> None:
    """Let imports from here on find the compiled modules, if there are any of these sources."""
    where = base()
    if where is None or not where.is_dir():
        return
    directory = where / key_of(root())
    if directory.is_dir():
        sys.meta_path.insert(0, _Finder(directory))


def edited() -> list[str]:
    """Return the sources that differ from those last compiled here; none if none ever were."""
    where = base()
    if where is None or in_force():
        return []
    found = sorted(where.glob(f"*/{MADE_OF}"), key=lambda path: path.stat().st_mtime)
    made = [json.loads(path.read_text(encoding="utf-8")) for path in found]
    ours = [each["files"] for each in made if each["root"] == str(root())]
    if not ours:
        return []
    now = digests(root())
    return sorted(path for path in {*now, *ours[-1]} if now.get(path) != ours[-1].get(path))


def in_force() -> bool:
    """Whether this process runs compiled modules."""
    return any(isinstance(finder, _Finder) for finder in sys.meta_path)


def is_compiled(module: str) -> bool:
    """Whether a loaded module is a compiled one."""
    spec = getattr(sys.modules.get(module), "__spec__", None)
    return spec is not None and str(spec.origin).endswith(_SUFFIX)


def class_source(kind: type) -> ast.ClassDef:
    """Return a class of ours as its source has it: compiled it has lost its hints and docstring."""
    source = root() / f"{kind.__module__.replace('.', '/')}.py"
    tree = ast.parse(source.read_text(encoding="utf-8"))
    (found,) = (n for n in tree.body if isinstance(n, ast.ClassDef) and n.name == kind.__name__)
    return found
