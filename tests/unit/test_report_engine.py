"""The report looks into the cylinders of a detailed engine: diagram, power, figures."""

import json

import pytest

pytest.importorskip("numba", reason="needs the extra detailed")
pytest.importorskip("uplot", reason="needs the extra desk")

import numpy as np

import hil.log
from bench.report import indicator
from bench.report.cylinders import section
from bench.report.indicator import last_cycle
from bench.report.plots_engine import parts_of, power, pressure_volume, pressure_volume_log
from bench.run.commands import RunOptions, overrides, run
from bench.run.directory import RunFiles
from bench.web.page import Page
from hil.config.resolved import read_resolved
from hil.errors import MissingExtraError
from hil.wire.messages import MOTOR


def made(directory, model, duration_s, report=False):
    flags = {"link.kind": "memory", "loop.clock": "lockstep", "plant.model": model}
    given = [f"run.duration_s={duration_s}"]
    run("steady", overrides(flags, given), RunOptions(directory, report, True))
    files = RunFiles(directory)
    return read_resolved(files.scenario), files


@pytest.fixture(scope="module")
def two_stroke(tmp_path_factory):
    return made(tmp_path_factory.mktemp("two"), "two-stroke", 0.8, report=True)


@pytest.fixture(scope="module")
def four_stroke(tmp_path_factory):
    return made(tmp_path_factory.mktemp("four"), "four-stroke", 1.2)


@pytest.fixture(scope="module")
def started(tmp_path_factory):
    return made(tmp_path_factory.mktemp("starting"), "starting", 1.0)


@pytest.fixture(scope="module")
def motored(tmp_path_factory):
    return made(tmp_path_factory.mktemp("motoring"), "motoring", 4.0)


@pytest.fixture(params=["two_stroke", "four_stroke", "started"])
def cycle(request):
    found, why = last_cycle(*request.getfixturevalue(request.param))
    assert why == ""
    return found


def test_the_diagram_encloses_the_indicated_work(cycle):
    """The indicated work of a cycle is the integral of p dV over it, both cylinders."""
    f = cycle.figures
    work = sum(np.trapezoid(p, v) for p, v in zip(cycle.p_pa, cycle.volume_m3, strict=True))
    seconds = cycle.t_s[-2] - cycle.t_s[0]
    assert work / seconds == pytest.approx(f.indicated_w, rel=0.01)


def test_the_diagram_closes(cycle):
    assert cycle.p_pa[:, -1] == pytest.approx(cycle.p_pa[:, 0], rel=0.15)
    assert cycle.p_pa.max() == pytest.approx(cycle.figures.p_max_pa, rel=0.03)


def test_what_leaves_is_what_the_fuel_brought(cycle):
    f = cycle.figures
    rest = f.fuel_w - f.heat_w - f.exhaust_w - f.leak_w - f.indicated_w
    assert abs(rest) < 0.005 * f.fuel_w
    left = f.indicated_w - f.friction_w - f.motoring_w - f.pump_w - f.copper_w
    assert f.electric_w == pytest.approx(left, rel=1e-3 if f.copper_w else 1e-6)


def test_the_fuel_of_the_figures_is_the_fuel_that_burnt(two_stroke):
    found, _ = last_cycle(*two_stroke)
    f = found.figures
    charges = f.speed_rpm / 60.0 * 2.0
    text = (two_stroke[1].directory / "summary.json").read_text()
    burnt_kg = float(text.split('"fuel_final_mg": ')[1].split(",")[0]) * 1e-6
    assert f.fuel_w == pytest.approx(charges * burnt_kg * 44.0e6, rel=0.01)


def figures_of(files):
    return json.loads(files.summary.read_text())["figures"]


def crossings_hz(files):
    """Frequency by the instants at which the speed changes its sign, over whole cycles of four."""
    with hil.log.open(files.plant_log) as log:
        truth = log.array("/truth")
    t_s, v = truth["t_ns"] * 1e-9, truth["v_m_s"]
    at = np.flatnonzero(v[:-1] * v[1:] < 0.0)
    turned_s = t_s[at] - v[at] * (t_s[at + 1] - t_s[at]) / (v[at + 1] - v[at])
    count = (len(turned_s) - 1) // 4 * 4
    return 0.5 * count / (turned_s[-1] - turned_s[-1 - count])


