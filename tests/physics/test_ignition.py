"""Ignition: what catches fire, what its moment is worth, and a last correction by it."""

import math

import pytest

from bench.run import scenarios
from bench.run.offline import simulate
from bench.run.resolve import resolve
from bench.studies.engine.ignition import compression, estimates
from hil.config.charge.ignition import IgnitionConfig
from hil.config.load import build, with_override
from hil.config.prototypes import BIT, NU
from hil.errors import ConfigError
from plant.engines.fast.ignition import best_lead, burnt, factors, knock_limited_lead, work
from plant.rig.ignition import Ignition, ignition_of, place_m


def scenario(name="steady", **changes):
    tree = {**scenarios.tree_of(name), "expect": {}}
    for key, value in changes.items():
        tree = with_override(tree, key, value)
    return resolve(build(tree, name))


def ends_mm(course, since_s=0.0):
    return [1e3 * abs(dc.x_m) for dc in course.dead_centres if dc.t_ns > since_s * 1e9]


def test_the_work_is_that_of_equation_3_12():
    """dp/dt = ((gamma-1) dQ/dt - gamma p dV/dt) / V in small steps, less what no heat gives."""
    c, lead_s = compression("nu", 0.0155, 810.0)[0], 2.0e-3
    steps, found = 40_000, []
    for heat_j in (0.0, c.heat_j):
        quarter_s = 0.5 * math.pi / c.omega
        h, p, done = 2.0 * quarter_s / steps, c.p0_pa, 0.0
        for n in range(steps):
            t = -quarter_s + n * h
            v0 = c.area_m2 * c.half_m * c.share(t)
            v1 = c.area_m2 * c.half_m * c.share(t + h)
            dq = heat_j * (burnt((t + h + lead_s) / c.burn_s) - burnt((t + lead_s) / c.burn_s))
            p1 = (p + (c.gamma - 1.0) * dq / v0) * (v0 / v1) ** c.gamma
            done += 0.5 * (p + p1) * (v1 - v0)
            p = p1
        found.append(done)
    assert (found[1] - found[0]) / c.heat_j == pytest.approx(work(c, lead_s), rel=2e-3)


def test_the_planned_spark_has_exactly_its_work_and_both_sides_of_the_best_one_less():
    c = compression("nu", 0.0155, 810.0)[0]
    best_s = best_lead(c, 8e-3)
    leads = (0.5e-3, 1.5e-3, best_s, 6e-3)
    late, planned, best, early = factors(c, 1.5e-3, leads)
    assert planned == 1.0
    assert late < planned < best
    assert early < late
    assert Ignition(0.0, 2e5, leads, (late, planned, best, early)).work_of(1.5e6) == 1.0


def test_more_charge_knocks_earlier():
    limits = [knock_limited_lead(compression("nu", tdc_m, 810.0)[0], 8e-3)
              for tdc_m in (0.0155, 0.0165, 0.0175)]  # fmt: skip
    assert limits == sorted(limits, reverse=True)
    assert limits[0] > limits[-1]


@pytest.mark.parametrize("engine", [NU, BIT])
def test_a_charge_catches_fire_where_it_is_compressed_enough(engine):
    known = ignition_of(IgnitionConfig(least_pa=3e5), engine)
    ratio = engine.half_stroke_m / (engine.half_stroke_m - known.from_m)
    assert engine.p0_pa * ratio**engine.gamma == pytest.approx(3e5)
    assert known.objection(known.from_m - 1e-6).startswith("early spark")
    assert not known.objection(known.from_m)


def test_the_place_of_a_spark_is_found_within_a_tick():
    w, x = 2.0 * math.pi * 20.0, 0.0155

    def at(t):
        return x * math.sin(w * t), x * w * math.cos(w * t)

    found = place_m(*at(0.010), *at(0.011), 1e-3, 0.4e-3)
    assert found == pytest.approx(at(0.0104)[0], abs=1e-7)


def test_the_beijing_engine_burns_at_its_28_mm():
    """App. I 4.2; at this speed that is 3.4 ms ahead of the dead centre, beyond the old window."""
    changes = {"plant.prototype": "bit", "controller.timing.spark_position_m": 0.028}
    course = simulate(scenario(**changes, **{"run.duration_s": 0.6}))
    assert not course.events
    assert ends_mm(course)[-1] == pytest.approx(30.0, abs=0.02)


def test_an_early_spark_moves_the_dead_centre_where_the_map_says():
    settled = {}
    for place_m_ in (None, 0.0125):
        changes = {"plant.ignition.work": "map", "controller.name": "open-loop"}
        if place_m_ is not None:
            changes["controller.timing.spark_position_m"] = place_m_
        course = simulate(scenario(**changes, **{"run.duration_s": 0.9}))
        last = course.dead_centres[-1]
        settled[place_m_] = (abs(last.x_m), last.efficiency)
    (planned_m, planned), (early_m, early) = settled[None], settled[0.0125]
    assert planned == pytest.approx(1.0, abs=2e-3)
    assert early < 0.96
    assert early_m / planned_m == pytest.approx(1.0 - 0.65 * (1.0 - early), abs=5e-3)


def test_a_spark_corrects_what_fuel_no_longer_can():
    """With port injection the charge of the next dead centre is settled when its load has gone."""
    second = {}
    for trims in (False, True):
        changes = {"plant.injector.kind": "port", "plant.ignition.work": "map",
                   "controller.name": "pdf", "controller.timing.spark_trim": trims,
                   "run.duration_s": 1.4}  # fmt: skip
        after = ends_mm(simulate(scenario("load-decrease", **changes)), 1.1)
        second[trims] = max(abs(x - 15.5) for x in after)
    assert second[True] < 0.85 * second[False]


@pytest.mark.parametrize("model", ["harmonic", "nonlinear"])
def test_dead_centres_are_estimated_from_fuel_and_ignition_within_3_percent(model):
    for found in estimates(model, (1.03,)):
        assert found.estimated_m == pytest.approx(found.settled_m, rel=0.008)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"controller.timing.spark_trim": True}, "plant.ignition.work = 'map'"),
        pytest.param({"plant.model": "two-stroke", "plant.ignition.work": "map"},
                     "accepted there: constant", marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_what_has_no_map_is_refused_by_name(changes, told):
    with pytest.raises(ConfigError, match=told):
        scenario(**changes)
