"""Runs from Python: values, arrays, frames, and loops stepped by hand."""

import subprocess
import sys

import numpy as np
import pytest

import hil
from bench.dev.golden import record
from bench.run.directory import RunFiles
from bench.run.single_process import run as run_in_process
from hil import log as logs
from hil.errors import ConfigError


@pytest.fixture(scope="module")
def run():
    return hil.run("load-decrease", {"events.load.at_s": 0.2}, run__duration_s=0.6, seed=3)


def test_a_run_has_verdict_figures_and_every_check(run):
    assert run.verdict == "met"
    assert run.figures["strokes"] == len(run.dead_centre.t_ns)
    assert [check.key for check in run.checks] == ["within_mm", "mode", "contacts"]
    assert run.scenario.run.seed == 3


def test_topics_are_numpy_arrays_and_pandas_frames(run):
    assert len(run.truth.x_m) == 600
    assert run.stroke.tdc_m == pytest.approx(np.full(len(run.stroke.tdc_m), 0.0155), abs=0.002)
    assert run.controller.sensor.x_m == pytest.approx(run.plant.sensor.x_m, abs=1e-8)
    frame = run.pandas("stroke")
    assert frame.attrs["units"]["tdc_m"] == "m"
    assert run.signal("dead_centre.fuel_kg").value == pytest.approx(run.dead_centre.fuel_kg)


def test_a_run_can_be_held_against_more_expectations(run):
    run.expect(signal="plant.sensor.p_left_pa", max=100e5)
    with pytest.raises(hil.ExpectationError, match="at most 1000"):
        run.expect(signal="plant.sensor.p_left_pa", max=1e3)
    with pytest.raises(ConfigError, match="'mis' is no event"):
        run.check(never="mis")


def test_names_that_are_not_there_tell_those_that_are(run):
    with pytest.raises(AttributeError, match="a run has no strokes"):
        _ = run.strokes
    with pytest.raises(AttributeError, match=r"/stroke has no tdc; it has: index"):
        _ = run.stroke.tdc
    with pytest.raises(AttributeError, match="no topic nix; it has: sensor"):
        _ = run.plant.nix


def test_a_pair_is_stepped_by_hand():
    with hil.pair("steady") as pair:
        assert pair.advance(100) == 100
        assert pair.plant.state.tick == 100
        pair.order({"kind": "set-point", "tdc_ref_m": 0.0152})
        assert pair.advance_to(0.5) == 500
        assert pair.controller.state.set_points.tdc_ref_m == 0.0152
        assert pair.value("controller.stroke.tdc_ref_m") == 0.0152
        sensed = pair.value("plant.sensor.x_m")
        assert pair.value("plant.truth.x_m") == pytest.approx(sensed, abs=1e-9)


@pytest.mark.parametrize(
    ("scenario", "told"), [("nix", "scenario 'nix'"), ({"a": 1}, "a: unknown")]
)
def test_what_is_wrong_is_one_line(scenario, told):
    with pytest.raises(ConfigError, match=told):
        hil.run(scenario)


def test_logs_of_this_process_are_those_of_processes_to_the_bit(tmp_path):
    """A recorder without a process writes what one of its own writes."""
    scenario = hil.resolve("steady", run__duration_s=0.2)
    here, there = RunFiles(tmp_path / "here"), RunFiles(tmp_path / "there")
    for files in (here, there):
        files.directory.mkdir()
    record(scenario, here.directory)
    run_in_process(scenario, there.plant_log, there.controller_log)
    for name in ("plant_log", "controller_log"):
        with logs.open(getattr(here, name)) as a, logs.open(getattr(there, name)) as b:
            assert b"".join(a.raw()) == b"".join(b.raw())
            assert a.metadata["recorder"]["end"] == b.metadata["recorder"]["end"] == "closed"
            assert a.attachments.keys() == b.attachments.keys()


def test_hil_alone_imports_nothing_of_the_bench():
    code = "import hil, sys; sys.exit('bench.api' in sys.modules or 'numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
