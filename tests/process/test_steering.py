"""Who may steer an engine: processes really started, operators really asking."""

from __future__ import annotations

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
rate_hz = 200
peer_timeout_s = 15
[log]
enabled = false
[controller]
running = false
"""


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
    assert (told.returncode, len(told.stderr.splitlines())) == (2, 1)
