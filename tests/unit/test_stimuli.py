"""Courses of parameters over time, and the conditions by which they begin and end."""

import math

import numpy as np
import pytest

import hil
from bench.logs.replay.replay import replay_file
from bench.run.scenarios import read
from hil import snapshot
from hil.config.check import check
from hil.config.load import build
from hil.config.suite.stimulus import Stimulus
from hil.errors import ConfigError
from hil.log import Span
from hil.log.part import ALWAYS
from hil.stimuli.courses import extremes, own_end_s, value_at
from hil.stimuli.player import Player, PlayerMemory

KEY = "plant.disturbance.load_scale"
OTHER = "plant.sensors.offset_x_m"
BASE = {KEY: 1.0, OTHER: 0.0}
PERIOD_NS = 1_000_000


def stimulus(**given):
    return check(Stimulus, {"parameter": KEY, **given}, "test")


def course(given, t_s, base=1.0, tick=0):
    return value_at(given, t_s, base, tick, 1, 0)


def test_a_ramp_goes_from_what_is_there_to_its_value_and_stays():
    ramp = stimulus(kind="ramp", value=1.5, over_s=0.2)
    assert [course(ramp, t) for t in (0.0, 0.1, 0.2, 9.0)] == [1.0, 1.25, 1.5, 1.5]
    from_its_own = stimulus(kind="ramp", start=2.0, value=1.0, over_s=0.1)
    assert course(from_its_own, 0.05) == 1.5
    assert extremes(ramp, 1.0) == (1.0, 1.5)


def test_a_sine_swings_about_its_middle():
    sine = stimulus(kind="sine", amplitude=0.2, frequency_hz=5.0, phase_rad=math.pi / 2)
    assert course(sine, 0.0) == pytest.approx(1.2)
    assert course(sine, 0.1) == pytest.approx(0.8)
    assert extremes(sine, 1.0) == (0.8, 1.2)


def test_noise_is_a_function_of_seed_and_tick_and_has_its_deviation():
    noise = stimulus(kind="noise", sigma=0.1)
    values = [value_at(noise, 0.0, 1.0, tick, 7, 3) for tick in range(4000)]
    assert values == [value_at(noise, 0.0, 1.0, tick, 7, 3) for tick in range(4000)]
    mean = sum(values) / len(values)
    assert mean == pytest.approx(1.0, abs=0.01)
    assert math.dist(values, [mean] * 4000) / math.sqrt(4000) == pytest.approx(0.1, rel=0.05)
    low, high = extremes(noise, 1.0)
    assert low <= min(values) < max(values) <= high
    held = stimulus(kind="noise", sigma=0.1, hold_s=0.01)
    assert (
        course(held, 0.001, tick=1) == course(held, 0.009, tick=9) != course(held, 0.011, tick=11)
    )


def test_playback_holds_its_samples_or_joins_them():
    samples = ((0.0, 0.1, 0.3), (1.0, 2.0, 0.0))
    held = stimulus(kind="playback", samples=samples, scale=2.0, offset=1.0)
    assert [course(held, t) for t in (0.0, 0.099, 0.1, 0.5)] == [3.0, 3.0, 5.0, 1.0]
    line = stimulus(kind="playback", samples=samples, between="line")
    assert course(line, 0.2) == pytest.approx(1.0)
    assert own_end_s(line) == 0.3
    assert extremes(held, 9.0) == (1.0, 5.0)


def play(stimuli, ticks=1000, read=lambda name, tick: 0.0, happened=lambda tick: ()):
    """Return (tick, changes, commands, told) of every tick in which something is new."""
    player, found = Player(stimuli, PERIOD_NS, 1, BASE), []
    for tick in range(ticks):
        taken = player.take(tick, lambda name, tick=tick: read(name, tick), happened(tick))
        if any(taken):
            found.append((tick, taken.changes, taken.commands, taken.told))
    return found


