"""Laws on engines: what a row says, and how it is told."""

import json

import pytest

from bench.studies import survey, survey_page
from bench.studies.survey import EngineModel, Extent, Row, Task
from controller.motion.laws import LAWS
from hil.files import Output

HARMONIC = EngineModel("nu", "harmonic")
SHORT = Extent((0.25,), (1000,), 2.0)


def row(law="pdf", rate_hz=1000, extent=SHORT, **changes):
    return survey.row_of(Task(law, HARMONIC, rate_hz, extent, tuple(changes.items())))


def test_a_row_has_the_worst_step_and_the_scatter_under_noise():
    found = row("pdf")
    assert found[:4] == ("pdf", "nu", "harmonic", 1000)
    assert found.peak_mm == pytest.approx(1.885, abs=0.02)
    assert found.settling_ms == pytest.approx(47.0, abs=1.0)
    assert 0.09 < found.sigma_mm < 0.16
    assert (found.lost, found.misfires, found.note) == (0, 0, "")


def test_what_is_refused_is_a_row_with_its_reason():
    found = row(rate_hz=500, **{"plant.command_delay_ticks": 3})
    assert found.peak_mm is None
    assert "plant.command_delay_ticks 3" in found.note


def test_open_loop_burns_what_keeps_the_set_point():
    found = row("open-loop", extent=SHORT._replace(noise_s=1.0))
    assert found.peak_mm == pytest.approx(2.735, abs=0.02)
    assert found.settling_ms is None


def test_the_bound_is_of_what_the_law_can_know_and_least_sigma_that_of_minimum_variance():
    full = survey.bound_row((HARMONIC, Extent((0.75,), (1000,), 1.0), (), survey.known_to("pdf")))
    mid = survey.bound_row(
        (HARMONIC, Extent((0.75,), (1000,), 1.0), (), survey.known_to("cascade"))
    )
    assert full[0] == pytest.approx(0.251, abs=0.002)
    assert mid[0] == pytest.approx(2.112, abs=0.002)
    assert full[2] == mid[2] == pytest.approx(0.1175, abs=0.0005)


def test_every_law_meets_every_engine_at_every_rate():
    todo = survey.tasks(list(LAWS), survey.ENGINES, survey.WHOLE)
    assert len(todo) == len(LAWS) * len(survey.ENGINES) * len(survey.RATES)
    assert len({(task.law, task.engine, task.rate_hz) for task in todo}) == len(todo)


def test_rows_are_told_as_a_table_as_json_and_as_a_page(tmp_path):
    rows = [
        Row("cascade", "nu", "harmonic", 1000, 1.9, 156.0, 1.885, 47.0, 0.19, 0.117),
        Row("cascade", "nu", "harmonic", 500, note="no time"),
        Row("pdf", "nu", "harmonic", 1000, 1.9, None, lost=2),
    ]
    text = survey_page.table(rows)
    assert (
        "| nu harmonic | 1000 | cascade | 1.900 | 156 | 1.885 | 47 | 0.190 | 0.117 | 0 | 0 |"
        in text
    )
    assert "- cascade, nu harmonic, 500 Hz: no time" in text
    told = json.loads(survey_page.as_json(rows))["rows"]
    assert told[0]["bound_mm"] == 1.885
    assert told[2]["settling_ms"] is None
    survey_page.write_page(rows, Output("--out", tmp_path / "compare.html"))
    assert "1.900 / 1.885" in (tmp_path / "compare.html").read_text(encoding="utf-8")
