"""What can be expected of a run: of signals, of events and their order, from when to when."""

from pathlib import Path

import numpy as np
import pytest
from bench_logs import Made, alternating, make_run

from bench.judge import signal_checks
from bench.judge.checks import judge
from bench.judge.figures import read_run
from bench.judge.signal_checks import Part
from bench.judge.traces import Trace
from bench.run.resolve import resolve
from bench.run.scenarios import read
from hil import log as logs
from hil.config.load import build
from hil.errors import ConfigError
from hil.event_codes import MEANINGS
from plant.rig import events

LOAD = (260_000_000, "disturbance", "load (load-scale) begins")
RAISE = {"kind": "set-point", "tdc_ref_m": 0.0152, "at_s": 0.6}
MISFIRES = tuple((t, "misfire", "left") for t in (300_000_000, 500_000_000))
MODES = ((310_000_000, "mode motoring", "a"), (700_000_000, "mode generating", "b"))
POWER = "plant.sensor.electric_power_w"  # 100 W throughout
SPEED = "plant.truth.v_m_s"  # cos(tick / 8)


def checks_of(directory, expectation, errors_mm=(0.0,) * 38, events=(LOAD, *MISFIRES), more=None):
    """Judge a synthetic run of a second by one expectation."""
    made = Made(alternating(list(errors_mm)), events=events, controller_events=MODES)
    scenario, files = make_run(directory, made, run__duration_s=1.0)
    tree = scenario.model_dump() | {"expect": {"it": expectation}}
    tree["events"] = tree["events"] | (more or {})
    return judge(read_run(build(tree, "test"), files))


def outcome(directory, **expectation):
    (check,) = checks_of(directory, expectation)
    return check


@pytest.mark.parametrize(
    ("expectation", "met"),
    [
        ({"signal": POWER, "max": 100.0}, True),
        ({"signal": POWER, "max": 99.9}, False),
        ({"signal": POWER, "min": 100.1}, False),
        ({"signal": SPEED, "max": 0.9, "from_s": 0.006, "until_s": 0.04}, True),  # cos falls
        ({"signal": SPEED, "max": 0.9, "from_s": 0.0, "until_s": 0.04}, False),
        ({"signal": SPEED, "statistic": "rms", "min": 0.70, "max": 0.72}, True),
        ({"signal": SPEED, "statistic": "peak-to-peak", "max": 1.9}, False),
        ({"signal": SPEED, "reference": "controller.sensor.v_m_s", "tolerance": 0.1}, False),
        ({"signal": SPEED, "reference": 0.0, "tolerance": 1.0}, True),
        ({"signal": POWER, "reference": 110.0, "tolerance": 0.1, "relative": True}, True),
        ({"signal": SPEED, "min": -1.0, "max": -0.99, "within_s": 0.03}, True),
        ({"signal": SPEED, "min": -1.0, "max": -0.99, "within_s": 0.01}, False),
        ({"event": "misfire", "then": "mode motoring", "within_s": 0.010}, True),
        ({"event": "misfire", "then": "mode motoring", "within_s": 0.009}, False),
        ({"event": "misfire", "then": "safe-state", "within_s": 0.5}, False),
        ({"never": "misfire"}, False),
        ({"never": "misfire", "until_event": "load"}, True),
        ({"never": "misfire", "event": "mode generating"}, True),
        ({"order": ["load", "misfire", "mode motoring", "misfire", "mode generating"]}, True),
        ({"order": ["misfire", "load"]}, False),
        ({"mode": "motoring", "until_s": 0.5}, True),
        ({"mode": "motoring"}, False),
        ({"misfires_min": 2}, True),
        ({"misfires_min": 2, "from_s": 0.4}, False),
        ({"signal": "dead_centre.error_m", "min": -1e-9, "max": 1e-9}, True),
    ],
)  # fmt: skip
def test_what_is_expected_is_met_or_not(tmp_path, expectation, met):
    found = checks_of(tmp_path, expectation)
    assert all(check.met for check in found) is met, [check.text for check in found]


def test_bounds_tell_where_they_were_first_left(tmp_path):
    check = outcome(tmp_path, signal=SPEED, min=-0.5)
    wanted = "plant.truth.v_m_s at least -0.5 throughout: -0.999999, first at 0.0170 s"
    assert check.text == wanted  # cos(17 / 8) is the first below


def test_a_later_set_point_does_not_fail_an_earlier_band(tmp_path):
    """The set point changes at 0.6 s; the stroke in between belongs to nobody's band."""
    errors = [0.0] * 10 + [1.0, 0.05] + [0.0] * 12 + [0.7, 0.4] + [0.0] * 10
    band = {"event": "load", "within_mm": 0.1, "after_s": 0.1}
    (check,) = checks_of(tmp_path, band, errors, more={"raise": RAISE})
    assert check.met
    ended = band | {"until_s": 0.3}
    (check,) = checks_of(tmp_path, ended, errors)
    assert check.met
    (check,) = checks_of(tmp_path, band, errors)
    assert not check.met