def test_a_step_begins_in_its_tick_and_gives_back_what_was_there():
    found = play({"load": stimulus(kind="step", value=0.8, at_s=0.1, duration_s=0.05)})
    assert found == [
        (100, {KEY: 0.8}, [], ["load (step) begins"]),
        (150, {KEY: 1.0}, [], ["load ends"]),
    ]


def test_a_value_may_stay_when_its_stimulus_is_over():
    found = play({"a": stimulus(kind="step", value=0.8, at_s=0.1, until_s=0.15, hold=True)})
    assert [(tick, changes) for tick, changes, _, _ in found] == [(100, {KEY: 0.8}), (150, {})]


def test_pulses_repeat_each_at_its_own_time():
    found = play({"p": stimulus(kind="pulse", value=2.0, width_s=0.01, repeat=3, every_s=0.1)})
    assert [tick for tick, *_ in found] == [0, 10, 100, 110, 200, 210]


def test_of_two_the_one_begun_last_counts_and_another_is_added():
    a = stimulus(kind="step", value=0.8, at_s=0.0, until_s=0.4)
    b = stimulus(kind="step", value=0.6, at_s=0.1, until_s=0.2)
    c = stimulus(kind="step", value=0.05, at_s=0.15, until_s=0.3, added=True)
    values = {tick: changes[KEY] for tick, changes, _, _ in play({"a": a, "b": b, "c": c})}
    expected = {0: 0.8, 100: 0.6, 150: 0.65, 200: 0.85, 300: 0.8, 400: 1.0}
    assert {t: v if v is None else round(v, 12) for t, v in values.items()} == expected


def test_a_crossing_is_seen_in_the_tick_in_which_the_signal_has_passed():
    when = {"signal": "plant.truth.x_m", "rises_through": 0.0}
    until = {"signal": "plant.truth.x_m", "below": -0.5, "after_s": 0.01}
    given = stimulus(kind="step", value=0.5, at_s=0.05, when=when, until=until, repeat=2)
    found = play({"s": given}, read=lambda name, tick: math.sin(2 * math.pi * (tick - 0.5) / 100))
    begins = [tick for tick, _, _, told in found if told == ["s (step) begins"]]
    ends = [tick for tick, _, _, told in found if told == ["s ends"]]
    assert begins == [101, 201]
    assert ends == [169, 269]  # below -0.5 from 59 on, 10 ms later


def test_an_event_begins_what_waits_for_it_even_another_stimulus():
    a = stimulus(kind="step", value=0.8, when={"event": "misfire", "after_s": 0.02})
    b = stimulus(kind="step", parameter=OTHER, value=0.001, when={"event": "a"})
    found = play({"a": a, "b": b}, happened=lambda tick: ("misfire",) if tick == 30 else ())
    assert [(tick, changes) for tick, changes, _, _ in found] == [(50, {KEY: 0.8, OTHER: 0.001})]


def test_a_player_goes_on_from_its_memory_as_if_it_had_never_stopped():
    stimuli = {
        "n": stimulus(kind="noise", sigma=0.1, at_s=0.2, until_s=0.6),
        "p": stimulus(
            kind="pulse", parameter=OTHER, value=1e-3, width_s=0.02, repeat=9, every_s=0.1
        ),
    }
    whole = play(stimuli)
    first = Player(stimuli, PERIOD_NS, 1, BASE)
    for tick in range(333):
        first.take(tick, lambda name: 0.0, ())
    second = Player(stimuli, PERIOD_NS, 1, BASE)
    second.memory = snapshot.loads(PlayerMemory, snapshot.dumps(first.memory))
    later = []
    for tick in range(333, 1000):
        taken = second.take(tick, lambda name: 0.0, ())
        if any(taken):
            later.append((tick, taken.changes, taken.commands, taken.told))
    assert later == [entry for entry in whole if entry[0] >= 333]


