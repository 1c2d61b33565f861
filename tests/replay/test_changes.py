"""Parameters that change while the engine runs: when, with which effect, and again in a replay."""

import random

import numpy as np
import pytest
from runs import CHANGES

import hil.log
from bench.dev import golden
from bench.dev.golden_cases import Order
from bench.logs.replay.replay import replay_file
from bench.logs.what_if.continuation import Wish, continue_run
from bench.run import scenarios
from bench.run.resolve import resolve
from hil.log import Span
from hil.log.part import ALWAYS

BOTH = ("plant", "controller")


def recorded(directory, orders, *changes):
    """A run with orders over the command key; returns its directory."""
    directory.mkdir(parents=True, exist_ok=True)
    scenario = resolve(scenarios.read("load-decrease", [*CHANGES, *changes]))
    golden.record(scenario, directory, [Order(at_s, table) for at_s, table in orders])
    return directory


def change(**values):
    return {"kind": "set", **{key.replace("__", "."): value for key, value in values.items()}}


def told(directory, process, code="parameters"):
    with hil.log.open(directory / f"{process}.mcap") as log:
        return [(e.tick, e.text) for e in log.records("/event") if e.code == code]


def is_repeated(directory, span=ALWAYS):
    outcomes = [replay_file(directory / f"{process}.mcap", None, span) for process in BOTH]
    assert [outcome.found for outcome in outcomes] == [None, None]
    return True


RANGES = {
    "controller.cascade.outer.kp": (20.0, 45.0),
    "controller.cascade.outer.ki": (20.0, 60.0),
    "controller.cascade.inner.kp": (1e-6, 4e-6),
    "controller.timing.spark_advance_s": (1.0e-3, 2.0e-3),
    "controller.supervisory.load_coefficient_n_s_m": (800.0, 830.0),
    "controller.limits.fuel_max_kg": (5e-6, 7e-6),
    "controller.injector.dead_time_s": (0.79e-3, 0.81e-3),
    "controller.tdc_ref_m": (0.0153, 0.0157),
    "plant.sensors.noise_x_m": (0.0, 2e-6),
    "plant.sensors.offset_v_m_s": (-1e-3, 1e-3),
    "plant.injector.flow_scale_left": (0.98, 1.02),
    "plant.disturbance.load_scale": (0.95, 1.05),
    "plant.disturbance.efficiency_low": (0.97, 1.0),
    "plant.load_coefficient_n_s_m": (800.0, 900.0),
    "plant.spark_window_s": (2.8e-3, 3.2e-3),
}


def hundred_changes():
    """A hundred transactions, of one to three keys of either side or of both."""
    draw = random.Random(16)
    for number in range(100):
        keys = draw.sample(list(RANGES), draw.randint(1, 3))
        yield 0.02 + 0.0125 * number, {
            "kind": "set", **{key: draw.uniform(*RANGES[key]) for key in keys},
        }  # fmt: skip


@pytest.fixture(scope="module")
def changed_a_hundred_times(tmp_path_factory):
    directory = tmp_path_factory.mktemp("hundred")
    return recorded(directory, hundred_changes(), ("run.duration_s", 1.4))


def test_a_run_with_a_hundred_changes_is_repeated_bit_by_bit(changed_a_hundred_times):
    directory = changed_a_hundred_times
    counts = [len(told(directory, process)) for process in BOTH]
    assert sum(counts) > 100
    assert min(counts) > 40
    assert is_repeated(directory)


def test_from_a_snapshot_in_the_middle_too(changed_a_hundred_times):
    assert is_repeated(changed_a_hundred_times, Span(700_000_000, 1_300_000_000))


