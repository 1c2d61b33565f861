"""Status messages: written as declared, read as declared, and nothing else believed."""

import json

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hil.wire import status
from hil.wire.status import ControllerStatus, PlantStatus

CONTROLLER = ControllerStatus(
    mode="generating", t_s=3.3, tick=3300, tdc_mm=15.501, tdc_ref_mm=15.5, fuel_mg=2.818,
    speed_hz=19.94, power_w=1527.0, power_ref_w=None,
    load_n_s_m=810.0, stale=0, late_samples=1, implausible_samples=0, changes=0,
    reception={"ok": 9271},
)  # fmt: skip
PLANT = PlantStatus(
    t_s=3.3, tick=3300, tdc_mm=15.501, late_us=2, late_max_us=81, missed=1, answered=3225,
    used_tick=3299, safe=False, contacts=0, changes=2, reception={"ok": 6576, "lost": 2},
)  # fmt: skip


@pytest.mark.parametrize(("process", "told"), [("controller", CONTROLLER), ("plant", PLANT)])
def test_what_was_written_is_read_back(process, told):
    assert status.read(process, status.write(told._asdict())) == told._asdict()
    assert set(status.FIGURES[process]) == set(told._fields)


def test_what_is_no_number_yet_is_nothing():
    raw = status.write(CONTROLLER._replace(fuel_mg=float("nan"))._asdict())
    assert json.loads(raw)["fuel_mg"] is None
    assert status.read("controller", raw)["fuel_mg"] is None


def test_how_a_figure_is_shown():
    shown = {name: status.SHOWN[name].text(value) for name, value in PLANT._asdict().items()
             if name in status.SHOWN}  # fmt: skip
    assert shown == {
        "t_s": "3.3 s", "tick": "3300", "tdc_mm": "15.501 mm", "late_us": "2 µs",
        "late_max_us": "81 µs", "missed": "1", "answered": "3225", "used_tick": "3299",
        "safe": "no", "contacts": "0", "changes": "2",
    }  # fmt: skip


ANY = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=4,
)  # fmt: skip
NAMES = st.sampled_from([*ControllerStatus._fields, *PlantStatus._fields]) | st.text()


@given(st.dictionaries(NAMES, ANY).map(lambda table: json.dumps(table).encode()) | st.binary())
@example(json.dumps({"tick": 1}).encode("utf-16"))
@example(b"[" * (1 << 20))
@example(b'{"tdc_mm": ' + b"9" * 4000 + b"}")
@example(b'{"tdc_mm": "[red]15", "tick": true, "mode": "a\\u001b[31mb", "reception": {"ok": "1"}}')
def test_from_any_bytes_only_what_can_be_shown_is_read(raw):
    for process in ("controller", "plant"):
        told = status.read(process, raw)
        for name, value in (told or {}).items():
            if value is not None and name != "reception":
                assert status.SHOWN[name].text(value).isprintable()
    assert status.read("nobody", raw) is None
