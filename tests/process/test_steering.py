"""Who may steer an engine: processes really started, operators really asking."""

from __future__ import annotations

import json
import os
import shutil
import socket
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

WAIT_S = 20.0
NOBODY = 65534

BASE = """
begins = "at-rest"
[run]
duration_s = 600
[loop]
rate_hz = 1000
peer_timeout_s = 15
[log]
enabled = false
[controller]
running = false
limits.stale_s = 0.1
[plant]
stale_s = 0.1
"""
"""A stall of a busy machine is not what is tried here: it takes no engine."""


@pytest.fixture
def engine() -> Iterator[Path]:
    """The engine's directory; the paths of sockets are short."""
    folder = Path(tempfile.mkdtemp(prefix="hil-t"))
    yield folder / "own"
    shutil.rmtree(folder)


class Bench:
    """Processes of one user with one engine's directory."""

    def __init__(self, folder: Path, engine: Path) -> None:
        self._folder = folder
        self.environment = {**os.environ, "HIL_RUNTIME_DIRECTORY": str(engine)}
        self.started: list[subprocess.Popen[str]] = []

    def config(self, name: str, text: str = BASE) -> Path:
        path = self._folder / f"{name}.toml"
        path.write_text(text)
        return path

    def start(self, side: str, text: str = BASE, *more: str) -> subprocess.Popen[str]:
        name = f"{side}{len(self.started)}"
        arguments = [side, "--config", str(self.config(name, text)), *more]
        self.started.append(
            subprocess.Popen(
                [sys.executable, "-P", "-m", "bench.cli", *arguments], env=self.environment,
                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            )
        )  # fmt: skip
        return self.started[-1]

    def hil(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-P", "-m", "bench.cli", *arguments], env=self.environment,
            check=False, capture_output=True, text=True, timeout=WAIT_S,
        )  # fmt: skip

    def pair(self, text: str = BASE) -> None:
        """Start plant and controller; return when they run."""
        self.start("plant", text)
        self.start("controller", text)
        end_s = time.monotonic() + WAIT_S
        while (
            told := self.hil("status", "--json")
        ).returncode or '"controller"' not in told.stdout:
            assert time.monotonic() < end_s, told.stderr

    def end(self) -> None:
        for process in self.started:
            if process.poll() is None:
                process.kill()
            process.communicate()


@pytest.fixture
def bench(tmp_path: Path, engine: Path) -> Iterator[Bench]:
    made = Bench(tmp_path, engine)
    yield made
    made.end()


