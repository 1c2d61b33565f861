"""What `hil bench soak` calls flat; the run itself is made short."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from bench.measure import soak
from bench.measure.soak import Ages, Look, Watcher, judge, look_at, processes_of
from hil.config.scenario import Scenario

MINUTES = 5.0


def scenario(minutes=MINUTES):
    return Scenario.model_validate({"name": "t", "run": {"duration_s": 60.0 * minutes}})


def looks(grown_bytes=0, more=0):
    return [
        Look(t, (60 << 20) + (grown_bytes if t > 200 else 0), 20 + (more if t > 200 else 0))
        for t in np.arange(0.0, 60.0 * MINUTES, 1.0)
    ]


def aged(drift_us=0.0, answer=1.0):
    t_s = np.arange(0.0, 60.0 * MINUTES, soak.BIN_S)
    answers = np.where(t_s > 100.0, answer, 1.0)
    return Ages(t_s, drift_us * t_s / t_s[-1], answers, np.zeros(len(t_s)))


def not_flat(**given):
    found = judge({"plant": given.pop("plant", looks())}, given.pop("aged", aged()), scenario())
    return [verdict.what for verdict in found if not verdict.flat]


def test_what_stays_as_it_is_is_flat():
    assert not_flat() == []
    assert not_flat(plant=looks(grown_bytes=1 << 20)) == []


def test_a_passing_spike_is_no_growth():
    rows = looks()
    rows[200] = Look(200.0, 90 << 20, 25)
    assert not_flat(plant=rows) == []


def test_each_growth_is_told_by_name():
    assert not_flat(plant=looks(grown_bytes=(1 << 20) + 1)) == ["memory of plant"]
    assert not_flat(plant=looks(more=1)) == ["handles of plant"]
    assert not_flat(aged=aged(drift_us=200.0)) == ["sample age"]
    assert not_flat(aged=aged(answer=2.0)) == ["answer age"]
    assert not_flat(aged=aged()._replace(answer_ticks=np.full(30, np.nan))) == ["answer age"]


def test_what_a_start_takes_is_no_growth():
    rows = [Look(t, 1 << 20, 3) for t in range(30)] + looks()[30:]
    assert not_flat(plant=rows) == []


def test_a_process_is_found_below_the_one_that_started_it_and_looked_at():
    sleeper = [sys.executable, "-c", "import time; time.sleep(60)", "drivers.recorder.process"]
    start = f"import subprocess; subprocess.run({sleeper!r})"
    child = subprocess.Popen([sys.executable, "-c", start, "plant.main"])
    try:
        for _ in range(1000):
            found = processes_of(os.getpid())
            if len(found) == 2:
                break
            os.sched_yield()
        assert found["plant"] == child.pid
        look = look_at(found["plant recorder"], 1.5)
        assert look.t_s == 1.5
        assert look.resident_bytes > 0
        assert look.handles >= 3
    finally:
        os.kill(found["plant recorder"], 9)
        child.wait()
    assert look_at(child.pid, 0.0) is None
    assert processes_of(os.getpid()) == {}


def test_a_watcher_that_is_stopped_ends():
    watcher = Watcher(os.getpid())
    watcher.start()
    watcher.stop()
    assert watcher.looks == {}


@pytest.mark.slow
def test_a_short_soak_tells_and_stores(tmp_path, capsys):
    changes = [("link.kind", "zenoh"), ("loop.rate_hz", 500)]
    code = soak.run(0.2, changes, tmp_path / "out", force=False)
    told = json.loads((tmp_path / "out" / "soak.json").read_text())
    assert set(told["processes"]) == {"plant", "controller", "plant recorder",
                                      "controller recorder"}  # fmt: skip
    assert len(told["verdicts"]) == 10
    assert (tmp_path / "out" / "soak.png").read_bytes()[:4] == b"\x89PNG"
    assert code == (0 if told["flat"] else 1)
    assert (tmp_path / "out" / "plant.mcap").exists() == (code == 1)
    assert "memory of controller" in capsys.readouterr().out
