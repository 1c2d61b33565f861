"""The recorder process: complete files whatever happens to the loop, and a loop that goes on."""

import mmap
import os
import random
import resource
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Channel, Schema
from mcap.stream_reader import StreamReader

import hil.log
from bench.logs.repair import repair
from drivers.recorder import ring, room
from drivers.recorder.client import NullRecorder, Recorder
from drivers.recorder.index import index_messages
from drivers.recorder.mcap_file import McapFile
from drivers.recorder.output import wait_finished
from hil.errors import ConfigError, RunError
from hil.log.topics import (
    ACTUATOR,
    ALL,
    EVENT,
    FRAMES_RECEIVED,
    FRAMES_SENT,
    SENSOR,
    TIMING,
    TRUTH,
)

ZEROS = (0, 0, 0, 0)


def tick_records(k):
    """A tick as a plant or a controller logs it."""
    t = k * 1_000_000
    return b"".join(
        (
            SENSOR.pack(k, t, 0.01, 1.0, 1e5, 1e5, 0.0, 0),
            ACTUATOR.pack(k, t, k, 2, 0.0, 30.0, 0.5, 0, ZEROS, ZEROS, ZEROS),
            TRUTH.pack(k, t, 0.01, 1.0, 2.8e-6, 30.0, 0, 0, 0, 0.0, 0, 1.4, 1.3e5),
            TIMING.pack(k, t, t, t + 50_000, t + 90_000, k - 1, 0),
            FRAMES_SENT.pack(k, t, bytes(20)),
            FRAMES_RECEIVED.pack(k, t, bytes(30)),
        )
    )


RECORDS_A_TICK = 6

# A loop that is going to be killed: it tells in shared memory how many ticks it has put.
WRITER = """
import mmap, sys, pathlib, os
sys.path[:0] = {paths!r}
from drivers.recorder.client import Recorder
from test_recorder import tick_records
count = memoryview(mmap.mmap(int(sys.argv[2]), 4096)).cast("Q")
recorder = Recorder.open(pathlib.Path(sys.argv[1]), {{"run": {{}}}}, blocking=True)
tick = 0
while True:
    recorder.put(tick_records(tick))
    tick += 1
    count[0] = tick
    if tick == int(sys.argv[3]):
        os._exit(0)
"""


class Writer:
    """A writing process and the number of ticks that it has surely put."""

    def __init__(self, path, last_tick=-1):
        fd = os.memfd_create("count")
        os.ftruncate(fd, 4096)
        self.count = memoryview(mmap.mmap(fd, 4096)).cast("Q")
        here = os.path.dirname(__file__)  # noqa: PTH120
        code = WRITER.format(paths=[here, *sys.path])
        command = [sys.executable, "-c", code, str(path), str(fd), str(last_tick)]
        self.process = subprocess.Popen(command, pass_fds=[fd])
        os.close(fd)

    def kill_after(self, ticks):
        while self.count[0] < ticks:
            assert self.process.poll() is None
        self.process.kill()
        self.process.wait()


def assert_complete(path, at_least):
    """Ours and the public readers find a finished file with every tick that was put."""
    with hil.log.open(path) as log:
        for topic in ("/sensor", "/actuator", "/truth", "/timing"):
            ticks = log.array(topic)["tick"]
            assert np.array_equal(ticks, np.arange(len(ticks)))
        assert len(ticks) >= at_least
        assert len(list(log.records("/frames/received"))) == len(ticks)
        end = log.metadata["recorder"]["end"]
    with path.open("rb") as file:
        for _ in StreamReader(file, emit_chunks=True, validate_crcs=True).records:
            pass
    with path.open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
    assert summary.statistics.message_count == len(ticks) * RECORDS_A_TICK
    return end


@pytest.mark.parametrize("seed", range(5))
def test_a_kill_at_any_instant_leaves_every_tick_that_was_put(tmp_path, seed):
    path = tmp_path / "plant.mcap"
    writer = Writer(path)
    writer.kill_after(random.Random(seed).randrange(1, 60_000))
    wait_finished(path, 20)
    assert assert_complete(path, writer.count[0]) == "writer ended without closing the log"


def test_a_writer_that_leaves_at_once_is_recorded_too(tmp_path):
    path = tmp_path / "plant.mcap"
    writer = Writer(path, last_tick=1)
    writer.process.wait()
    wait_finished(path, 20)
    assert_complete(path, 1)


