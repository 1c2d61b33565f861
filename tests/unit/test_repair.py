"""Damaged logs: one clear line each, and every whole chunk is saved and read back."""

import os
import random
import zlib

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from test_log import TICKS, chunk, open_file

import hil.log
from bench.logs.commands import repair as repair_command
from bench.logs.repair import default_out, repair
from drivers.recorder.mcap_file import McapFile
from hil.errors import ConfigError, HilError, LogError
from hil.log import summary

MANY = 12


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """A finished log of many chunks, with the place where each ends."""
    path = tmp_path_factory.mktemp("repair") / "plant.mcap"
    fd, file = open_file(path)
    file.add_metadata("run", {"process": "plant"})
    file.add_attachment("fpeg.dbc", "text/plain", b"VERSION")
    ends = []
    for number in range(MANY):
        file.add_chunk(*chunk(number))
        ends.append(file.size)
    file.finish()
    os.close(fd)
    return path, ends


def whole_before(path, cut):
    """How many chunks lie before a cut, by the file's own index."""
    with hil.log.open(path) as log:
        return sum(place.offset + place.length <= cut for place in log.parts[0].places)


def test_every_whole_chunk_before_a_cut_is_saved(sound, tmp_path):
    """A log that is cut at 200 random bytes."""
    path, _ = sound
    whole = path.read_bytes()
    rng = random.Random(7)
    first = path.read_bytes().index(b"VERSION")  # behind the topics' descriptions
    for number in range(200):
        cut = rng.randrange(first + 20, len(whole))
        damaged = tmp_path / f"cut{number}.mcap"
        damaged.write_bytes(whole[:cut])
        if not whole_before(path, cut):
            with pytest.raises(LogError, match="no whole chunk was found"):
                repair(damaged)
            assert not default_out(damaged).exists()
            continue
        done = repair(damaged)
        assert done.chunks == whole_before(path, cut), cut
        with hil.log.open(done.out) as log:
            assert len(log.array("/sensor")) == TICKS * done.chunks
        damaged.unlink()
        done.out.unlink()


def test_a_repaired_log_is_whole_for_others_too(sound, tmp_path):
    path, _ = sound
    damaged = tmp_path / "plant.mcap"
    damaged.write_bytes(path.read_bytes()[:-300])
    done = repair(damaged)
    assert done.out == tmp_path / "plant.repaired.mcap" == default_out(damaged)
    with done.out.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert sum(1 for _ in reader.iter_messages()) == done.messages
    with hil.log.open(done.out) as log:
        assert log.metadata["run"] == {"process": "plant"}
        assert log.metadata["repaired"]["from"] == "plant.mcap"
        assert log.attachments["fpeg.dbc"].content == b"VERSION"


@pytest.mark.parametrize("seed", range(20))
def test_a_flipped_bit_costs_one_chunk_at_the_most(sound, tmp_path, seed):
    path, ends = sound
    whole = bytearray(path.read_bytes())
    place = random.Random(seed).randrange(ends[0], ends[-1])
    whole[place] ^= 1 << seed % 8
    damaged = tmp_path / "flipped.mcap"
    damaged.write_bytes(whole)
    done = repair(damaged)
    assert done.chunks >= MANY - 1
    with hil.log.open(done.out) as log:
        assert len(log.array("/timing")) == TICKS * done.chunks


def test_a_damaged_length_is_passed_over(sound, tmp_path):
    path, _ = sound
    whole = bytearray(path.read_bytes())
    with hil.log.open(path) as log:
        place = log.parts[0].places[3].offset
    whole[place + 1 : place + 9] = (1 << 60).to_bytes(8, "little")
    damaged = tmp_path / "length.mcap"
    damaged.write_bytes(whole)
    done = repair(damaged)
    assert done.chunks == MANY - 1
    assert any(f"from byte {place} on" in line for line in done.lost)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"", "the file is empty"),
        (b"PK\x03\x04" + bytes(5000), "it is no MCAP file"),
        (b"\x89MCAP0\r\n", "ends before its topics are described"),
        (b"\x89MCAP0\r\n" + bytes(100), "ends before its topics are described"),
    ],
)
def test_what_holds_nothing_is_told_in_one_line(tmp_path, content, told):
    path = tmp_path / "some.mcap"
    path.write_bytes(content)
    for attempt in (lambda: hil.log.open(path), lambda: repair(path)):
        with pytest.raises(LogError) as caught:
            attempt()
        line = str(caught.value)
        assert line.startswith(f"{path}: ")
        assert "\n" not in line
        assert caught.value.exit_code == 2
    assert told in line
    assert not default_out(path).exists()


