"""What `hil bench` makes of its measurements; the measuring itself is run small and once."""

import json
import struct

import numpy as np
import pytest

from bench.logs.replay import speed
from bench.measure import cyclictest, step_cost
from bench.measure.highest_rate import Trial, highest, line
from bench.measure.latency import (
    Found,
    Plan,
    histogram,
    measure_round,
    quantiles,
    ratios,
    run,
    summarise,
)
from bench.measure.latency_plot import write_picture
from bench.measure.pingpong import TimedLink, Times
from bench.measure.step_cost import measure
from hil.ports import Link

PRINTED = """# Histogram
000000 000000
000021 000007
000022 000002
# Total: 000000009
# Min Latencies: 00021
# Histogram Overflows: 00001
# Thread 0: 00005
"""


def found():
    late, trip = np.arange(1.0, 101.0), np.arange(100.0, 200.0)
    return Found(
        {
            "late cyclictest": [late, late], "late loop": [2.0 * late, late],
            "trip bare": [trip, trip], "trip link": [1.2 * trip, trip], "trip loop": [trip, trip],
        },
        {"missed": 3, "unanswered": 1},
        {"scheduling": "granted"},
    )  # fmt: skip


def copy_into(some):
    some.series.update(found().series)
    some.counts.update(found().counts)


def test_the_histogram_of_cyclictest_is_read():
    late = cyclictest.parse(PRINTED)
    assert sorted(late) == [21.0] * 7 + [22.0] * 2 + [20_000.0]
    assert len(cyclictest.parse("")) == 0


def test_ratios_compare_within_each_round():
    told = ratios(found())
    lateness = told["lateness p99, loop / cyclictest"]
    assert lateness["rounds"] == pytest.approx([2.0, 1.0])
    assert lateness["target"] == 2.0
    assert told["round trip p50, link / bare"]["rounds"] == pytest.approx([1.2, 1.0])
    assert told["round trip p99, loop / bare"]["pooled"] == pytest.approx(1.0)


def test_without_cyclictest_there_is_no_ratio_to_it():
    some = found()
    del some.series["late cyclictest"]
    assert "lateness p99, loop / cyclictest" not in ratios(some)


def test_a_histogram_counts_everything_once():
    values = np.array([0.0, 0.1, 3.0, 1e9])
    told = histogram(values)
    assert sum(told["counts"]) == len(values)
    assert len(told["edges_us"]) == len(told["counts"]) + 1
    assert quantiles(np.empty(0)) == {}


def test_the_summary_is_json_and_a_picture(tmp_path):
    told = summarise(Plan("zenoh", 1000, 2, 1.0), found())
    assert json.loads(json.dumps(told))["figures_us"]["late loop"]["max"] == 200.0
    assert told["beyond_a_period"]["trip bare"] == 0.0
    write_picture(told, tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.slow
@pytest.mark.parametrize("link", ["zenoh", "shm"])
def test_a_round_measures_every_series(link, monkeypatch):
    monkeypatch.setattr(cyclictest, "installed", lambda: False)
    some = Found({}, {}, {})
    measure_round(Plan(link, 500, 1, 0.6), some)
    assert set(some.series) == {"trip bare", "trip link", "trip loop", "late loop"}
    assert all(len(rounds[0]) for rounds in some.series.values())


def test_a_measurement_is_written(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(cyclictest, "installed", lambda: False)
    monkeypatch.setattr("bench.measure.latency.measure_round", lambda _plan, some: copy_into(some))
    assert run(Plan("zenoh", 500, 1, 0.6), tmp_path) == 0
    assert "apt install rt-tests" in capsys.readouterr().out
    assert {path.name for path in tmp_path.iterdir()} == {"latency.json", "latency.png"}


def test_the_highest_rate_is_the_highest_that_was_held():
    trials = [
        Trial(1000, 0.0, 1.0, 5.0, 0.0),
        Trial(2000, 2e-4, 0.99, 9.0, 1e-4),
        Trial(4000, 1e-4, 0.99, 9.0, None),
        Trial(5000, None, None, None, None),
    ]
    assert [trial.held for trial in trials] == [True, False, True, False]
    assert highest(trials) == 4000
    assert highest(trials[1:2]) is None
    assert line(trials[1]) == (
        "  2000 Hz  not held: missed 0.0200 %, answered in the next tick 99.000 %,"
        " late p99 9 µs; cyclictest beyond a period 0.0100 %"
    )
    assert "did not come to its end" in line(trials[3])


def test_every_part_of_a_tick_is_told(tmp_path):
    whole, parts = measure(200, [("controller.name", "observer")])
    assert whole.mean_us > 0.0
    assert {"controller: layers", "plant: packing records", "recorder rings"} <= set(parts)
    assert parts["controller: layers"] > 0.0


def test_every_fast_model_is_told_with_every_law_or_refused(monkeypatch):
    monkeypatch.setattr(step_cost, "LAWS", {"cascade": None, "machine": None})
    table = step_cost.measure_all(100)
    assert set(table) == {"closed-form", "harmonic", "rectangular", "nonlinear"}
    assert table["nonlinear"]["machine"] > 0.0
    assert table["closed-form"]["machine"] is None


class SlowLink(Link):
    """Answers come in the order given: None stands for nothing yet."""

    def __init__(self, *answers):
        self.answers = list(answers)

    def send(self, batch):
        pass

    def wait(self, _timeout_ns):
        return self.answers.pop(0) if self.answers else None

    def receive(self):
        return None


def test_a_late_answer_does_not_pass_for_the_one_that_is_timed():
    head = struct.Struct("<HQ")
    earlier, mine = (head.pack(0x200, tick << 12) for tick in (6, 7))
    times = Times()
    link = TimedLink(SlowLink(earlier, mine), 1_000_000, times)
    link.send(head.pack(0x100, 7 << 12))
    assert (len(times.trip_ns), times.unanswered) == (1, 0)
    assert [link.receive(), link.receive(), link.receive()] == [earlier, mine, None]
    link.send(head.pack(0x100, 8 << 12))
    assert times.unanswered == 1
    assert times.trip_ns[1] >= 800_000  # what was given up counts with its time


def test_a_run_and_the_replays_of_its_logs_are_told_in_times_of_real_time():
    found = dict(speed.measure(0.5, "harmonic", "cascade"))
    assert set(found) == {"run, both logs on", "replay of the plant", "replay of the controller"}
    assert min(found.values()) > 0.0
