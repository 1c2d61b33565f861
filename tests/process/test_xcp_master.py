"""The XCP slave under a public master: no sample of twenty at 1 kHz is lost, a gain changes."""

import contextlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import run_rig

import hil.log
from hil.log import Span

pytest.importorskip("pyxcp", reason="needs pyxcp (extra test)")

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

GAIN = "controller.cascade.outer.kp"
TICK_NS = 1_000_000
HIL = [sys.executable, "-m", "bench.cli"]


def topic_of(name):
    return f"/{name.split('.')[1]}"


@contextlib.contextmanager
def served(out):
    """A slave of a run: its port."""
    command = [*HIL, "xcp", "--port", "0", "--run", str(out)]
    slave = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        yield slave.stdout.readline().partition(":")[2].partition(",")[0]
    finally:
        slave.terminate()
        slave.communicate()


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """What the master got over TCP, and the run that it measured, ended since."""
    folder = tmp_path_factory.mktemp("xcp")
    out = folder / "out"
    run = run_rig.start(out, duration_s=900.0)
    file, script = folder / "measured.npz", Path(__file__).with_name("xcp_master.py")
    try:
        with served(out) as port:
            command = [sys.executable, script, "TCP", port, "2", file]
            subprocess.run(command, check=True, capture_output=True, timeout=120)
    finally:
        run.terminate()
        run.communicate(timeout=60)
    found = dict(np.load(file))
    assert len(found) == 20
    return found, out


@pytest.mark.parametrize("side", ["plant", "controller"])
def test_every_tick_arrives_with_the_values_of_the_log(measured, side):
    found, out = measured
    values = {name: v for name, v in found.items() if name.startswith(side)}
    (ticks,) = (v.astype(np.int64) for name, v in values.items() if name.endswith(".tick"))
    assert len(ticks) > 1000
    assert np.all(np.diff(ticks) == 1)
    span = Span((int(ticks[0]) - 1000) * TICK_NS, (int(ticks[-1]) + 1) * TICK_NS)
    with hil.log.open(out / f"{side}.mcap") as log:
        recorded = {topic: log.array(topic, span) for topic in {topic_of(name) for name in values}}
    for name, value in values.items():
        rows = recorded[topic_of(name)]
        at = np.searchsorted(rows["tick"], ticks, side="right") - 1  # missed: the last one holds
        assert np.array_equal(rows[name.rpartition(".")[2]][at], value), name


def test_a_gain_that_the_master_changes_is_logged_with_who_did_it_and_replayed(measured):
    _, out = measured
    with hil.log.open(out / "controller.mcap") as log:
        commands = [(c.origin, json.loads(bytes(c.data))) for c in log.records("/command")]
    changed = [(origin, table[GAIN]) for origin, table in commands if GAIN in table]
    assert [gain for _, gain in changed] == [41.0]
    assert all(origin.startswith("hil xcp") for origin, _ in changed)
    done = subprocess.run(
        [*HIL, "replay", str(out / "controller.mcap")], check=False, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
