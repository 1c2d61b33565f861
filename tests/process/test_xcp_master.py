"""The XCP slave under a public master: no sample of twenty at 1 kHz is lost, a gain is changed."""

import contextlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import run_rig

import hil.log

pytest.importorskip("pyxcp", reason="needs pyxcp (extra test)")

pytestmark = [pytest.mark.slow, pytest.mark.timeout(180)]

ROWS = 1500
EVERY_TICK = {"plant": "/truth", "controller": "/sensor"}
"""The topic of each side that has a row for every tick, skipped ones too; for every sample."""

GAIN = "controller.cascade.outer.kp"
HIL = [sys.executable, "-m", "bench.cli"]


@contextlib.contextmanager
def served(out):
    """Serve a run to a master; yields the port."""
    command = [*HIL, "xcp", "--port", "0", "--run", str(out)]
    slave = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        yield slave.stdout.readline().partition(":")[2].partition(",")[0]
    finally:
        slave.terminate()
        slave.communicate()


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """What the master got over TCP and over UDP, and the run that it measured, ended since."""
    folder = tmp_path_factory.mktemp("xcp")
    out = folder / "out"
    found = {}
    with run_rig.ended(run_rig.start(out, duration_s=900.0)) as run:
        with served(out) as port:
            for protocol in ("TCP", "UDP"):
                file = folder / f"{protocol}.npz"
                words = [Path(__file__).with_name("xcp_master.py"), protocol, port, str(ROWS), file]
                subprocess.run([sys.executable, *words], check=True, timeout=120)
                found[protocol] = dict(np.load(file))
                assert len(found[protocol]) == 20
        run.terminate()
        run.communicate(timeout=60)
    return found, out


@pytest.mark.parametrize("protocol", ["TCP", "UDP"])
@pytest.mark.parametrize("side", ["plant", "controller"])
def test_no_tick_of_the_log_is_lost_and_each_has_its_values(measured, protocol, side):
    found, out = measured
    values = {name: v for name, v in found[protocol].items() if name.startswith(side)}
    (ticks,) = (v.astype(np.int64) for name, v in values.items() if name.endswith(".tick"))
    assert len(ticks) >= ROWS
    with hil.log.open(out / f"{side}.mcap") as log:
        logged = log.array(EVERY_TICK[side])["tick"]
        within = (logged >= ticks[0]) & (logged <= ticks[-1])
        assert np.array_equal(np.unique(ticks), logged[within])
        for name, value in values.items():
            _, topic, field = name.split(".")
            rows = log.array(f"/{topic}")
            at = np.searchsorted(rows["tick"], ticks, side="right") - 1  # missed: the last holds
            assert np.array_equal(rows[field][at], value), name


def test_a_gain_that_the_master_changes_is_logged_with_who_did_it_and_replayed(measured):
    _, out = measured
    with hil.log.open(out / "controller.mcap") as log:
        commands = [(c.origin, json.loads(bytes(c.data))) for c in log.records("/command")]
    changed = [(origin, table[GAIN]) for origin, table in commands if GAIN in table]
    assert [gain for _, gain in changed] == [41.0, 43.0]
    assert all(origin.startswith("hil xcp") for origin, _ in changed)
    done = subprocess.run(
        [*HIL, "replay", str(out / "controller.mcap")], check=False, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
