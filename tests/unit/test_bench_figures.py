import json
import math

import numpy as np
import pytest
from bench_logs import Centre, Made, alternating, make_run
from hypothesis import given
from hypothesis import strategies as st

from bench.api.judgement import cut_short
from bench.dev.golden_cases import LOCKSTEP, Case, scenario_for
from bench.judge.checks import judge
from bench.judge.figure_table import FIGURES
from bench.judge.figures import event_figures, figures, read_run
from bench.judge.punctuality import Histogram
from bench.judge.response import BAND_MM, settled_after_s
from bench.judge.response import response as response_of
from bench.judge.strokes import Strokes, set_point_at
from bench.judge.summary import summarise, summarise_fault, write
from bench.run.directory import RunFiles
from bench.run.memory.execution import execute_here
from hil.config.prototypes import NU

LOAD = (260_000_000, "disturbance", "load (load-scale) begins")
RESPONSE = [0.0] * 10 + [1.9, 1.2, -0.3, 0.05] + [0.02] * 20


@pytest.fixture(scope="module")
def response(tmp_path_factory):
    made = Made(
        alternating(RESPONSE), events=(LOAD,), missed=frozenset({7, 8}), late_ns=(10_000, 90_000)
    )
    scenario, files = make_run(
        tmp_path_factory.mktemp("run"), made, run__duration_s=1.0, events__load__at_s=0.25
    )
    return read_run(scenario, files)


def test_every_dead_centre_is_found_once_and_the_first_is_where_the_run_begins(response):
    strokes = response.strokes
    assert len(strokes.t_ns) == len(RESPONSE)
    assert strokes.error_m * 1e3 == pytest.approx(RESPONSE, abs=1e-9)


def test_settling_runs_to_the_first_dead_centre_after_the_last_outside(response):
    found = figures(response, None)
    assert found["settling_s"] == pytest.approx(14 * 0.025 - 0.26)
    assert found["tdc_error_peak_mm"] == pytest.approx(1.9)
    assert event_figures(response)[0]["t_s"] == pytest.approx(0.26)


def test_frequency_mean_and_sigma_are_those_of_the_strokes(response):
    found = figures(response, None)
    tdc_mm = 15.5 + np.array(RESPONSE)
    assert found["frequency_mean_hz"] == pytest.approx(20.0)
    assert found["tdc_mean_mm"] == pytest.approx(tdc_mm.mean())
    assert found["tdc_sigma_mm"] == pytest.approx(tdc_mm.std(ddof=1))
    assert found["fuel_total_mg"] == pytest.approx(2.8 * len(RESPONSE))


def test_frequency_is_that_of_whole_cycles(tmp_path):
    """Strokes of 10, 20, 30 and 40 ms in turn: two periods in 100 ms."""
    t_ns = np.cumsum([0, *([10_000_000, 20_000_000, 30_000_000, 40_000_000] * 9)])
    centres = [Centre(int(t), 0.0155 * (-1) ** (n + 1)) for n, t in enumerate(t_ns)]
    fires = [True, False, False, True]
    scenario, files = make_run(tmp_path, Made(centres), controller__timing__fires=fires)
    found = figures(read_run(scenario, files), None)
    assert found["frequency_mean_hz"] == pytest.approx(20.0)
    assert found["frequency_final_hz"] == pytest.approx(20.0)
    assert found["strokes"] == len(centres) - 1


def test_skipped_ticks_take_no_power_off_the_mean(tmp_path):
    made = Made(alternating(RESPONSE), missed=frozenset(range(500, 600)))
    found = figures(read_run(*make_run(tmp_path, made)), None)
    assert found["electric_power_mean_w"] == pytest.approx(100.0)
    assert found["electric_energy_j"] == pytest.approx(100.0)


def test_energy_is_power_times_time(response):
    found = figures(response, 0.5)
    assert found["electric_energy_j"] == pytest.approx(100.0 * 1.0)
    fuel_kg_s = found["fuel_mean_mg"] * 1e-6 * 2.0 * found["frequency_mean_hz"]
    assert found["brake_fuel_kg_kwh"] == pytest.approx(fuel_kg_s / 100.0 * 3.6e6)
    assert found["electric_power_mean_w"] == pytest.approx(100.0)
    assert found["speed_sim_s_per_wall_s"] == pytest.approx(2.0)


def test_lateness_is_in_microseconds_and_leaves_missed_ticks_out(response):
    found = figures(response, None)
    assert found["plant_missed_ticks"] == 2
    assert found["plant_late_max_us"] == pytest.approx(90.0)
    assert found["plant_late_p50_us"] == pytest.approx(10.0, rel=0.015)
    assert found["answered_next_tick_share"] == 1.0
    # driven by samples: lateness counts from the earliest one
    assert found["controller_late_max_us"] == pytest.approx(80.0)


