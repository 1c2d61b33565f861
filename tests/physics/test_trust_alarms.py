"""No false alarm: samples of a sound engine are never taken for a fault of its sensors."""

import pytest

from bench.run import scenarios
from bench.run.resolve import resolve
from bench.trust.rig import Rig
from controller.motion.laws import LAWS
from controller.observe.plausibility import NAMES
from hil.errors import ConfigError

SCENARIOS = [path.stem for path in scenarios.packaged()]
LOST = {"misfire-unloaded": "machine takes up no power"}
"""What a scenario takes away is told by its name, and no false alarm."""


def rig_of(scenario, rate_hz, **changes):
    given = [("link.kind", "memory"), ("loop.rate_hz", rate_hz), *changes.items()]
    text = scenarios.find(scenario).read_text()
    events = (event for event in ("load", "misfire") if f"[events.{event}]" in text)
    given += [(f"events.{event}.at_s", 0.2) for event in events]
    return Rig(resolve(scenarios.read(scenario, given)))


def alarms(rig, seconds):
    for _ in range(round(seconds * rig.scenario.loop.rate_hz)):
        rig.turn()
    return [
        told for told in rig.told
        if told.code == "sample-doubted" or any(name and name in told.text for name in NAMES)
    ]  # fmt: skip


@pytest.mark.parametrize("scenario", SCENARIOS)
@pytest.mark.parametrize("model", ["harmonic", "rectangular", "nonlinear", "closed-form"])
def test_no_scenario_raises_an_alarm(scenario, model):
    found = alarms(rig_of(scenario, 1000, **{"plant.model": model}), 0.9)
    assert [told for told in found if LOST.get(scenario, "-") not in told.text] == []


@pytest.mark.parametrize("law", [name for name in LAWS if name != "cycle"])  # four-stroke only
@pytest.mark.parametrize("rate_hz", [500, 1000, 4000])
def test_no_law_raises_an_alarm(law, rate_hz):
    for scenario in ("load-decrease", "load-increase"):
        assert alarms(rig_of(scenario, rate_hz, **{"controller.name": law}), 0.5) == []


@pytest.mark.parametrize("prototype", ["nu", "bit", "gas-spring", "mechanical-spring", "opposed"])
@pytest.mark.parametrize("model", ["harmonic", "two-stroke", "four-stroke", "starting", "motoring"])
def test_no_engine_raises_an_alarm(prototype, model):
    try:
        rig = rig_of("variations", 1000, **{"plant.prototype": prototype, "plant.model": model})
    except ConfigError:
        pytest.skip("no such engine")
    assert alarms(rig, 0.5) == []


def test_noise_of_a_good_sensor_raises_no_alarm():
    noise = {"noise_x_m": 2e-5, "noise_v_m_s": 2e-2, "resolution_x_m": 1e-5}
    sensors = {f"plant.sensors.{name}": value for name, value in noise.items()}
    assert alarms(rig_of("variations", 1000, **sensors), 1.0) == []
