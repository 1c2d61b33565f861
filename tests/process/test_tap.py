"""A live view of a recorder's ring: whole records, in order, and no trace of the reader."""

import os

import numpy as np
import pytest
from test_recorder import tick_records

import hil.log
from drivers.recorder import ring, tap
from drivers.recorder.client import Recorder
from drivers.recorder.tap import Tap
from hil.errors import LinkError

RUN = {"run": {"process": "plant", "rate_hz": "1000"}}


@pytest.fixture
def joined(tmp_path):
    """A recorder that can be joined, and one reader of it."""
    path = tmp_path / "plant.records"
    recorder = Recorder.open(tmp_path / "a.mcap", RUN, blocking=True, live=tap.listen(path))
    reader = Tap.join(path)
    yield recorder, reader
    reader.close()
    recorder.close()


def everything(reader):
    """What there is by now: the newest is told one read late."""
    return reader.read() + reader.read()


def test_a_reader_is_told_what_it_reads_and_gets_it_whole(joined):
    recorder, reader = joined
    data = b"".join(tick_records(k) for k in range(100))
    for k in range(100):
        recorder.put(tick_records(k))
    assert everything(reader) == data
    assert reader.read() == b""
    assert (reader.process, reader.rate_hz, reader.lost) == ("plant", 1000, 0)
    assert reader.schemas["/sensor"][0] == "fpeg_hil/msg/Sensor"


def test_the_records_come_as_arrays_by_topic(joined):
    recorder, reader = joined
    for k in range(50):
        recorder.put(tick_records(k))
    rows = reader.rows(everything(reader))
    assert rows["/sensor"]["tick"].tolist() == list(range(50))
    assert np.all(rows["/truth"]["fuel_kg"] == 2.8e-6)
    assert set(rows) >= {"/sensor", "/actuator", "/truth", "/timing"}


def test_the_log_is_the_same_with_readers(joined, tmp_path):
    recorder, reader = joined
    for k in range(20_000):
        recorder.put(tick_records(k))
        if k % 500 == 0:
            reader.read()
    recorder.close()
    assert reader.ended
    with hil.log.open(tmp_path / "a.mcap") as log:
        assert log.array("/sensor")["tick"].tolist() == list(range(20_000))


def test_who_comes_later_sees_what_comes_from_then_on(tmp_path):
    path = tmp_path / "plant.records"
    recorder = Recorder.open(tmp_path / "a.mcap", RUN, blocking=True, live=tap.listen(path))
    recorder.put(tick_records(0))
    reader = Tap.join(path)
    recorder.put(tick_records(1))
    assert everything(reader) == tick_records(1)
    recorder.close()
    assert reader.ended
    reader.close()
    assert not path.exists()


def test_nobody_records_where_nobody_listens(tmp_path):
    with pytest.raises(LinkError, match="nobody records there"):
        Tap.join(tmp_path / "plant.records")


def test_a_socket_that_is_served_is_not_taken_away(tmp_path):
    path = tmp_path / "plant.records"
    first = tap.listen(path)
    assert tap.listen(path) is None
    tap.remove(first)
    second = tap.listen(path)
    assert second is not None
    tap.remove(second)


def test_a_reader_that_falls_behind_loses_records_and_goes_on_with_the_newest():
    fd = ring.create(64 * ring.PAGE)
    producer, consumer, observer = ring.Producer(fd), ring.Consumer(fd), ring.Observer(fd)
    os.close(fd)
    record = bytes(1000)
    for _ in range(400):
        assert producer.put(record)
        consumer.read(1 << 20)
    assert observer.read() + observer.read() == b""
    assert observer.lost == 400 * len(record)
    producer.put(b"newest")
    assert observer.read() + observer.read() == b"newest"


def test_a_reader_cannot_write_into_the_ring():
    fd = ring.create(ring.PAGE)
    ring.Producer(fd)
    observer = ring.Observer(os.open(f"/proc/self/fd/{fd}", os.O_RDONLY))
    with pytest.raises(TypeError, match="read-only"):
        observer._bytes[0] = 1