def test_lockstep_has_no_lateness(tmp_path):
    scenario, files = make_run(tmp_path, Made(alternating(RESPONSE)), loop__clock="lockstep")
    assert figures(read_run(scenario, files), None)["plant_late_p99_us"] is None


def test_an_answer_two_ticks_old_is_not_one_in_the_next_tick(tmp_path):
    scenario, files = make_run(tmp_path, Made(alternating(RESPONSE), age=2))
    found = figures(read_run(scenario, files), None)
    assert found["answered_next_tick_share"] == 0.0
    assert found["sample_age_p50_ticks"] == found["sample_age_max_ticks"] == 2


def test_expectation_counts_from_the_event(response):
    tdc, mode, contacts = judge(response)
    assert (tdc.key, tdc.met) == ("within_mm", True)
    assert tdc.found == pytest.approx(0.09)
    assert mode.met
    assert contacts.met


@pytest.mark.parametrize(("after_s", "met"), [(0.0901, True), (0.0899, False)])
def test_settling_must_come_no_later_than_asked(tmp_path, after_s, met):
    made = Made(alternating(RESPONSE), events=(LOAD,))
    scenario, files = make_run(tmp_path, made, expect__tdc__after_s=after_s)
    assert judge(read_run(scenario, files))[0].met is met


def test_an_event_that_did_not_happen_meets_nothing(tmp_path):
    scenario, files = make_run(tmp_path, Made(alternating(RESPONSE)))
    check = judge(read_run(scenario, files))[0]
    assert not check.met
    assert check.text == "event 'load' did not happen"


def test_a_run_that_ends_before_the_judged_time_meets_nothing(tmp_path):
    made = Made(alternating(RESPONSE), events=((840_000_000, *LOAD[1:]),))
    scenario, files = make_run(tmp_path, made)
    assert not judge(read_run(scenario, files))[0].met


def test_the_last_mode_change_is_the_final_mode(tmp_path):
    events = ((1_000_000, "mode motoring", "a"), (2_000_000, "mode safe", "b"))
    made = Made(alternating(RESPONSE), events=(LOAD,), controller_events=events)
    scenario, files = make_run(tmp_path, made)
    data = read_run(scenario, files)
    assert data.mode == "safe"
    assert [c.met for c in judge(data)] == [True, False, True]


def test_every_figure_is_declared_and_every_declared_one_is_computed(response):
    told = summarise(
        response, {"processes": {"plant": {"loop_s": 2.0, "cpu_s": 1.0, "recorder_cpu_s": 0.5}}}
    )
    assert sorted(told["figures"]) == sorted(figure.name for figure in FIGURES)


def test_a_run_without_a_stroke_has_figures_too(tmp_path):
    scenario, files = make_run(tmp_path, Made([]))
    found = figures(read_run(scenario, files), None)
    assert found["strokes"] == 0
    assert found["tdc_mean_mm"] is None


def test_summary_is_json_without_nan(response, tmp_path):
    told = summarise(response, {"processes": {"plant": {"loop_s": 2.0}}})
    told["figures"]["tdc_mean_mm"] = math.nan
    write(told, tmp_path / "summary.json")
    read = json.loads((tmp_path / "summary.json").read_text(), parse_constant=pytest.fail)
    assert read["verdict"] == "met"
    assert read["figures"]["tdc_mean_mm"] is None
    assert read["figures"]["wall_s"] == 2.0


RAISE = {"kind": "set-point", "tdc_ref_m": 0.03, "at_s": 0.4}
REFUSED = (400_000_000, "command-refused", "tdc_ref_m=0.03 from scenario: accepted up to 0.0195")


def told_of(directory, said=(), plant_said=(LOAD,), **changes):
    """Summarise a synthetic run in which the controller said this; `changes` are whole tables."""
    made = Made(alternating(RESPONSE), events=plant_said, controller_events=said)
    scenario, files = make_run(directory, made, run__duration_s=1.0)
    changed = scenario.model_validate(scenario.model_dump() | changes)
    return summarise(read_run(changed, files), {})


def test_a_scenario_that_expects_nothing_is_not_met(tmp_path):
    told = told_of(tmp_path, expect={})
    assert (told["verdict"], told["exit_code"]) == ("none", 0)
    assert told["exit_reason"] == "nothing expected"


def test_a_refused_event_blocks_the_run_and_names_the_bound(tmp_path):
    told = told_of(tmp_path, (REFUSED,), events={"raise": RAISE}, expect={})
    assert (told["verdict"], told["exit_code"]) == ("blocked", 4)
    assert told["exit_reason"] == f"event 'raise' refused: {REFUSED[2]}"
    assert told["refused"] == [told["exit_reason"]]
    (event,) = told["events"]
    assert (event["t_s"], event["refused"]) == (None, REFUSED[2])


