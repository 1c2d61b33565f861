"""A load that drifts is followed: what it will be is foreseen, and it teaches the laws nothing."""

import pytest

from bench.run.offline import simulate
from bench.run.resolve import resolve
from bench.run.scenarios import find
from controller.motion.load_estimate import LoadDrift
from hil.config.load import build, with_override
from hil.toml import read_toml

REF = 0.0155
BEGINS_S, LASTS_S, STROKE_S = 0.2, 0.4, 0.025


def ramp(law, model, rise):
    """Errors [mm] with their times [s] from the ramp's beginning on: a step a stroke."""
    tree = read_toml(find("steady"))
    steps = round(LASTS_S / STROKE_S)
    tree["events"] = {
        f"ramp_{k}": {
            "kind": "load-scale",
            "value": 1.0 + rise * (k + 1) / steps,
            "at_s": BEGINS_S + STROKE_S * k,
        }
        for k in range(steps)
    }
    settings = {"plant.model": model, "controller.name": law, "run.duration_s": 0.9}
    for key, value in settings.items():
        tree = with_override(tree, key, value)
    course = simulate(resolve(build(tree, "ramp")))
    return [
        (dc.t_ns * 1e-9, 1e3 * (abs(dc.x_m) - REF))
        for dc in course.dead_centres
        if dc.t_ns > BEGINS_S * 1e9
    ]


@pytest.mark.parametrize(("law", "peak_mm"), [("pdf", 0.2), ("machine", 0.05)])
@pytest.mark.parametrize("model", ["harmonic", "nonlinear"])
def test_a_ramp_of_the_load_is_followed(law, peak_mm, model):
    """+20 % in 0.4 s; a step of its staircase alone is worth 0.16 mm."""
    errors = ramp(law, model, 0.2)
    assert max(abs(e) for _, e in errors) < peak_mm
    assert all(abs(e) < 0.1 for t, e in errors if t > BEGINS_S + LASTS_S + 0.1)


@pytest.mark.parametrize(("model", "peak_mm"), [("harmonic", 0.25), ("nonlinear", 0.2)])
@pytest.mark.parametrize("rise", [0.2, -0.2])
def test_predictive_foresees_a_ramp_though_it_sees_the_load_once_a_stroke(model, peak_mm, rise):
    errors = ramp("predictive", model, rise)
    assert max(abs(e) for _, e in errors) < peak_mm
    assert all(abs(e) < 0.1 for t, e in errors if t > BEGINS_S + LASTS_S + 0.1)


def test_a_drift_is_what_lasts():
    """A step shows once, and what alternates never; a ramp shows from its second stroke on."""
    drift, seen = LoadDrift(), []
    for c in (800.0, 800.0, 900.0, 900.0, 890.0, 900.0, 910.0, 921.0, 930.0):
        drift = drift.after(c)
        seen.append(drift.lasting)
    assert seen == [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 10.0, 10.0, 9.0]