def test_a_change_acts_from_the_tick_behind_the_one_in_which_it_was_taken(tmp_path):
    gain = change(controller__cascade__outer__kp=0.1 + 0.2)
    directory = recorded(tmp_path / "run", [(0.1, gain)])
    ((tick, text),) = told(directory, "controller")
    assert tick == 101
    assert text.startswith("controller.cascade.outer.kp = 0.30000000000000004 (was 39.0); from ")
    before = recorded(tmp_path / "without", [])
    rows = []
    for each in (directory, before):
        with hil.log.open(each / "controller.mcap") as log:
            rows.append(log.array("/stroke"))
    (a, b) = rows
    first = np.flatnonzero(a["outer_p_m_s"] != b["outer_p_m_s"])
    assert first.size
    assert a["tick"][first[0]] > 100


def test_a_change_is_taken_whole_or_not_at_all(tmp_path):
    bad = change(controller__cascade__outer__kp=20.0, controller__cascade__outer__ki=1e9)
    directory = recorded(tmp_path, [(0.1, bad)])
    assert told(directory, "controller") == []
    ((tick, text),) = told(directory, "controller", "command-refused")
    assert tick == 100
    assert "controller.cascade.outer.ki = 1000000000.0; accepted: from -1000 to 1000" in text
    assert is_repeated(directory)


def test_what_is_a_whole_only_together_is_checked_so(tmp_path):
    orders = [
        (
            0.1,
            change(plant__disturbance__efficiency_low=0.9, plant__disturbance__efficiency_high=0.9),
        ),
        (0.2, change(plant__disturbance__efficiency_low=0.95)),
    ]
    directory = recorded(tmp_path, orders)
    assert len(told(directory, "plant")) == 1
    ((tick, text),) = told(directory, "plant", "command-refused")
    assert "accepted is at most efficiency_high = 0.9" in text
    assert tick == 200


def test_both_sides_change_at_one_tick(tmp_path):
    both = change(controller__cascade__outer__kp=30.0, plant__disturbance__load_scale=1.1)
    directory = recorded(tmp_path, [(0.1, both | {"at_tick": 150})])
    assert [told(directory, process)[0][0] for process in BOTH] == [150, 150]
    with hil.log.open(directory / "plant.mcap") as log:
        loads = log.array("/truth")["load_coefficient_n_s_m"]
    assert loads[150] == pytest.approx(1.1 * loads[149])
    assert is_repeated(directory)


def test_a_set_point_and_a_law_move_as_by_their_own_commands(tmp_path):
    keys = [(0.1, change(controller__tdc_ref_m=0.0152)), (0.3, change(controller__name="pdf"))]
    commands = [
        (0.101, {"kind": "set-point", "tdc_ref_m": 0.0152}), (0.301, {"kind": "law", "law": "pdf"}),
    ]  # fmt: skip
    by_key = recorded(tmp_path / "keys", keys)
    by_command = recorded(tmp_path / "commands", commands)
    with (
        hil.log.open(by_key / "controller.mcap") as a,
        hil.log.open(by_command / "controller.mcap") as b,
    ):
        one, other = a.array("/stroke"), b.array("/stroke")
    assert set(one["tdc_ref_m"]) >= {0.0155, 0.0152}
    assert np.allclose(one["tdc_m"][-1], other["tdc_m"][-1], atol=2e-5)
    assert is_repeated(by_key)
    assert is_repeated(by_command)


def test_the_load_slews_to_what_is_set(tmp_path):
    load = change(controller__supervisory__load_coefficient_n_s_m=700.0)
    directory = recorded(tmp_path, [(0.3, load)])
    with hil.log.open(directory / "controller.mcap") as log:
        loads = log.array("/actuator")["load_coefficient_n_s_m"]
    assert loads[-1] == 700.0
    assert -np.diff(loads).min() <= 2.001


def test_a_what_if_changes_what_had_been_changed_live(tmp_path):
    first = change(controller__cascade__outer__kp=30.0)
    directory = recorded(tmp_path / "run", [(0.1, first)])
    continue_run(
        directory, Wish("0.3s", ("controller.cascade.outer.kp=20.0",), None, tmp_path / "if")
    )
    ((_, text),) = told(tmp_path / "if", "controller")
    assert text.startswith("controller.cascade.outer.kp = 20.0 (was 30.0)")
    assert is_repeated(tmp_path / "if", Span())