def test_a_closed_log_holds_what_was_put_and_what_it_was_given(tmp_path):
    path = tmp_path / "controller.mcap"
    metadata = {"run": {"seed": "1"}, "host": {"kernel": "6.1"}}
    attachments = [("fpeg.dbc", "text/plain", b"VERSION"), ("empty", "text/plain", b"")]
    recorder = Recorder.open(path, metadata, attachments, blocking=True)
    for k in range(5000):
        recorder.put(tick_records(k))
    result = recorder.close()
    assert result == (5000 * RECORDS_A_TICK, 0)
    assert recorder.close() == result
    assert assert_complete(path, 5000) == "closed"
    with hil.log.open(path) as log:
        assert log.metadata == metadata | {"recorder": {"end": "closed"}}
        assert log.attachments["fpeg.dbc"].content == b"VERSION"
        assert log.attachments["empty"].content == b""


def test_an_empty_log_is_a_log(tmp_path):
    path = tmp_path / "empty.mcap"
    assert Recorder.open(path, {}, blocking=False).close().messages == 0
    with hil.log.open(path) as log:
        assert log.topics["/sensor"].messages == 0


def test_two_logs_of_one_process_end_on_their_own(tmp_path):
    paths = [tmp_path / "plant.mcap", tmp_path / "controller.mcap"]
    recorders = [Recorder.open(path, {}, blocking=True) for path in paths]
    for recorder in recorders:
        recorder.put(tick_records(0))
        assert recorder.close().messages == RECORDS_A_TICK


def test_signals_to_the_recorder_do_not_cut_the_log(tmp_path):
    path = tmp_path / "plant.mcap"
    recorder = Recorder.open(path, {}, blocking=True)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        os.kill(recorder.pid, number)
    recorder.put(tick_records(0))
    assert recorder.close().messages == RECORDS_A_TICK


@pytest.mark.parametrize(
    ("name", "why"), [("none/plant.mcap", "No such file"), (".", "Is a directory")]
)
def test_a_path_that_cannot_be_written_is_told_at_once(tmp_path, name, why):
    with pytest.raises(ConfigError, match=f"cannot be written: {why}"):
        Recorder.open(tmp_path / name, {}, blocking=True)


def test_a_log_in_use_is_not_overwritten(tmp_path):
    path = tmp_path / "plant.mcap"
    recorder = Recorder.open(path, {}, blocking=True)
    with pytest.raises(ConfigError, match="being written by another recorder"):
        Recorder.open(path, {}, blocking=True)
    with pytest.raises(RunError, match="still being written"):
        wait_finished(path, 0.0)
    recorder.put(tick_records(0))
    recorder.close()
    wait_finished(path, 0.0)


def stopped(recorder):
    """Stop the recorder process and wait until it has stopped."""
    os.kill(recorder.pid, signal.SIGSTOP)
    os.waitid(os.P_PID, recorder.pid, os.WSTOPPED | os.WNOWAIT)


def test_a_full_ring_drops_whole_ticks_and_the_log_says_so(tmp_path):
    path = tmp_path / "plant.mcap"
    recorder = Recorder.open(path, {}, blocking=False, ring_bytes=ring.PAGE)
    stopped(recorder)
    for k in range(100):
        recorder.put(tick_records(k))
    kept = 100 - recorder.dropped
    assert kept == ring.PAGE // len(tick_records(0))
    os.kill(recorder.pid, signal.SIGCONT)
    assert recorder.close() == (kept * RECORDS_A_TICK + 1, 100 - kept)
    with hil.log.open(path) as log:
        assert len(log.array("/sensor")) == kept
        (event,) = log.records("/event")
        assert log.metadata["recorder"]["dropped"] == str(100 - kept)
    assert (event.code, event.tick) == ("log-dropped", kept - 1)
    assert event.text.startswith(f"{100 - kept} ticks are missing")


