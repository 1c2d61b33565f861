"""Logs: what is written is read back by us and by the public readers; damage is told in a line."""

import os
import resource
from io import BytesIO

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.records import Channel, Schema
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory

import hil.log
from drivers.recorder import index
from drivers.recorder.index import index_messages
from drivers.recorder.mcap_file import McapFile
from hil.errors import LogError
from hil.log.topics import (
    ALL,
    EVENT,
    FRAMES_RECEIVED,
    FRAMES_SENT,
    SENSOR,
    STROKE,
    TIMING,
    TRUTH,
)

ZEROS = (0, 0, 0, 0)
CHUNKS, TICKS = 3, 100


def tick_records(k):
    """The records of one tick, some topics in every tick and some not."""
    t = k * 1_000_000
    data = SENSOR.pack(k, t, k * 1e-6, -0.5 * k, 1e5, 2e5, 3.5, k % 3)
    data += TRUTH.pack(k, t, 0.1, 0.2, 2.8e-6, 30.0, 5, k // 7, t - 3, 0.0155, 0, 1.4, 1.3e5)
    data += TIMING.pack(k, t, t, t + 5, t + 9, k - 1, 0)
    data += FRAMES_SENT.pack(k, t, bytes([k % 256]) * (k % 4 * 10))
    if k % 7 == 0:
        data += STROKE.pack(k // 7, k, t, 1, *(0.5 * n for n in range(13)))
        data += EVENT.pack(k, t, 1, "stroke", f"Hub {k} \N{GREEK SMALL LETTER OMEGA}")
    return data


def open_file(path):
    fd = os.open(path, os.O_RDWR | os.O_CREAT)
    schemas = [Schema(t.channel_id, t.definition.encode(), "ros2msg", t.schema_name) for t in ALL]
    channels = [Channel(t.channel_id, t.name, "cdr", {}, t.channel_id) for t in ALL]
    return fd, McapFile(fd, schemas, channels)


def chunk(number):
    data = b"".join(tick_records(k) for k in range(number * TICKS, (number + 1) * TICKS))
    return data, index_messages(data)


def write_log(path):
    fd, file = open_file(path)
    file.add_metadata("run", {"seed": "7", "model": "harmonic"})
    file.add_attachment("fpeg.dbc", "text/plain", b"VERSION")
    for number in range(CHUNKS):
        file.add_chunk(*chunk(number))
    file.finish()
    os.close(fd)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "plant.mcap"
    write_log(path)
    return path


@pytest.fixture
def log(path):
    with hil.log.open(path) as log:
        yield log


def test_whole_topics_come_as_arrays(log):
    sensor = log.array("/sensor")
    ticks = np.arange(CHUNKS * TICKS)
    assert np.array_equal(sensor["tick"], ticks)
    assert np.array_equal(sensor["x_m"], ticks * 1e-6)
    assert np.array_equal(log.array("/stroke")["tick"], ticks[::7])


def test_blocks_come_chunk_by_chunk(log):
    blocks = list(log.blocks("/timing"))
    assert [len(block) for block in blocks] == [TICKS] * CHUNKS
    assert blocks[1]["used_tick"][0] == TICKS - 1


def test_a_topic_without_messages_is_an_empty_array(log):
    assert len(log.array("/actuator")) == 0
    assert list(log.records("/actuator")) == []


def test_events_and_frames_come_one_by_one(log):
    events = list(log.records("/event"))
    assert [event.tick for event in events] == list(range(0, CHUNKS * TICKS, 7))
    assert events[1].text == "Hub 7 \N{GREEK SMALL LETTER OMEGA}"
    assert list(log.frames("sent"))[3] == (3, 3_000_000, bytes([3]) * 30)
    assert list(log.frames("received")) == []


def test_a_log_tells_what_it_holds(log):
    assert log.metadata == {"run": {"seed": "7", "model": "harmonic"}}
    assert log.attachments["fpeg.dbc"].content == b"VERSION"
    assert (log.start_ns, log.end_ns) == (0, (CHUNKS * TICKS - 1) * 1_000_000)
    assert log.topics["/sensor"].messages == CHUNKS * TICKS
    units = {field.name: field.unit for field in log.topics["/sensor"].fields}
    assert (units["x_m"], units["v_m_s"], units["status"]) == ("m", "m/s", "")
    assert set(log.topics) == {topic.name for topic in ALL}


def test_public_readers_accept_every_checksum(path):
    with path.open("rb") as file:
        kinds = [type(record).__name__ for record in StreamReader(file, validate_crcs=True).records]
    messages = CHUNKS * TICKS * 4 + 2 * len(range(0, CHUNKS * TICKS, 7))
    assert kinds.count("Message") == messages
    assert kinds[-1] == "Footer"
    with path.open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
    assert summary.statistics.message_count == messages
    assert len(summary.chunk_indexes) == CHUNKS


def test_a_public_decoder_sees_the_same_values(path, log):
    ours = {name: log.records(name) for name in log.topics}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, _, theirs in reader.iter_decoded_messages(log_time_order=False):
            for name, value in next(ours[channel.topic])._asdict().items():
                got = getattr(theirs, name)
                assert (bytes(got) if isinstance(value, bytes) else got) == value
    assert all(next(rest, None) is None for rest in ours.values())


def test_an_unknown_topic_is_told_with_the_known_ones(log, path):
    with pytest.raises(LogError, match=r"plant\.mcap: no topic /speed; it has /actuator, /command"):
        log.array("/speed")


def test_a_topic_of_varying_size_is_no_array(log):
    with pytest.raises(LogError, match=r"/event varies in size: read it with records\(\)"):
        log.array("/event")


@pytest.mark.parametrize("cut", [0, 5, 300, 0.5, -9, -1])
def test_a_cut_log_is_told_in_one_line(path, tmp_path, cut):
    whole = path.read_bytes()
    damaged = tmp_path / "cut.mcap"
    damaged.write_bytes(whole[: int(cut * len(whole)) if isinstance(cut, float) else cut])
    with pytest.raises(LogError, match=r"cut\.mcap: no complete MCAP log") as caught:
        hil.log.open(damaged)
    assert "\n" not in str(caught.value)


def test_a_missing_log_is_told(tmp_path):
    with pytest.raises(LogError, match="No such file"):
        hil.log.open(tmp_path / "none.mcap")


def test_no_flipped_byte_goes_unnoticed_in_the_messages(path, tmp_path):
    """Every byte of a chunk is under its checksum, the index is checked against the messages."""
    whole = path.read_bytes()
    summary = make_reader(BytesIO(whole)).get_summary()
    index = summary.chunk_indexes[1]
    with hil.log.open(path) as log:
        sound = log.array("/sensor")
    damaged = tmp_path / "flipped.mcap"
    start, size = index.chunk_start_offset, index.chunk_length + index.message_index_length
    for place in range(start + 9, start + size, 13):
        damaged.write_bytes(whole[:place] + bytes([whole[place] ^ 0x55]) + whole[place + 1 :])
        with hil.log.open(damaged) as log:
            try:
                read = log.array("/sensor")
            except LogError as error:
                assert "damaged chunk at byte" in str(error)  # noqa: PT017
            else:
                assert np.array_equal(read, sound)


@pytest.fixture
def file_limit():
    """Stands for a full disk: files of this process grow no further than the limit."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_the_last_chunk_makes_room_for_the_end_on_a_full_disk(tmp_path, file_limit):
    path = tmp_path / "full.mcap"
    fd, file = open_file(path)
    for number in range(CHUNKS):
        file.add_chunk(*chunk(number))
    file_limit(os.fstat(fd).st_size + 100)
    with pytest.raises(OSError, match="File too large"):
        file.add_metadata("late", {"text": "x" * 200})
    file.finish()
    os.close(fd)
    with hil.log.open(path) as log:
        assert len(log.array("/sensor")) == TICKS * (CHUNKS - 1)
    with path.open("rb") as stream:
        assert list(StreamReader(stream, validate_crcs=True).records)


def test_records_that_are_no_messages_are_refused():
    with pytest.raises(ValueError, match="no Message record at byte 0: opcode 9"):
        index_messages(b"\x09" + bytes(40))


def test_a_cut_record_is_left_for_later():
    whole, half = tick_records(7), tick_records(8)[:-3]
    found = index_messages(whole + half)
    assert len(whole) < found.size < len(whole + half)
    assert FRAMES_RECEIVED.channel_id not in found.channels


@given(st.lists(st.integers(0, 2**32 - 1), max_size=20), st.integers(0, 2000))
def test_both_ways_of_indexing_agree(numbers, taken_off):
    """Compiled, the records are walked by native reads; the other way is the reference."""
    records = b"".join(tick_records(k) for k in numbers)
    cut = records[: max(len(records) - taken_off, 0)]
    reference = index._walk(cut)
    assert index_messages(cut) == index._walk_natively(cut) == reference
    assert reference.size <= len(cut)


def test_a_length_beyond_all_bounds_ends_the_index():
    whole, next_one = tick_records(7), bytearray(tick_records(8))
    next_one[8] = 0x80  # of the length, now beyond 2^63
    for walk in (index._walk, index._walk_natively):
        assert walk(bytes(whole + next_one)).size == len(whole)
