"""A campaign that is killed in the middle, for real, ends with the table of one that was not."""

import os
import signal
import subprocess
import sys
import time

import pyarrow.parquet as pq
import pytest

CAMPAIGN = """
name = "killed"
runs = 200
seed = 3
duration_s = 0.5
controllers = ["cascade", "predictive"]
[load]
at_s = 0.2
"""


def campaign(tmp_path, out):
    command = [sys.executable, "-m", "bench.cli", "campaign", "killed.toml", "--out", out]
    return subprocess.Popen(
        [*command, "--workers", "2"], cwd=tmp_path, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip


def parts_of(directory):
    return sorted(directory.glob("parts/part-*.parquet"))


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_a_campaign_killed_in_the_middle_goes_on(tmp_path):
    (tmp_path / "killed.toml").write_text(CAMPAIGN)
    assert campaign(tmp_path, "whole").wait(120) == 0
    killed = campaign(tmp_path, "cut")
    deadline_s = time.monotonic() + 120
    while len(parts_of(tmp_path / "cut")) < 2 and time.monotonic() < deadline_s:
        time.sleep(0.01)
    os.killpg(killed.pid, signal.SIGKILL)
    killed.wait()
    left = {path: path.stat().st_mtime_ns for path in parts_of(tmp_path / "cut")}
    assert 2 <= len(left) < 10
    assert not (tmp_path / "cut/results.parquet").exists()
    assert campaign(tmp_path, "cut").wait(120) == 0
    assert {path: path.stat().st_mtime_ns for path in left} == left, "a part was run twice"
    tables = [pq.read_table(tmp_path / name / "results.parquet") for name in ("whole", "cut")]
    assert tables[0].equals(tables[1])
    texts = [(tmp_path / name / "table.md").read_bytes() for name in ("whole", "cut")]
    assert texts[0] == texts[1]
