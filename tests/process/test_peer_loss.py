"""One process is killed in mid-run: the other brakes, says why, and both logs can be read."""

import contextlib
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from bench.run.resolve import resolve
from drivers.links import open_operator
from drivers.recorder.output import wait_finished
from hil.config.load import build

DEADLINE_S = 40.0
KILL_TICK = 400
# Ticks of 2 ms, so that a stall of a busy machine is not taken for a loss.
SCENARIO = {
    "name": "peer-loss",
    "run": {"duration_s": 4.0},
    "loop": {"clock": "realtime", "rate_hz": 500, "peer_timeout_s": 20.0},
}

pytestmark = pytest.mark.slow


class Loss(NamedTuple):
    """What was left: exit code and last line of the survivor, decoded messages of both logs."""

    exit_code: int
    error: str
    survivor: dict
    victim: dict


def start(name, folder, config):
    return subprocess.Popen(
        [sys.executable, "-m", f"{name}.main", "--config", str(config),
         "--log", str(folder / f"{name}.mcap")],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def wait_for_tick(scenario, process, tick):
    """Follow the status of a process until it has come so far."""
    operator = open_operator(scenario.link, scenario.loop, "test")
    try:
        end_s = time.monotonic() + DEADLINE_S
        while time.monotonic() < end_s:
            told = operator.poll_status()
            if told is not None and told[0] == process and told[1]["tick"] >= tick:
                return
            time.sleep(0.0 if told else 0.005)
    finally:
        operator.close()
    raise AssertionError(f"{process} did not reach tick {tick}")


def read(path):
    """Decoded messages by topic, by the public readers."""
    wait_finished(path, DEADLINE_S)
    found = defaultdict(list)
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        for _, channel, _, decoded in reader.iter_decoded_messages():
            found[channel.topic].append(decoded)
    return found


def lose(victim, survivor, folder):
    """Run both over unix sockets, kill one with SIGKILL, let the other come to its end."""
    with contextlib.ExitStack() as stack:
        sockets = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="hil-")))
        scenario = resolve(build(SCENARIO, "test"), sockets)
        config = folder / "scenario.json"
        config.write_text(scenario.model_dump_json())
        processes = {name: start(name, folder, config) for name in ("plant", "controller")}
        for process in processes.values():
            stack.callback(process.communicate)
            stack.callback(process.kill)
        wait_for_tick(scenario, victim, KILL_TICK)
        processes[victim].kill()
        _, errors = processes[survivor].communicate(timeout=DEADLINE_S)
        code = processes[survivor].returncode
    logs = {name: read(folder / f"{name}.mcap") for name in (victim, survivor)}
    return Loss(code, errors.strip(), logs[survivor], logs[victim])


@pytest.fixture(scope="module")
def without_controller(tmp_path_factory):
    return lose("controller", "plant", tmp_path_factory.mktemp("c"))


@pytest.fixture(scope="module")
def without_plant(tmp_path_factory):
    return lose("plant", "controller", tmp_path_factory.mktemp("p"))


def last_used(log):
    """Last tick in which something of the peer's was acted on."""
    return max(timing.tick for timing in log["/timing"] if timing.used_tick >= 0)


def test_plant_reaches_its_safe_state_in_time_and_says_why(without_controller):
    log = without_controller.survivor
    event = [e for e in log["/event"] if e.code == "safe-state"][-1]
    assert 0 < event.tick - last_used(log) <= 8
    assert "no valid command for 12 ms" in event.text
    assert event.severity == 2


def test_plant_comes_to_rest_without_its_controller(without_controller):
    log = without_controller.survivor
    assert log["/event"][-1].code == "at-rest"
    last = log["/truth"][-1]
    assert last.v_m_s == 0.0
    assert last.contacts == 0


def test_plant_ends_with_exit_code_3_and_one_line(without_controller):
    assert without_controller.exit_code == 3
    assert without_controller.error.startswith("controller lost: no valid command in the last")
    assert "\n" not in without_controller.error


def test_controller_reaches_its_safe_state_in_time_and_says_why(without_plant):
    log = without_plant.survivor
    event = [e for e in log["/event"] if e.code == "mode safe"][-1]
    assert 0 < event.tick - last_used(log) <= 8
    assert event.text.endswith("-> SAFE: sample lost")
    assert event.severity == 2


def test_controller_brakes_and_fires_no_more_without_the_plant(without_plant):
    log = without_plant.survivor
    safe_tick = [e for e in log["/event"] if e.code == "mode safe"][-1].tick
    after = [order for order in log["/actuator"] if order.tick >= safe_tick]
    assert len(after) > 100
    assert {(o.mode, o.load_coefficient_n_s_m, o.pulse_count) for o in after} == {(2, 810.0, 0)}


def test_controller_ends_with_exit_code_3_and_one_line(without_plant):
    assert without_plant.exit_code == 3
    assert without_plant.error.startswith("plant lost: no valid sample in the last")
    assert "\n" not in without_plant.error


@pytest.mark.parametrize("which", ["without_controller", "without_plant"])
def test_log_of_the_killed_process_is_complete_to_the_kill(which, request):
    """What it sent and the other used is in its log, but for the tick in which it died."""
    loss = request.getfixturevalue(which)
    ticks = [timing.tick for timing in loss.victim["/timing"]]
    used = max(timing.used_tick for timing in loss.survivor["/timing"])
    assert ticks == list(range(ticks[0], ticks[-1] + 1))
    assert ticks[-1] >= used - 1
    assert ticks[-1] >= KILL_TICK


@pytest.mark.parametrize("which", ["without_controller", "without_plant"])
def test_log_of_the_survivor_has_every_tick_to_the_end_of_the_run(which, request):
    ticks = [timing.tick for timing in request.getfixturevalue(which).survivor["/timing"]]
    assert ticks == list(range(ticks[0], 2000))
