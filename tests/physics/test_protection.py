"""Protection: what is measured once a stroke, and that each limit takes something back."""

import math

import pytest
from protection_rig import WATCHED, Protected

from controller.mode.start_restart import GENERATING, SAFE
from controller.observe.cylinder import compression_pa, knock_w_m2
from controller.supervision.protection import (
    BURNT,
    CONTRADICTION,
    DERATING,
    MISFIRED,
    NO_PRESSURE,
    Combustion,
    Guard,
    Protection,
)
from hil.config.controller import ControllerConfig
from hil.config.hardware import WindingConfig
from hil.config.prototypes import NU
from hil.wire.messages import CylinderPeak
from plant.engines.machine import Machine, MachineOrder
from plant.rig import indicator


def limits(**given):
    return tuple((f"controller.protection.{key}", value) for key, value in given.items())


def peaks(run):
    return [cycle.peak.p_peak_pa for cycle in run.cycles]


@pytest.fixture(scope="module")
def healthy():
    return Protected(0.6, WATCHED, *limits(fired_ratio=1.5))


def test_the_peak_of_a_cycle_is_that_of_a_charge_that_burns_at_the_dead_centre(healthy):
    """p = (p0 + E / (A Ls)) (Ls / (Ls - X))^gamma, E by eq. 5.36, at X itself."""
    burnt_pa = 2.8185e-6 * NU.energy_j_kg / (NU.area_m2 * NU.half_stroke_m)
    squeezed = (20.0 / 4.5) ** NU.gamma
    cycle = healthy.cycles[-1].peak
    assert cycle.p_peak_pa == pytest.approx((NU.p0_pa + burnt_pa) * squeezed, rel=2e-3)
    assert abs(cycle.x_peak_m) == pytest.approx(15.5e-3, abs=0.01e-3)
    assert cycle.rise_pa_s == pytest.approx(burnt_pa * squeezed / 1e-4, rel=2e-3)


def test_each_cycle_is_told_once_of_either_side_in_turn(healthy):
    sides = [cycle.peak.side for cycle in healthy.cycles]
    assert sides == [i % 2 for i in range(len(sides))]
    assert len(sides) == len(healthy.strokes)
    assert all(cycle.verdict == BURNT for cycle in healthy.cycles[1:])


def test_without_the_indicator_nothing_is_told():
    run = Protected(0.1)
    assert not run.cycles
    assert run.state.instruments.left.p_pa == 0.0


def test_the_ringing_intensity_is_that_of_its_definition():
    """I = (beta p')^2 / (2 gamma p) sqrt(gamma R T), T = T0 p V / (p0 V0)."""
    peak = CylinderPeak(1, 50e5, 0.015, 2e9)
    kelvin = 298.15 * 50.0 * 5.0 / 20.0
    sound = math.sqrt(1.35 * 287.0 * kelvin)
    expected = (0.05e-3 * 2e9) ** 2 / (2 * 1.35 * 50e5) * sound
    assert knock_w_m2(NU, peak) == pytest.approx(expected, rel=1e-12)
    assert compression_pa(NU, 0, 0.0155) == pytest.approx(1e5 * (20 / 4.5) ** 1.35, rel=1e-12)


def test_a_peak_that_is_too_high_takes_load_back_and_the_dead_centre_is_kept():
    run = Protected(3.0, WATCHED, *limits(peak_pa=56e5))
    assert run.mind.mode is GENERATING
    assert DERATING in run.codes
    assert run.mean(peaks(run)) == pytest.approx(0.9 * 56e5, rel=0.01)
    assert run.cycles[-1].load_share < 0.95
    assert run.strokes[-1].tdc_m == pytest.approx(15.5e-3, abs=0.1e-3)


def test_a_peak_beyond_the_limit_ends_in_the_safe_state_by_its_name():
    run = Protected(0.3, WATCHED, *limits(peak_pa=50e5, gain=0.0))
    assert run.mind.mode is SAFE
    assert "GENERATING -> SAFE: peak pressure beyond its limit" in [text for _, text in run.told]


def test_overspeed_takes_fuel_back():
    before = Protected(0.3)
    run = Protected(3.0, *limits(speed_hz=21.5))
    assert run.mind.mode is GENERATING
    assert before.strokes[-1].speed_hz == pytest.approx(19.94, abs=0.02)
    assert run.mean([stroke.speed_hz for stroke in run.strokes]) == pytest.approx(19.35, rel=0.01)
    assert run.strokes[-1].demand.fuel_kg < 0.97 * before.strokes[-1].demand.fuel_kg
    tripped = Protected(0.3, *limits(speed_hz=19.0, gain=0.0))
    assert tripped.mind.mode is SAFE