@pytest.mark.parametrize("run", ["two_stroke", "four_stroke", "started"])
def test_the_summary_says_what_the_cycles_say(request, run):
    scenario, files = request.getfixturevalue(run)
    told, (cycle, _) = figures_of(files), last_cycle(scenario, files)
    f = cycle.figures
    assert told["electric_power_mean_w"] == pytest.approx(f.electric_w, rel=0.01)
    assert told["frequency_mean_hz"] == pytest.approx(f.speed_rpm / 60.0, rel=0.005)
    assert told["frequency_mean_hz"] == pytest.approx(crossings_hz(files), rel=0.002)


def test_a_drives_brake_is_terminal_power_and_no_electric_power(four_stroke):
    """The energy balance of the mover: what the gas gives less friction is at the terminals."""
    scenario, files = four_stroke
    told, (cycle, _) = figures_of(files), last_cycle(scenario, files)
    f = cycle.figures
    assert told["terminal_power_mean_w"] == pytest.approx(f.indicated_w - f.friction_w, rel=0.005)
    assert told["electric_power_mean_w"] == pytest.approx(663.0, rel=0.01)
    assert told["frequency_final_hz"] == pytest.approx(14.85, abs=0.01)


def test_a_motored_engine_takes_power_and_is_motoring(motored):
    scenario, files = motored
    told, (cycle, _) = figures_of(files), last_cycle(scenario, files)
    f = cycle.figures
    assert told["mode_final"] == "motoring"
    assert json.loads(files.summary.read_text())["verdict"] == "met"
    assert f.electric_w == pytest.approx(f.indicated_w - f.friction_w, rel=1e-3)
    assert told["electric_power_mean_w"] == pytest.approx(f.electric_w, rel=0.02)
    with hil.log.open(files.controller_log) as log:
        assert set(log.array("/actuator")["mode"]) == {MOTOR}


def test_every_loss_takes_its_part_off_what_is_left(cycle):
    parts = parts_of(cycle.figures)
    names = [part.name for part in parts]
    assert names[0] == "fuel"
    assert names[-1] == "electric"
    left = parts[0].power_w
    for part in parts[1:]:
        if part.remains:
            assert left == pytest.approx(part.power_w, abs=0.005 * cycle.figures.fuel_w)
            left = part.power_w
        else:
            left -= part.power_w


def test_the_pictures_say_what_is_on_their_axes(cycle):
    for plot in (pressure_volume(cycle), pressure_volume_log(cycle)):
        assert (plot.x, plot.y) == ("V  [cm³]", "p  [bar]")
        assert [series.label for series in plot.series] == ["left", "right"]
    assert " W · 100.0 %" in power(cycle)


def test_the_page_has_the_section_with_tiles_pictures_and_table(two_stroke):
    page = two_stroke[1].report.read_text()
    at = page.index("Engine cycle")
    assert page.count("<figure", at) == 3
    for text in ("Compression ratio", "Efficiency", "indicated mean effective pressure"):
        assert text in page[at:]


def test_a_motored_engine_has_a_diagram_and_no_efficiency(motored):
    text = section(Page("motored"), *motored)
    assert text.count("<figure") == 2
    assert "Compression ratio" in text
    assert "Efficiency" not in text


def test_a_run_too_short_to_look_into_says_so(tmp_path):
    assert "Not shown: the run is too short" in section(
        Page(""), *made(tmp_path, "two-stroke", 0.3)
    )


def test_a_log_of_another_motion_is_not_shown(two_stroke, monkeypatch):
    monkeypatch.setattr(indicator, "_SAME_M", 0.0)
    assert "Not shown: the motion cannot be run again" in section(Page(""), *two_stroke)


def test_a_missing_compiler_is_named_on_the_page(two_stroke, monkeypatch):
    def missing(*_):
        raise MissingExtraError("numba", "detailed", "the detailed engine")

    monkeypatch.setattr(indicator, "make_params", missing)
    assert "Not shown: the detailed engine needs numba" in section(Page(""), *two_stroke)


def test_a_fast_model_has_no_such_section(tmp_path):
    assert section(Page(""), *made(tmp_path, "harmonic", 0.3)) == ""
