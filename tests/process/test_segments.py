"""A log in segments: reads as one, keeps to its limits, and survives a full disk and a kill."""

import itertools
import os
import random
import resource
import shutil

import numpy as np
import pytest
from test_recorder import RECORDS_A_TICK, tick_records

import hil.log
from bench.run import scenarios
from bench.run.commands import log_flags
from drivers.recorder.client import Recorder, Rotation
from drivers.recorder.output import wait_finished
from drivers.system.log import rotation_of
from hil.errors import ConfigError, LogError, RunError
from hil.log.segments import segment_path, segments_before
from hil.log.topics import FRAMES_SENT

RNG = random.Random(3)


def record(path, ticks, rotation, *, chunk_like=400, end=True):
    """Record so many ticks, with noise that does not compress."""
    recorder = Recorder.open(path, {"run": {}}, blocking=True, rotation=rotation, ring_bytes=65_536)
    for k in range(ticks):
        recorder.put(tick_records(k) + FRAMES_SENT.pack(k, k * 10**6, RNG.randbytes(chunk_like)))
    if end:
        recorder.close()
    return recorder


def test_a_log_in_segments_reads_as_one(tmp_path):
    path = tmp_path / "plant.mcap"
    record(path, 2000, Rotation(segment_bytes=200_000))
    segments = segments_before(path)
    assert len(segments) >= 3
    with hil.log.open(path) as log:
        assert np.array_equal(log.array("/sensor")["tick"], np.arange(2000))
        assert log.topics["/truth"].messages == 2000
        assert len(log.parts) == len(segments) + 1
        assert not log.continues
        assert sum(1 for _ in log.frames("sent")) == 4000
    with hil.log.open(segments[1]) as log:  # each is a whole log by itself
        assert log.continues
        assert log.metadata["segment"] == {"number": "2"}


def test_segments_by_time_have_that_length(tmp_path):
    path = tmp_path / "plant.mcap"
    record(path, 2000, Rotation(segment_ns=500_000_000))
    with hil.log.open(path) as log:
        spans = [part.end_ns - part.start_ns for part in log.parts]
    assert all(500_000_000 <= span < 700_000_000 for span in spans[:-1])


def test_no_more_is_retained_than_allowed(tmp_path):
    path = tmp_path / "plant.mcap"
    record(path, 4000, Rotation(segment_bytes=150_000, retain_bytes=500_000))
    segments = segments_before(path)
    assert sum(segment.stat().st_size for segment in segments) <= 500_000
    with hil.log.open(path) as log:
        ticks = log.array("/sensor")["tick"]
        assert log.continues
    assert ticks[0] > 0
    assert np.array_equal(ticks, np.arange(ticks[0], 4000))


def test_a_new_log_takes_the_old_segments_away(tmp_path):
    path = tmp_path / "plant.mcap"
    record(path, 1000, Rotation(segment_bytes=100_000))
    assert segments_before(path)
    record(path, 10, None)
    assert not segments_before(path)
    with hil.log.open(path) as log:
        assert len(log.array("/sensor")) == 10


def test_a_missing_segment_is_a_gap_and_no_failure(tmp_path):
    path = tmp_path / "plant.mcap"
    record(path, 2000, Rotation(segment_bytes=150_000))
    segments_before(path)[1].unlink()
    with hil.log.open(path) as log:
        ticks = log.array("/sensor")["tick"]
    assert ticks[0] == 0
    assert ticks[-1] == 1999
    assert len(ticks) < 2000


def test_a_segment_that_is_no_log_is_told(tmp_path):
    path = tmp_path / "plant.mcap"
    record(path, 1000, Rotation(segment_bytes=150_000))
    segment_path(path, 1).write_bytes(b"")
    with pytest.raises(LogError, match=r"plant\.0001\.mcap: .*the file is empty"):
        hil.log.open(path)


