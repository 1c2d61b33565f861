"""Plant and controller as services: ready, watched, resumed, reloaded, ended."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import hil.log

WAIT_S = 30.0


class Manager:
    """Stands in for the service manager: starts a service and hears what it tells."""

    def __init__(self, directory: Path, process: str, config: Path) -> None:
        self.process = process
        self.directory = directory / process
        self.directory.mkdir(exist_ok=True)
        self._config = config
        address = self.directory / "notify"
        address.unlink(missing_ok=True)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(address))
        self._socket.settimeout(0.2)
        environment = {
            **os.environ,
            "NOTIFY_SOCKET": str(address),
            "RUNTIME_DIRECTORY": str(self.directory),
        }
        arguments = [process, "--config", str(config), "--logs", str(self.directory)]
        self.child = subprocess.Popen(
            [sys.executable, "-P", "-m", "bench.run.service", *arguments],
            env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip

    def hear(self, found: Callable[[str], bool]) -> str:
        """Return the first message from now on for which this holds."""
        end_s, last = time.monotonic() + WAIT_S, ""
        while time.monotonic() < end_s:
            with contextlib.suppress(TimeoutError):
                message = self._socket.recv(4096).decode()
                if found(message):
                    return message
                last = message if "STATUS" in message else last
        raise AssertionError(f"{self.process} did not tell it in {WAIT_S:g} s; last: {last}")

    def hear_text(self, text: str) -> str:
        return self.hear(lambda message: text in message)

    def prepare_set_points(self) -> int:
        out = self.directory / "set-points.json"
        arguments = ["set-points", "--config", str(self._config), "--out", str(out)]
        return subprocess.run(
            [sys.executable, "-P", "-m", "bench.run.service", *arguments], check=False,
            stderr=subprocess.DEVNULL,
        ).returncode  # fmt: skip

    def end(self) -> int:
        """Ask it to end; returns its exit code."""
        self.child.send_signal(signal.SIGTERM)
        self.child.communicate(timeout=WAIT_S)
        return self.child.returncode

    def kill(self) -> None:
        self.child.kill()
        self.child.communicate()

    def leave(self) -> None:
        """Give everything back."""
        if self.child.poll() is None:
            self.kill()
        self._socket.close()


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "engine.toml"
    path.write_text(
        f"""
begins = "at-rest"
[loop]
rate_hz = 1000
peer_timeout_s = 30
[link.zenoh]
plant_endpoint = "unixsock-stream/{tmp_path}/p.sock"
controller_endpoint = "unixsock-stream/{tmp_path}/c.sock"
[safety]
rearm = true
[plant]
stale_s = 0.1
[controller]
running = false
tdc_ref_m = 0.0155
limits.stale_s = 0.1
[events]
"""
        + "".join(f'start-{k} = {{ kind = "start", at_s = {k} }}\n' for k in range(1, 6))
    )
    return path


@pytest.fixture
def serve(tmp_path: Path, config: Path) -> Iterator[Callable[[str], Manager]]:
    started: list[Manager] = []

    def start(process: str) -> Manager:
        started.append(Manager(tmp_path, process, config))
        return started[-1]

    yield start
    for manager in started:
        manager.leave()


@pytest.mark.slow
def test_a_killed_controller_resumes_and_takes_new_set_points(
    config: Path, serve: Callable[[str], Manager]
) -> None:
    controller = serve("controller")
    assert "EXTEND_TIMEOUT_USEC" in controller.hear_text("waiting for the plant")
    plant = serve("plant")
    assert controller.hear_text("READY=1").startswith("READY=1")
    plant.hear_text("READY=1")
    controller.hear_text("STATUS=generating")
    controller.hear_text("WATCHDOG=1")

    config.write_text(config.read_text().replace("0.0155", "0.0152"))
    assert controller.prepare_set_points() == 0
    controller.child.send_signal(signal.SIGHUP)
    controller.hear_text("of 15.20 mm")
    config.write_text(config.read_text().replace("0.0152", "0.9"))
    assert controller.prepare_set_points() == 2

    config.write_text(config.read_text().replace("0.9", "0.0155"))
    controller.kill()
    plant.hear_text("STATUS=safe state")
    controller = serve("controller")
    controller.hear(lambda told: "generating" in told and "of 15.20 mm" in told)
    plant.hear_text("STATUS=controlled")

    assert controller.end() == 0
    assert plant.end() == 0
    _, log = sorted(controller.directory.glob("*.mcap"), key=lambda path: path.stat().st_mtime)
    with hil.log.open(log) as reader:
        told = [record.text for record in reader.records("/event")]
    assert "start from resume" in told
    assert "OFF -> MOTORING: start requested" in told


@pytest.mark.slow
def test_a_controller_gives_up_on_a_plant_that_begins_anew(
    serve: Callable[[str], Manager],
) -> None:
    plant, controller = serve("plant"), serve("controller")
    controller.hear_text("STATUS=generating")
    plant.kill()
    controller.hear_text("STATUS=safe")
    serve("plant")  # ready once its own controller answers
    _, errors = controller.child.communicate(timeout=WAIT_S)
    assert controller.child.returncode == 3
    assert "plant began anew" in errors


def test_a_service_ends_at_once_while_it_waits_for_its_peer(
    serve: Callable[[str], Manager],
) -> None:
    plant = serve("plant")
    plant.hear_text("waiting for the controller, up to 30 s")
    begin_s = time.monotonic()
    assert plant.end() == 0
    assert time.monotonic() - begin_s < WAIT_S / 2


@pytest.mark.parametrize(("line", "named"), [
    ('clock = "lockstep"', "real time only"),
    ('peer_timeout_s = -1', "loop.peer_timeout_s"),
])  # fmt: skip
def test_what_is_no_service_is_refused(tmp_path: Path, line: str, named: str) -> None:
    path = tmp_path / "engine.toml"
    path.write_text(f"[loop]\n{line}\n")
    done = subprocess.run(
        [sys.executable, "-P", "-m", "bench.run.service", "plant", "--config", str(path)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert named in done.stderr
    assert len(done.stderr.splitlines()) == 1
