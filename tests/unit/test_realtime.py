"""What was asked of the operating system is told, whether it was granted or not."""

import gc
import os
import threading

import pytest

from drivers.system import realtime
from hil.config.process import RealtimeConfig


@pytest.fixture(autouse=True)
def _collector_left_as_found():
    yield
    gc.enable()
    gc.unfreeze()


def in_a_thread(config):
    """Scheduling and affinity belong to a thread, so the test's own stays as it is."""
    told = {}
    thread = threading.Thread(
        target=lambda: told.update(realtime.prepare(config) | realtime.pin(config))
    )
    thread.start()
    thread.join()
    return told


def test_without_a_priority_only_the_collector_and_the_timer_slack_are_touched():
    told = in_a_thread(RealtimeConfig(priority=0))
    assert told["garbage_collection"].startswith("granted: collected, ")
    assert told["timer_slack"] == "granted: 1 ns"
    assert {told[k] for k in ("locked_memory", "cpu", "scheduling")} == {realtime.NOT_ASKED}
    assert not gc.isenabled()
    assert gc.get_freeze_count() > 0


def test_a_cpu_that_exists_is_granted_and_shown_to_be_in_force():
    cpu = max(os.sched_getaffinity(0))
    told = in_a_thread(RealtimeConfig(cpu=cpu))
    assert told["cpu"] == f"granted: CPU {cpu}"
    assert told["in_force"].endswith(f"CPUs {cpu}")


def test_a_cpu_that_does_not_exist_is_refused_in_words():
    assert in_a_thread(RealtimeConfig(cpu=1023))["cpu"] == "refused: Invalid argument"


def test_a_priority_is_granted_with_its_number_or_refused_with_the_reason():
    told = in_a_thread(RealtimeConfig(priority=7))
    assert told["scheduling"] in {
        "granted: SCHED_FIFO priority 7",
        "refused: Operation not permitted",
    }
    granted = told["scheduling"].startswith("granted")
    assert told["in_force"].startswith("SCHED_FIFO priority 7") == granted


def test_a_refused_lock_names_the_call(monkeypatch):
    class Library:
        def mlockall(self, _flags):
            return -1

    monkeypatch.setattr(realtime, "_libc", Library)
    monkeypatch.setattr(realtime.ctypes, "get_errno", lambda: 12)
    assert realtime._told(realtime._lock_memory) == "refused: mlockall: Cannot allocate memory"


def test_a_system_without_the_call_is_a_refusal_too(monkeypatch):
    monkeypatch.setattr(realtime, "_libc", object)
    told = realtime._told(realtime._cut_timer_slack)
    assert told.startswith("refused: not on this system")


def test_page_faults_only_rise():
    before = realtime.page_faults()
    pages = bytearray(8 << 20)
    after = realtime.page_faults()
    assert len(pages) == 8 << 20
    assert after[0] >= before[0]
    assert after[1] >= before[1] >= 0
