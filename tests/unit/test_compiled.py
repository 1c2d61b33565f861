"""Compiled modules are used while they match the sources, and never after."""

import json
import shutil
import sys
from contextlib import suppress
from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest

from bench.cli import main
from bench.dev.compile import _bring_sources, _refuse_empty_tuples, _workshop
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


def compiled_as_it_is(copy):
    """Leave what `hil compile` leaves of the sources, without anything compiled."""
    built = copy / "built" / compiled.key_of(copy / "src")
    built.mkdir(parents=True)
    made = {"root": str(copy / "src"), "files": compiled.digests(copy / "src")}
    (built / compiled.MADE_OF).write_text(json.dumps(made))


def test_the_edited_sources_are_named(copy):
    assert compiled.edited() == []  # never compiled: nothing to warn of
    compiled_as_it_is(copy)
    assert compiled.edited() == []
    (copy / "src/plant/extra.py").touch()
    (copy / "src/controller/step.py").unlink()
    assert compiled.edited() == ["controller/step.py", "plant/extra.py"]


def test_another_checkout_is_not_warned(copy, monkeypatch):
    compiled_as_it_is(copy)
    shutil.copytree(copy / "src", copy / "other")
    (copy / "other/plant/loop.py").write_text("")
    monkeypatch.setattr(compiled, "root", lambda: copy / "other")
    assert compiled.edited() == []


def test_a_command_tells_of_an_edit_in_one_line(copy, monkeypatch, capsys):
    compiled_as_it_is(copy)
    (copy / "src/plant/loop.py").write_text("")
    monkeypatch.setattr(sys, "argv", ["hil", "--version"])
    with pytest.raises(SystemExit):
        main()
    assert capsys.readouterr().err == (
        "plant/loop.py changed since `hil compile`: the loops are interpreted until it is run "
        "again\n"
    )
    monkeypatch.setenv("HIL_COMPILED", "off")
    with pytest.raises(SystemExit):
        main()
    assert capsys.readouterr().err == ""


def test_sources_that_stay_the_same_keep_their_time(copy):
    work = copy / "work"
    _bring_sources(work)
    assert compiled.key_of(work) == compiled.key_of(copy / "src")
    kept = (work / "plant/rig/step.py").stat().st_mtime_ns
    (copy / "src/plant/loop.py").write_text("changed = 1\n")
    (copy / "src/plant/memory.py").unlink()
    _bring_sources(work)
    assert compiled.key_of(work) == compiled.key_of(copy / "src")
    assert (work / "plant/rig/step.py").stat().st_mtime_ns == kept


def test_what_broke_off_is_not_gone_on_with(tmp_path):
    with _workshop(tmp_path, print) as work:
        (work / "half").touch()
    with suppress(KeyboardInterrupt), _workshop(tmp_path, print) as work:
        assert (work / "half").exists()
        raise KeyboardInterrupt
    with _workshop(tmp_path, print) as work:
        assert not (work / "half").exists()


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