def test_events_with_a_course_or_a_condition_become_stimuli_of_the_scenario():
    tree = {
        "events": {
            "drift": {"kind": "ramp", "parameter": OTHER, "value": 1e-3, "over_s": 1.0},
            "late": {"kind": "misfire", "when": {"event": "drift", "after_s": 0.5}},
            "load": {"kind": "load-scale", "value": 0.9, "at_s": 1.0},
        },
        "expect": {"it": {"never": "contact", "event": "drift"}},
    }
    scenario = build(tree, "test")
    assert set(scenario.events) == {"load"}
    assert {n: (s.kind, s.side) for n, s in scenario.stimuli.items()} == {
        "drift": ("ramp", "plant"), "late": ("command", "plant"),
    }  # fmt: skip
    assert build(scenario.model_dump(), "again") == scenario


@pytest.mark.parametrize(
    ("event", "told"),
    [
        ({"kind": "ramp", "parameter": KEY, "value": 1.0}, "over_s: a ramp needs it"),
        ({"kind": "ramp", "value": 1.0, "over_s": 1.0}, "parameter: a ramp needs it"),
        ({"kind": "step", "parameter": KEY, "value": 1.0, "sigma": 1.0}, "sigma: no key of a step"),
        ({"kind": "playback", "parameter": KEY}, "file: a playback needs it"),
        ({"kind": "step", "parameter": KEY, "value": 1.0, "repeat": 2}, "repeat: needs every_s"),
        (
            {"kind": "step", "parameter": KEY, "value": 1.0, "when": {}},
            "accepted: event, or signal",
        ),
        ({"kind": "step", "parameter": KEY, "value": 1.0, "when": {"event": "nix"}}, "'nix' is no"),
        ({"kind": "misfire", "count": 0, "repeat": 2, "every_s": 1.0}, "count = 0; accepted"),
    ],
)
def test_what_is_no_stimulus_is_refused_by_its_key(event, told):
    with pytest.raises(ConfigError, match=told):
        build({"events": {"it": event}}, "test")


def test_a_scenario_without_stimuli_has_none():
    assert read("load-decrease").stimuli == {}


RUNNING = {
    "run": {"duration_s": 1.4},
    "events": {
        "ramp": {"kind": "ramp", "parameter": KEY, "value": 1.1, "over_s": 0.2, "at_s": 0.1},
        "drift": {"kind": "sine", "parameter": OTHER, "amplitude": 1e-4, "frequency_hz": 3.0},
        "noise": {"kind": "noise", "parameter": "plant.sensors.offset_v_m_s", "sigma": 0.01,
                  "when": {"event": "miss"}, "duration_s": 0.2},
        "miss": {"kind": "misfire", "when": {"event": "ramp", "after_s": 0.2}},
        "set": {"kind": "pulse", "parameter": "controller.tdc_ref_m", "value": 0.0152,
                "width_s": 0.1, "repeat": 4, "every_s": 0.3, "at_s": 0.05},
        "gain": {"kind": "ramp", "parameter": "controller.cascade.outer.kp", "value": 20.0,
                 "over_s": 0.1, "at_s": 0.6},
        "again": {"kind": "set-point", "tdc_ref_m": 0.0153,
                  "when": {"signal": "controller.stroke.index", "above": 48.0}},
    },
    "expect": {"it": {"event": "miss", "then": "misfire", "within_s": 0.08},
               "set": {"signal": "controller.stroke.tdc_ref_m", "statistic": "final",
                       "min": 0.0153, "max": 0.0153}},
}  # fmt: skip


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    return hil.run(RUNNING, out=tmp_path_factory.mktemp("run") / "it")


