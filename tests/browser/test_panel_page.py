"""The panel in a browser, beside a running engine: it shows, and clicks change the engine."""

import re
import subprocess
import sys
from itertools import pairwise
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest

pytest.importorskip("starlette", reason="needs the extra panel")

from bench.run.directory import RunFiles

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

LONG_S = 2000  # it is ended with the last test


@pytest.fixture(scope="module")
def engine(tmp_path_factory):
    """A run with its panel; in lockstep, for which no machine is too busy: (address, files)."""
    out = tmp_path_factory.mktemp("run") / "out"
    command = [sys.executable, "-m", "bench.cli", "run", "steady", "--no-report", "--out", str(out)]
    command += ["--panel", "0", "--set", f"run.duration_s={LONG_S}", "--clock", "lockstep"]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    address = child.stdout.readline().strip()
    yield address, RunFiles(out)
    child.terminate()
    child.communicate(timeout=30)


@pytest.fixture
def panel(visit, engine):
    page = visit(engine[0], width=1400, bypass_csp=True)  # waiting evaluates strings
    page.on("dialog", lambda dialog: dialog.accept())  # who has gone may still be said to steer
    page.wait_for_selector("html[data-ready]")
    page.wait_for_function("Panel.state.frames > 3")
    return page


def steer(page):
    page.get_by_role("button", name=re.compile("^(Steer|Take over)$")).click()
    page.wait_for_function("Panel.state.steering")


def told(page, text):
    """The answer that says it, waited for."""
    item = page.locator("#answers li", has_text=text).first
    item.wait_for()
    return item.inner_text()


def test_the_address_is_one_line_on_this_machine_with_a_token(engine):
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=[\w-]{20,}", engine[0])


def test_without_the_token_or_from_elsewhere_there_is_nothing_to_see(engine):
    base = engine[0].partition("?")[0]
    for url, heads in ((base, {}), (engine[0], {"Origin": "http://evil.example"}),
                       (engine[0], {"Host": "rebound.example"})):  # fmt: skip
        with pytest.raises(HTTPError, match="403"):
            urlopen(Request(url, headers=heads))


def test_scopes_show_what_the_engine_does(panel):
    assert panel.evaluate("document.documentElement.dataset.ready") is not None
    x = panel.evaluate("Array.from(Panel.trackOf('plant.truth.x_m').y('plant.truth.x_m'))")
    assert max(x) > 0.01 > -0.01 > min(x)
    panel.wait_for_function("Panel.scopes.find(p => p.spec.pulses).spec.lanes.length >= 4")
    assert panel.locator("#mode").inner_text() == "generating"


def test_who_does_not_steer_changes_nothing(panel):
    panel.evaluate("Panel.ask({do: 'order', command: {kind: 'misfire', count: 1}})")
    assert "does not steer" in told(panel, "misfire")


def test_a_fault_at_a_click_reaches_the_engine(panel, engine):
    steer(panel)
    panel.locator("button[data-kind='misfire']").click()
    assert "taken" in told(panel, "misfire count=1")
    panel.locator("#events li", has_text="misfire").first.wait_for()


def test_a_mark_is_in_the_log_and_in_the_scopes(panel):
    steer(panel)
    panel.fill("#mark", "here it begins")
    panel.click("#put-mark")
    panel.locator("#events li", has_text="here it begins").first.wait_for()
    assert panel.evaluate("Panel.scopes[0].spec.marks.some(m => m.label.startsWith('here it'))")


def test_a_set_point_moves_the_dead_centres_and_is_undone(panel):
    steer(panel)
    row = panel.locator("#parameters label[data-key='controller.tdc_ref_m']")
    row.locator("input").fill("0.015")
    panel.click("#apply")
    assert "taken" in told(panel, "controller.tdc_ref_m=0.015")
    reached = (
        "(() => { const y = Panel.trackOf('controller.stroke.tdc_m').y('controller.stroke.tdc_m');"
    )
    reached += " return Math.abs(y[y.length - 1] - %s) < 1e-4; })()"
    panel.wait_for_function(reached % 0.015)
    panel.click("#undo")
    panel.wait_for_function(reached % 0.0155)


def test_samples_of_an_earlier_choice_hide_no_later_ones(panel):
    name = "controller.stroke.tdc_m"
    panel.evaluate(f"Panel.send({{ do: 'show', signals: ['{name}'] }})")
    panel.wait_for_function(f"Panel.tracks.has('{name}')")
    panel.evaluate(
        f"for (const k of [...Panel.tracks.keys()]) k === '{name}' || Panel.tracks.delete(k)"
    )
    panel.evaluate(
        f"Panel.send({{ do: 'show', signals: ['{name}', 'controller.stroke.fuel_kg'] }})"
    )
    panel.wait_for_function(f"Panel.trackOf('{name}').members.length === 2", timeout=20_000)


def test_pause_holds_and_the_last_minute_comes_at_full_rate(panel):
    panel.click("#pause")
    held = panel.evaluate("Panel.group.range[1]")
    panel.click("#full")
    panel.wait_for_function("Panel.group.range[1] - Panel.group.range[0] > 50")
    t = panel.evaluate("Array.from(Panel.trackOf('plant.truth.x_m').x())")
    end = panel.evaluate("Panel.group.range[1]")  # what has come since then may be thinned
    steps = {round((b - a) * 1000) for a, b in pairwise(t) if b <= end}
    assert steps == {1}
    assert t[-1] > held


def test_a_trigger_holds_where_a_signal_crosses_its_level(panel):
    panel.fill("#trigger-on", "plant.truth.x_m")
    panel.fill("#trigger-level", "0.005")
    panel.check("#trigger-single")
    panel.click("#trigger")
    panel.wait_for_function("Panel.state.held !== null")
    crossing = "t.y('plant.truth.x_m')[Plots.place(t.x(), Panel.state.held)]"
    x_m = panel.evaluate(f"(t => {crossing})(Panel.trackOf('plant.truth.x_m'))")
    assert x_m == pytest.approx(0.005, abs=0.005)


def test_a_scope_of_any_signals_is_added(panel):
    before = panel.locator("#scopes figure").count()
    panel.fill("#add", "controller.timing.used_tick, plant.sensor.v_m_s")
    panel.click("#add-scope")
    assert panel.locator("#scopes figure").count() == before + 1
    panel.wait_for_function("Panel.trackOf('plant.sensor.v_m_s')?.n > 100")


def test_a_second_viewer_sees_and_does_not_steer(panel, visit, engine):
    steer(panel)
    second = visit(engine[0], bypass_csp=True)
    second.wait_for_selector("html[data-ready]")
    second.wait_for_function("Panel.state.steers !== null")
    assert not second.evaluate("Panel.state.steering")
    assert second.locator("button[data-kind='misfire']").is_disabled()


def test_anybody_stops_the_engine_at_once_and_the_log_says_who(panel, engine):
    panel.keyboard.press("Escape")
    panel.wait_for_function("document.getElementById('mode').textContent === 'safe'")
    panel.locator("#asked", has_text="emergency-stop").wait_for()
    steer(panel)
    panel.get_by_role("button", name="Start").click()
    panel.wait_for_function(
        "['motoring', 'generating'].includes(document.getElementById('mode').textContent)"
    )
