import re

import pytest
from bench_logs import Made, alternating, make_run

from bench.judge.figures import read_run
from bench.judge.summary import summarise
from bench.report.document import save_picture, write_report
from bench.run.commands import report
from bench.run.resolve import resolve
from hil.errors import ConfigError, LogError
from hil.files import Output

pytest.importorskip("matplotlib")

RESPONSE = [0.0] * 10 + [1.9, 1.2, -0.3, 0.05] + [0.02] * 20
LOAD = (260_000_000, "disturbance", "load (load-scale) begins")


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
    fetched = re.findall(r"""(?:src|href)\s*=\s*["']([^"'#][^"']*)""", text)
    assert [url for url in fetched if not url.startswith("#")] == []
    assert "@import" not in text
    assert "url(http" not in text
    assert "<script" not in text


def test_the_report_shows_pictures_verdict_and_configuration(page):
    text = page.report.read_text()
    assert text.count("<svg") == 8
    assert "expectations met" in text
    assert "settled after 90.0 ms" in text
    assert "at_stroke_fraction" in text


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