def test_stimuli_act_in_their_ticks_and_are_in_the_log(running):
    """The sensor's offset at tick k is the sine at its time, and the load that of the ramp."""
    assert running.checks[0].met, running.checks[0].text
    assert running.checks[1].met, running.checks[1].text
    x_m, true_m = running.sensor.x_m, running.truth.x_m
    t_s = running.truth.t_s
    expected = 1e-4 * np.sin(2 * np.pi * 3.0 * t_s)
    assert x_m - true_m == pytest.approx(expected, abs=1e-12)
    load = running.truth.load_coefficient_n_s_m
    assert load[302] / load[50] == pytest.approx(1.1, rel=1e-9)
    assert load[202] / load[50] == pytest.approx(1.0 + 0.1 * 0.1 / 0.2, rel=2e-2)
    gain = running.controller.stimulus.value[-1]
    assert 20.0 in gain
    told = [line.text for line in running.events if line.code == "stimulus"]
    assert told[0] == "drift (sine) begins"
    assert "noise (noise) begins" in told
    assert "noise ends" in told


@pytest.mark.parametrize("side", ["plant", "controller"])
def test_a_run_with_stimuli_replays_to_the_bit_from_its_start_and_from_a_snapshot(running, side):
    log = running.directory / f"{side}.mcap"
    assert replay_file(log, None, ALWAYS).identical
    assert replay_file(log, None, Span(1_200_000_000, 1_400_000_000)).identical


PLAYED = "time,scale\n0.0,1.0\n0.1,0.9\n0.2,1.1\n"


def test_a_column_of_a_file_is_played_back(tmp_path):
    (tmp_path / "load.csv").write_text(PLAYED)
    (tmp_path / "it.toml").write_text(
        f'[events.it]\nkind = "playback"\nfile = "load.csv"\nparameter = "{KEY}"\nat_s = 0.1\n'
    )
    played = hil.run(str(tmp_path / "it.toml"), run__duration_s=0.4, out=tmp_path / "run")
    load = played.truth.load_coefficient_n_s_m
    assert load[[150, 250, 350]] / load[50] == pytest.approx([1.0, 0.9, 1.0])
    again = {"events": {"it": {"kind": "playback", "parameter": OTHER, "scale": 0.001,
                               "file": str(tmp_path / "run/plant.mcap"),
                               "column": "plant.truth.x_m"}}}  # fmt: skip
    second = hil.run(again, run__duration_s=0.2)
    assert second.sensor.x_m - second.truth.x_m == pytest.approx(
        0.001 * played.truth.x_m[:200], abs=1e-12
    )


@pytest.mark.parametrize(
    ("event", "told"),
    [
        ({"parameter": "plant.engine.bore_m"}, "cannot change while the engine runs"),
        ({"parameter": "plant.sensors.noise_y"}, "is no parameter"),
        ({"parameter": KEY, "value": 20.0}, "load_scale = 20.*accepted"),
        ({"parameter": KEY, "when": {"signal": "controller.stroke.tdc_m", "above": 1.0}},
         "when.signal: 'controller.stroke.tdc_m': accepted here: plant.truth.x_m"),
        ({"parameter": KEY, "when": {"event": "mode safe"}}, "'mode safe' is none of the plant's"),
        ({"parameter": "controller.tdc_ref_m", "value": 0.5}, "tdc_ref_m = 0.5; accepted"),
    ],
)  # fmt: skip
def test_what_cannot_be_followed_is_refused_before_the_run(event, told):
    with pytest.raises(ConfigError, match=rf"events\.it: .*{told}"):
        hil.resolve({"events": {"it": {"kind": "step", "value": 0.5, **event}}})


@pytest.mark.parametrize(
    ("text", "told"),
    [("time,a,b\n0,1,2\n", "no column ''; it has: time, a, b"), ("time,a\n0,x\n", "no numbers"),
     ("time,a\n1,1\n0,1\n", "times must increase")],
)  # fmt: skip
def test_a_file_that_cannot_be_played_is_refused(tmp_path, text, told):
    (tmp_path / "it.csv").write_text(text)
    event = {"kind": "playback", "parameter": KEY, "file": str(tmp_path / "it.csv")}
    with pytest.raises(ConfigError, match=rf"events\.it\.file: .*{told}"):
        hil.resolve({"events": {"it": event}})