def test_a_file_of_a_newer_format_is_refused_by_its_number(sound, tmp_path):
    path, _ = sound
    newer = tmp_path / "newer.mcap"
    newer.write_bytes(path.read_bytes().replace(b"fpeg-hil log 1", b"fpeg-hil log 2", 1))
    for attempt in (lambda: hil.log.open(newer), lambda: repair(newer)):
        with pytest.raises(LogError, match="newer log format 2; this version reads 1"):
            attempt()


def test_a_schema_of_another_kind_is_told_with_its_topic(sound, tmp_path):
    path, _ = sound
    whole = path.read_bytes()
    other = tmp_path / "other.mcap"
    start = int.from_bytes(whole[-28:-20], "little")
    changed = whole[start:-37].replace(b"float64 x_m", b"complex x_m", 1)
    head = whole[-37:-12]
    crc = zlib.crc32(head, zlib.crc32(changed)).to_bytes(4, "little")
    other.write_bytes(whole[:start] + changed + head + crc + whole[-8:])
    with hil.log.open(other) as log:
        told = r"/sensor: its schema is of another kind: type 'fpeg_hil/complex'"
        with pytest.raises(LogError, match=told):
            log.array("/sensor")
        assert len(log.array("/timing")) == MANY * TICKS


@pytest.mark.parametrize("compression", list(CompressionType))
def test_logs_of_other_writers_are_read_and_repaired(tmp_path, compression):
    """The public writer puts schemas and channels into its chunks."""
    path = tmp_path / "rig.mcap"
    with path.open("wb") as file:
        writer = Writer(file, compression=compression, chunk_size=2000)
        writer.start("ros2", "another program")
        schema = writer.register_schema("a/msg/B", "ros2msg", b"int64 t_ns\nfloat64 x_m  # [m] x\n")
        channel = writer.register_channel("/sensor", "cdr", schema)
        for k in range(500):
            data = b"\x00\x01\x00\x00" + k.to_bytes(8, "little") + bytes(8)
            writer.add_message(channel, k, data, k, k)
        writer.finish()
    with hil.log.open(path) as log:
        assert log.array("/sensor")["t_ns"].tolist() == list(range(500))
        assert log.units("/sensor") == {"x_m": "m"}
    damaged = tmp_path / "cut.mcap"
    damaged.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    done = repair(damaged)
    with hil.log.open(done.out) as log:
        assert log.array("/sensor")["t_ns"].tolist() == list(range(done.messages))
    assert done.messages > 100


def test_a_repair_overwrites_nothing(sound, tmp_path):
    path, _ = sound
    out = tmp_path / "there.mcap"
    out.write_bytes(b"precious")
    with pytest.raises(ConfigError, match=r"there\.mcap: exists already"):
        repair(path, out)
    with pytest.raises(ConfigError, match="exists already"):
        repair(path, path)
    with pytest.raises(ConfigError, match="No such file"):
        repair(path, tmp_path / "none" / "out.mcap")
    assert out.read_bytes() == b"precious"


def test_the_command_says_what_was_saved_and_what_was_lost(sound, tmp_path, capsys):
    path, ends = sound
    damaged = tmp_path / "plant.mcap"
    damaged.write_bytes(path.read_bytes()[: ends[4] + 50])
    assert repair_command(damaged, None) == 0
    told = capsys.readouterr().out
    assert "5 whole chunks" in told
    assert "lost: the last 50 bytes" in told
    with hil.log.open(path) as log:
        first = log.parts[0].places[0]
    damaged.write_bytes(path.read_bytes()[: first.offset + first.length - 1])
    with pytest.raises(HilError, match="no whole chunk was found"):
        repair_command(damaged, tmp_path / "none.mcap")


def test_a_repair_that_does_not_read_back_is_told(sound, tmp_path, monkeypatch):
    path, _ = sound
    original = McapFile.add_chunk

    def forgetful(self, data, index, **named):
        original(self, data[: len(data) // 2], chunk(0)[1], **named)

    monkeypatch.setattr(McapFile, "add_chunk", forgetful)
    with pytest.raises(LogError, match=r"does not read back as it was written|damaged"):
        repair(path, tmp_path / "out.mcap")


def test_the_beginning_of_a_file_is_told_from_a_whole_one(sound, tmp_path):
    path, _ = sound
    damaged = tmp_path / "cut.mcap"
    damaged.write_bytes(path.read_bytes()[:9000])
    with pytest.raises(LogError, match="it is cut off or was never finished"):
        hil.log.open(damaged)
    with path.open("rb") as file:
        assert summary.read_summary(file).statistics.chunk_count == MANY
