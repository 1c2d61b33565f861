"""A run is resumed bit by bit from its log, and then changed."""

import numpy as np
import pytest

import hil.log
from bench.logs.commands import what_if as what_if_command
from bench.logs.diff import compare
from bench.logs.replay.replay import replay_file
from bench.logs.what_if.continuation import Wish, continue_run, tick_of
from controller.loop import ControllerLoop
from hil.errors import ConfigError, LogError
from hil.log import Span
from plant.loop import PlantLoop


def wish(out, *assignments, start="0.45s", duration_s=None):
    return Wish(start, assignments, duration_s, out)


def compared(run_directory, out, process):
    name = f"{process}.mcap"
    with hil.log.open(run_directory / name) as a, hil.log.open(out / name) as b:
        return compare(a, b)


@pytest.mark.parametrize("start", ["0.45s", "tick:1", "tick:249", "tick:250", "0.251", "tick:698"])
def test_without_a_change_a_run_goes_on_as_it_did(run_directory, tmp_path, start):
    told = continue_run(run_directory, wish(tmp_path, start=start))
    assert told.notes == ()
    for process in ("plant", "controller"):
        found = compared(run_directory, tmp_path, process)
        assert found.first is None
        assert sum(gap.common for gap in found.topics) > 0


@pytest.mark.parametrize(
    "change", ["controller.cascade.outer.kp=20.0", "controller.name=single-loop"]
)
def test_a_changed_controller_acts_from_there_on_and_not_before(run_directory, tmp_path, change):
    continue_run(run_directory, wish(tmp_path, change, start="0.25s"))
    found = compared(run_directory, tmp_path, "controller")
    assert found.first is not None
    assert found.first.tick >= 250
    assert not found.from_input


def test_a_set_point_goes_in_as_the_operators_command(run_directory, tmp_path):
    continue_run(run_directory, wish(tmp_path, "controller.tdc_ref_m=0.0152"))
    with hil.log.open(tmp_path / "controller.mcap") as log:
        codes = [(event.tick, event.code) for event in log.records("/event")]
        assert set(log.array("/stroke")["tdc_ref_m"][2:]) == {0.0152}
    assert (450, "command") in codes


def test_an_event_to_come_may_be_changed(run_directory, tmp_path):
    continue_run(run_directory, wish(tmp_path, "events.load.value=0.9", start="0.15s"))
    with hil.log.open(tmp_path / "plant.mcap") as log:
        loads = set(np.unique(log.array("/truth")["load_coefficient_n_s_m"]))
    assert loads == {810.0, 729.0}


def test_the_plant_may_be_changed_from_the_next_stroke_on(run_directory, tmp_path):
    told = continue_run(run_directory, wish(tmp_path, "plant.injector.flow_scale_left=1.02"))
    assert "from the next dead centre on" in told.notes[0]
    assert compared(run_directory, tmp_path, "plant").first is not None


def test_a_continued_run_may_be_longer_and_is_replayed_like_any_other(run_directory, tmp_path):
    continue_run(run_directory, wish(tmp_path, duration_s=0.9))
    for process in ("plant", "controller"):
        outcome = replay_file(tmp_path / f"{process}.mcap", None, Span())
        assert (outcome.identical, outcome.first_tick, outcome.ticks) == (True, 450, 450)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ("events.load.value=0.9", r"events\.load: it has begun"),
        ("events.other.value=1", "no events.other; it has: load"),
        ("plant.prototype=bit", "acts at the start of a run only"),
        ("controller.preset.fuel_kg=1e-6", "acts at the start of a run only"),
        ("loop.rate_hz=2000", "accepted in a what-if are"),
        ("controller.cascade.outer.kp=lots", "controller.cascade.outer.kp"),
        ("controller.nothing=1", "unknown key"),
        ("run.duration_s=0.3", "ends before it is continued"),
    ],
)
def test_what_cannot_be_changed_is_refused_by_name(run_directory, tmp_path, change, told):
    with pytest.raises(ConfigError, match=told) as caught:
        continue_run(run_directory, wish(tmp_path / "none", change))
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize("text", ["", "soon", "-1", "0", "tick:x", "tick:0", "nan", "inf"])
def test_an_instant_that_is_none_is_refused(text):
    with pytest.raises(ConfigError, match="accepted is a time after 0"):
        tick_of(text, 1000)


def test_an_instant_means_the_first_tick_at_or_after_it():
    assert [tick_of(t, 1000) for t in ("1.05s", "1.05", "1.0501s", "tick:7")] == [
        1050,
        1050,
        1051,
        7,
    ]


def test_an_instant_behind_the_end_is_refused(run_directory, tmp_path):
    with pytest.raises((LogError, ConfigError), match="ends before"):
        continue_run(run_directory, wish(tmp_path / "none", start="5s", duration_s=9.0))


def test_the_command_draws_both_and_prints_both(run_directory, tmp_path, capsys):
    out = tmp_path / "drawn"
    assert what_if_command(run_directory, "0.3s", ["controller.name=open-loop"], None, out) == 0
    told = capsys.readouterr().out
    assert "recorded" in told
    assert "what if" in told
    assert (out / "what-if.svg").stat().st_size > 10_000


PORTS = {
    "_link",
    "_pacer",
    "_recorder",
    "_put",
    "_status",
    "_commands",
    "_schedule",
    "_initial_events",
}
TOLD_ONLY = {"_late_max_ns", "_finished", "heard_tick"}  # goes into the status and nowhere else
CODEC = {"_encoder", "decoder", "_changes", "_stimulation"}
PARTS = {"reception", "answers", "_age"}  # which remember by themselves
DERIVED = {"_mode", "_machine", "_pulses", "_command", "_answer"}  # of the last orders, once more
CONSTANT = {
    "_age", "params", "peer_timeout_s", "_status_every", "_snapshot_every", "_largest_gap",
    "_period_ns",
}  # fmt: skip


def attributes_of(thing):
    """What an object holds by name; a compiled one has no `__dict__`."""
    names = getattr(type(thing), "__mypyc_attrs__", None) or vars(thing)
    return {name: getattr(thing, name) for name in names}


@pytest.mark.parametrize("kind", [ControllerLoop, PlantLoop])
def test_a_loop_remembers_everything_that_changes(kind, tmp_path, monkeypatch):
    """A new attribute of a loop must go into its memory, or into one of the sets above."""
    from runs import make_run

    made = []
    original = kind.__init__

    def spied(self, *arguments, **named):
        original(self, *arguments, **named)
        made.append(self)

    monkeypatch.setattr(kind, "__init__", spied)
    make_run(tmp_path / "one", ("run.duration_s", 0.35))
    make_run(tmp_path / "two", ("run.duration_s", 0.002))
    ran, fresh = made[0], made[-1]
    fresh.recall(ran.remember())
    assert_same_memory(fresh, ran)


def assert_same_memory(fresh, ran):
    left = attributes_of(fresh)
    for name, value in attributes_of(ran).items():
        if name in CODEC and value is not None:
            assert left[name].remember() == value.remember()
        elif name in PARTS:
            assert_same_memory(left[name], value)
        elif name not in PORTS | TOLD_ONLY | CONSTANT | DERIVED:
            assert repr(left[name]) == repr(value), name
