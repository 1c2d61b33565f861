"""Export and frames: the same numbers and units as in the log, whatever reads them."""

import numpy as np
import pytest
from test_log import CHUNKS, TICKS, write_log

import hil.log
from bench.logs.commands import export as export_command
from bench.logs.export import export
from bench.report.quantities import bytes_text, size_of
from hil.errors import ConfigError, LogError, MissingExtraError
from hil.log import Span
from hil.log.tables import column_units, columns

ALWAYS = Span()
NAMES = ["/event", "/frames/sent", "/sensor", "/stroke", "/timing", "/truth"]


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("export") / "plant.mcap"
    write_log(path)
    return path


@pytest.fixture
def log(path):
    with hil.log.open(path) as log:
        yield log


def test_parquet_has_the_same_numbers_and_the_units(log, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    files = export(log, "parquet", tmp_path, [], ALWAYS).files
    assert sorted(f.path.name for f in files) == [
        "event.parquet", "frames_sent.parquet", "sensor.parquet", "stroke.parquet",
        "timing.parquet", "truth.parquet",
    ]  # fmt: skip
    table = parquet.read_table(tmp_path / "sensor.parquet")
    sensor = log.array("/sensor")
    for name in sensor.dtype.names:
        assert np.array_equal(table[name].to_numpy(), sensor[name], equal_nan=True)
    assert table.schema.field("x_m").metadata[b"unit"] == b"m"
    frames = parquet.read_table(tmp_path / "frames_sent.parquet")["data"].to_pylist()
    assert frames == [batch for _, _, batch in log.frames("sent")]


def test_csv_reads_back_to_the_last_bit(log, tmp_path):
    csv = pytest.importorskip("pyarrow.csv")
    export(log, "csv", tmp_path, ["/sensor", "/event"], ALWAYS)
    table = csv.read_csv(tmp_path / "sensor.csv")
    assert np.array_equal(table["x_m"].to_numpy(), log.array("/sensor")["x_m"])
    events = csv.read_csv(tmp_path / "event.csv")["text"].to_pylist()
    assert events == [event.text for event in log.records("/event")]


def test_mf4_has_a_group_a_topic_with_units(log, tmp_path):
    asammdf = pytest.importorskip("asammdf")
    (file,) = export(log, "mf4", tmp_path / "plant.mf4", [], ALWAYS).files
    assert file.messages == CHUNKS * TICKS * 3 + 43
    with asammdf.MDF(file.path) as measured:
        signal = measured.get("sensor.x_m")
        assert signal.unit == "m"
        assert np.array_equal(signal.samples, log.array("/sensor")["x_m"])
        assert np.allclose(signal.timestamps, log.array("/sensor")["t_ns"] * 1e-9)


def test_a_stretch_of_time_is_all_that_is_exported(log, tmp_path):
    pytest.importorskip("pyarrow")
    span = Span(10_000_000, 59_000_000)
    (file,) = export(log, "parquet", tmp_path, ["/sensor"], span).files
    assert file.messages == 50
    (file,) = export(log, "parquet", tmp_path, ["/event"], span).files
    assert file.messages == len([t for t in range(0, 150, 7) if 10 <= t <= 59])


def test_an_unknown_topic_is_refused(log, tmp_path):
    with pytest.raises(LogError, match="no topic /speed"):
        export(log, "parquet", tmp_path, ["/speed"], ALWAYS)


def test_a_place_that_cannot_be_written_is_told(log, tmp_path):
    pytest.importorskip("pyarrow")
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="file"):
        export(log, "parquet", tmp_path / "file", [], ALWAYS)


@pytest.mark.parametrize(("kind", "module"), [("parquet", "pyarrow"), ("mf4", "asammdf")])
def test_a_missing_library_is_named_with_its_extra(log, tmp_path, monkeypatch, kind, module):
    monkeypatch.setitem(__import__("sys").modules, module, None)
    monkeypatch.setitem(__import__("sys").modules, f"{module}.parquet", None)
    with pytest.raises(
        MissingExtraError, match=rf"{module}: .* -m pip install 'fpeg-hil\[export\]'"
    ):
        export(log, kind, tmp_path / "out", [], ALWAYS)


def test_the_command_tells_files_and_rate(path, tmp_path, capsys):
    pytest.importorskip("pyarrow")
    assert export_command(path, "parquet", tmp_path, [], None, None) == 0
    told = capsys.readouterr().out
    assert f"sensor.parquet: {CHUNKS * TICKS} messages" in told
    assert "messages in" in told


def test_pandas_and_polars_frames_carry_the_units(log):
    pytest.importorskip("pandas")
    pytest.importorskip("polars")
    frame = log.pandas("/sensor")
    assert frame["x_m"].tolist() == log.array("/sensor")["x_m"].tolist()
    assert frame.attrs["units"]["v_m_s"] == "m/s"
    other = log.polars("/event", Span(0, 20_000_000))
    assert other["tick"].to_list() == [0, 7, 14]
    assert log.polars("/actuator").is_empty()


def test_fixed_arrays_become_a_column_an_item(log):
    assert list(columns(log, "/actuator")) == []
    units = column_units(log, "/actuator")
    assert units["pulse_open_t_ns_3"] == "ns"
    with pytest.raises(LogError, match="no topic /speed"):
        list(columns(log, "/speed"))


@pytest.mark.parametrize(
    ("text", "size"),
    [("256MiB", 256 << 20), ("10 GiB", 10 << 30), ("1.5kB".upper(), 1500), ("1000000", 1000000)],
)
def test_sizes_are_read_as_they_are_written(text, size):
    assert size_of(text, "--log-segment") == size


@pytest.mark.parametrize("text", ["", "much", "-1MiB", "1 XiB", "MiB", "1e3"])
def test_what_is_no_size_is_refused(text):
    with pytest.raises(ConfigError, match="accepted is a size, as in 256MiB"):
        size_of(text, "--log-segment")


def test_sizes_are_told_in_a_unit_that_suits_them():
    assert [bytes_text(n) for n in (12, 2048, 3 << 20)] == ["12 bytes", "2.0 KiB", "3.0 MiB"]


def test_a_long_curve_keeps_its_extremes_when_it_is_thinned():
    pytest.importorskip("matplotlib")
    from bench.report.style import extremes

    values = np.sin(np.arange(100_000) / 700.0)
    values[33_333], values[77_777] = 5.0, -5.0
    kept = extremes(values, 1000)
    assert len(kept) <= 2000
    assert (np.diff(kept) > 0).all()
    assert {33_333, 77_777} <= set(kept.tolist())