def test_waiting_follows_a_log_into_its_next_segment(tmp_path):
    path = tmp_path / "plant.mcap"
    recorder = record(path, 1500, Rotation(segment_bytes=100_000), end=False)
    with pytest.raises(RunError, match="still being written"):
        wait_finished(path, 0.0)
    recorder.close()
    wait_finished(path, 1.0)


@pytest.mark.parametrize("limit", [300_000, 400_001])
def test_where_no_segment_can_be_written_any_more_the_log_ends_whole(tmp_path, limit):
    path = tmp_path / "plant.mcap"
    recorder = record(path, 0, Rotation(segment_bytes=350_000), end=False)
    resource.prlimit(recorder.pid, resource.RLIMIT_FSIZE, (limit, limit))
    for k in range(6000):
        recorder.put(tick_records(k) + FRAMES_SENT.pack(k, k, RNG.randbytes(40)))
    if limit < 350_000:
        with pytest.raises(RunError, match="ends early: File too large"):
            recorder.close()
    else:
        recorder.close()
    with hil.log.open(path) as log:
        ticks = log.array("/sensor")["tick"]
    assert np.array_equal(ticks, np.arange(len(ticks)))
    assert len(ticks)


@pytest.mark.skipif(os.geteuid() != 0, reason="a small disk can be mounted by root only")
def test_a_full_disk_ends_the_log_with_an_event_and_loses_nothing_written(tmp_path):
    import subprocess

    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(disk)]
    if shutil.which("mount") is None or subprocess.run(mount, check=False).returncode:
        pytest.skip("no file system can be mounted here")
    try:
        path = disk / "plant.mcap"
        with pytest.raises(RunError, match="ends early: No space left on device"):
            record(path, 10_000, None)
        with hil.log.open(path) as log:
            *_, last = log.records("/event")
            ticks = log.array("/sensor")["tick"]
            counts = [info.messages for info in log.topics.values() if info.messages > 1]
            assert not any(log.parts[0].file.read(0))
    finally:
        subprocess.run(["umount", "-l", str(disk)], check=True)
    assert (last.code, last.severity) == ("log-ended", 2)
    assert "control goes on" in last.text
    assert np.array_equal(ticks, np.arange(len(ticks)))
    assert last.tick in {ticks[-1], ticks[-1] + 1}  # a put may be cut between its records
    assert min(counts) > 500


def test_the_flags_of_a_run_set_size_or_time():
    assert log_flags(None, None) == {}
    assert log_flags("256MiB", "1GiB") == {
        "log.segment_bytes": 256 << 20, "log.retain_bytes": 1 << 30,
    }  # fmt: skip
    assert log_flags("600s", None) == {"log.segment_s": 600.0}
    with pytest.raises(ConfigError, match="--log-segment 'often': accepted is a size"):
        log_flags("often", None)


def test_a_limit_without_segments_is_refused():
    with pytest.raises(ConfigError, match="retain_bytes needs segment_bytes or segment_s"):
        scenarios.read("steady", [("log.retain_bytes", 1 << 30)])
    read = scenarios.read("steady", [("log.segment_s", 2.0), ("log.retain_bytes", 1 << 30)])
    assert rotation_of(read.log) == Rotation(None, 2_000_000_000, 1 << 30)


def test_a_kill_leaves_all_segments_readable(tmp_path):
    """The recorder ends by itself when its writer is gone."""
    path = tmp_path / "plant.mcap"
    child = os.fork()
    if child == 0:
        recorder = record(path, 0, Rotation(segment_bytes=100_000), end=False)
        for k in itertools.count():
            recorder.put(tick_records(k))
            if k == 5000:
                os._exit(0)
    os.waitpid(child, 0)
    wait_finished(path, 20.0)
    with hil.log.open(path) as log:
        assert np.array_equal(log.array("/sensor")["tick"], np.arange(5001))
        assert sum(part.messages for part in log.parts) == 5001 * RECORDS_A_TICK