def test_a_log_whose_last_ticks_are_missing_says_so_in_one_line(tmp_path):
    path = tmp_path / "plant.mcap"
    recorder = Recorder.open(path, {}, blocking=False, ring_bytes=ring.PAGE)
    stopped(recorder)
    for k in range(100):
        recorder.put(tick_records(k))
    os.kill(recorder.pid, signal.SIGCONT)
    recorder.close()
    with pytest.raises(RunError) as told:
        recorder.raise_if_cut()
    size = len(tick_records(0))
    kept = ring.PAGE // size
    assert str(told.value) == (
        f"log {path} ends early: {100 - kept} ticks ({(100 - kept) * size / 1e6:.1f} MB) from"
        f" {kept * 1e-3:.3f} to 0.099 s found no room: the recorder was too slow; the last record"
        f" is of {(kept - 1) * 1e-3:.3f} s, and the ring of 0.0 MB was at most"
        f" {kept * size / ring.PAGE:.0%} full"
    )
    with hil.log.open(path) as log:
        assert log.metadata["recorder"]["missing"] in str(told.value)
        assert log.metadata["recorder"]["dropped_bytes"] == str((100 - kept) * size)


def test_a_gap_in_the_middle_is_told_where_it_is_and_ends_no_run(tmp_path):
    path = tmp_path / "plant.mcap"
    recorder = Recorder.open(path, {}, blocking=False, ring_bytes=ring.PAGE)
    stopped(recorder)
    for k in range(10):
        recorder.put(tick_records(k))
    os.kill(recorder.pid, signal.SIGCONT)
    while recorder._producer.waiting:
        time.sleep(0.001)
    time.sleep(0.1)  # the recorder has looked again
    for k in range(10, 14):
        recorder.put(tick_records(k))
    recorder.close()
    recorder.raise_if_cut()
    with hil.log.open(path) as log:
        (event,) = log.records("/event")
        ticks = log.array("/sensor")["tick"]
    assert event.tick == ring.PAGE // len(tick_records(0)) - 1
    assert list(ticks) == [*range(event.tick + 1), *range(10, 14)]


def test_a_killed_recorder_leaves_what_was_put_a_tenth_of_a_second_before(tmp_path):
    path = tmp_path / "plant.mcap"
    recorder = Recorder.open(path, {}, blocking=False)
    while not path.stat().st_size:
        time.sleep(0.001)
    put = []
    for k in range(300):
        put.append(time.monotonic())
        recorder.put(tick_records(k))
        time.sleep(0.001)
    killed = time.monotonic()
    os.kill(recorder.pid, signal.SIGKILL)
    with pytest.raises(RunError):
        recorder.close()
    with hil.log.open(repair(path).out) as log:
        kept = len(log.array("/sensor"))
    assert put[kept] > killed - 0.2, "a tenth on a quiet machine"


def test_a_deferred_log_is_written_at_the_end_or_when_its_ring_fills_up(tmp_path):
    path = tmp_path / "plant.mcap"
    recorder = Recorder.open(path, {}, blocking=False, ring_bytes=64 * ring.PAGE, deferred=True)
    while not path.stat().st_size:
        time.sleep(0.001)
    head = path.stat().st_size
    ticks = 32 * ring.PAGE // len(tick_records(0))
    for k in range(ticks):
        recorder.put(tick_records(k))
    time.sleep(0.2)
    assert path.stat().st_size == head
    for k in range(ticks, 2 * ticks):
        recorder.put(tick_records(k))
    deadline = time.monotonic() + 5.0
    while path.stat().st_size == head and time.monotonic() < deadline:
        time.sleep(0.001)
    assert path.stat().st_size > head
    assert recorder.close() == (2 * ticks * RECORDS_A_TICK, 0)


def test_the_ring_holds_ten_seconds_or_the_run_as_far_as_memory_goes(monkeypatch):
    monkeypatch.setattr(room, "available_bytes", lambda: 1 << 40)
    assert room.ring_bytes(1000, 3600.0) == 8 << 20
    assert room.ring_bytes(20_000, 3600.0) == 256 << 20
    assert room.ring_bytes(20_000, 2.0) == 32 << 20
    assert room.deferred_ring_bytes(20_000, 60.0) == 1 << 30
    monkeypatch.setattr(room, "available_bytes", lambda: 1 << 30)
    assert room.ring_bytes(20_000, 3600.0) == 128 << 20
    with pytest.raises(ConfigError, match="take 2 x 1024 MiB of memory, 1024 MiB are available"):
        room.deferred_ring_bytes(20_000, 60.0)


