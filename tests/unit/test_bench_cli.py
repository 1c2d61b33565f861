import resource
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from bench import cli
from bench.measure import machine
from bench.run.conclusion import motion_rows, tick_rows
from bench.run.progress import Newest
from bench.run.scenarios import read

CLI = CliRunner()


def hil(*arguments):
    """Run `hil` as its entry point does, and return (exit code, standard error)."""
    done = subprocess.run(
        [sys.executable, "-m", "bench.cli", *arguments],
        check=False,
        capture_output=True,
        text=True,
        timeout=60,
    )
    return done.returncode, done.stdout, done.stderr


def test_help_imports_nothing_heavy():
    heavy = ("numpy", "pydantic", "zenoh", "matplotlib", "mcap", "uvloop", "rich")
    code = (
        "import sys; from typer.testing import CliRunner; from bench import cli\n"
        "assert CliRunner().invoke(cli.app, ['--help']).exit_code == 0\n"
        f"print([m for m in {heavy!r} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert done.stdout.strip() == "[]", done.stderr


def test_help_is_there_at_once():
    took_s = []
    for _ in range(3):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        assert hil("--help")[0] == 0
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        took_s.append(sum(after[:2]) - sum(before[:2]))
    assert min(took_s) < 0.6  # of processor; 0.13 s on a quiet machine


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["run", "no-such"], "accepted is a path to a .toml file, or: "),
        (["run", "steady", "--set", "plant.modle=x"], "plant.modle: unknown key; accepted here"),
        (["run", "steady", "--set", "loop.rate_hz=10"], "accepted: 100 to 20000"),
        (["run", "steady", "--set", "novalue"], "accepted is key=value"),
        (["run", "steady", "--set", "events.load.value=1"], "has no events.load"),
        (["run", "steady", "--model", "magic"], "plant.model"),
        (["run", "steady", "--link", "pigeon"], "'pigeon' is not one of 'zenoh'"),
        (["report", "/nowhere"], "no finished run"),
        (["plant", "--config", "/nowhere.toml"], "/nowhere.toml: No such file"),
    ],
)
def test_a_bad_argument_is_one_line_and_exit_2(arguments, told, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["hil", *arguments])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    out, err = capsys.readouterr()
    assert (ended.value.code, out) == (2, "")
    assert told in err.strip().splitlines()[-1]


def test_the_command_itself_ends_without_a_traceback():
    code, out, err = hil("run", "no-such")
    assert (code, out) == (2, "")
    assert len(err.strip().splitlines()) == 1


def test_version_is_told():
    assert CLI.invoke(cli.app, ["--version"]).output.startswith("fpeg-hil ")


def test_scenarios_are_listed():
    result = CLI.invoke(cli.app, ["scenarios"])
    assert result.exit_code == 0
    assert "misfire-unloaded" in result.output


def test_check_says_how_each_thing_stands():
    result = CLI.invoke(cli.app, ["check"])
    assert result.exit_code == 0
    assert all(what in result.output for what in ("Python", "CAN", "real-time priority"))


@pytest.mark.parametrize("look", machine.LOOKS, ids=lambda look: look.__name__)
def test_a_finding_that_can_be_mended_says_how(look):
    found = look()
    assert found.state in {machine.OK, machine.WORTH_KNOWING, machine.MISSING}
    assert found.text
    assert found.state != machine.OK or not found.mend


def test_live_figures_show_what_is_known():
    newest = Newest(read("steady"))
    assert newest.figures() == []
    newest.take({"process": "plant", "t_s": 0.5, "tdc_mm": 15.6, "late_us": 7})
    newest.take({"process": "controller", "t_s": 0.4, "tdc_ref_mm": 15.5, "mode": "generating"})
    assert newest.t_s == 0.5
    assert newest.figures() == [
        ("TDC", "15.600 mm (+0.100)"), ("", "generating"), ("late", "7 µs"),
    ]  # fmt: skip


def test_closing_figures_leave_out_what_has_no_value():
    assert ("settling", "not settled") in motion_rows({"settling_s": None})
    assert tick_rows({"plant_ticks": 10, "plant_missed_ticks": 0}) == [("ticks", "10, 0 missed")]
