"""The plant's configuration: ranges, overrides and event kinds."""

import pytest
from pydantic import ValidationError

from hil.config.plant import DisturbanceConfig, PlantConfig
from hil.config.prototypes import PROTOTYPES
from hil.wire.commands import read_event
from hil.wire.messages import GENERATOR
from plant.build import plant_params
from plant.engines.machine import MachineOrder
from plant.rig.charges import efficiency
from plant.rig.orders import obey


def test_defaults_are_the_newcastle_engine_and_the_harmonic_model():
    config = PlantConfig()
    assert (config.prototype, config.model) == ("nu", "harmonic")
    assert config.resolved_prototype() == PROTOTYPES["nu"]


def test_single_figures_replace_the_prototypes():
    config = PlantConfig(
        prototype="bit", load_coefficient_n_s_m=300.0, engine={"moving_mass_kg": 6.0}
    )
    prototype = config.resolved_prototype()
    assert (prototype.load_coefficient_n_s_m, prototype.moving_mass_kg) == (300.0, 6.0)
    assert prototype.bore_m == PROTOTYPES["bit"].bore_m


@pytest.mark.parametrize(
    "bad",
    [
        {"modle": "harmonic"},
        {"model": "cubic"},
        {"load_coefficient_n_s_m": -1.0},
        {"load_coefficient_n_s_m": float("nan")},
        {"engine": {"bore_m": 0.0}},
        {"engine": {"load": 1.0}},
        {"contact_restitution": 1.0},
        {"stale_s": 0.0},
        {"stale_ticks": 10},
        {"spark_window_s": 0.0},
    ],
)
def test_unknown_keys_and_values_out_of_range_are_refused(bad):
    with pytest.raises(ValidationError):
        PlantConfig.model_validate(bad)


@pytest.mark.parametrize(
    "good",
    [
        {"kind": "load-scale", "value": 0.85, "at_s": 1.1, "at_stroke_fraction": 0.25},
        {"kind": "efficiency", "until_s": 3.0},
        {"kind": "misfire", "count": 2, "cause": "fuel"},
        {"kind": "sensor-fault", "signal": "v", "duration_s": 0.1},
    ],
)
def test_every_kind_of_event_can_be_named(good):
    event = read_event(good)
    assert event.kind == good["kind"]
    assert event.at_s == good.get("at_s", 0.0)


@pytest.mark.parametrize(
    "bad",
    [
        {"kind": "earthquake"},
        {"kind": "load-scale"},
        {"kind": "load-scale", "value": -0.1},
        {"kind": "load-scale", "value": 0.85, "at_stroke_fraction": 1.5},
        {"kind": "load-scale", "value": 0.85, "at_s": 2.0, "until_s": 1.0},
        {"kind": "efficiency", "low": 0.9, "high": 0.8},
        {"kind": "misfire", "at_stroke_fraction": 0.5},
        {"kind": "sensor-fault", "signal": "p", "duration_s": 0.1},
        {"kind": "misfire", "at_s": -1.0},
    ],
)
def test_events_out_of_range_are_refused(bad):
    with pytest.raises(ValueError, match=r"accepted|must"):
        read_event(bad)


def test_the_load_scale_acts_beside_that_of_an_event():
    p = plant_params(PlantConfig(disturbance=DisturbanceConfig(load_scale=0.5)), 1_000_000)
    order = MachineOrder(GENERATOR, 0.0, 30.0)
    assert obey(p, order, 1.0).load_coefficient_n_s_m == 15.0
    assert obey(p, order, 3.0).load_coefficient_n_s_m == 45.0


def test_the_efficiency_is_drawn_where_no_event_gives_another():
    given = DisturbanceConfig(efficiency_low=0.9, efficiency_high=0.95)
    p = plant_params(PlantConfig(disturbance=given), 1_000_000, seed=3)
    drawn = [efficiency(p, None, index) for index in range(200)]
    assert all(0.9 <= value <= 0.95 for value in drawn)
    assert max(drawn) - min(drawn) > 0.04
    assert efficiency(p, (0.5, 0.5), 1) == 0.5
    fixed = DisturbanceConfig(efficiency_low=0.8, efficiency_high=0.8)
    assert efficiency(plant_params(PlantConfig(disturbance=fixed), 1_000_000), None, 1) == 0.8


def test_an_efficiency_that_is_no_range_is_refused():
    with pytest.raises(ValueError, match="accepted is at most efficiency_high"):
        DisturbanceConfig(efficiency_low=0.9, efficiency_high=0.8)
