"""Compiled modules are used while they match the sources, and never after."""

import shutil
import sys
from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest

from bench.dev.compile import _refuse_empty_tuples
from hil import compiled


@pytest.fixture
def copy(tmp_path, monkeypatch):
    """A copy of the sources to edit, and nothing changed for the rest of the process."""
    for package in ("hil", "plant", "controller", "drivers", "bench"):
        shutil.copytree(compiled.root() / package, tmp_path / "src" / package)
    finders = [finder for finder in sys.meta_path if not isinstance(finder, compiled._Finder)]
    monkeypatch.setattr(sys, "meta_path", finders)
    monkeypatch.setattr(compiled, "root", lambda: tmp_path / "src")
    monkeypatch.setenv("HIL_COMPILED", str(tmp_path / "built"))
    return tmp_path


def test_modules_are_found_under_the_hash_of_their_sources(copy):
    built = copy / "built" / compiled.key_of(copy / "src") / "controller"
    built.mkdir(parents=True)
    (built / f"step{compiled._SUFFIX}").touch()
    compiled.use()
    assert compiled.in_force()
    spec = sys.meta_path[0].find_spec("controller.step", None)
    assert isinstance(spec, ModuleSpec)
    assert Path(str(spec.origin)).parent == built
    assert sys.meta_path[0].find_spec("controller.loop", None) is None


def test_an_edited_source_is_interpreted(copy):
    (copy / "built" / compiled.key_of(copy / "src")).mkdir(parents=True)
    with (copy / "src/controller/step.py").open("a") as file:
        file.write("\n")
    compiled.use()
    assert not compiled.in_force()


def test_what_is_not_compiled_does_not_change_the_key(copy):
    before = compiled.key_of(copy / "src")
    with (copy / "src/bench/cli.py").open("a") as file:
        file.write("\n")
    assert compiled.key_of(copy / "src") == before


def test_off_means_off(copy, monkeypatch):
    (copy / "built" / compiled.key_of(copy / "src")).mkdir(parents=True)
    monkeypatch.setenv("HIL_COMPILED", "off")
    compiled.use()
    assert not compiled.in_force()
    assert compiled.base() is None


def test_every_pattern_means_something():
    names = [str(path) for path in compiled.sources(compiled.root())]
    assert all(any(Path(n).match(pattern) for n in names) for pattern in compiled.PATTERNS)
    assert "controller/main.py" not in names


def test_a_place_for_the_empty_tuple_alone_is_refused(tmp_path):
    said = 'CPy_TypeError("tuple[]", r1);\nCPy_AddTraceback("plant/loop.py", "turn", 147, g);\n'
    (tmp_path / "one.c").write_text('CPy_TypeError("tuple[int]", r1);\n')
    _refuse_empty_tuples(tmp_path)
    (tmp_path / "two.c").write_text(said)
    with pytest.raises(SystemExit, match=r"plant/loop\.py:147 \(turn\): \(\) assigned where"):
        _refuse_empty_tuples(tmp_path)
