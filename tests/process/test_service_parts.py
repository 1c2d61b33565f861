"""The parts of a service: what it tells its manager, what it keeps, how it records."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import hil.log
from controller.duty import RESUME_TRIES, DutyCommands, Resumption
from controller.mode.start_restart import Mode
from drivers.channels import MemoryCommands
from drivers.recorder.client import Recorder
from drivers.recorder.output import wait_finished
from drivers.system.keepsake import SIZE, Keepsake
from drivers.system.notify import Notifier
from drivers.system.service import KEPT_LOGS, Heart, log_file
from hil.errors import ConfigError, RunError
from hil.log import topics
from hil.values import NEVER


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as heard:
        heard.bind(str(tmp_path / "notify"))
        heard.setblocking(False)
        yield heard


def heard_by(manager: socket.socket) -> list[str]:
    messages = []
    while True:
        try:
            messages.append(manager.recv(4096).decode())
        except BlockingIOError:
            return messages


@pytest.fixture
def notifier(tmp_path: Path, manager: socket.socket) -> Iterator[Notifier]:
    told = Notifier({"NOTIFY_SOCKET": str(tmp_path / "notify")})
    yield told
    told.close()


def test_without_a_manager_nothing_is_told() -> None:
    silent = Notifier({})
    silent.ready("here")
    silent.feed()
    assert silent.watchdog_ns == 0


def test_a_manager_that_has_gone_is_no_fault(tmp_path: Path) -> None:
    Notifier({"NOTIFY_SOCKET": str(tmp_path / "nobody")}).feed()


@pytest.mark.parametrize(("usec", "pid", "ns"), [
    ("2000000", str(os.getpid()), 2_000_000_000),
    ("2000000", "1", 0),
    ("soon", str(os.getpid()), 0),
])  # fmt: skip
def test_the_watchdog_is_for_one_process(usec: str, pid: str, ns: int) -> None:
    assert Notifier({"WATCHDOG_USEC": usec, "WATCHDOG_PID": pid}).watchdog_ns == ns


def test_ready_is_told_once_and_only_after_the_first_answer(
    notifier: Notifier, manager: socket.socket
) -> None:
    heart = Heart(notifier, rate_hz=1000)
    heart.start(0)
    heart.beat(0, False, lambda: "waiting")
    assert not any("READY=1" in message for message in heard_by(manager))
    heart.beat(50, True, lambda: "running")
    assert sum("READY=1" in message for message in heard_by(manager)) == 1
    heart.beat(100, True, lambda: "running")
    assert heard_by(manager) == ["WATCHDOG=1"]
    assert heart.next_tick == 150


def test_a_run_that_is_no_service_never_beats() -> None:
    heart = Heart()
    heart.start(0)
    assert heart.next_tick == NEVER


def test_a_hang_up_is_told_to_the_loop_once(notifier: Notifier) -> None:
    before = signal.getsignal(signal.SIGHUP)
    try:
        heart = Heart(notifier, rate_hz=100)
        heart.start(0)
        assert not heart.beat(0, True, lambda: "")
        signal.raise_signal(signal.SIGHUP)
        assert heart.beat(5, True, lambda: "")
        assert not heart.beat(10, True, lambda: "")
    finally:
        signal.signal(signal.SIGHUP, before)


def test_what_is_kept_outlives_the_process(tmp_path: Path) -> None:
    path = tmp_path / "duty.json"
    program = (
        "import os, pathlib, sys; from drivers.system.keepsake import Keepsake;"
        "Keepsake(pathlib.Path(sys.argv[1])).keep({'running': True}); os.kill(os.getpid(), 9)"
    )
    subprocess.run([sys.executable, "-c", program, str(path)], check=False)
    assert Keepsake(path).read() == {"running": True}


@pytest.mark.parametrize("content", [b"", b"\0" * SIZE, b'{"running": tr', b"[1, 2]", b"\xff" * 9])
def test_what_was_cut_in_two_is_nothing(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "duty.json"
    path.write_bytes(content)
    assert Keepsake(path).read() == {}


def all_of(commands: DutyCommands) -> list[tuple[str, bytes]]:
    return list(iter(commands.poll, None))


def test_a_predecessor_that_ran_the_engine_speaks_first() -> None:
    others = MemoryCommands()
    commands = DutyCommands(others)
    others.submit("operator", {"kind": "start"})
    resumption = Resumption(
        {"running": True, "tdc_ref_m": 0.0152, "target_power_w": None}, rearm=True
    )
    resumption.attend(Mode.OFF, commands, stale=0)
    assert all_of(commands) == [
        ("resume", b'{"kind": "set-point", "tdc_ref_m": 0.0152}'),
        ("resume", b'{"kind": "start"}'),
        ("operator", b'{"kind": "start"}'),
    ]


def test_a_start_is_asked_for_only_on_fresh_samples_and_until_it_is_obeyed() -> None:
    commands, resumption = DutyCommands(MemoryCommands()), Resumption({"running": True}, rearm=True)
    resumption.attend(Mode.OFF, commands, stale=3)
    assert commands.idle
    for _ in range(2):
        resumption.attend(Mode.OFF, commands, stale=0)
        assert all_of(commands) == [("resume", b'{"kind": "start"}')]
    resumption.attend(Mode.MOTORING, commands, stale=0)
    resumption.attend(Mode.SAFE, commands, stale=0)
    assert commands.idle


def test_a_start_is_not_asked_for_for_ever() -> None:
    commands, resumption = DutyCommands(MemoryCommands()), Resumption({"running": True}, rearm=True)
    asked = 0
    for _ in range(100):
        resumption.attend(Mode.OFF, commands, stale=0)
        asked += len(all_of(commands))
    assert asked == RESUME_TRIES


def test_an_operators_stop_ends_the_resumption() -> None:
    others = MemoryCommands()
    commands, resumption = DutyCommands(others), Resumption({"running": True}, rearm=True)
    others.submit("operator", {"kind": "stop"})
    commands.poll()
    resumption.attend(Mode.OFF, commands, stale=0)
    assert commands.idle


def test_without_rearming_a_start_is_the_operators_to_ask_for() -> None:
    commands = DutyCommands(MemoryCommands())
    Resumption({"running": True}, rearm=False).attend(Mode.OFF, commands, stale=0)
    assert commands.idle


@pytest.mark.parametrize("kept", [{}, {"running": False, "tdc_ref_m": 0.0152}, {"running": "yes"}])
def test_a_predecessor_that_had_stopped_says_nothing(kept: dict[str, Any]) -> None:
    commands = DutyCommands(MemoryCommands())
    Resumption(kept, rearm=True).attend(Mode.OFF, commands, stale=0)
    assert commands.idle


def test_of_the_older_logs_the_newest_are_kept(tmp_path: Path) -> None:
    for number in range(KEPT_LOGS + 5):
        path = tmp_path / f"plant-{number}.mcap"
        path.touch()
        os.utime(path, (number, number))
    new = log_file(tmp_path, "plant")
    kept = {path.name for path in tmp_path.iterdir()}
    assert new.name not in kept
    assert len(kept) == KEPT_LOGS - 1
    assert f"plant-{KEPT_LOGS + 4}.mcap" in kept
    assert "plant-5.mcap" not in kept


def record_for_a_connection(path: Path, ready: threading.Event) -> None:
    """What the service manager does for one connection to the recorders' socket."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listening:
        listening.bind(str(path))
        listening.listen()
        ready.set()
        connection, _ = listening.accept()
        with connection:
            subprocess.run(
                [sys.executable, "-P", "-m", "drivers.recorder.process"], stdin=connection,
                check=True,
            )  # fmt: skip


