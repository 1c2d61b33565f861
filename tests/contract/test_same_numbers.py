"""Lockstep gives the same bytes on every link and in every run."""

import json
import subprocess
import sys
from collections import defaultdict

import pytest
from mcap.reader import make_reader

from bench.run.resolve import resolve
from drivers.recorder.output import wait_finished
from hil.config.load import build

DEADLINE_S = 60.0
SCENARIO = {
    "name": "same-numbers",
    "run": {"duration_s": 0.5, "seed": 7},
    "loop": {"clock": "lockstep", "peer_timeout_s": 20.0},
    "plant": {"sensors": {"noise_x_m": 1e-6, "noise_v_m_s": 1e-4}},
    "events": {
        "eta": {"kind": "efficiency"},
        "load": {"kind": "load-scale", "value": 0.85, "at_s": 0.1, "at_stroke_fraction": 0.25},
        "misfire": {"kind": "misfire", "at_s": 0.3},
    },
}


def start(module, *arguments):
    return subprocess.Popen(
        [sys.executable, "-m", module, *map(str, arguments)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def finish(*processes):
    """Wait for all, at most so long; end what is left."""
    try:
        for process in processes:
            _, errors = process.communicate(timeout=DEADLINE_S)
            assert (process.returncode, errors) == (0, "")
    finally:
        for process in processes:
            if process.poll() is None:
                process.kill()
                process.communicate()


def messages(path):
    """Payloads by topic, in order, with their log times."""
    wait_finished(path, DEADLINE_S)
    found = defaultdict(list)
    with path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            found[channel.topic].append((message.log_time, message.data))
    return dict(found)


def run(folder, link):
    """Run the scenario over a link; returns messages of plant and controller."""
    folder.mkdir()
    tree = SCENARIO | {"link": {"kind": link}}
    sockets = folder if link == "zenoh" else None
    config = folder / "scenario.json"
    config.write_text(resolve(build(tree, "test"), sockets).model_dump_json())
    logs = [folder / "plant.mcap", folder / "controller.mcap"]
    if link == "memory":
        finish(start("bench.run.single_process", "--config", config,
                     "--plant-log", logs[0], "--controller-log", logs[1]))  # fmt: skip
    else:
        finish(*(
            start(f"{log.stem}.main", "--config", config, "--log", log) for log in logs
        ))  # fmt: skip
    return [messages(log) for log in logs]


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("n")
    names = ("memory1", "memory2", "zenoh1", "zenoh2")
    return {name: run(folder / name, name[:-1]) for name in names}


SIDES = pytest.mark.parametrize("side", [0, 1], ids=["plant", "controller"])


@SIDES
@pytest.mark.parametrize("link", ["memory", "zenoh"])
def test_two_runs_are_byte_identical_in_every_topic(runs, link, side):
    first, second = runs[f"{link}1"][side], runs[f"{link}2"][side]
    assert set(first) == set(second)
    for topic in first:
        assert first[topic] == second[topic], topic


@SIDES
def test_frames_are_byte_identical_over_memory_and_zenoh(runs, side):
    memory, zenoh = runs["memory1"][side], runs["zenoh1"][side]
    for topic in ("/frames/sent", "/frames/received"):
        assert len(memory[topic]) >= 499
        assert memory[topic] == zenoh[topic]


@SIDES
def test_every_other_topic_is_the_same_over_both_links_too(runs, side):
    memory, zenoh = runs["memory1"][side], runs["zenoh1"][side]
    assert set(memory) == set(zenoh)
    for topic in memory:
        assert memory[topic] == zenoh[topic], topic


def test_what_one_side_sent_the_other_received(runs):
    """The plant acts in tick k + 1 on what the controller sent in tick k."""
    plant, controller = runs["zenoh1"]
    sent = [data[12:] for _, data in plant["/frames/sent"]]
    assert sent == [data[12:] for _, data in controller["/frames/received"]]
    answers = [data[16:] for _, data in controller["/frames/sent"]]
    assert answers[:-1] == [data[16:] for _, data in plant["/frames/received"]]


def test_every_tick_is_in_both_logs(runs):
    for side in runs["zenoh1"]:
        assert [t for t, _ in side["/timing"]] == [k * 1_000_000 for k in range(500)]


def test_summary_of_a_process_is_one_json_line(tmp_path):
    config = tmp_path / "scenario.json"
    tree = SCENARIO | {"link": {"kind": "memory"}, "run": {"duration_s": 0.02}, "events": {}}
    config.write_text(resolve(build(tree, "test")).model_dump_json())
    process = start("bench.run.single_process", "--config", config)
    output, errors = process.communicate(timeout=DEADLINE_S)
    assert (process.returncode, errors) == (0, "")
    facts = json.loads(output.splitlines()[-1])
    assert facts["plant"]["ticks"] == facts["controller"]["ticks"] == 20
    assert facts["controller"]["reception"]["ok"] == 40
