"""The short way of commands to a running engine: the same as the declared one, at a fraction."""

import subprocess
import sys

import pytest
from typer.main import get_command

from bench import cli, entry
from bench.ending import run_to_end
from bench.live import status, steer

PLAIN = [
    ["get"],
    ["get", "controller.cascade", "plant.disturbance", "--json"],
    ["get", "--run", "a-run"],
    ["set", "controller.tdc_ref_m=0.015", "--config", "engine.toml"],
    ["set", "@set.toml", "tdc_ref_m=0.015", "--save", "all.toml", "--force"],
    ["start"],
    ["stop", "--run", "a-run"],
    ["status", "--json"],
]
LEFT = [
    [], ["run", "steady"], ["get", "--help"], ["get", "-h"], ["get", ""], ["get", "--run"],
    ["get", "--run", "--json"], ["get", "--run=a-run"], ["get", "--run", "a", "--config", "b"],
    ["get", "--json", "--json"], ["get", "--", "x"], ["set", "--save", ""], ["set", "--sve", "x"],
    ["start", "now"], ["status", "--watch"], ["status", "a-run"], ["get", "--force"],
]  # fmt: skip


@pytest.fixture
def called(monkeypatch):
    """What is called, with which arguments."""
    calls = []
    for module, name in ((steer, "change"), (steer, "tell_values"), (steer, "order"),
                         (status, "show")):  # fmt: skip
        monkeypatch.setattr(
            module, name, lambda *given, _n=name, **named: calls.append((_n, given, named)) or 0
        )
    return calls


@pytest.mark.parametrize("arguments", PLAIN, ids=" ".join)
def test_the_short_way_does_what_is_declared(arguments, called, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["hil", *arguments])
    assert entry.work_of(entry.read(arguments))() == 0
    assert run_to_end(lambda: cli.app(standalone_mode=False)) == 0
    short, declared = called
    assert short == declared


@pytest.mark.parametrize("arguments", LEFT, ids=" ".join)
def test_what_is_not_plain_is_left_to_the_declarations(arguments):
    assert entry.read(arguments) is None


def test_the_options_of_the_short_way_are_declared():
    commands = get_command(cli.app).commands
    for name, options in entry.OPTIONS.items():
        declared = {o: p for p in commands[name].params for o in p.opts if o.startswith("--")}
        assert set(options) <= declared.keys()
        assert set(declared) - set(options) <= {"--watch", "--help"}
        valued = {o for o in options if not declared[o].is_flag}
        assert valued == set(options) & set(entry.WITH_VALUE)


@pytest.mark.parametrize("name", ["get", "set x=1", "status", "start"])
def test_a_command_to_an_engine_imports_nothing_heavy(name, tmp_path):
    heavy = ("numpy", "pydantic", "typer", "rich", "mcap", "uvloop", "asyncio", "inspect",
             "hil.config.scenario", "hil.wire.frames.plant")  # fmt: skip
    run = tmp_path / "scenario.json"
    run.write_text('{"link": {"zenoh": {"engine": "nobody"}}}')
    code = (
        "import sys; from bench import entry\n"
        f"sys.argv = ['hil', *{name.split()!r}, '--run', {str(run)!r}]\n"
        "try: entry.main()\nexcept SystemExit as end: print(end.code, file=sys.stderr)\n"
        f"print([m for m in {heavy!r} if m in sys.modules])"
    )
    environment = {"HIL_RUNTIME_DIRECTORY": str(tmp_path), "HIL_COMPILED": "off"}
    done = subprocess.run(
        [sys.executable, "-c", code], check=False, capture_output=True, text=True, env=environment
    )
    assert done.stdout.strip() == "[]", done.stderr
