"""An engine in a file of one's own runs over every link in lockstep, to the same bits."""

import subprocess
import sys

import pytest

from bench.own.beginning import write

HIL = [sys.executable, "-m", "bench.cli"]

pytestmark = [pytest.mark.slow, pytest.mark.timeout(180)]


def hil_of(*words):
    return subprocess.run([*HIL, *map(str, words)], check=False, capture_output=True, text=True)


@pytest.fixture(scope="module")
def engine(tmp_path_factory):
    """An engine as `hil new engine` writes it, and its run in one process."""
    folder = tmp_path_factory.mktemp("own")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        file = folder / write("engine", "mine", force=False)
    run_over("memory", file, folder / "memory")
    return file


def run_over(link, file, out):
    done = hil_of(
        "run", "load-decrease", "--model", file, "--link", link, "--clock", "lockstep",
        "--no-report", "--out", out, "--set", "events.load.at_s=0.1", "--set", "run.duration_s=0.4",
    )  # fmt: skip
    assert done.returncode in (0, 1), done.stderr  # the template meets no band of ours so soon


@pytest.mark.parametrize("link", ["zenoh", "shm"])
def test_two_processes_have_the_logs_of_one(engine, link):
    out = engine.parent / link
    run_over(link, engine, out)
    told = hil_of("diff", engine.parent / "memory", out)
    assert told.returncode == 0, told.stdout
    again = hil_of("replay", out / "plant.mcap", "--model", engine)
    assert again.returncode == 0, again.stdout + again.stderr
