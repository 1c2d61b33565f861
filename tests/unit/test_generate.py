"""The generated files: they load elsewhere, agree with the declarations, and drift is seen."""

import subprocess
import sys

import cantools
import pytest

from bench.dev import generate
from hil.wire.fields import LAYOUTS


@pytest.fixture(scope="module")
def database():
    return cantools.database.load_string(generate.dbc_text(), "dbc", strict=True)


def test_checked_in_files_follow_from_the_declarations():
    outputs = [(generate.DBC, generate.dbc_text()), (generate.TABLE, generate.table_text())]
    assert generate.drifted(outputs) == []


def test_drift_and_absence_are_both_seen(tmp_path):
    path = tmp_path / "fpeg.dbc"
    assert generate.drifted([(path, "text")]) == [path]
    path.write_text("text")
    assert generate.drifted([(path, "text")]) == []
    assert generate.drifted([(path, "other")]) == [path]


def test_check_exits_with_zero_when_nothing_has_drifted():
    done = subprocess.run(
        [sys.executable, "-W", "error", "-m", "bench.dev.generate", "--check"],
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")


def test_checked_in_dbc_loads_with_every_message():
    database = cantools.database.load_file(generate.DBC, strict=True)
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
    text = generate.table_text()
    for layout in LAYOUTS.values():
        assert f"## {layout.name} (0x{layout.can_id:X}" in text
        assert all(f"| `{placed.name}` |" in text for placed in layout.fields)
    assert "3 spark_right" in text
