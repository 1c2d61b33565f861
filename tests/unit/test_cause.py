"""Why a run went to its safe state: the machine's stalls are told from a controller's own work."""

from types import SimpleNamespace

import numpy as np
import pytest

from bench.judge.cause import Cause, Trace, cause_of
from bench.judge.checks import Check
from bench.judge.events import Happening
from bench.judge.stalls import Stall, read_stalls
from bench.judge.verdict import conclude

MS = 1_000_000
SAFE = Happening(520 * MS, "controller", "fault", "mode safe", "GENERATING -> SAFE: sample lost")
TIMING = np.dtype(
    [("tick", "u8"), ("scheduled_ns", "i8"), ("woke_ns", "i8"), ("done_ns", "i8"), ("missed", "u1")]
)
NOT_MET = [Check("tdc", "within_mm", 0.1, None, met=False, text="TDC: not reached")]


def log_of(*ticks, per_block=1):
    """A log's /timing of (tick, woke, done) in ms."""
    rows = [(t, t * MS, round(woke * MS), round(done * MS), 0) for t, woke, done in ticks]
    blocks = [np.array(rows[n : n + per_block], TIMING) for n in range(0, len(rows), per_block)]
    return SimpleNamespace(blocks=lambda _topic: iter(blocks))


def scenario(link="zenoh", clock="realtime"):
    return SimpleNamespace(
        link=SimpleNamespace(kind=link), loop=SimpleNamespace(clock=clock, period_ns=MS)
    )


def cause(*stalls, safe=SAFE, silent=False, processes=None, **how):
    return cause_of(scenario(**how), Trace(stalls, safe, silent), processes or {})


def test_a_tick_that_comes_late_is_a_stall_from_when_it_was_due():
    log = log_of((10, 10.0, 10.1), (11, 11.0, 11.1), (70, 70.2, 70.3), (71, 71.0, 71.1))
    assert read_stalls(log, "plant", MS) == (Stall("plant", 70, 12 * MS, 58_200_000, False),)


def test_work_is_no_lateness_of_the_tick_that_comes_after_it():
    log = log_of((10, 10.0, 41.0), (41, 41.1, 41.2))
    assert read_stalls(log, "controller", MS) == (Stall("controller", 10, 10 * MS, 31 * MS, True),)


def test_a_first_sample_that_waited_is_a_stall_though_the_controllers_time_begins_with_it():
    ticks = [(n, 0.2 * n, 0.2 * n + 0.1) for n in range(20)]  # it catches up
    ticks += [(n, n - 17.0, n - 16.9) for n in range(20, 40)]
    log = log_of(*ticks, per_block=40)
    assert read_stalls(log, "controller", MS) == (Stall("controller", 0, -17 * MS, 17 * MS, False),)


def test_who_was_not_woken_was_held_up_by_the_machine():
    found = cause(Stall("controller", 512, 453 * MS, 59 * MS, working=False))
    line = (
        "safe state of the controller at 0.520 s: the machine was 59 ms late (controller, tick 512)"
    )
    assert found == Cause(line, by_machine=True, safe=True)


LONG_WORK = Stall("controller", 500, 500 * MS, 20 * MS, working=True)


def test_long_work_of_the_controller_is_its_own():
    found = cause(LONG_WORK)
    assert not found.by_machine
    assert found.text.endswith("the controller worked for 20 ms on tick 500")


@pytest.mark.parametrize(
    "held",
    [
        {"from_s": 0.45, "to_s": 0.55, "waited_s": 0.015, "stopped": False},
        {"from_s": 0.45, "to_s": 0.55, "waited_s": 0.0, "stopped": True},
    ],
    ids=["not run", "stopped"],
)
def test_long_work_in_which_it_was_not_run_is_the_machines(held):
    assert cause(LONG_WORK, processes={"controller": {"held": [held]}}).by_machine
    later = held | {"from_s": 0.6, "to_s": 0.7}
    assert not cause(LONG_WORK, processes={"controller": {"held": [later]}}).by_machine


def test_what_stalls_both_at_once_is_the_machine_but_not_where_both_share_a_thread():
    both = (LONG_WORK, Stall("plant", 520, 501 * MS, 19 * MS, working=False))
    assert cause(*both).by_machine
    assert not cause(*both, link="memory").by_machine
    alone = Stall("plant", 520, 501 * MS, 19 * MS, working=False)
    assert cause(alone, link="memory").by_machine


def test_silence_of_the_link_is_the_machines_unless_it_is_a_bus():
    assert cause(silent=True).by_machine
    assert "the machine did not carry it in time" in cause(silent=True).text
    assert not cause(silent=True, link="can").by_machine
    assert cause(silent=True, link="can").text.endswith("the sample was lost on the bus")
    assert not cause(silent=True, clock="lockstep").by_machine


def test_any_other_safe_state_is_told_as_the_process_told_it():
    assert cause().text.endswith("at 0.520 s: GENERATING -> SAFE: sample lost")


def test_without_a_safe_state_a_stall_counts_that_no_controller_bears():
    short = Stall("plant", 100, 100 * MS, 8 * MS, working=False)
    long = Stall("plant", 300, 300 * MS, 12 * MS, working=False)
    assert cause(short, safe=None) is None
    assert cause(short, long, safe=None).text == "the machine was 12 ms late (plant, tick 300)"


def test_what_the_machine_spoilt_is_blocked_and_what_was_met_is_met():
    spoilt = cause(Stall("plant", 300, 300 * MS, 12 * MS, working=False), safe=None)
    assert conclude(NOT_MET, [], spoilt) == (
        "blocked", 4, "the machine was 12 ms late (plant, tick 300); TDC: not reached",
    )  # fmt: skip
    met = [NOT_MET[0]._replace(met=True)]
    assert conclude(met, [], spoilt)[:2] == ("met", 0)
    assert conclude(met, [], spoilt).reason == "every expectation met"


def test_a_controllers_own_fault_is_not_met_and_says_why():
    verdict = conclude(NOT_MET, [], cause(LONG_WORK))
    assert verdict[:2] == ("not met", 1)
    assert "worked for 20 ms" in verdict.reason
