"""`hil compile`: the modules that run in every tick, translated to C by mypyc (hil/compiled.py).

It is done in a directory that stays: of a package that has not changed since, and of what is not
ours, nothing is done again. Each package is a library of its own, so that all processors have
something to build.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hashlib import blake2b
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from rich.console import Console

from bench.progress import steps
from bench.run import directory
from hil import compiled
from hil.errors import ConfigError, MissingExtraError, RunError

_PACKAGES: Final = ("hil", "plant", "controller", "drivers", "bench")
_KEPT: Final = 4
_MYPY: Final = "[mypy]\nplugins = pydantic.mypy\nignore_missing_imports = True\n"
# No fused multiply-add: its last bit is another than that of two operations.
_C_FLAGS: Final = ["-ffp-contract=off"]
_EMPTY_TUPLE: Final = 'CPy_TypeError("tuple[]"'
_STEP: Final = "step: "
"""What the compiling process says of its progress begins so."""


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
    directory.make_directory("--into", base)
    with steps("compiling") as tell, _workshop(base, tell) as work:
        _bring_sources(work)
        target = base / compiled.key_of(work)
        _compile(work, tell)
        _write_what_it_is_made_of(work)
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


@contextmanager
def _workshop(base: Path, tell: Callable[[str], None]) -> Iterator[Path]:
    """The directory of what is half done, for one at a time; what broke off begins anew."""
    tools = f"{Path(__file__).read_bytes()!r} {version('mypy')} {sys.version}"
    work = base / ".work"
    work.mkdir(exist_ok=True)
    with (work / "lock").open("a+") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            tell("waiting for another `hil compile`")
            fcntl.flock(lock, fcntl.LOCK_EX)
        inner = work / blake2b(tools.encode(), digest_size=8).hexdigest()
        begun = inner / "begun"
        for other in work.iterdir():
            if other.is_dir() and (other != inner or begun.exists()):
                shutil.rmtree(other)
        inner.mkdir(exist_ok=True)
        begun.touch()
        yield inner
        begun.unlink()


def _bring_sources(work: Path) -> None:
    """Make the copy of the sources what they are now; a file that is the same keeps its time."""
    for package in _PACKAGES:
        here, there = compiled.root() / package, work / package
        ours = {path.relative_to(here): path for path in here.rglob("*.py")}
        for path in there.rglob("*.py"):
            if path.relative_to(there) not in ours:
                path.unlink()
        for name, path in ours.items():
            copy, text = there / name, path.read_bytes()
            if not copy.is_file() or copy.read_bytes() != text:
                copy.parent.mkdir(parents=True, exist_ok=True)
                copy.write_bytes(text)


def _compile(work: Path, tell: Callable[[str], None]) -> None:
    """Run the compilers in a process that is told nothing of ours but the copy.

    Raises: RunError, with what they say on standard error
    """
    said = []
    with subprocess.Popen(
        [sys.executable, "-P", "-m", "bench.dev.compile"], cwd=work, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env={**os.environ, "HIL_COMPILED": "off"},
    ) as process:  # fmt: skip
        for line in process.stdout or ():
            if line.startswith(_STEP):
                tell(line.removeprefix(_STEP).strip())
            else:
                said.append(line)
    if process.returncode:
        print("".join(said), file=sys.stderr)
        raise RunError("compilation failed; what the compilers say stands above")


def _write_what_it_is_made_of(work: Path) -> None:
    """Leave beside the result what `hil.compiled` names an edited source by."""
    made = {"root": str(compiled.root()), "files": compiled.digests(work)}
    (work / "out" / compiled.MADE_OF).write_text(json.dumps(made), encoding="utf-8")


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
    library = f"{compiled.GROUP}*__mypyc*"
    others = {path.parent for path in target.parent.glob(f"*/{library}")} - {target}
    kept = sorted(
        (path for path in others if re.fullmatch(r"[0-9a-f]{20}", path.name)),
        key=lambda path: path.stat().st_mtime, reverse=True,
    )  # fmt: skip
    for path in kept[_KEPT - 1 :]:
        shutil.rmtree(path, ignore_errors=True)


def build(work: Path) -> None:
    """Compile the copy of the sources in the working directory into its directory `out`."""
    from setuptools import Distribution

    print(f"{_STEP}types and translation to C", flush=True)
    extensions = _translate(work)
    _refuse_empty_tuples(work / "c")
    distribution = Distribution({"name": "fpeg-hil", "ext_modules": extensions})
    command: Any = _steps(len(extensions))(distribution)
    command.build_lib, command.build_temp = str(work / "out"), str(work / "objects")
    command.parallel = os.cpu_count()
    command.ensure_finalized()
    command.run()
    wanted = set(command.get_outputs())
    for path in (work / "out").rglob("*.so"):
        if str(path) not in wanted:
            path.unlink()


def _translate(work: Path) -> list[Any]:
    """Have mypyc write the C of each package; the largest comes first, to be built the longest."""
    from mypyc.build import mypycify

    (work / "mypy.ini").write_text(_MYPY, encoding="utf-8")
    cache = work / "cache"
    for ours in (kept for package in _PACKAGES for kept in cache.glob(f"*/{package}")):
        shutil.rmtree(ours)  # mypyc 2.4 does not keep which fields of a class may be unset
    options = [f"--config-file={work / 'mypy.ini'}", f"--cache-dir={cache}", "--no-sqlite-cache"]
    sources = compiled.sources(work)
    groups: list[tuple[list[str], str | None]] = [
        ([str(path) for path in sources if path.parts[0] == package], f"{compiled.GROUP}_{package}")
        for package in _PACKAGES
    ]
    modules = [name for names, _ in groups for name in names]
    extensions: list[Any] = mypycify(
        [*options, *modules], opt_level="2", debug_level="0", separate=groups,
        target_dir=str(work / "c"),
    )  # fmt: skip
    for extension in extensions:
        extension.extra_compile_args += _C_FLAGS
    return sorted(extensions, key=lambda each: -Path(each.sources[0]).stat().st_size)


def _steps(total: int) -> Any:  # noqa: ANN401
    """Return the command of setuptools that builds, telling of each library that is done."""
    from setuptools.command.build_ext import build_ext

    done = 0

    class _Steps(build_ext):  # type: ignore[misc]
        def build_extension(self, ext: Any) -> None:  # noqa: ANN401
            nonlocal done
            super().build_extension(ext)
            done += 1
            if compiled.GROUP in ext.name or done == total:
                print(f"{_STEP}machine code, {done} of {total} libraries\n", end="", flush=True)

    return _Steps


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
