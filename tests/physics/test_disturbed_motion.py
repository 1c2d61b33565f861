"""Load steps, misfires and varying combustion through the step function (thesis section 5.3)."""

import statistics

import pytest
from plant_rig import Rig, make

from hil.config.prototypes import NU
from hil.wire.commands import read_event
from plant.engines.fast.constants import constants_of
from plant.engines.fast.limit_cycle import fuel_for_tdc

H = fuel_for_tdc(constants_of(NU, "harmonic"), 0.0155, 810.0)
R = fuel_for_tdc(constants_of(NU, "rectangular"), 0.0155, 810.0)
N = fuel_for_tdc(constants_of(NU, "nonlinear"), 0.0155, 810.0)


def load(value, **when):
    return read_event(dict(kind="load-scale", value=value, **when))


def after_step(model, fuel_kg, value, fraction, **options):
    events = {"load": load(value, at_s=0.2, at_stroke_fraction=fraction)}
    rig = Rig(make(model, fuel_kg, events=events, **options), fuel_kg).run(1.0)
    (changed,) = [e.t_ns for e in rig.events if e.code == "disturbance"]
    return rig, [abs(dc.x_m) * 1e3 for dc in rig.dead_centres if dc.t_ns > changed]


@pytest.mark.parametrize(
    ("model", "fuel", "value", "sequence", "final"),
    [
        ("harmonic", H, 0.85, (16.65, 17.84, 18.14), 15.5 / 0.85),
        ("harmonic", H, 1.05, (15.15, 14.82), 15.5 / 1.05),
        ("rectangular", R, 0.85, (), 17.803),
        ("rectangular", R, 1.05, (), 14.897),
        ("closed-form", H, 0.85, (15.5, 15.5 / 0.85), 15.5 / 0.85),
        ("nonlinear", N, 1.05, (), 14.692),
        ("nonlinear", N, 0.95, (), 16.6535),
    ],
)
def test_load_step_at_mid_stroke(model, fuel, value, sequence, final):
    _, tdc = after_step(model, fuel, value, 0.5)
    assert tdc[: len(sequence)] == pytest.approx(list(sequence), abs=0.0051)
    assert tdc[-1] == pytest.approx(final, abs=0.001)


def test_every_moment_of_a_load_step_leads_to_the_same_motion():
    final = {round(after_step("harmonic", H, 0.85, f)[1][-1], 6) for f in (0.0, 0.25, 0.5, 0.75)}
    assert len(final) == 1


def test_load_change_acts_at_its_fraction_of_the_undisturbed_stroke():
    rig, _ = after_step("harmonic", H, 0.85, 0.25)
    (changed,) = [e.t_ns for e in rig.events if e.code == "disturbance"]
    before = max(dc.t_ns for dc in rig.dead_centres if dc.t_ns <= changed)
    undisturbed = rig.dead_centres[1].t_ns - rig.dead_centres[0].t_ns
    assert before >= 200_000_000
    assert changed - before == pytest.approx(0.25 * undisturbed, abs=2.0)


def test_load_scale_ends_by_the_rule_it_began_by():
    events = {"load": load(0.85, at_s=0.2, until_s=0.6, at_stroke_fraction=0.5)}
    rig = Rig(make("harmonic", H, events=events), H).run(1.6)
    assert rig.codes() == ["disturbance", "disturbance"]
    assert max(rig.tdc_mm()) > 18.2
    assert rig.tdc_mm()[-1] == pytest.approx(15.5, abs=1e-4)


def test_nonlinear_engine_strikes_the_head_when_the_load_falls():
    rig, _ = after_step("nonlinear", N, 0.85, 0.5)
    assert rig.state.contacts > 0
    assert rig.codes().count("contact") == rig.state.contacts
    assert all(abs(dc.x_m) <= 0.020 for dc in rig.dead_centres)


@pytest.mark.parametrize(
    ("model", "period_ns"), [(m, p) for m in ("harmonic", "rectangular") for p in (200_000, 10_000)]
)
def test_dead_centres_do_not_depend_on_the_tick(model, period_ns):
    seconds = 0.4 if period_ns < 100_000 else 1.0
    fuel = H if model == "harmonic" else R
    events = {"load": load(0.85, at_s=0.1, at_stroke_fraction=0.3)}
    coarse = Rig(make(model, fuel, events=events), fuel).run(seconds)
    fine = Rig(make(model, fuel, events=events, period_ns=period_ns), fuel).run(seconds)
    assert len(fine.dead_centres) == len(coarse.dead_centres)
    for a, b in zip(coarse.dead_centres, fine.dead_centres, strict=True):
        assert a.x_m == pytest.approx(b.x_m, abs=1e-12)
        assert abs(a.t_ns - b.t_ns) <= 1


