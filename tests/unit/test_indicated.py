"""The indicated work of a run is the same, wherever the chunks of its log end."""

from __future__ import annotations

import pytest

import hil.log
from bench.judge.energy import read_indicated
from bench.judge.strokes import read_truth
from bench.run.commands import RunOptions, overrides, run
from bench.run.directory import RunFiles
from hil.config.resolved import read_resolved
from hil.log.part import ALWAYS


class Cut:
    """A log whose chunks end behind other rows."""

    def __init__(self, log, rows):
        self._log, self._rows = log, rows
        self.array = log.array

    def blocks(self, topic, span=ALWAYS):
        for block in self._log.blocks(topic, span):
            yield block[: self._rows]
            if len(block) > self._rows:
                yield block[self._rows :]


@pytest.fixture(scope="module")
def steady(tmp_path_factory):
    out = tmp_path_factory.mktemp("run")
    flags = overrides({"link.kind": "memory", "loop.clock": "lockstep"}, ["run.duration_s=0.4"])
    run("steady", flags, RunOptions(out, False, True))
    return RunFiles(out)


@pytest.mark.parametrize("rows", [1, 2, 3, 57])
def test_a_first_block_of_any_length_changes_nothing(steady, rows):
    scenario = read_resolved(steady.scenario)
    with hil.log.open(steady.plant_log) as log:
        strokes = read_truth(log, 0.0155, ([], [])).strokes
        whole = read_indicated(log, scenario, strokes)
        cut = read_indicated(Cut(log, rows), scenario, strokes)
    assert whole.power_w > 1000.0
    assert cut == pytest.approx(whole, rel=1e-12)
