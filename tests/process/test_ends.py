"""Whatever ends a run, nothing of it goes on alone and why it ended is told."""

import json
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from run_rig import HIL, children_of, ended, family, start, wait_gone, wait_until

import hil.log
from drivers.recorder.output import wait_finished

LINKS = [
    "zenoh",
    "memory",
    *(pytest.param(link, marks=pytest.mark.slow) for link in ("shm", "can")),
]


@pytest.fixture
def scratch(monkeypatch):
    """A directory for the sockets of runs, with a short path."""
    with tempfile.TemporaryDirectory(prefix="t-") as directory:
        monkeypatch.setenv("TMPDIR", directory)
        yield Path(directory)


def events_of(path):
    with hil.log.open(path) as log:
        return {record.code: record.text for record in log.records("/event")}


@pytest.mark.parametrize("link", LINKS)
def test_a_killed_run_leaves_nobody_and_two_logs_that_say_why(tmp_path, scratch, link):
    bus = ["--bus", "zenoh:t"] if link == "can" else []
    with ended(start(tmp_path, "--link", link, *bus, "--clock", "lockstep")) as process:
        others = family(process)
        process.kill()
        wait_gone(others.values())
    for name, safe in (("plant", "safe-state"), ("controller", "mode safe")):
        wait_finished(tmp_path / f"{name}.mcap", 10.0)
        events = events_of(tmp_path / f"{name}.mcap")
        assert events["starter-lost"] == f"its starter (pid {process.pid}) is gone"
        assert safe in events
    assert list(scratch.glob("hil-run-*"))
    done = subprocess.run(
        [*HIL, "run", "steady", "--link", link, *bus, "--set", "run.duration_s=0.1", "--clock",
         "lockstep", "--no-report", "--out", str(tmp_path / "next")],
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert not list(scratch.glob("*hil-run-*"))


def test_a_run_whose_terminal_is_closed_ends_as_by_an_interrupt(tmp_path):
    with ended(start(tmp_path, "--clock", "lockstep")) as process:
        others = family(process)
        process.send_signal(signal.SIGHUP)
        _, err = process.communicate(timeout=40)
        assert (process.returncode, err) == (130, f"interrupted; logs: {tmp_path}\n")
        wait_gone(others.values())


def test_nohup_is_respected(tmp_path):
    with ended(start(tmp_path, preexec_fn=lambda: signal.signal(1, signal.SIG_IGN))) as process:
        process.send_signal(signal.SIGHUP)
        process.send_signal(signal.SIGTERM)
        assert process.wait(40) == 130


@pytest.mark.parametrize("side", ["plant", "controller"])
def test_a_lost_recorder_ends_the_run_at_once_and_both_parts_are_read_as_one(tmp_path, side):
    with ended(start(tmp_path, "--clock", "lockstep")) as process:
        pid = family(process)[f"{side} recorder"]
        os.kill(pid, signal.SIGKILL)
        _, err = process.communicate(timeout=40)
    line = f"{side}: its recorder (pid {pid}) was killed by SIGKILL; logs: {tmp_path}\n"
    assert (process.returncode, err) == (3, line)
    assert events_of(tmp_path / f"{side}.mcap")["log-lost"] in line
    with hil.log.open(tmp_path / f"{side}.mcap") as log:
        assert len(log.parts) == 2
        assert len(log.array("/timing")) > 50
    assert json.loads((tmp_path / "summary.json").read_text())["exit_reason"] == line.strip()


@pytest.mark.parametrize("link", ["zenoh", "memory"])
def test_a_lost_recorder_is_followed_by_another_where_that_is_asked_for(tmp_path, link):
    changes = ["--set", "log.recorder_lost=restart", "--link", link]
    with ended(start(tmp_path, *changes, "--clock", "lockstep")) as process:
        before = family(process)
        victims = [pid for name, pid in before.items() if "recorder" in name]
        os.kill(victims[0], signal.SIGKILL)
        wait_until((tmp_path / "plant.0001.mcap").exists, "a log set aside")
        wait_until(lambda: (tmp_path / "plant.mcap").stat().st_size > 60_000, "a log that goes on")
        process.send_signal(signal.SIGINT)
        assert process.wait(40) == 130
    told = events_of(tmp_path / "plant.mcap")["log-lost"]
    assert (
        told
        == f"its recorder (pid {victims[0]}) was killed by SIGKILL, another one goes on from here"
    )


def test_a_process_by_itself_ends_with_its_terminal(tmp_path):
    """No run, no starter: SIGHUP alone."""
    config = Path("bench/scenarios/steady.toml")
    plant = subprocess.Popen(
        [sys.executable, "-m", "bench.cli", "plant", "--config", str(config),
         "--log", str(tmp_path / "p.mcap")],
        stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    wait_until(lambda: children_of(plant.pid), "a recorder")
    plant.send_signal(signal.SIGHUP)
    _, err = plant.communicate(timeout=20)
    assert (plant.returncode, err) == (3, "the terminal is gone\n")
