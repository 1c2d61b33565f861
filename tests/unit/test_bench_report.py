import json
import re

import pytest
from bench_logs import Made, alternating, make_run
from web_sheets import unpacked

import hil
from bench.judge.figures import read_run
from bench.judge.summary import summarise
from bench.report.document import save_picture, write_report
from bench.run.commands import report
from bench.run.resolve import resolve
from hil.errors import ConfigError, LogError
from hil.files import Output

pytest.importorskip("matplotlib", reason="needs the extra desk")
pytest.importorskip("uplot", reason="needs the extra desk")

RESPONSE = [0.0] * 10 + [1.9, 1.2, -0.3, 0.05] + [0.02] * 20
LOAD = (260_000_000, "disturbance", "load (load-scale) begins")


def sheet_of(text):
    """The plots and arrays of a page."""
    found = re.search(r'<script type="application/json" id="sheet">(.*?)</script>', text, re.DOTALL)
    return json.loads(found[1])


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    made = Made(alternating(RESPONSE), events=(LOAD, (300_000_000, "misfire", "<b>left</b>")))
    scenario, files = make_run(tmp_path_factory.mktemp("run"), made)
    data = read_run(scenario, files)
    write_report(data, summarise(data, {}), files)
    save_picture(data, files, Output("--picture", files.directory / "picture.svg"))
    return files


def test_the_report_needs_nothing_but_itself(page):
    text = page.report.read_text()
    assert re.findall(r"""<[^>]*\s(?:src|href)\s*=\s*["']([^"'#][^"']*)""", text) == ["data:,"]
    for fetching in ("@import", "url(", "fetch(", "XMLHttpRequest", "WebSocket"):
        assert fetching not in text


def test_the_report_shows_pictures_verdict_and_configuration(page):
    text = page.report.read_text()
    drawn = [plot["title"] for plot in sheet_of(text)["plots"]]
    assert drawn[:3] == [
        "Piston position, pulses and modes",
        "Top dead centre of every stroke, from mid-stroke",
        "TDC error after load",
    ]
    assert text.count("<figure data-plot=") == len(drawn) == 13
    assert "expectations met" in text
    assert "settled after 90.0 ms" in text
    assert "at_stroke_fraction" in text


def test_no_two_figures_of_a_page_have_the_same_name(page):
    names = re.findall(r'class="tile"><span>([^<]*)<', page.report.read_text())
    assert len(names) == len(set(names)) > 5


def test_every_stroke_is_in_the_report_and_left_is_no_right(page):
    sheet = sheet_of(page.report.read_text())
    plot = next(p for p in sheet["plots"] if p["title"].startswith("Top dead centre"))
    named = {series["label"]: series for series in plot["series"]}
    left, right = named["left"], named["right"]
    assert len(unpacked(sheet, left["y"])) + len(unpacked(sheet, right["y"])) == len(RESPONSE)
    assert unpacked(sheet, right["y"])[5] == pytest.approx(15.5 + 1.9, abs=1e-4)
    assert (left["colour"], left["shape"]) != (right["colour"], right["shape"])


def test_a_stimulus_is_marked_with_what_it_does(tmp_path):
    ramp = {
        "kind": "ramp",
        "parameter": "plant.disturbance.load_scale",
        "value": 1.2,
        "over_s": 0.1,
    }
    command = {"kind": "misfire", "when": {"event": "load"}}
    events = {"load": ramp | {"at_s": 0.2}, "lost": command}
    hil.run({"run": {"duration_s": 0.6}, "events": events}, out=tmp_path / "run", report=True)
    plot = sheet_of((tmp_path / "run" / "report.html").read_text())["plots"][0]
    assert [mark["label"] for mark in plot["marks"]] == ["load: ramp", "lost: no spark"]


LAW = """
class Law:
    signals = {"asked_kg": "fuel asked for", "error_m": "of the stroke before", "strokes": "so far"}

    def initial(self):
        return 0.0, 0.0, 0

    def step(self, state, view):
        fuel_kg = view.point.fuel_kg
        return (fuel_kg, view.tdc_ref_m - view.motion.tdc_m, state[2] + 1), fuel_kg

    def tell(self, state):
        return dict(zip(self.signals, state))
"""


def test_what_a_law_of_ones_own_tells_is_drawn_under_its_names(tmp_path):
    (tmp_path / "mine.py").write_text(LAW)
    law = str(tmp_path / "mine.py")
    hil.run(controller=law, run__duration_s=0.3, out=tmp_path / "run", report=True)
    plots = sheet_of((tmp_path / "run" / "report.html").read_text())["plots"]
    drawn = [(plot["title"], plot["y"]) for plot in plots if plot["title"].startswith("Law")]
    assert drawn == [
        ("Law mine: asked_kg", "[mg]"), ("Law mine: error_m", "[mm]"), ("Law mine: strokes", "")
    ]  # fmt: skip


def test_what_a_log_says_is_text_and_never_markup(page):
    text = page.report.read_text()
    assert "<b>left</b>" not in text
    assert "&lt;b&gt;left" in text


def test_the_picture_stands_alone(page):
    assert (page.directory / "picture.svg").read_text().startswith("<svg")


@pytest.mark.parametrize("centres", [[], alternating([])], ids=["no stroke", "only the first"])
def test_a_run_that_shows_nothing_still_has_a_report(tmp_path, centres):
    scenario, files = make_run(tmp_path, Made(centres), loop__clock="lockstep")
    data = read_run(scenario, files)
    write_report(data, summarise(data, {}), files)
    assert "event &#x27;load&#x27; did not happen" in files.report.read_text()


def test_a_log_without_truth_is_told_in_one_line(tmp_path):
    scenario, files = make_run(tmp_path, Made([], ticks=0))
    files.scenario.write_text(resolve(scenario).model_dump_json())
    with pytest.raises(LogError, match=r"plant\.mcap: nothing to judge or draw: it has no rows of"):
        report(tmp_path, None)


def test_a_picture_replaces_no_log(page, tmp_path):
    before = page.plant_log.read_bytes()
    (tmp_path / "a.svg").symlink_to(page.plant_log)
    (tmp_path / "b.svg").write_text("there")
    with pytest.raises(ConfigError, match=r"accepted is a name ending in \.svg"):
        report(page.directory, page.plant_log, force=True)
    with pytest.raises(ConfigError, match="is read by this command"):
        report(page.directory, tmp_path / "a.svg", force=True)
    with pytest.raises(ConfigError, match="exists already"):
        report(page.directory, tmp_path / "b.svg")
    assert page.plant_log.read_bytes() == before
