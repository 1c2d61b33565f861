"""Runs of two processes, over each link and by each clock, are repeated bit by bit."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import hil.log
from bench.logs.replay.replay import replay_file
from hil.log import topics
from hil.log.part import ALWAYS

LAYOUT = Path(__file__).parents[2] / "docs" / "foxglove-layout.json"
BUS = ("--bus", "zenoh:replay-test")
SHORT = ("--no-report", "--set", "run.duration_s=1.3")


def run(directory, *flags):
    command = [sys.executable, "-m", "bench.cli", "run", "load-decrease", "--out", str(directory)]
    done = subprocess.run(
        [*command, *flags, *SHORT], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode in (0, 1, 4), done.stderr  # the verdict is another matter
    return directory


@pytest.mark.slow
@pytest.mark.parametrize("clock", ["realtime", "lockstep"])
@pytest.mark.parametrize("link", [("zenoh",), ("can", *BUS), ("memory",)], ids=lambda link: link[0])
def test_a_live_run_is_repeated_bit_by_bit(tmp_path, link, clock):
    if link[0] == "memory" and clock == "realtime":
        pytest.skip("one thread has no answer in time")
    directory = run(tmp_path / "run", "--link", *link, "--clock", clock)
    for process in ("plant", "controller"):
        outcome = replay_file(directory / f"{process}.mcap", None, ALWAYS)
        assert outcome.found is None, outcome.found.differences
        assert not outcome.gaps
        assert outcome.ticks >= 1290


def test_another_decoder_of_ros_messages_sees_the_same(run_directory):
    highlevel = pytest.importorskip("rosbags.highlevel")
    path = run_directory / "plant.mcap"
    with hil.log.open(path) as log:
        ours = {name: log.records(name) for name in log.topics}
        with highlevel.AnyReader([path]) as reader:
            for connection, t_ns, raw in reader.messages():
                theirs = reader.deserialize(raw, connection.msgtype)
                values = next(ours[connection.topic])._asdict()
                assert t_ns == values["t_ns"]
                for name, value in values.items():
                    got = getattr(theirs, name)
                    assert same(got, value), (connection.topic, name)
        assert all(next(rest, None) is None for rest in ours.values())


def same(got, value):
    if isinstance(value, bytes):
        return bytes(got) == value
    if isinstance(value, tuple):
        return tuple(got) == value
    return got == value or (got != got and value != value)  # noqa: PLR0124  # nan


def paths_of(tree):
    """Every message path that a layout shows."""
    if isinstance(tree, dict):
        for key, value in tree.items():
            if key in {"value", "topicPath"} and isinstance(value, str) and value.startswith("/"):
                yield value
            else:
                yield from paths_of(value)
    elif isinstance(tree, list):
        for item in tree:
            yield from paths_of(item)


def test_the_layout_for_foxglove_shows_only_what_a_log_has():
    fields = {t.name: {f.name for f in t.layout.fields} for t in topics.ALL}
    shown = list(paths_of(json.loads(LAYOUT.read_text())))
    assert len(shown) > 10
    for path in shown:
        topic, _, field = path.partition(".")
        assert topic in fields, path
        assert not field or field in fields[topic], path
