"""The report in a browser: plots are drawn, linked, measured with cursors; phone, dark, offline."""

import pytest
from bench_logs import Made, alternating, make_run

from bench.judge.figures import read_run
from bench.judge.summary import summarise
from bench.report.document import write_report

LOAD = (260_000_000, "disturbance", "load (load-scale) begins")
RESPONSE = [0.0] * 10 + [1.9, 1.2, -0.3, 0.05] + [0.02] * 20
RANGES = "Plots.group('time').plots.map(plot => [plot.u.scales.x.min, plot.u.scales.x.max])"


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    scenario, files = make_run(
        tmp_path_factory.mktemp("run"), Made(alternating(RESPONSE), events=(LOAD,))
    )
    data = read_run(scenario, files)
    write_report(data, summarise(data, {}), files)
    return files.report.as_uri()


@pytest.fixture
def report(visit, address):
    page = visit(address)
    page.wait_for_selector("html[data-drawn]")
    return page


def ink_of(page, plot):
    """How many pixels of a plot's canvas are neither empty nor grid."""
    return page.evaluate(
        """n => { const c = document.querySelectorAll('figure[data-plot] canvas')[n];
        const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let count = 0;
        for (let i = 0; i < d.length; i += 4)
          { const rgb = [d[i], d[i + 1], d[i + 2]];
            if (d[i + 3] > 128 && Math.max(...rgb) - Math.min(...rgb) > 40) count++; }
        return count; }""",
        plot,
    )


def test_every_plot_is_drawn(report):
    count = report.locator("figure[data-plot] canvas").count()
    assert count == report.locator("figure[data-plot]").count() == 13
    assert all(ink_of(report, n) > 50 for n in range(3))


def test_a_drag_zooms_all_plots_of_the_run_and_a_double_click_shows_it_whole(report):
    over = report.locator("figure[data-plot='1'] .u-over")
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    whole = report.evaluate(RANGES)
    y = box["y"] + 50
    report.mouse.move(box["x"] + 0.25 * box["width"], y)
    report.mouse.down()
    report.mouse.move(box["x"] + 0.5 * box["width"], y, steps=4)
    report.mouse.up()
    zoomed = report.evaluate(RANGES)
    assert len(zoomed) > 5
    assert all(shown == pytest.approx(zoomed[0], abs=1e-6) for shown in zoomed)
    assert zoomed[0] == pytest.approx([0.25, 0.5], abs=0.01)
    over.dblclick(position={"x": 20, "y": 20})
    assert report.evaluate(RANGES) == whole


def test_a_button_goes_to_the_event(report):
    report.get_by_role("button", name="load × 0.85").click()
    assert report.evaluate(RANGES)[0] == pytest.approx([0.16, 0.71], abs=1e-3)


def test_hovering_tells_the_value_of_every_linked_plot(report):
    over = report.locator("figure[data-plot='1'] .u-over")
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    report.mouse.move(box["x"] + 0.276 * box["width"], box["y"] + 40)
    told = report.locator("figure[data-plot='1'] figcaption button", has_text="right")
    assert told.locator("output").inner_text() == "17.4"
    elsewhere = report.locator("figure[data-plot='0'] figcaption button", has_text="position")
    assert elsewhere.locator("output").inner_text() == "0"


def test_two_clicks_measure_between_cursors(report):
    over = report.locator("figure[data-plot='1'] .u-over")
    over.scroll_into_view_if_needed()
    width = over.bounding_box()["width"]
    over.click(position={"x": 0.2 * width, "y": 60})
    over.click(position={"x": 0.6 * width, "y": 60})
    a, b = report.evaluate("[Plots.group('time').a, Plots.group('time').b]")
    assert b - a == pytest.approx(0.4, abs=0.01)


def test_a_series_is_hidden_by_its_name(report):
    before = ink_of(report, 0)
    report.locator("figure[data-plot='0'] figcaption button", has_text="position").click()
    assert ink_of(report, 0) < before


def test_the_page_fits_a_phone(visit, address):
    page = visit(address, width=390, height=800, has_touch=True)
    page.wait_for_selector("html[data-drawn]")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert page.locator("figure[data-plot] .u-over").first.bounding_box()["width"] > 180


def test_in_the_dark_paper_is_dark_and_ink_is_light(visit, address):
    page = visit(address, scheme="dark")
    page.wait_for_selector("html[data-drawn]")
    shades = "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)"
    assert max(page.evaluate(shades)) < 40
    bright = page.evaluate("Plots.ink('motion')")
    page.emulate_media(color_scheme="light")
    page.wait_for_function("ink => Plots.ink('motion') !== ink", arg=bright)