def test_a_recorder_of_the_service_manager_writes_the_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    address, ready = tmp_path / "recorder.sock", threading.Event()
    serving = threading.Thread(target=record_for_a_connection, args=(address, ready))
    serving.start()
    ready.wait(10.0)
    monkeypatch.setenv("HIL_RECORDER_SOCKET", str(address))
    log = tmp_path / "log.mcap"
    recorder = Recorder.open(log, {"run": {"process": "plant"}}, blocking=True)
    assert recorder.pid is None
    for tick in range(100):
        recorder.put(topics.EVENT.pack(tick, tick * 1000, topics.INFO, "code", "text"))
    assert recorder.close().messages == 100
    serving.join(10.0)
    with hil.log.open(log) as reader:
        assert len(list(reader.records("/event"))) == 100


def test_the_log_is_finished_after_a_kill(tmp_path: Path) -> None:
    address, ready = tmp_path / "recorder.sock", threading.Event()
    serving = threading.Thread(target=record_for_a_connection, args=(address, ready))
    serving.start()
    ready.wait(10.0)
    log = tmp_path / "log.mcap"
    program = (
        "import os, pathlib, sys; from hil.log import topics\n"
        "from drivers.recorder.client import Recorder\n"
        "r = Recorder.open(pathlib.Path(sys.argv[1]), {}, blocking=True)\n"
        "r.put(topics.EVENT.pack(0, 0, topics.INFO, 'code', 'text')); os.kill(os.getpid(), 9)"
    )
    environment = {**os.environ, "HIL_RECORDER_SOCKET": str(address)}
    subprocess.run([sys.executable, "-c", program, str(log)], env=environment, check=False)
    serving.join(20.0)
    wait_finished(log, 10.0)
    with hil.log.open(log) as reader:
        assert [record.code for record in reader.records("/event")] == ["code"]


def test_a_missing_recorder_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HIL_RECORDER_SOCKET", str(tmp_path / "nobody"))
    with pytest.raises(RunError, match=r"recorder at .*nobody"):
        Recorder.open(tmp_path / "log.mcap", {}, blocking=True)


def test_a_log_directory_that_is_none_is_named(tmp_path: Path) -> None:
    begin_s = time.monotonic()
    with pytest.raises(ConfigError, match=r"cannot be written"):
        Recorder.open(log_file(tmp_path / "none", "plant"), {}, blocking=True)
    assert time.monotonic() - begin_s < 10.0


CHURN = """
import sys
from drivers.system import realtime
if sys.argv[1] == "reserved":
    realtime._reserve_memory()
before = sum(realtime.page_faults())
for _ in range(20):
    objects = [bytes(450) for _ in range(5000)]
    buffer = bytearray(1 << 20)
    del objects, buffer
print(sum(realtime.page_faults()) - before)
"""


def test_reserved_memory_is_not_faulted_in_again() -> None:
    def faults(how: str) -> int:
        done = subprocess.run(
            [sys.executable, "-c", CHURN, how], capture_output=True, text=True, check=True
        )
        return int(done.stdout)

    assert faults("reserved") < 100 < faults("as it is")
