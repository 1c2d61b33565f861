"""Compiled and interpreted loops give the same bits."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

GOLDEN = Path(__file__).parent.parent / "golden"


def hil(*arguments, **environment):
    command = [sys.executable, "-m", "bench.cli", *arguments]
    told = {**os.environ, **{name: str(value) for name, value in environment.items()}}
    return subprocess.run(command, capture_output=True, text=True, check=False, env=told)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_golden_runs_come_out_of_compiled_modules_bit_by_bit(tmp_path):
    built = hil("compile", "--into", tmp_path)
    assert built.returncode == 0, built.stderr
    asked = "import controller.loop as c, plant.loop as p; print(c.__file__, p.__file__)"
    where = subprocess.run(
        [sys.executable, "-c", asked], capture_output=True, text=True, check=True,
        env={**os.environ, "HIL_COMPILED": str(tmp_path)},
    ).stdout  # fmt: skip
    assert where.count(str(tmp_path)) == 2
    replayed = hil("golden", HIL_COMPILED=tmp_path)
    assert replayed.returncode == 0, replayed.stdout
    logs = len(list(GOLDEN.glob("*/*.mcap")))
    assert replayed.stdout.count("identical") == logs > 10
    again = hil("compile", "--into", tmp_path)
    assert again.stdout.startswith("compiled already")


def test_a_place_is_needed(tmp_path):
    refused = hil("compile", HIL_COMPILED="off")
    assert refused.returncode == 2
    assert refused.stderr == "HIL_COMPILED=off: accepted a directory, or --into DIR\n"