def as_nobody(program: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a program of the standard library as another user."""
    if os.geteuid() or shutil.which("setpriv") is None:
        pytest.skip("only root can be somebody else")
    drop = ["setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups"]
    python = "/usr/bin/python3"
    return subprocess.run(
        [*drop, python, "-c", program, *arguments], check=False, capture_output=True, text=True,
        cwd="/",
    )  # fmt: skip


CONNECT = "import socket, sys; socket.socket(socket.AF_UNIX).connect(sys.argv[1])"


@pytest.mark.slow
def test_a_pair_meets_on_sockets_that_only_its_user_reaches(bench: Bench, engine: Path) -> None:
    bench.pair()
    for side in ("plant", "controller"):
        path = engine / f"fpeg-{side}.sock"
        assert stat.S_ISSOCK(path.stat().st_mode)
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        with socket.socket(socket.AF_UNIX) as connection:
            connection.connect(str(path))
        assert "PermissionError" in as_nobody(CONNECT, str(path)).stderr
    for process in bench.started:
        assert listening_ports(process.pid) == set()


def listening_ports(pid: int) -> set[int]:
    """TCP ports on which a process listens."""
    handles = [str(link.readlink()) for link in Path(f"/proc/{pid}/fd").iterdir()]
    inodes = {name.removeprefix("socket:[").removesuffix("]") for name in handles}
    found = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/{pid}/net/{table}").read_text().splitlines()[1:]:
            _, local, _, state, *rest = line.split()
            if state == "0A" and rest[5] in inodes:
                found.add(int(local.rpartition(":")[2], 16))
    return found


@pytest.mark.slow
@pytest.mark.skipif(os.geteuid() != 0, reason="only root makes a stranger's directory")
def test_a_directory_that_a_stranger_has_made_is_refused_by_both_sides(
    bench: Bench, engine: Path
) -> None:
    engine.mkdir(mode=0o700)
    os.chown(engine, NOBODY, NOBODY)
    for process in (bench.start("plant"), bench.start("controller")):
        _, errors = process.communicate(timeout=WAIT_S)
        assert (process.returncode, len(errors.splitlines())) == (2, 1)
        assert f"{engine}: belongs to user {NOBODY}" in errors
    told = bench.hil("status")
    assert (told.returncode, len(told.stderr.splitlines())) == (3, 1)  # no engine of this user


RUNNING = BASE.replace("running = false", "running = true")

FLOOD = """
import json, sys, time
import zenoh
from drivers.zenoh.config import session_config
from drivers.zenoh.sockets import placed
from hil.config.process import ZenohConfig
tree = session_config("bench", placed(ZenohConfig(), "bench"), lockstep=False)
session = zenoh.open(zenoh.Config.from_json5(json.dumps(tree)))
key, size = sys.argv[1], int(sys.argv[2])
publisher = session.declare_publisher(key, congestion_control=zenoh.CongestionControl.BLOCK)
while not publisher.matching_status.matching:
    time.sleep(0.01)
print("there", flush=True)
end = time.monotonic() + float(sys.argv[3])
while time.monotonic() < end:
    publisher.put(b'{"kind": "law", "law": "cascade"}' if size == 0 else bytes(size))
    if size > 1 << 20:
        break
time.sleep(1.0)
session.close()
"""


def flood(bench: Bench, key: str, size: int, duration_s: float) -> subprocess.Popen[str]:
    """Put messages on a key as fast as they go, from another process."""
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", FLOOD, key, str(size), str(duration_s)],
        env=bench.environment, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    bench.started.append(process)
    assert process.stdout is not None
    assert process.stdout.readline() == "there\n"
    return process


@pytest.mark.slow
def test_a_command_is_answered_with_its_tick_or_with_the_reason(bench: Bench) -> None:
    bench.pair()
    told = bench.hil("set", "tdc_ref_m=0.0152")
    assert told.returncode == 0, told.stderr
    assert "controller.tdc_ref_m = 0.0152 (was 0.0155); from tick " in told.stdout
    told = bench.hil("set", "tdc_ref_m=0.03")
    assert (told.returncode, told.stdout) == (1, "")
    assert "tdc_ref_m" in told.stderr
    assert "accepted" in told.stderr
    assert len(told.stderr.splitlines()) == 1


@pytest.mark.slow
def test_no_flood_drowns_a_stop(bench: Bench) -> None:
    bench.pair(RUNNING)
    floods = [flood(bench, f"hil/fpeg/{key}", 0, 12.0) for key in ("command", "command")]
    for _ in range(2):
        told = bench.hil("stop")
        assert told.returncode == 0, told.stderr
        assert "taken at tick" in told.stdout
        told = bench.hil("start")  # behind the flood, or refused for want of room: never lost
        assert told.returncode in {0, 3, 4}
        assert told.stdout or len(told.stderr.splitlines()) == 1
    told = bench.hil("stop")
    assert told.returncode == 0, told.stderr
    for process in floods:
        process.communicate(timeout=WAIT_S)
    mode = json.loads(bench.hil("status", "--json").stdout)["controller"]["mode"]
    assert mode in {"off", "stopping", "safe"}  # safe where the flood has held up the machine
    assert [process.poll() for process in bench.started[:2]] == [None, None]


def grown_kib(pid: int) -> int:
    """The most memory that a process has had [KiB]."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith("VmHWM")).split()[1])


@pytest.mark.slow
@pytest.mark.parametrize("key", ["frames/controller", "frames/plant", "command"])
def test_a_message_of_100_mb_takes_no_memory(bench: Bench, key: str) -> None:
    bench.pair()
    before = [grown_kib(process.pid) for process in bench.started[:2]]
    flood(bench, f"hil/fpeg/{key}", 100_000_000, 1.0).communicate(timeout=WAIT_S)
    for process, most in zip(bench.started[:2], before, strict=True):
        assert process.poll() is None
        assert grown_kib(process.pid) - most < 20_000
    assert bench.hil("status").returncode == 0