def test_nonlinear_dead_centres_hardly_depend_on_the_tick():
    events = {"load": load(1.05, at_s=0.1, at_stroke_fraction=0.3)}
    coarse = Rig(make("nonlinear", N, events=events), N).run(0.5)
    fine = Rig(make("nonlinear", N, events=events, period_ns=50_000), N).run(0.5)
    for a, b in zip(coarse.dead_centres, fine.dead_centres, strict=True):
        assert a.x_m == pytest.approx(b.x_m, abs=1e-9)
        assert abs(a.t_ns - b.t_ns) <= 10


def dead_centres_after_misfire(left):
    events = {
        "dead": read_event({"kind": "misfire", "at_s": 0.1, "count": 1000}),
        "load": load(left, at_s=0.1),
    }
    rig = Rig(make("harmonic", H, events=events), H).run(1.2)
    misfired = next(e.t_ns for e in rig.events if e.code == "misfire")
    return [abs(dc.x_m) * 1e3 for dc in rig.dead_centres if dc.t_ns > misfired]


@pytest.mark.parametrize(
    ("left", "extremum_mm", "strokes"),
    [
        (1.0, 0.003, 1),
        (0.75, 0.68, 2),
        (0.5, 2.91, 3),
        (0.25, 7.25, 7),
        (0.1, 11.5, 16),
        (0.0, 15.5, None),
    ],
)
def test_misfire_dies_out_as_the_load_left_allows(left, extremum_mm, strokes):
    tdc = dead_centres_after_misfire(left)
    assert tdc[0] == pytest.approx(extremum_mm, abs=0.05 if extremum_mm == 11.5 else 0.0051)
    under = [number for number, x in enumerate(tdc, 1) if x < 0.01 * 15.5]
    assert (under[0] if under else None) == strokes


def test_one_misfire_of_the_running_engine_is_told_and_outlived():
    events = {"dead": read_event({"kind": "misfire", "at_s": 0.1, "cause": "fuel"})}
    lit = {"least_pa": 1.1e5}  # the stroke behind the misfire compresses to hardly more
    engine = make("harmonic", H, events=events, load_coefficient_n_s_m=400.0, ignition=lit)
    rig = Rig(engine, H * 0.5).run(0.3)
    texts = [e.text for e in rig.events if e.code == "misfire"]
    assert texts[0].endswith("forced, no fuel")
    assert [dc.fuel_kg for dc in rig.dead_centres].count(0.0) >= 1
    assert rig.dead_centres[-1].fuel_kg > 0.0


def test_misfire_at_the_start_acts_on_the_first_stroke():
    events = {"dead": read_event({"kind": "misfire", "at_s": 0.0})}
    rig = Rig(make("harmonic", H, events=events), H)
    assert rig.codes() == ["misfire"] or rig.codes() == ["disturbance", "misfire"]
    assert rig.state.dead_centre.fuel_kg == 0.0
    assert rig.state.disturbances.mask == 4


@pytest.mark.parametrize(
    ("value", "mean_mm", "sigma_mm"), [(None, 15.256, 0.119), (0.85, 17.95, 0.13)]
)
def test_varying_efficiency_spreads_the_dead_centres(value, mean_mm, sigma_mm):
    events = {"eta": read_event({"kind": "efficiency"})}
    if value:
        events["load"] = load(value)
    rig = Rig(make("harmonic", H, events=events, period_ns=5_000_000), H).run(200.0)
    tdc = rig.tdc_mm()[20:]
    assert len(tdc) > 7800
    assert statistics.mean(tdc) == pytest.approx(mean_mm, abs=0.005)
    assert statistics.stdev(tdc) == pytest.approx(sigma_mm, abs=0.005 if value else 0.002)


def test_same_seed_same_run_and_another_seed_another():
    events = {"eta": read_event({"kind": "efficiency"})}
    runs = [
        Rig(make("harmonic", H, events=events, seed=seed), H).run(0.3).dead_centres
        for seed in (1, 1, 2)
    ]
    assert runs[0] == runs[1] != runs[2]
