"""`hil run --link can` with real processes on the virtual bus, and other tools beside it."""

import json
import os
import re
import signal
import subprocess
import sys
import time

import pytest

import hil.log

HIL = [sys.executable, "-m", "bench.cli"]


@pytest.fixture
def environment(tmp_path_factory):
    return os.environ | {"HIL_CAN_DIRECTORY": str(tmp_path_factory.mktemp("can"))}


def start(environment, *arguments):
    return subprocess.Popen(
        [*HIL, *arguments], env=environment, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


def finish(process, timeout=90):
    out, err = process.communicate(timeout=timeout)
    return process.returncode, out, err


def frames(directory):
    found = {}
    for process in ("plant", "controller"):
        with hil.log.open(directory / f"{process}.mcap") as log:
            for direction in ("sent", "received"):
                found[process, direction] = list(log.frames(direction))
    return found


def test_can_and_zenoh_give_the_same_frames_in_lockstep(tmp_path, environment):
    for link in (["zenoh"], ["can", "--bus", "zenoh:can0"]):
        code, out, err = finish(start(
            environment, "run", "load-decrease", "--link", *link, "--clock", "lockstep",
            "--no-report", "--out", str(tmp_path / link[0]),
        ))  # fmt: skip
        assert (code, err) == (0, "")
    assert re.search(r"bus load \d+\.\d% in the mean tick", out)
    assert frames(tmp_path / "zenoh") == frames(tmp_path / "can")
    told = json.loads((tmp_path / "can" / "summary.json").read_text())["run"]
    assert told["bus"]["load_fullest_tick"] < told["bus"]["load_worst_possible"] < 1.0
    assert told["processes"]["controller"]["reception"]["lost"] == 0


def wait_for_nodes(environment, count):
    code = (
        "import time\nfrom drivers.can.virtual.directory import channels\n"
        "end = time.monotonic() + 20\n"
        f"while channels().get('can0', 0) < {count} and time.monotonic() < end: time.sleep(0.05)"
    )
    subprocess.run([sys.executable, "-c", code], env=environment, timeout=30, check=True)


@pytest.mark.slow
def test_a_logger_and_a_monitor_join_while_it_runs(tmp_path, environment):
    # In lockstep no frame of the plant is without its answer, however busy the machine.
    run = start(
        environment, "run", "steady", "--link", "can", "--bus", "zenoh:can0", "--clock", "lockstep",
        "--no-report", "--out", str(tmp_path / "run"), "--set", "run.duration_s=600",
    )  # fmt: skip
    bus_log = tmp_path / "bus.log"
    logger = subprocess.Popen(
        [sys.executable, "-m", "can.logger", "-i", "zenoh", "-c", "can0", "-f", str(bus_log)],
        env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        wait_for_nodes(environment, 3)
        # Enough frames to hear of both, though the monitor meets one node before the other.
        monitor = start(
            environment, "bus", "monitor", "zenoh:can0", "--count", "20000", "--seconds", "60"
        )
        code, out, _ = finish(monitor, 90)
        assert code == 0
        assert {"PlantTick", "PistonSample", "ControllerTick", "MachineCommand"} <= set(out.split())
        end_s = time.monotonic() + 30
        while time.monotonic() < end_s and (not bus_log.exists() or bus_log.stat().st_size < 9000):
            time.sleep(0.05)
    finally:
        logger.send_signal(signal.SIGINT)
        logger.communicate(timeout=20)
        run.send_signal(signal.SIGINT)
        run.communicate(timeout=30)
    lines = bus_log.read_text().splitlines()
    assert len(lines) > 100
    assert {line.split()[2].partition("#")[0] for line in lines} >= {"100", "101", "200", "201"}


@pytest.mark.slow
@pytest.mark.parametrize("victim", ["plant", "controller"])
def test_a_killed_process_is_noticed_and_the_other_ends_safely(tmp_path, environment, victim):
    run = start(
        environment, "run", "steady", "--link", "can", "--bus", "zenoh:can0", "--clock", "lockstep",
        "--no-report", "--out", str(tmp_path), "--set", "run.duration_s=600",
    )  # fmt: skip
    wait_for_nodes(environment, 2)
    time.sleep(1.0)
    os.kill(pid_of(run.pid, f"{victim}.main"), signal.SIGKILL)
    code, _, err = finish(run)
    assert code == 3
    assert len(err.strip().splitlines()) == 1
    other = "controller" if victim == "plant" else "plant"
    with hil.log.open(tmp_path / f"{other}.mcap") as log:
        codes = {event.code for event in log.records("/event")}
    assert codes & {"mode safe", "safe-state"}


def pid_of(parent, module):
    """The child that runs a module; it may take a while to be there."""
    for _ in range(200):
        children = subprocess.run(
            ["ps", "-o", "pid=,args=", "--ppid", str(parent)],
            capture_output=True,
            text=True,
            check=False,  # ps ends with 1 while there is no child
        )
        for row in children.stdout.splitlines():
            if module in row:
                return int(row.split()[0])
        time.sleep(0.1)
    pytest.fail(f"{module} was never started")


def test_frames_that_take_their_time_still_close_the_loop(tmp_path, environment):
    code, _, err = finish(start(
        environment, "run", "steady", "--link", "can", "--bus", "zenoh:can0", "--clock", "lockstep",
        "--no-report", "--out", str(tmp_path), "--set", "run.duration_s=0.3",
        "--set", "link.wire_timing=true",
    ))  # fmt: skip
    assert (code, err) == (0, "")
    with hil.log.open(tmp_path / "plant.mcap") as log:
        assert len(log.array("/truth")) == 300


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--link", "can"], "needs bus"),
        (["--link", "can", "--bus", "nonsense:can0"], "not supported"),
        (["--link", "can", "--bus", "zenoh:a/b"], "accepted letters"),
        (["--link", "can", "--bus", "zenoh:c", "--set", "link.bitrate_bit_s=500000"], "617 Hz"),
    ],
)
def test_a_bus_that_will_not_do_is_exit_2_with_one_line(tmp_path, environment, arguments, line):
    code, _, err = finish(start(
        environment, "run", "steady", *arguments, "--no-report", "--out", str(tmp_path / "out")
    ))  # fmt: skip
    assert code == 2
    assert line in err
    assert len(err.strip().splitlines()) == 1
