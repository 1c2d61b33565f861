"""Scenarios as pytest items, and the fixtures; each test runs pytest in a directory of its own."""

import json
from xml.etree import ElementTree

import pytest

import bench.suite.background  # once for all of them: numpy cannot be loaded anew
import bench.suite.outputs
import bench.suite.rig  # noqa: F401

SHORT = """
include = "load-decrease"
[run]
duration_s = 0.5
[events.load]
at_s = 0.1
"""
GOOD = SHORT + '[expect.tdc]\nafter_s = 0.3\nrequirement = "REQ-1"\n'
BAD = SHORT + '[expect.p]\nsignal = "plant.sensor.p_left_pa"\nmax = 1e5\nrequirement = "REQ-2"\n'


@pytest.fixture
def inner(pytester, monkeypatch):
    """Run pytest in this process, with the plug-in and nothing of ours."""
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)

    def run(*arguments):
        plugins = ("-p", "no:hil", "-p", "bench.suite.plugin", "-p", "no:cacheprovider")
        return pytester.runpytest_inprocess(*plugins, *arguments)

    return run


def test_each_case_of_a_scenario_file_is_an_item(pytester, inner):
    pytester.makefile(".scenario.toml", good=GOOD + "[vary]\nevents.load.value = [0.85, 0.9]\n")
    result = inner("-v")
    result.assert_outcomes(passed=2)
    result.stdout.fnmatch_lines(["*good.scenario.toml::value=0.85*PASSED*"])


def test_what_is_not_met_is_told_in_a_line_an_expectation(pytester, inner):
    pytester.makefile(".scenario.toml", bad=BAD)
    result = inner("--junitxml=out.xml")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*NOT MET p: plant.sensor.p_left_pa at most 100000*"])
    properties = {
        p.get("name"): p.get("value")
        for p in ElementTree.parse(pytester.path / "out.xml").iter("property")
    }
    assert properties["requirement"] in ("REQ-2: not met", "REQ-1: met")
    assert float(properties["settling_s"]) > 0.0
    assert "hil-result" not in properties


def test_a_scenario_that_cannot_be_read_is_one_line(pytester, inner):
    pytester.makefile(".scenario.toml", wrong="[run]\nduration = 1\n", broken="= 1")
    result = inner("--continue-on-collection-errors")
    result.assert_outcomes(errors=1, failed=1)
    text = result.stdout.str()
    assert "run.duration: unknown key" in text
    assert "not a TOML file" in text
    assert "Traceback" not in text


def test_links_run_side_by_side_in_one_table_and_page(pytester, inner):
    pytester.makefile(".scenario.toml", good=GOOD)
    pytester.makepyfile(
        "def test_it(hil):\n    assert hil('steady', run__duration_s=0.1).verdict\n"
    )
    result = inner("--hil-link", "memory,zenoh", "--hil-out", "out")
    result.assert_outcomes(passed=4)
    result.stdout.fnmatch_lines(["*memory*zenoh*", "*good.scenario.toml*met*met*"])
    told = json.loads((pytester.path / "out/suite.json").read_text())
    assert told["requirements"] == {"REQ-1": True}
    assert [run["verdict"] for run in told["results"]].count("met") == 4
    page = (pytester.path / "out/suite.html").read_text()
    assert "4 of 4 met" in page
    for run in told["results"]:
        target = f"{run['directory'].rsplit('/', 1)[1]}/summary.json"
        assert target in page
        assert (pytester.path / "out" / target).is_file()


def test_an_unknown_link_is_refused(inner, pytester):
    pytester.makefile(".scenario.toml", good=GOOD)
    result = inner("--hil-link", "smoke")
    assert result.ret == pytest.ExitCode.USAGE_ERROR


RIG = """
import pytest
from hil.errors import ConfigError

@pytest.mark.hil_scenario("steady", model="rectangular")
def test_rig(rig):
    rig.wait(0.2)
    rig.set(tdc_ref_m=0.0152)
    took_s = rig.wait_for("controller.stroke.tdc_ref_m <= 0.0152", timeout_s=0.1)
    assert 0.0 < took_s <= 0.1
    rig.set({"controller.cascade.outer.kp": 20.0, "plant.disturbance.load_scale": 0.97})
    rig.wait(0.05)
    assert rig.engine.pair.controller.params.config.cascade.outer.kp == 20.0
    assert rig.engine.pair.plant.params.config.disturbance.load_scale == 0.97
    rig.fault("misfire", count=1)
    rig.wait_for(lambda rig: rig.read("plant.truth.disturbance") == 4, timeout_s=0.1)
    with pytest.raises(TimeoutError, match="plant.truth.x_m > 0.1 within 0.05 s: "):
        rig.wait_for("plant.truth.x_m > 0.1", timeout_s=0.05)
    with pytest.raises(ConfigError, match="tdc_ref_m = 9; accepted: 0.001 to 0.05"):
        rig.set(tdc_ref_m=9)
    with pytest.raises(ConfigError, match="accepted is SIGNAL < NUMBER"):
        rig.wait_for("plant.truth.x_m")
"""


def test_a_rig_is_steered_and_waited_for(pytester, inner):
    pytester.makepyfile(RIG)
    inner().assert_outcomes(passed=1)


@pytest.mark.slow
def test_workers_share_the_scenarios_and_one_table_tells_all(pytester, monkeypatch):
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)
    (pytester.path / "many.scenario.toml").write_text("seeds = 4\n" + GOOD)
    result = pytester.runpytest_subprocess(
        "-p", "no:cacheprovider", "-q", "-n", "2", "--hil-out", "out"
    )
    result.assert_outcomes(passed=4)
    told = json.loads((pytester.path / "out/suite.json").read_text())
    assert len({run["label"] for run in told["results"]}) == 4


LIVE = """
import pytest
from hil.errors import ConfigError

BORNE_S = 0.1  # a stall of a busy machine takes no engine
PATIENT = {"plant.stale_s": BORNE_S, "controller.limits.stale_s": BORNE_S}

@pytest.mark.hil_scenario("steady", model="harmonic", **PATIENT)
def test_rig(rig):
    rig.wait(0.2)
    rig.set(tdc_ref_m=0.0153)
    assert rig.wait_for("controller.stroke.tdc_ref_m <= 0.0153", timeout_s=2.0) >= 0.0
    rig.set({"plant.disturbance.load_scale": 0.97})
    rig.fault("misfire", count=1)
    rig.wait_for(lambda rig: rig.read("plant.truth.disturbance") == 4, timeout_s=2.0)
    with pytest.raises(ConfigError, match="tdc_ref_m=0.03 from"):
        rig.set(tdc_ref_m=0.03)
"""


@pytest.mark.slow
def test_a_rig_of_two_processes_is_steered_and_waited_for_as_one_in_memory(pytester, inner):
    pytester.makepyfile(LIVE)
    inner("--hil-link", "zenoh").assert_outcomes(passed=1)
