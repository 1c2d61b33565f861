"""The generated files: they load elsewhere, agree with the declarations, and drift is seen."""

import subprocess
import sys

import cantools
import pytest

from bench.dev import generate, messages_page
from bench.dev.dbc import dbc_text
from hil import compiled
from hil.wire.fields import LAYOUTS


@pytest.fixture(scope="module")
def database():
    return cantools.database.load_string(dbc_text(), "dbc", strict=True)


@pytest.mark.parametrize("name", generate.OUTPUTS)
def test_checked_in_files_follow_from_the_declarations(name):
    assert generate.drifted({name: generate.OUTPUTS[name]}, compiled.root()) == []


def test_drift_and_absence_are_both_seen(tmp_path):
    outputs = {"page.md": lambda: "text"}
    assert generate.drifted(outputs, tmp_path) == ["page.md"]
    (tmp_path / "page.md").write_text("text")
    assert generate.drifted(outputs, tmp_path) == []
    (tmp_path / "page.md").write_text("other")
    assert generate.drifted(outputs, tmp_path) == ["page.md"]


def test_check_names_the_file_that_has_drifted_in_one_line(tmp_path, monkeypatch, capsys):
    (tmp_path / "page.md").write_text("other")
    monkeypatch.setattr(generate, "OUTPUTS", {"page.md": lambda: "text"})
    monkeypatch.setattr(compiled, "root", lambda: tmp_path)
    monkeypatch.setattr(sys, "argv", ["generate", "--check"])
    assert generate.main() == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("page.md has drifted")


def test_check_exits_with_zero_when_nothing_has_drifted():
    done = subprocess.run(
        [sys.executable, "-W", "error", "-m", "bench.dev.generate", "--check"],
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")


def test_checked_in_dbc_loads_with_every_message():
    database = cantools.database.load_file(compiled.root() / "hil/wire/fpeg.dbc", strict=True)
    assert {m.frame_id: m.name for m in database.messages} == {
        layout.can_id: layout.name for layout in LAYOUTS.values()
    }
    assert {node.name for node in database.nodes} == {"plant", "controller"}


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=lambda layout: layout.name)
def test_dbc_has_scale_unit_range_and_comment_of_every_signal(layout, database):
    message = database.get_message_by_frame_id(layout.can_id)
    assert message.length == 8
    assert message.senders == [layout.sender]
    for placed in layout.fields:
        signal = message.get_signal_by_name(placed.name)
        low, high = placed.signal.raw_range
        assert signal.scale == pytest.approx(placed.signal.scale)
        assert (signal.unit or "") == placed.signal.unit
        assert signal.minimum == pytest.approx(low * placed.signal.scale)
        assert signal.maximum == pytest.approx(high * placed.signal.scale)
        assert signal.comment == layout.field_comments[placed.name]


def test_table_names_every_signal_and_every_channel():
    text = messages_page.page()
    for layout in LAYOUTS.values():
        assert f"## {layout.name} (0x{layout.can_id:X}" in text
        assert all(f"| `{placed.name}` |" in text for placed in layout.fields)
    assert "3 spark_right" in text
