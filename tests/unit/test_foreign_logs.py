"""Logs of others: counted, checked and repaired whatever is in them, exported as far as decoded."""

import json
import random
from itertools import pairwise

import pytest
from foreign_logs import CALENDAR_NS, LAYOUTS, PLAIN, TOPICS, UNDECODED, Topic, plain, write
from test_log import write_log

import hil.log
from bench.logs.commands import diff, export, info, repair
from bench.logs.export import export as write_files
from bench.logs.repair import default_out
from hil.errors import HilError, LogError
from hil.log.part import ALWAYS
from hil.log.verify import verify


@pytest.fixture(params=LAYOUTS)
def layout(request, tmp_path):
    """Two topics of ten messages each in every layout of a file."""
    topics = [Topic("/a", PLAIN, plain()), Topic("/b", PLAIN, plain(start=100))]
    return write(tmp_path / "rig.mcap", topics, **LAYOUTS[request.param])


def test_what_lies_in_a_file_is_found_whatever_its_index_says(layout):
    with hil.log.open(layout) as log:
        assert {name: info.messages for name, info in log.topics.items()} == {"/a": 10, "/b": 10}
        for name in ("/a", "/b"):
            assert log.array(name)["t_ns"].tolist() == list(range(10))
            assert [record.x_m for record in log.records(name)] == [0.5 * k for k in range(10)]
        assert (log.start_ns, log.end_ns) == (0, 109)
        assert log.metadata["rig"] == {"name": "other"}
        assert log.attachments["notes.txt"].content == b"quiet"


def test_every_layout_is_sound_and_repaired_whole(layout):
    verify(layout)
    assert repair(layout, None) == 0
    assert diff(layout, default_out(layout), timing=False) == 0
    assert not verify(default_out(layout)).notes


@pytest.mark.parametrize("name", TOPICS)
def test_every_decodable_kind_is_told_exported_and_repaired(tmp_path, name, capsys):
    csv, parquet = pytest.importorskip("pyarrow.csv"), pytest.importorskip("pyarrow.parquet")
    path = write(tmp_path / "rig.mcap", TOPICS[name])
    counts = sum(len(topic.messages) for topic in TOPICS[name])
    assert info(path, verify=True) == 0
    assert repair(path, None) == 0
    assert diff(path, default_out(path), timing=False) == 0
    for kind, read in (("csv", csv.read_csv), ("parquet", parquet.read_table)):
        assert export(path, kind, tmp_path / kind, [], None, None) == 0
        tables = [read(file) for file in (tmp_path / kind).iterdir()]
        assert sum(table.num_rows for table in tables) == counts
        assert all("t_ns" in table.column_names for table in tables)
    assert "\x1b" not in capsys.readouterr().out