def test_an_order_that_the_plant_refused_blocks_the_run_too(tmp_path):
    text = "command from desk: count: Input should be greater than 0"
    told = told_of(tmp_path, (), (LOAD, (1, "command-refused", text)))
    assert (told["verdict"], told["exit_reason"]) == ("blocked", f"plant refused: {text}")


def test_verdicts_rest_on_every_line_however_many_others_there_are(tmp_path):
    many = tuple((tick * 100_000, "misfire", "left") for tick in range(2500))
    told = told_of(tmp_path, (REFUSED,), (*many, LOAD))
    assert told["events"][0]["t_s"] == pytest.approx(0.26)
    assert told["figures"]["misfires"] == 2500


def test_a_fault_keeps_its_reason_and_exit_code(response):
    told = summarise_fault(response.scenario, {"error": "plant died", "exit_code": 3})
    assert (told["verdict"], told["exit_code"], told["exit_reason"]) == ("fault", 3, "plant died")


def strokes_of(errors_mm):
    centres = alternating(errors_mm)[1:]
    t_ns, x_m, fuel = (np.array(c) for c in zip(*centres, strict=True))
    return Strokes(t_ns, x_m, fuel, np.full(len(t_ns), 0.0155))


@given(st.lists(st.floats(-2.0, 2.0), min_size=1, max_size=30))
def test_after_settling_every_dead_centre_is_inside(errors_mm):
    strokes = strokes_of(errors_mm)
    found = response_of(strokes, 0)
    settled_s = settled_after_s(found)
    if settled_s is None:
        assert abs(found.errors_mm[-1]) > BAND_MM
    else:
        later = zip(found.times_s, found.errors_mm, strict=True)
        assert all(abs(error) <= BAND_MM for t, error in later if t >= settled_s)


def test_set_points_hold_from_their_change_on():
    changes = (np.array([100, 200]), np.array([0.015, 0.014]))
    at = set_point_at(np.array([50, 100, 199, 200, 900]), 0.0155, changes)
    assert at.tolist() == [0.0155, 0.015, 0.015, 0.014, 0.014]


@given(st.lists(st.integers(0, 10**9), min_size=1, max_size=400))
def test_histogram_quantiles_are_those_of_the_values_to_a_bin(times_ns):
    histogram = Histogram()
    histogram.add(np.array(times_ns))
    exact = float(np.quantile(times_ns, 0.5, method="inverted_cdf"))
    assert histogram.total == len(times_ns)
    assert histogram.max_ns == max(times_ns)
    assert exact * 0.98 - 1.0 <= histogram.quantile_ns(0.5) <= max(exact * 1.02, 10.0) + 1.0


def test_dead_centres_that_do_not_move_on_are_not_counted_again(tmp_path):
    scenario, files = make_run(tmp_path, Made([Centre(0, -0.0155), Centre(25_000_000, 0.0155)]))
    assert len(read_run(scenario, files).strokes.t_ns) == 1


def test_a_log_that_is_not_whole_is_in_the_summary_with_what_its_recorder_saw(response):
    missing = {"end": "closed", "missing": "9 ticks found no room", "dropped": "9"}
    cut = response._replace(recorders={"plant": missing})
    assert summarise(cut, {})["run"]["recorders"] == {"plant": missing}
    assert "recorders" not in summarise(response, {})["run"]
    longer = response.scenario.model_copy(
        update={"run": response.scenario.run.model_copy(update={"duration_s": 2.0})}
    )
    told = cut_short(cut._replace(scenario=longer))
    assert told["error"] == ("the plant's log lacks 1000 of 2000 ticks: 9 ticks found no room")


def test_the_indicated_work_is_that_of_charges_that_burn_at_the_dead_centre(tmp_path):
    """W = E / (gamma - 1) ((Ls/(Ls-X))^(gamma-1) - (Ls/(Ls+X))^(gamma-1)) a stroke, eq. 5.9 ff."""
    scenario = scenario_for(Case("imep", "steady", (("run.duration_s", 0.4),)), LOCKSTEP)
    execute_here(scenario, RunFiles(tmp_path))
    found = figures(read_run(scenario, RunFiles(tmp_path)), None)
    x, size, less = NU.tdc_ref_m, NU.half_stroke_m, NU.gamma - 1.0
    ratios = (size / (size - x)) ** less - (size / (size + x)) ** less
    work_j = 2.8185e-6 * NU.energy_j_kg / less * ratios
    power_w = work_j * 2.0 * found["frequency_mean_hz"]
    assert found["indicated_power_mean_w"] == pytest.approx(power_w, rel=2e-3)
    assert found["imep_bar"] == pytest.approx(work_j / (NU.area_m2 * 2 * x) * 1e-5, rel=2e-3)
    fuel = 2.8185e-6 / work_j * 3.6e6
    assert found["indicated_fuel_kg_kwh"] == pytest.approx(fuel, rel=2e-3)
