"""Ctrl-C as a terminal sends it, to the whole process group: one line, 130, nobody left behind."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

HIL = [sys.executable, "-m", "bench.cli"]
BEGUN_S = 0.15
"""Processor time after which the guard against interrupts is there."""

PATIENCE_S = 8.0
"""Three seconds of a quiet machine; this one may run other tests meanwhile."""


def interrupted(after_s, *arguments):
    """Return exit code, standard error and how long the end took."""
    process = subprocess.Popen(
        [*HIL, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip
    begun_s = wait_begun(process.pid)
    time.sleep(max(after_s - begun_s, 0.0))
    os.killpg(process.pid, signal.SIGINT)
    begin_s = time.monotonic()
    _, err = process.communicate(timeout=60)
    took_s = time.monotonic() - begin_s
    while (left := session(process.pid)) and time.monotonic() - begin_s < PATIENCE_S:
        time.sleep(0.05)  # a tracker of the library ends when it sees that all others have
    assert not left, f"left behind: {left}"
    return process.returncode, err, took_s


def wait_begun(pid):
    """Wait until a process has come to our modules, which on a busy machine takes its time.

    Before that the interpreter's own start has nobody to tell of an interrupt in one line.
    """
    used_s, end_s = 0.0, time.monotonic() + PATIENCE_S
    while used_s < BEGUN_S and time.monotonic() < end_s:
        time.sleep(0.005)
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        used_s = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return used_s


def session(number):
    """Processes of a session that still run."""
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, belongs = status.read_text().rpartition(")")[2].split()[:4]
        except OSError:
            continue
        if int(belongs) == number and state != "Z":
            found.append(status.parent.name)
    return found


@pytest.mark.parametrize("after_s", [0.6, 1.0, 1.7, 2.2, 2.6, 3.0, 4.0])
def test_a_campaign_is_interrupted_at_any_moment(tmp_path, after_s):
    pytest.importorskip("distributed")
    where = str(tmp_path / "out")
    code, err, took_s = interrupted(after_s, "campaign", "robustness", "--out", where)
    assert (code, err) == (130, "interrupted\n")
    assert took_s < PATIENCE_S


@pytest.mark.parametrize("after_s", [0.6, 1.2])
@pytest.mark.parametrize(
    "arguments",
    [
        ("tune", "cascade", "--search"),
        ("compare",),
        ("engine", "sweep", "--over", "load"),
        ("bench", "step", "--ticks", "1000000"),
        ("bench", "recorder", "--ticks", "100000000"),
        ("bench", "rate"),
        ("bus", "fuzz"),
        ("controller", "--config", "bench/scenarios/steady.toml"),
        ("plant", "--config", "bench/scenarios/steady.toml"),
    ],
    ids=" ".join,
)
def test_every_command_is_interrupted_in_one_line(arguments, after_s, monkeypatch, tmp_path):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    code, err, _ = interrupted(after_s, *arguments)
    assert (code, err) == (130, "interrupted\n")


def test_a_soak_and_a_run_name_their_logs(tmp_path):
    for command in (("bench", "soak"), ("run", "steady", "--set", "run.duration_s=60")):
        where = str(tmp_path / command[0])
        code, err, _ = interrupted(2.0, *command, "--out", where)
        assert (code, err) == (130, f"interrupted; logs: {where}\n")


CAUGHT_IN_C = """
import bench, ctypes, time
def interrupted(*_): raise KeyboardInterrupt
ctypes.CFUNCTYPE(None)(interrupted)()
time.sleep(10)
"""


LOST_IN_A_MODULE = """
import bench
try:
    raise KeyboardInterrupt
except KeyboardInterrupt as error:
    raise SystemError("initialization failed") from error
"""


@pytest.mark.parametrize(
    "code", ["import bench; raise KeyboardInterrupt", CAUGHT_IN_C, LOST_IN_A_MODULE]
)
def test_an_interrupt_is_no_traceback_wherever_it_comes(code):
    """While modules are imported, and where C can only ignore it."""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=20, check=False
    )
    assert (done.returncode, done.stderr) == (130, "interrupted\n")