def test_nested_types_become_columns(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    path = write(tmp_path / "rig.mcap", TOPICS["nested"])
    with hil.log.open(path) as log:
        write_files(log, "parquet", tmp_path / "out", [], ALWAYS)
    row = parquet.read_table(tmp_path / "out" / "a.parquet").to_pylist()[0]
    assert json.loads(row.pop("path")) == [{"x": 3.0, "y": 4.0}]
    assert row == {
        "t_ns": 5, "pose.position.x": 1.0, "pose.position.y": 2.0, "name": "ab",
        "samples": [7.0, 8.0], **{f"pose.flags_{k}": k + 1 for k in range(4)},
    }  # fmt: skip


@pytest.mark.parametrize("name", UNDECODED)
def test_what_is_not_decoded_hides_nothing_else(tmp_path, name, capsys):
    pytest.importorskip("pyarrow")
    (strange,) = UNDECODED[name]
    path = write(tmp_path / "rig.mcap", [Topic("/a", PLAIN, plain()), strange])
    assert info(path, verify=True) == 0
    assert repair(path, None) == 0
    assert diff(path, default_out(path), timing=False) == 0
    capsys.readouterr()
    assert export(path, "csv", tmp_path / "out", [], None, None) == 0
    assert [file.name for file in (tmp_path / "out").iterdir()] == ["a.csv"]
    assert f"skipped {strange.name}: " in capsys.readouterr().out
    with pytest.raises(LogError, match=f"nothing exported: {strange.name}: "):
        export(path, "csv", tmp_path / "none", [strange.name], None, None)
    assert not list((tmp_path / "none").iterdir())


def test_the_default_end_of_an_export_is_the_end_of_the_log(tmp_path, capsys):
    pytest.importorskip("pyarrow")
    path = write(tmp_path / "rig.mcap", TOPICS["calendar"])
    start_s = CALENDAR_NS * 1e-9
    for number, (begin, end) in enumerate(((None, None), (start_s - 1.0, None), (0.0, 2e9))):
        assert export(path, "csv", tmp_path / str(number), [], begin, end) == 0
        assert "10 messages in" in capsys.readouterr().out


def test_an_export_of_nothing_is_a_file_without_rows(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    path = write(tmp_path / "rig.mcap", TOPICS["calendar"])
    assert export(path, "parquet", tmp_path / "out", [], 0.0, 1.0) == 0
    table = parquet.read_table(tmp_path / "out" / "a.parquet")
    assert (table.num_rows, table.column_names) == (0, ["t_ns", "x_m"])


def test_logs_with_nothing_in_common_are_not_the_same(tmp_path):
    a = write(tmp_path / "a.mcap", [Topic("/a", PLAIN, plain())])
    b = write(tmp_path / "b.mcap", [Topic("/b", PLAIN, plain())])
    both = write(tmp_path / "both.mcap", [Topic("/a", PLAIN, plain()), Topic("/c", PLAIN, plain())])
    with pytest.raises(LogError, match="no topic in common"):
        diff(a, b, timing=False)
    assert diff(a, both, timing=False) == 1
    other = write(tmp_path / "other.mcap", [Topic("/a", PLAIN, plain()[:-1])])
    assert diff(a, other, timing=False) == 1


@pytest.mark.parametrize("claim", [9, 11])
def test_a_count_that_is_not_there_is_told_by_every_reader(tmp_path, claim):
    """The statistics tell of other messages than the file has, and its summary has no checksum."""
    path = write(tmp_path / "rig.mcap", [Topic("/a", PLAIN, plain())], enable_crcs=False)
    data = bytearray(path.read_bytes())
    place = data.rindex((10).to_bytes(8, "little") + (1).to_bytes(2, "little"))
    data[place : place + 8] = claim.to_bytes(8, "little")
    path.write_bytes(data)
    for attempt in (
        lambda: info(path, verify=False),
        lambda: info(path, verify=True),
        lambda: diff(path, path, timing=False),
        lambda: export(path, "csv", tmp_path / "out", [], None, None),
    ):
        with pytest.raises(LogError, match=f"tell of {claim} messages, 10 are there"):
            attempt()


def test_a_flip_in_a_log_without_index_is_seen_by_every_reader(tmp_path):
    path = write(tmp_path / "rig.mcap", [Topic("/a", PLAIN, plain())], **LAYOUTS["no-index"])
    data = bytearray(path.read_bytes())
    data[data.index(plain()[3][1]) + 9] ^= 1
    path.write_bytes(data)
    for attempt in (
        lambda: info(path, verify=True),
        lambda: diff(path, path, timing=False),
        lambda: repair(path, None),
    ):
        with pytest.raises(LogError, match=r"checksum \(CRC\) does not match"):
            attempt()
    assert not default_out(path).exists()


def unseen(path, places, flipped):
    """Places of one flipped bit at which `verify` finds nothing."""
    whole = path.read_bytes()
    found = []
    for place, bit in places:
        data = bytearray(whole)
        data[place] ^= 1 << bit
        flipped.write_bytes(data)
        if not refused(lambda: verify(flipped)):
            found.append(place)
    return found


def refused(attempt):
    """Whether something ends in one line for the user, and in nothing else."""
    try:
        attempt()
    except HilError as error:
        return "\n" not in str(error)
    return False


def test_no_flip_in_a_log_of_ours_goes_unseen(tmp_path):
    """Half of them in the message indexes, where there are few bytes."""
    path = tmp_path / "plant.mcap"
    write_log(path)
    rng = random.Random(5)
    with hil.log.open(path) as log:
        places = log.parts[0].places
    ends = [*(place.offset for place in places[1:]), places[-1].offset + places[-1].length + 500]
    indexes = [
        place
        for chunk, end in zip(places, ends, strict=True)
        for place in range(chunk.offset + chunk.length, end)
    ]
    size = path.stat().st_size
    flips = [(rng.randrange(size), rng.randrange(8)) for _ in range(300)]
    flips += [(rng.choice(indexes), rng.randrange(8)) for _ in range(300)]
    flips += [(place, rng.randrange(8)) for place in range(size - 60, size)]
    assert unseen(path, flips, tmp_path / "flipped.mcap") == []


@pytest.mark.slow
def test_no_flip_of_two_thousand_goes_unseen(tmp_path):
    path = tmp_path / "plant.mcap"
    write_log(path)
    rng = random.Random(11)
    flips = [(rng.randrange(path.stat().st_size), rng.randrange(8)) for _ in range(2000)]
    assert unseen(path, flips, tmp_path / "flipped.mcap") == []


@pytest.mark.parametrize("name", ["indexed", "many-chunks", "zstd", "lz4"])
def test_a_flip_that_a_reader_would_use_is_seen_without_a_checksum_of_the_data(tmp_path, name):
    """What goes unseen leaves everything that is read from the file as it was."""
    path = write(tmp_path / "rig.mcap", TOPICS["two-channels"], **LAYOUTS[name])
    rng = random.Random(3)
    places = [(place, rng.randrange(8)) for place in range(path.stat().st_size)]
    before = content(path)
    whole = path.read_bytes()
    for place in unseen(path, places, tmp_path / "flipped.mcap"):
        data = bytearray(whole)
        data[place] ^= 1 << dict(places)[place]
        path.write_bytes(data)
        assert content(path) == before, place


def content(path):
    """What readers take from a log, but metadata, which have no checksum of their own."""
    with hil.log.open(path) as log:
        rows = {name: list(log.timed_records(name)) for name in log.topics}
        return rows, log.attachments, log.start_ns, log.end_ns


@pytest.mark.parametrize("layout_name", LAYOUTS)
def test_no_cut_and_no_flip_ends_in_a_traceback(tmp_path, layout_name):
    path = write(tmp_path / "rig.mcap", TOPICS["nested"], **LAYOUTS[layout_name])
    whole, rng = path.read_bytes(), random.Random(9)
    for _ in range(40):
        data = bytearray(whole[: rng.randrange(len(whole))] if rng.random() < 0.3 else whole)
        for _ in range(rng.randrange(1, 4)):
            if data:
                data[rng.randrange(len(data))] = rng.randrange(256)
        path.write_bytes(data)
        for attempt in (
            lambda: info(path, verify=True),
            lambda: diff(path, path, timing=False),
            lambda: repair(path, tmp_path / "out.mcap", force=True),
            lambda: content(path),
        ):
            refused(attempt)


def test_the_names_of_files_are_told_apart(tmp_path):
    pytest.importorskip("pyarrow")
    path = write(tmp_path / "rig.mcap", TOPICS["one-file-name"])
    with hil.log.open(path) as log:
        files = write_files(log, "csv", tmp_path / "out", [], ALWAYS).files
    assert [(file.path.name, file.messages) for file in files] == [("a_b.csv", 4), ("a_b_2.csv", 3)]
    assert all(a.path != b.path for a, b in pairwise(files))
