"""Parameter studies of the detailed engines: what moves which way, and the pictures."""

import numpy as np
import pytest
from typer.testing import CliRunner

from bench.cli.engine import app
from bench.studies.engine.sweep import SWEEPS, fuel_study, starting_study, sweep
from hil.errors import ConfigError


def few(monkeypatch, over, values):
    """Leave a study some of its values."""
    if over in SWEEPS:
        monkeypatch.setitem(SWEEPS, over, SWEEPS[over]._replace(values=values))


def table(monkeypatch, over, name, values):
    few(monkeypatch, over, values)
    points = sweep(over, name)
    assert all(p.figures is not None or p.reason for p in points)
    return {p.value: p.figures for p in points if p.figures is not None}


def test_throttle_lowers_the_power_of_both_cycles(monkeypatch):
    """Figs 4.15 and 4.16: motoring takes the same at every throttle."""
    for name in ("nu-two-stroke", "nu-four-stroke"):
        found = table(monkeypatch, "throttle", name, (0.5, 0.8, 1.0))
        powers = [f.indicated_w for f in found.values()]
        assert powers == sorted(powers)
        assert powers[0] < 0.65 * powers[-1]
    motoring = [f.motoring_w for f in found.values()]
    assert np.ptp(motoring) < 0.05 * motoring[-1]


def test_an_earlier_spark_lowers_the_compression_ratio_and_raises_the_peak(monkeypatch):
    """Fig. 4.17; and Fig. 4.18: it raises the power of the two-stroke engine."""
    found = list(table(monkeypatch, "ignition", "nu-two-stroke", (18.0, 24.0)).values())
    assert [f.compression_ratio for f in found] == sorted(
        (f.compression_ratio for f in found), reverse=True
    )
    assert [f.p_max_pa for f in found] == sorted(f.p_max_pa for f in found)
    assert found[-1].electric_w > found[0].electric_w


def test_more_motor_force_speeds_the_four_stroke_engine_up(monkeypatch):
    """Figs 4.19 and 4.20: more speed, compression and power, and motoring takes about half."""
    found = list(table(monkeypatch, "motor-force", "nu-four-stroke", (0.95, 1.1)).values())
    for key in ("speed_rpm", "compression_ratio", "indicated_w"):
        values = [getattr(f, key) for f in found]
        assert values == sorted(values)
    share = [f.motoring_w / f.indicated_w for f in found]
    assert share == pytest.approx([0.45] * len(share), abs=0.05)


def test_starting_study_has_the_four_forces():
    """App. I Fig. 10: 10 bar is passed with 110 N and 130 N alone."""
    reached = {force: max(peaks) >= 10.0 for force, peaks in starting_study().items()}
    assert reached == {70.0: False, 90.0: False, 110.0: True, 130.0: True}


def test_fuel_study_is_fig_6_2():
    low, *_, high = fuel_study()
    assert low[1:] == pytest.approx((2.75e-3, 673.8), rel=1e-3)
    assert high[1:] == pytest.approx((22.70e-3, 1552.3), rel=1e-3)


def test_a_trace_is_one_closed_cycle():
    point = sweep("throttle", "bit-running")[-1]
    trace = point.trace
    assert trace.x_m[-1] == pytest.approx(trace.x_m[0], abs=0.2e-3)
    work = np.trapezoid(trace.p_pa, trace.volume_m3)
    cycles_per_s = point.figures.speed_rpm / 60.0
    assert 2.0 * work * cycles_per_s == pytest.approx(point.figures.indicated_w, rel=0.02)


@pytest.mark.parametrize(
    ("over", "name"),
    [("throttle", "nu-two-stroke"), ("throttle", "bit-running"), ("ignition", "nu-two-stroke"),
     ("motor-force", "nu-four-stroke"), ("motor-force", "bit-starting"), ("load", "nu-two-stroke"),
     ("fuel", "nu-two-stroke")],
)  # fmt: skip
def test_each_study_prints_its_table_and_draws_its_picture(tmp_path, monkeypatch, over, name):
    few(monkeypatch, over, (20.0, 24.0) if over == "ignition" else (0.97, 1.0))
    picture = tmp_path / "study.svg"
    done = CliRunner().invoke(
        app, ["sweep", "--over", over, "--engine", name, "--out", str(picture)]
    )
    assert done.exit_code == 0, done.output
    assert len(done.output.splitlines()) >= 3
    assert picture.read_text().rstrip().endswith("</svg>")


@pytest.mark.parametrize(
    ("over", "name"), [("motor-force", "nu-two-stroke"), ("ignition", "bit-starting")]
)
def test_a_study_that_means_nothing_is_refused(over, name):
    with pytest.raises(ConfigError, match="accepted"):
        sweep(over, name)