def test_a_blocking_recorder_waits_for_a_slow_disk(tmp_path):
    path = tmp_path / "plant.mcap"
    recorder = Recorder.open(path, {}, blocking=True, ring_bytes=16 * ring.PAGE)
    for k in range(2000):
        recorder.put(tick_records(k))
    assert recorder.close() == (2000 * RECORDS_A_TICK, 0)


@pytest.mark.parametrize("blocking", [True, False])
def test_the_loop_outlives_a_killed_recorder(tmp_path, blocking):
    recorder = Recorder.open(tmp_path / "a.mcap", {}, blocking=blocking, ring_bytes=ring.PAGE)
    os.kill(recorder.pid, signal.SIGKILL)
    for k in range(1000):
        recorder.put(tick_records(k))
    assert recorder.dropped > 900
    with pytest.raises(RunError, match=r"a\.mcap: its recorder ended with -9"):
        recorder.close()
    with pytest.raises(RunError, match="its recorder ended with -9"):
        recorder.close()


def test_a_recorder_that_hangs_is_told_in_time(tmp_path):
    recorder = Recorder.open(tmp_path / "a.mcap", {}, blocking=True)
    stopped(recorder)
    try:
        with pytest.raises(RunError, match=r"a\.mcap was not finished within 0.05 s"):
            recorder.close(timeout_s=0.05)
    finally:
        os.kill(recorder.pid, signal.SIGCONT)
        os.waitpid(recorder.pid, 0)
        recorder._process.returncode = 0


@pytest.mark.parametrize("limit", [300_000, 400_001, 700_000])
def test_a_full_disk_ends_the_log_and_not_the_loop(tmp_path, limit):
    """A limit on the size of files stands for the disk; the recorder cannot tell them apart."""
    path = tmp_path / "plant.mcap"
    recorder = Recorder.open(path, {}, blocking=True)
    resource.prlimit(recorder.pid, resource.RLIMIT_FSIZE, (limit, limit))
    rng = random.Random(1)
    for k in range(20_000):
        recorder.put(tick_records(k) + FRAMES_SENT.pack(k, k, rng.randbytes(40)))
    with pytest.raises(RunError, match=r"plant\.mcap ends early: File too large; \d+ bytes"):
        recorder.close()
    with hil.log.open(path) as log:
        ticks = log.array("/sensor")["tick"]
        assert 0 < len(ticks) < 20_000
        assert np.array_equal(ticks, np.arange(len(ticks)))


def test_a_run_without_a_log_needs_no_process():
    recorder = NullRecorder()
    recorder.put(tick_records(0))
    assert recorder.close() == (0, 0)


def test_one_core_records_60_000_ticks_a_second(tmp_path):
    ticks = 20_000
    data = b"".join(tick_records(k) + EVENT.pack(k, k, 0, "a", "b") for k in range(ticks))
    fd = os.open(tmp_path / "fast.mcap", os.O_RDWR | os.O_CREAT)
    schemas = [Schema(t.channel_id, t.definition.encode(), "ros2msg", t.schema_name) for t in ALL]
    file = McapFile(fd, schemas, [Channel(t.channel_id, t.name, "cdr", {}, 1) for t in ALL])
    before = time.process_time()
    while data:
        index = index_messages(data[: 256 << 10])
        file.add_chunk(data[: index.size], index)
        data = data[index.size :]
    rate = ticks / (time.process_time() - before)
    os.close(fd)
    print(f"{rate:.0f} ticks of 7 records per second of processor time")
    assert rate > 60_000


def test_a_signal_while_a_put_waits_is_no_fault(tmp_path):
    """The loss of a recorder is looked for in a signal's handler, whatever the loop is doing."""
    recorder = Recorder.open(tmp_path / "log.mcap", {}, blocking=True, ring_bytes=1 << 16)
    recorder.watch("end", lambda *_: None)
    os.kill(recorder.pid, signal.SIGSTOP)

    def look():
        for _ in range(300):
            os.kill(os.getpid(), signal.SIGIO)
            time.sleep(1e-3)
        os.kill(recorder.pid, signal.SIGCONT)

    looking = threading.Thread(target=look)
    looking.start()
    for tick in range(200):
        recorder.put(EVENT.pack(tick, tick, 0, "code", "x" * 1000))
    looking.join()
    assert recorder.close().messages == 200
