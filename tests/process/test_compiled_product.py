"""What `hil compile` makes is the same product: every scenario, every command, every loop.

Each row runs twice, with the loops compiled and interpreted, and must come to the same. Here the
loops are compiled by `./check compiled`; without it only the table of commands is looked at.
"""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest
import typer

from bench.cli import app

COMPILED = os.environ.get("HIL_TEST_COMPILED", "")
WAYS = {"compiled": COMPILED, "interpreted": "off"}
HIL = [sys.executable, "-m", "bench.cli"]
HERE = Path(__file__).parent
GOLDEN = HERE.parent / "golden"
BUS = "zenoh:compiled"
MEMORY = "--link memory --clock lockstep"
SHORT = "--set events.load.at_s=0.2 --set run.duration_s=0.7"
LINKS = {
    "memory": MEMORY,
    "zenoh": "--link zenoh --clock lockstep",
    "shm": "--link shm --clock lockstep",
    "can": f"--link can --bus {BUS} --clock lockstep",
}

needs_compiled = pytest.mark.skipif(not COMPILED, reason="compiled loops: ./check compiled")
pytestmark = pytest.mark.timeout(300)


class Row(NamedTuple):
    """One use of a command; `same` is what must agree besides the exit code."""

    arguments: str
    same: bool = True


TIMED = False
"""What is printed is measured times: one after the other, and only the exit code must agree."""

ROWS = {
    "run": [Row(f"load-decrease {MEMORY} {SHORT} --out again", TIMED)],
    "scenarios": [Row("")],
    "report": [Row("run --picture run.svg")],
    "check": [Row("", TIMED)],
    "compile": [Row(f"--into {COMPILED or 'none'}")],
    "replay": [Row("run/plant.mcap"), Row("run/controller.mcap --from 0.1 --to 0.5")],
    "diff": [Row("run/plant.mcap nonlinear/plant.mcap"), Row("run/plant.mcap run/plant.mcap")],
    "info": [Row("run/controller.mcap --verify")],
    "export": [Row("run/plant.mcap --to csv --out csv")],
    "repair": [Row("run/plant.mcap --out repaired.mcap")],
    "golden": [Row(f"--directory {GOLDEN}")],
    "what-if": [
        Row("run --from 0.3 --set plant.load_coefficient_n_s_m=800 --out what-if"),
        Row("run --from 0.3 --set controller.name=predictive --out what-if-law"),
    ],
    "compare": [Row("--controllers cascade,observer --out compared")],
    "tune": [Row("cascade"), Row("pdf --model harmonic --search --generations 1", TIMED)],
    "map": [Row("--tdc 15.5 --out mapped.toml")],
    "campaign": [Row("robustness --runs 4 --out campaign")],
    "atlas": [Row("F6.2 F5.8 --out atlas", TIMED)],
    "bench latency": [
        Row(f"--link {link} --rate 200 --rounds 1 --seconds 0.5", TIMED)
        for link in ("zenoh", "shm")
    ],
    "bench rate": [Row("--lowest 100 --highest 200 --seconds 0.5", TIMED)],
    "bench lockstep": [Row("--seconds 1", TIMED)],
    "bench step": [Row("--ticks 200", TIMED)],
    "bench recorder": [Row("--ticks 10000", TIMED)],
    "bench soak": [Row("--minutes 0.1 --rate 200 --out soak", TIMED)],
    "bus list": [Row("", TIMED)],
    "bus load": [Row("run")],
    "bus faults": [Row("")],
    "bus fuzz": [Row("--frames 2000")],
    "bus cost": [Row("", TIMED)],
    "engine table": [Row("")],
    "engine sweep": [Row("--over load"), Row("--over fuel")],
    "engine analyse": [Row("")],
    "engine ignition": [Row("")],
    "engine precision": [Row("", TIMED)],
    "engine sensitivities": [Row("--model nonlinear")],
    "parameters": [Row("cascade")],
    "signals": [Row("stroke")],
    "scenario prove": [Row("steady --set run.duration_s=0.4", TIMED)],
    "new": [Row("law my-law")],
    "fmu export": [Row("unit.fmu --model nonlinear")],
    "fmu check": [Row("../unit.fmu")],
}
LIVE = {"plant", "controller", "status", "set", "start", "stop", "bus monitor"}
"""Commands that need a running pair: the tests at the end."""

SERVERS = {"foxglove", "get", "panel", "view", "xcp"}
"""What serves a page or a tool beside a pair, and reads it: tests of their own."""


