"""Places for results: a bad name or place is refused before the work, in one line."""

import math

import pytest

from bench import cli
from bench.run import directory
from bench.run.offline import Course
from bench.studies import trial, tune
from hil.errors import ConfigError
from hil.files import Output

FILES = {
    "--out .svg": ("engine", "sweep", "--over", "load", "--out"),
    "--out .csv": ("engine", "precision", "--out"),
    "--out .toml": ("tune", "cascade", "--search", "--out"),
    "--picture .svg": ("report", "{run}", "--picture"),
    "OUT .fmu": ("fmu", "export"),
    "--can-log .blf": ("run", "steady", "--can-log"),
}
DIRECTORIES = {
    "compare": ("compare", "--out"),
    "campaign": ("campaign", "robustness", "--out"),
    "latency": ("bench", "latency", "--out"),
    "rate": ("bench", "rate", "--out"),
    "step": ("bench", "step", "--out"),
    "recorder": ("bench", "recorder", "--out"),
    "soak": ("bench", "soak", "--out"),
    "run": ("run", "steady", "--out"),
    "golden": ("golden", "--update", "--directory"),
    "compile": ("compile", "--into"),
    "what-if": ("what-if", "{run}", "--from", "0.1s", "--out"),
}


@pytest.fixture
def refused(monkeypatch, capsys, tmp_path):
    """Run a command that must be refused; everything that would be work fails."""
    for name in ("plant.mcap", "controller.mcap", "scenario.json"):
        (tmp_path / "a-run").mkdir(exist_ok=True)
        (tmp_path / "a-run" / name).touch()
    for work in (
        "bench.studies.engine.sweep.sweep",
        "bench.studies.engine.precision.measure",
        "bench.studies.tune.looked_for",
        "bench.studies.trial.judge",
        "bench.studies.compare_command.compare",
        "bench.measure.latency.measure_round",
        "bench.measure.highest_rate.try_rate",
        "bench.measure.step_cost.measure",
        "bench.dev.golden.record",
        "bench.run.execution.execute",
        "bench.run.commands.execute",
        "bench.measure.soak.execute",
        "bench.fmu.export._compile",
        "bench.run.commands.read_run",
        "bench.logs.what_if.continuation.resume",
        "bench.dev.compile._move",
    ):
        monkeypatch.setattr(work, lambda *_a, _work=work, **_k: pytest.fail(f"{_work} was begun"))

    def run(*arguments):
        told = [a.format(run=tmp_path / "a-run") for a in arguments]
        monkeypatch.setattr("sys.argv", ["hil", *told])
        with pytest.raises(SystemExit) as end:
            cli.main()
        err = capsys.readouterr().err
        assert end.value.code == 2
        assert len(err.splitlines()) == 1, err
        return err

    return run


@pytest.mark.parametrize("what", FILES)
def test_a_file_with_a_bad_suffix_or_place(refused, tmp_path, what):
    option, suffix = what.split()
    bad = tmp_path / "x.foo"
    assert refused(*FILES[what], str(bad)).startswith(f"{option} {bad}: accepted is a name ending")
    nowhere = tmp_path / "none" / f"x{suffix}"
    assert refused(*FILES[what], str(nowhere)) == f"{option} {nowhere}: No such file or directory\n"
    assert [path.name for path in tmp_path.iterdir()] == ["a-run"]


@pytest.mark.parametrize("what", DIRECTORIES)
def test_a_directory_that_cannot_be(refused, tmp_path, what):
    (tmp_path / "file").touch()
    where = tmp_path / "file" / "x"
    command = DIRECTORIES[what]
    assert refused(*command, str(where)) == f"{command[-1]} {where}: Not a directory\n"


def test_a_check_leaves_no_trace(tmp_path):
    Output("--out", tmp_path / "x.svg").check(".svg")
    directory.check_directory("--out", tmp_path / "new" / "deep")
    assert not (tmp_path / "new").exists()
    directory.make_directory("--out", tmp_path / "new")
    assert not list((tmp_path / "new").iterdir())
    (tmp_path / "there.svg").write_text("kept")
    Output("--out", tmp_path / "there.svg", force=True).check(".svg")
    assert (tmp_path / "there.svg").read_text() == "kept"
    with pytest.raises(ConfigError, match="directory"):
        Output("--out", tmp_path / "new", force=True).check()


def test_gains_with_which_the_engine_stops_before_the_step_are_unsettled():
    course = Course([], [], "safe", [], [])
    result = trial.read_off(course, 0.0155)
    assert (result.errors_mm, result.settling_ms) == ((), math.inf)
    cells = trial.trial_of()
    assert tune.cost(cells, [result] * len(cells.every)) == tune.UNSETTLED


def test_a_search_comes_to_its_end():
    """Candidates with which the engine stops are among the first of it."""
    cells, others = trial.trial_of()
    before = tune.gains_in_force("cascade")
    found = tune.looked_for("cascade", before, 1, trial.Trial(cells[:1], others[:1]))
    assert found.keys() == before.keys()
