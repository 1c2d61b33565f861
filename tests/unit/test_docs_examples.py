"""What the pages show runs: scenarios, Python, the notebook."""

import json
import re
import tomllib

import matplotlib as mpl
import pytest
from source_tree import ROOT

import hil
from hil.config.suite.cases import cases_of

PAGES = ("first-hour.md", "scenarios.md", "python.md")


def blocks(page, language):
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.M | re.S)


TOML = [(page, text) for page in PAGES for text in blocks(page, "toml")]
PYTHON = [(page, text) for page in ("python.md",) for text in blocks(page, "python")]


@pytest.mark.parametrize(("page", "text"), TOML)
def test_a_scenario_on_a_page_meets_what_it_expects(page, text, tmp_path):
    path = tmp_path / "page.toml"
    path.write_text(text)
    if "include" in text:
        assert len(cases_of(tomllib.loads(text), path)) == 8
        path = f"{path}::light-tdc_ref_m=0.0153-seed=1"
    run = hil.run(str(path), out=tmp_path / "run", report=True)
    assert run.verdict in ("met", "none"), run.reason
    assert (tmp_path / "run" / "report.html").stat().st_size > 100_000


@pytest.mark.parametrize(("page", "text"), PYTHON)
def test_python_on_a_page_runs(page, text, capsys):
    exec(compile(text, page, "exec"), {})


def test_the_tests_on_the_page_on_pytest_pass(pytester):
    pytester.makepyfile("\n".join(blocks("testing.md", "python")))
    plugins = ("-p", "no:hil", "-p", "bench.suite.plugin", "-p", "no:cacheprovider")
    pytester.runpytest_inprocess(*plugins).assert_outcomes(passed=2)


def test_the_notebook_runs_from_its_first_cell_to_its_last():
    mpl.use("svg")
    cells = json.loads((ROOT / "docs/examples/load-step.ipynb").read_text())["cells"]
    names = {}
    for cell in cells:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), cell["id"], "exec"), names)
    assert names["runs"]["cascade"].verdict == "met"