def test_a_band_that_is_ended_before_its_deadline_meets_nothing(tmp_path):
    (check,) = checks_of(
        tmp_path, {"event": "load", "within_mm": 0.1, "after_s": 0.2, "until_s": 0.1}
    )
    assert not check.met
    assert "the run ends before" in check.text


def test_a_window_without_a_value_meets_nothing(tmp_path):
    check = outcome(tmp_path, signal=POWER, max=1e9, from_s=5.0)
    assert (check.met, check.found) == (False, None)
    assert "no value of it there" in check.text


def test_requirements_are_carried_through(tmp_path):
    assert outcome(tmp_path, never="contact", requirement="REQ-7").requirement == "REQ-7"


def test_a_recorded_run_is_a_reference(tmp_path):
    earlier, now = tmp_path / "earlier", tmp_path / "now"
    earlier.mkdir()
    now.mkdir()
    scenario, files = make_run(earlier, Made(alternating([0.0] * 38)), run__duration_s=1.0)
    files.scenario.write_text(resolve(scenario).model_dump_json())
    demand = {"signal": SPEED, "recorded": str(earlier), "tolerance": 1e-12}
    assert outcome(now, **demand).met
    tdc = demand | {"signal": "dead_centre.tdc_m", "tolerance": 1e-5}
    assert not checks_of(now, tdc, [0.0] * 20 + [0.02] * 18)[0].met


def test_every_code_of_the_golden_logs_and_of_the_plant_is_declared():
    golden = Path(__file__).parents[1] / "golden"
    found = set(events.CODES)
    for path in golden.glob("*/*.mcap"):
        with logs.open(path) as log:
            found |= {record.code for record in log.records("/event")}
    assert found <= set(MEANINGS)


def first_order(t_end=1.0, tau=0.1, overshoot=0.0):
    """A step response 1 - exp(-t / tau), which goes beyond its end for a moment."""
    t = np.linspace(0.0, t_end, 1001)
    value = 1.0 - np.exp(-t / tau)
    value[300] += overshoot
    return Part(Trace((t * 1e9).astype(np.int64), value), 0.0, np.ones(1001), 0)


def test_rise_is_from_a_tenth_to_nine_tenths():
    """tau ln 9 of a first-order lag."""
    assert signal_checks.rise_s(first_order()) == pytest.approx(0.1 * np.log(9.0), abs=2e-3)


def test_settling_is_the_last_time_outside_the_band():
    """tau ln 50 to 2 %."""
    found = signal_checks.settling_s(first_order(), 0.02, relative=True)
    assert found == pytest.approx(0.1 * np.log(50.0), abs=2e-3)
    assert signal_checks.settling_s(first_order(0.1), 0.02, relative=True) is None


def test_overshoot_is_a_share_of_the_step():
    assert signal_checks.overshoot(first_order(overshoot=0.2)) == pytest.approx(0.15, abs=2e-3)


def test_a_signal_without_a_step_has_no_rise_and_no_overshoot():
    flat = Part(Trace(np.arange(5), np.ones(5)), 1.0, None, 0)
    assert signal_checks.rise_s(flat) is None
    assert signal_checks.overshoot(flat) is None


@pytest.mark.parametrize(
    ("expectation", "told"),
    [
        ({"max": 1.0}, "max: needs signal"),
        ({"signal": POWER}, "signal: needs one of min, max"),
        ({"signal": POWER, "tolerance": 1.0}, "tolerance: needs reference"),
        ({"signal": POWER, "min": 2.0, "max": 1.0}, "min must not exceed max"),
        ({"signal": POWER, "max": 1.0, "reference": 1.0}, "reference: needs tolerance"),
        ({"signal": POWER, "settling_s": 1.0, "reference": 1.0}, "settling_s: needs tolerance"),
        ({"then": "misfire"}, "then: needs within_s"),
        ({"within_s": 1.0}, "within_s: needs then"),
        ({"never": "mis-fire"}, "'mis-fire' is no event; known: load"),
        ({"contacts": 0, "from_s": 1.0, "until_s": 0.5}, "until_s must be greater"),
        ({"at_rest": True, "until_s": 0.5}, "at_rest: is of the end"),
    ],
)
def test_what_cannot_be_judged_is_refused(expectation, told):
    tree = read("load-decrease").model_dump() | {"expect": {"it": expectation}}
    with pytest.raises(ConfigError, match=told):
        build(tree, "test")


def test_an_unknown_signal_or_run_is_refused_before_the_run():
    tree = read("load-decrease").model_dump()
    unknown = tree | {"expect": {"it": {"signal": "plant.truth.x", "max": 1.0}}}
    with pytest.raises(ConfigError, match=r"expect\.it: signal 'plant\.truth\.x'.*truth\.x_m"):
        resolve(build(unknown, "test"))
    gone = {"signal": POWER, "recorded": "/nowhere", "tolerance": 1.0}
    with pytest.raises(ConfigError, match=r"expect\.it\.recorded: /nowhere: no finished run"):
        resolve(build(tree | {"expect": {"it": gone}}, "test"))