def hil(way: str, where: Path, arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*HIL, *arguments.split()], cwd=where, text=True, env=environment(way, where),
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


def environment(way: str, where: Path) -> dict[str, str]:
    sources = str(HERE.parents[1])
    return os.environ | {
        "HIL_COMPILED": WAYS[way], "PYTHONPATH": sources,
        "COLUMNS": "200",
    }  # fmt: skip


def finished(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    out, err = process.communicate(timeout=120)
    return process.returncode, out, err


def both(base: Path, arguments: str, *, at_once: bool = True) -> dict[str, tuple[int, str, str]]:
    """Run a command both ways, each in its directory of the same name below `base`."""

    def run(way: str) -> tuple[int, str, str]:
        (base / way).mkdir(exist_ok=True)
        return finished(hil(way, base / way, arguments))

    with ThreadPoolExecutor(len(WAYS) if at_once else 1) as pool:
        return dict(zip(WAYS, pool.map(run, WAYS), strict=True))


MEASURED = re.compile(r"in [\d.,]+ m?s|[\d.,]+( \w?i?B)?/s|[\d.,]+ × real time|\d+:\d\d:\d\d")
PROGRESS = re.compile(r"^.* \d+ of \d+ .*, about .* left\n", re.MULTILINE)
CHUNKED = re.compile(r"[\d.,]+ \w?i?B in \d+ file|\d+ (whole )?chunks")
"""A log's chunks end where its recorder found the time."""


def timeless(text: str) -> str:
    """Leave out what differs from run to run of one and the same way."""
    return CHUNKED.sub("", MEASURED.sub("", text))


def judged(directory: Path) -> dict[str, object]:
    """A run's summary without what is measured of the machine; sums go by chunks of the log."""
    told = json.loads(
        (directory / "summary.json").read_text(), parse_float=lambda t: f"{float(t):.12g}"
    )
    told["figures"] = {
        name: value for name, value in told["figures"].items()
        if name.partition("_")[0] not in {"wall", "speed", "processor", "plant", "controller"}
    }  # fmt: skip
    del told["run"]
    return told


@pytest.fixture(scope="module", autouse=True)
def sockets():
    """A directory for the buses; the path of a unix socket is short."""
    with tempfile.TemporaryDirectory(prefix="can-") as name, pytest.MonkeyPatch.context() as patch:
        patch.setenv("HIL_CAN_DIRECTORY", name)
        yield


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """Two directories with the same finished runs and unit, for the commands that need some."""
    base = tmp_path_factory.mktemp("product")
    made = {
        f"run load-decrease {MEMORY} {SHORT} --out run",
        f"run load-decrease {MEMORY} {SHORT} --model nonlinear --no-report --out nonlinear",
    }
    for arguments in made:
        assert {code for code, _, _ in both(base, arguments).values()} <= {0, 1}
    done = subprocess.run(
        [*HIL, "fmu", "export", str(base / "unit.fmu")], capture_output=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return base


def names_of(command, path=()):
    """Every command of the application by its words."""
    if not hasattr(command, "commands"):
        return [" ".join(path)]
    inner = command.commands.items()
    return [name for word, sub in inner for name in names_of(sub, (*path, word))]


def test_every_command_has_its_row_here():
    assert sorted([*ROWS, *LIVE, *SERVERS]) == sorted(names_of(typer.main.get_command(app)))


@needs_compiled
def test_every_loop_gives_the_same_bits(tmp_path):
    def told(way):
        done = subprocess.run(
            [sys.executable, str(HERE / "loop_matrix.py"), str(tmp_path / "runs" / way)],
            env=environment(way, tmp_path), capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, f"{way}: {done.stderr}"
        return json.loads(done.stdout)

    (tmp_path / "runs").mkdir()
    with ThreadPoolExecutor() as pool:
        compiled, interpreted = pool.map(told, WAYS)
    assert (compiled.pop("compiled"), interpreted.pop("compiled")) == (True, False)
    assert compiled == interpreted
    ran = [outcome for outcome in compiled.values() if "Error" not in outcome]
    assert len(ran) > 60


@needs_compiled
@pytest.mark.parametrize("link", LINKS)
def test_every_link_comes_to_the_same_summary(tmp_path, link):
    arguments = f"run load-increase-variations {LINKS[link]} --set run.duration_s=1.5 --no-report"
    told = {}
    for way in WAYS:
        (tmp_path / way).mkdir()
        ended = finished(hil(way, tmp_path / way, f"{arguments} --out out"))
        told[way] = ended[0], ended[2], judged(tmp_path / way / "out")
    assert told["compiled"] == told["interpreted"]
    assert told["compiled"][0] in {0, 1}


@needs_compiled
@pytest.mark.parametrize("link", ["zenoh", "shm", f"can --bus {BUS}"])
def test_every_link_runs_in_real_time(tmp_path, link):
    arguments = f"run variations --link {link} --clock realtime --no-report --out out"
    code, _, err = finished(
        hil("compiled", tmp_path, f"{arguments} --set run.duration_s=1 --set loop.rate_hz=500")
    )
    assert (code in (0, 1, 4), err) == (True, "")  # a stalled machine may spoil the run itself


@needs_compiled
@pytest.mark.parametrize(
    ("command", "row"), [(name, row) for name, rows in ROWS.items() for row in rows],
    ids=lambda value: value.arguments if isinstance(value, Row) else value,
)  # fmt: skip
def test_every_command_does_the_same(bench, command, row):
    ended = both(bench, f"{command} {row.arguments}", at_once=row.same)
    told = {}
    for way, (code, out, err) in ended.items():
        printed = timeless(out.replace(str(bench / way), "")) if row.same else ""
        told[way] = code, printed, PROGRESS.sub("", err)
        if not row.same:  # what measures may find that interpreted loops take too long
            told[way] = code in (0, 1, 4), printed, PROGRESS.sub("", err)
    assert told["compiled"] == told["interpreted"]


@contextmanager
def pair(way: str, where: Path):
    """A pair that runs in real time, and is interrupted in the end."""
    run = "run steady --link zenoh --clock realtime --no-report --out live"
    run += " --set run.duration_s=300"
    run += " --set plant.stale_s=0.1 --set controller.limits.stale_s=0.1"
    with hil(way, where, run) as process:
        try:
            yield process
            process.send_signal(signal.SIGINT)
            assert finished(process)[0] == 130
        finally:
            if process.poll() is None:
                process.kill()


def asked(way: str, where: Path, arguments: str) -> tuple[int, str, str]:
    return finished(hil(way, where, arguments))


@needs_compiled
@pytest.mark.parametrize("way", WAYS)
def test_a_running_pair_is_told_and_asked(tmp_path, way):
    with pair(way, tmp_path) as process:
        end_s = time.monotonic() + 30.0
        while asked(way, tmp_path, "status --config live --json")[0] != 0:
            assert process.poll() is None
            assert time.monotonic() < end_s
        told = json.loads(asked(way, tmp_path, "status --config live --json")[1])
        assert isinstance(told["plant"]["tick"], int)
        assert isinstance(told["controller"]["tick"], int)
        for order in ("set tdc_ref_m=0.0152", "set law=predictive", "stop", "start"):
            code, _, err = asked(way, tmp_path, f"{order} --config live")
            assert (code, err) == (0, ""), order


@needs_compiled
@pytest.mark.parametrize("way", WAYS)
def test_two_processes_started_one_by_one_end_together(tmp_path, way):
    (tmp_path / "pair.toml").write_text(
        f"""
[run]
duration_s = 0.5
[loop]
clock = "lockstep"
[link.zenoh]
plant_endpoint = "unixsock-stream/{tmp_path}/p.sock"
controller_endpoint = "unixsock-stream/{tmp_path}/c.sock"
"""
    )
    both_sides = [
        hil(way, tmp_path, f"{side} --config pair.toml --log {side}.mcap")
        for side in ("plant", "controller")
    ]
    for process in both_sides:
        code, _, err = finished(process)
        assert (code, err) == (0, "")
    assert finished(hil(way, tmp_path, "info plant.mcap"))[0] == 0


@needs_compiled
def test_a_monitor_reads_the_bus_of_a_run(tmp_path):
    monitor = hil("compiled", tmp_path, f"bus monitor {BUS} --count 400 --seconds 60")
    run = hil("compiled", tmp_path, f"run steady --link can --bus {BUS} --clock lockstep"
              " --no-report --out out --set run.duration_s=60")  # fmt: skip
    code, out, err = finished(monitor)
    assert (code, err) == (0, "")
    assert {"PlantTick", "PistonSample"} <= set(out.split())
    run.send_signal(signal.SIGINT)
    assert finished(run)[0] == 130
