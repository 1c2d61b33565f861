"""Sensitivities found by disturbing an engine are its derivatives, and the laws work with them."""

import pytest

from bench.run.offline import simulate
from bench.run.resolve import resolve
from bench.run.scenarios import find
from bench.run.sensitivities import identify
from bench.studies.trial import Cell, read_off, scenario_of
from controller.build import make_params
from controller.motion.choice import make_laws, refusal
from controller.motion.maps.sensitivities import SensitivityMap, Table
from hil.config.controller import ControllerConfig
from hil.config.load import build, with_override
from hil.config.prototypes import NU
from hil.toml import read_toml

LOAD, REF = 810.0, 0.0155
LAWS_MADE = make_laws(ControllerConfig())


def resolved(model, *changes):
    tree = with_override(read_toml(find("steady")), "plant.model", model)
    for key, value in changes:
        tree = with_override(tree, key, value)
    return resolve(build(tree, model))


@pytest.fixture(scope="module", params=["harmonic", "nonlinear"])
def both(request):
    """The map that solves an engine's equation, and the sensitivities found by disturbing it."""
    scenario = resolved(request.param)
    params = make_params(scenario.controller, NU, scenario.loop.period_ns)
    return scenario.controller.preset.fuel_kg, params.stroke_map, identify(scenario)


def test_they_are_the_derivatives_of_a_whole_stroke(both):
    q, exact, found = both
    h = 0.01
    by_start = (exact.end_of(q, LOAD, REF + 1e-5) - exact.end_of(q, LOAD, REF - 1e-5)) / 2e-5
    by_fuel = (exact.end_of(q * (1 + h), LOAD, REF) - exact.end_of(q * (1 - h), LOAD, REF)) / 0.02
    by_load = (exact.end_of(q, LOAD * (1 + h), REF) - exact.end_of(q, LOAD * (1 - h), REF)) / 0.02
    assert found.end.start == pytest.approx(by_start, abs=0.03)
    assert found.end.fuel == pytest.approx(by_fuel, rel=0.04)
    assert found.end.load == pytest.approx(by_load, rel=0.02)
    assert found.stroke_s == pytest.approx(exact.stroke_s, abs=5e-6)


@pytest.mark.parametrize(("load", "speed"), [(0.97, 1.0), (1.0, 0.995), (1.03, 1.005)])
def test_the_rest_of_a_stroke_is_told_from_any_point_of_it(both, load, speed):
    q, exact, found = both
    believed = SensitivityMap(Table(found), found.mass_kg)
    s = found.stations
    for z, v, left_s in list(zip(s.z_m, s.v_m_s, s.left_s, strict=True))[16::6]:
        tau = found.stroke_s - left_s
        end_m, seconds = exact.travel(q, load * LOAD, z, speed * v, tau)
        told_m, told_s = believed.travel(q, load * LOAD, z, speed * v, tau)
        assert told_m == pytest.approx(end_m, abs=0.06e-3)
        assert told_s == pytest.approx(seconds, abs=0.15e-3)
        reached_s = exact.reach(q, load * LOAD, z, speed * v, tau, 0.015)
        assert believed.reach(q, load * LOAD, z, speed * v, tau, 0.015) == pytest.approx(
            reached_s, abs=0.15e-3
        )


def test_the_charge_for_a_target_reaches_it(both):
    believed = SensitivityMap(Table(both[2]), both[2].mass_kg)
    q = believed.charge_for(1.1 * LOAD, 0.0160, REF, both[0])
    assert believed.end_of(q, 1.1 * LOAD, 0.0160) == pytest.approx(REF, abs=1e-9)


@pytest.mark.parametrize(("load", "peak_mm"), [(0.85, 0.961), (1.15, 1.145)])  # its bound
def test_a_two_stroke_engine_is_kept_at_the_bound(load, peak_mm):
    """A step at a quarter of a stroke; without a map of this engine it never settled."""
    scenario = scenario_of(Cell("two-stroke", load, 0.25), "pdf", {})
    course = simulate(scenario)
    result = read_off(course, scenario.controller.tdc_ref_m)
    assert [event.code for event in course.events] == ["disturbance"]
    assert result.peak_mm <= 1.1 * peak_mm
    assert max(map(abs, result.errors_mm[1:])) < 0.2


def test_what_follows_the_force_within_a_stroke_is_refused_without_one(both):
    believed = SensitivityMap(Table(both[2]), both[2].mass_kg)
    assert "follows the force" in refusal("observer", LAWS_MADE, believed)
    assert refusal("pdf", LAWS_MADE, believed) == ""
