"""`hil compile`: the modules that run in every tick, translated to C by mypyc (hil/compiled.py)."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from rich.console import Console

from hil import compiled
from hil.errors import ConfigError, MissingExtraError, RunError

_PACKAGES: Final = ("hil", "plant", "controller", "drivers", "bench")
_KEPT: Final = 4
_MYPY: Final = "[mypy]\nplugins = pydantic.mypy\nignore_missing_imports = True\n"
# No fused multiply-add: its last bit is another than that of two operations.
_C_FLAGS: Final = ["-ffp-contract=off"]
_EMPTY_TUPLE: Final = 'CPy_TypeError("tuple[]"'


def run(into: Path | None) -> int:
    """Compile what is not compiled yet.

    Raises: MissingExtraError, ConfigError without a C compiler or a place for the result,
        RunError when the compilation fails
    """
    console = Console(highlight=False)
    base = compiled.base() if into is None else into
    if base is None:
        raise ConfigError("HIL_COMPILED=off: accepted a directory, or --into DIR")
    target = base / compiled.key_of(compiled.root())
    if target.is_dir():
        console.print(f"compiled already: {target}")
        return 0
    _check_tools()
    try:
        base.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{base}: {error.strerror}") from None
    with tempfile.TemporaryDirectory(prefix="hil-compile-") as name:
        work = Path(name)
        for package in _PACKAGES:
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(compiled.root() / package, work / package, ignore=ignored)
        with console.status("compiling, about two minutes"):
            done = subprocess.run(
                [sys.executable, "-P", "-m", "bench.dev.compile"], cwd=work, capture_output=True,
                text=True, check=False, env={**os.environ, "HIL_COMPILED": "off"},
            )  # fmt: skip
        if done.returncode:
            print(done.stdout + done.stderr, file=sys.stderr)
            raise RunError("compilation failed; what the compilers say stands above")
        target = base / compiled.key_of(work)
        _move(work / "out", target)
    if into is None:
        _forget(target)
    console.print(f"compiled {len(compiled.sources(compiled.root()))} modules: {target}")
    return 0


def _check_tools() -> None:
    """See that there is all it takes."""
    if find_spec("mypyc") is None or find_spec("setuptools") is None:
        raise MissingExtraError("mypyc", "compile", "hil compile")
    compiler = (sysconfig.get_config_var("CC") or "cc").split()[0]
    if shutil.which(compiler) is None:
        raise ConfigError(f"no C compiler {compiler} (Debian: apt-get install gcc python3-dev)")


def _move(built: Path, target: Path) -> None:
    """Put the result in its place as a whole: who looks finds all of it or nothing."""
    aside = Path(tempfile.mkdtemp(dir=target.parent, prefix=".new-"))
    shutil.copytree(built, aside, dirs_exist_ok=True)
    aside.chmod(0o755)
    try:
        aside.rename(target)
    except OSError:  # somebody else was faster
        shutil.rmtree(aside)
        if not target.is_dir():
            raise


def _forget(target: Path) -> None:
    """Keep the newest few results, so that going back and forth between versions is cheap."""
    library = f"{compiled.GROUP}__mypyc*"
    others = [path.parent for path in target.parent.glob(f"*/{library}") if path.parent != target]
    others = [path for path in others if re.fullmatch(r"[0-9a-f]{20}", path.name)]
    others.sort(key=lambda path: path.stat().st_mtime, reverse=True)
    for path in others[_KEPT - 1 :]:
        shutil.rmtree(path, ignore_errors=True)


def build(work: Path) -> None:
    """Compile the copy of the sources in the working directory into its directory `out`."""
    from mypyc.build import mypycify
    from setuptools import Distribution

    (work / "mypy.ini").write_text(_MYPY, encoding="utf-8")
    options = [f"--config-file={work / 'mypy.ini'}", f"--cache-dir={work / 'cache'}"]
    modules = [str(path) for path in compiled.sources(work)]
    extensions: Any = mypycify(
        [*options, *modules], opt_level="2", group_name=compiled.GROUP, target_dir=str(work / "c")
    )
    for extension in extensions:
        extension.extra_compile_args += _C_FLAGS
    _refuse_empty_tuples(work / "c")
    distribution = Distribution({"name": "fpeg-hil", "ext_modules": extensions})
    command: Any = distribution.get_command_obj("build_ext")
    command.build_lib, command.build_temp = str(work / "out"), str(work / "objects")
    command.ensure_finalized()
    command.run()


def _refuse_empty_tuples(generated: Path) -> None:
    """See that nothing is taken for the empty tuple alone: anything longer would be a TypeError.

    `a, b = (), a + b` is such a place: the type of the first value is taken for that of the other.
    """
    for path in generated.rglob("*.c"):
        text = path.read_text(encoding="utf-8")
        if (place := text.find(_EMPTY_TUPLE)) >= 0:
            near = re.search(r'CPy_AddTraceback\("([^"]+)", "(\w+)", (\d+)', text[place:])
            where = f"{near[1]}:{near[3]} ({near[2]})" if near else path.name
            raise SystemExit(f"{where}: () assigned where a longer tuple may stand; write it alone")


if __name__ == "__main__":
    build(Path.cwd())
