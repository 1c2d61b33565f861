"""Expectations that no fault can break are found, and those that some fault breaks are not told."""

import pytest

from bench.run.resolve import resolve
from bench.run.scenarios import read
from bench.suite import prove
from bench.suite.mutants import mutants
from hil.config.check import check
from hil.config.load import build
from hil.config.resolved import Resolved

PRESSURE = "plant.sensor.p_left_pa"
VACUOUS = {
    "pressure-high": {"signal": PRESSURE, "max": 1e9},
    "pressure-low": {"signal": PRESSURE, "min": 0.0},
    "contacts": {"contacts": 100_000},
    "misfires": {"misfires_min": 0},
    "band": {"within_mm": 50.0, "event": "load"},
    "peak": {"peak_mm": 50.0, "after_s": 0.1},
    "log": {"never": "log-dropped"},
    "speed": {"signal": "plant.truth.v_m_s", "reference": 0.0, "tolerance": 1e3},
    "load": {"signal": "plant.truth.load_coefficient_n_s_m", "min": 0.0, "until_event": "load"},
    "scatter": {"signal": "dead_centre.error_m", "statistic": "spread", "max": 1.0},
}
SOUND = {
    "tdc": {"event": "load", "within_mm": 0.1, "after_s": 0.3},
    "engine": {"mode": "generating", "contacts": 0},
    "pressure": {"signal": PRESSURE, "max": 100e5},
    "power": {"signal": "plant.sensor.electric_power_w", "statistic": "mean", "min": 1000.0},
    "misfire": {"never": "misfire", "from_s": 0.1},
    "fuel": {"signal": "controller.stroke.fuel_kg", "reference": 2.8e-6, "tolerance": 1e-6,
             "from_s": 0.1},
    "safe": {"never": "mode safe"},
}  # fmt: skip


def scenario(expect):
    tree = read("load-decrease").model_dump() | {"expect": expect}
    tree["events"]["load"] = {"kind": "load-scale", "value": 0.85, "at_s": 0.2}
    tree["run"]["duration_s"] = 0.7
    return build(tree, "test")


def test_every_one_of_ten_planted_vacuous_expectations_is_found_and_no_other():
    proofs = prove.prove(scenario(VACUOUS | SOUND))
    vacuous = {proof.name.split(".")[1] for proof in proofs if not proof.broken_by}
    assert vacuous == set(VACUOUS)


def test_a_scenario_that_fails_by_itself_proves_nothing():
    with pytest.raises(prove.NotMetError, match="not met without any fault: at least 3 misfires"):
        prove.prove(scenario({"it": {"misfires_min": 3}}))


def test_the_command_names_what_is_vacuous(tmp_path, capsys):
    short = 'include = "steady"\n[run]\nduration_s = 0.4\n'
    (tmp_path / "good.toml").write_text(short)
    (tmp_path / "bad.toml").write_text(short + "[expect.many]\ncontacts = 9999\n")
    assert prove.run([str(tmp_path / "good.toml")], []) == 0
    assert prove.run([str(tmp_path / "bad.toml")], []) == 1
    out = capsys.readouterr().out
    assert "expect.engine.contacts: fails when" in out
    assert out.splitlines()[-1] == "vacuous, no fault breaks it: expect.many.contacts"


def test_faults_are_those_that_the_controller_is_not_told_of():
    whole = resolve(scenario(SOUND))
    found = [check(Resolved, m.tree, m.name) for m in mutants(whole, [0.1]) if "gives" in m.name]
    assert found
    assert all(mutant.controller == whole.controller for mutant in found)