def test_a_winding_warms_up_by_its_heat_and_cools_by_its_surroundings():
    """T -> T_ambient + (F / K)^2 / G with C / G as time constant."""
    config = WindingConfig(on=True, heat_capacity_j_k=1000.0, cooling_w_k=5.0)
    machine, w = Machine(MachineOrder(2, 0.0, 800.0), 800.0, 0.0), indicator.begun(config)
    for _ in range(1000):
        w = indicator.warmed(w, config, machine, (1.0, 1.0), 0.1)
    end_k = config.ambient_k + (800.0 / 80.0) ** 2 / 5.0
    expected = end_k + (config.ambient_k - end_k) * math.exp(-100.0 * 5.0 / 1000.0)
    assert w.winding_k == pytest.approx(expected, rel=1e-9)
    assert w.copper_w == pytest.approx(100.0)


def test_a_winding_that_is_too_hot_takes_load_back_then_trips():
    hot = ("plant.winding.on", True), ("plant.winding.begin_k", 390.0)
    run = Protected(2.0, *hot, *limits(winding_k=420.0, gain=0.5))
    assert run.mind.mode is GENERATING
    assert run.mind.set_points.load_share < 0.8
    assert run.mind.set_points.load_n_s_m < 0.8 * 810.0
    tripped = Protected(0.3, *hot, *limits(winding_k=380.0))
    assert tripped.mind.mode is SAFE
    assert "GENERATING -> SAFE: winding beyond its limit" in [text for _, text in tripped.told]


def test_knock_retards_the_spark_of_an_engine_in_full():
    model = ("plant.model", "two-stroke"), ("controller.name", "open-loop")
    free = Protected(0.4, *model, WATCHED)
    run = Protected(0.8, *model, WATCHED, *limits(knock_w_m2=1.03e6, gain=0.3))
    assert run.mind.mode is GENERATING
    assert run.cycles[-1].retard_m > 0.05e-3
    assert run.cycles[-1].load_share == 1.0
    assert run.mean([c.knock_w_m2 for c in run.cycles], 4) < 0.97 * free.cycles[-1].knock_w_m2


def test_the_cycle_of_an_engine_in_full_is_that_of_table_4_3():
    """47 bar are printed; the calibration reaches 45.8."""
    run = Protected(0.25, ("plant.model", "two-stroke"), WATCHED, *limits(fired_ratio=1.5))
    assert run.cycles[-1].peak.p_peak_pa == pytest.approx(47e5, rel=0.06)
    assert all(cycle.verdict == BURNT for cycle in run.cycles[1:])


def test_a_misfire_is_told_by_the_pressure_too():
    once = Protected(
        0.6, WATCHED, *limits(fired_ratio=1.5),
        ("events.misfire", {"kind": "misfire", "at_s": 0.2, "count": 1, "cause": "spark"}),
    )  # fmt: skip
    assert NO_PRESSURE in once.codes
    assert [cycle.verdict for cycle in once.cycles].count(MISFIRED) == 1


def heard(guard, p, side, p_pa, verdict):
    """A charge at 15.5 mm, the motion's verdict on it, and its cycle."""
    p, _ = guard.ended(p, side, Combustion(2.8e-6, 0.0155), -1, 0.025)
    p, _ = guard.ended(p, 1 - side, Combustion(), verdict, 0.025)
    p, _, events = guard.heard(p, CylinderPeak(side, p_pa, 0.0155, 0.0))
    return p, [code for code, _ in events]


def test_charges_that_only_the_pressure_can_judge_lead_to_the_safe_state():
    guard = Guard(ControllerConfig.model_validate({"protection": {"fired_ratio": 1.5}}), NU)
    p = Protection()
    for _ in range(3):
        assert p.trip == 0
        p, codes = heard(guard, p, 0, 8e5, -1)
        assert codes == [NO_PRESSURE]
    assert p.trip > 0


def test_a_pressure_that_the_motion_contradicts_is_told_and_stops_nothing():
    guard = Guard(ControllerConfig.model_validate({"protection": {"fired_ratio": 1.5}}), NU)
    p = Protection()
    for _ in range(5):
        p, codes = heard(guard, p, 1, 8e5, BURNT)
        assert codes == [CONTRADICTION]
    assert p.trip == 0
