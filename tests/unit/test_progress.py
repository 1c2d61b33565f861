"""How far a long command is: plain lines without a terminal, and nothing of a short one."""

import io

import pytest
from rich.console import Console

from bench import progress as module
from bench.progress import counted, progress, steps
from bench.report.text_table import text_table
from bench.run.resolve import resolve
from bench.run.scenarios import read
from bench.run.sensitivities import FRACTIONS, identify


@pytest.fixture
def plain():
    return Console(file=io.StringIO(), force_terminal=False)


def test_a_short_command_says_nothing(plain):
    with progress("compare", 3, "runs", console=plain) as advance:
        assert list(counted("abc", advance)) == ["a", "b", "c"]
    assert plain.file.getvalue() == ""


def test_a_long_one_says_a_line_with_what_is_left(plain, monkeypatch):
    times = iter([0.0, 3.0, 6.0])
    monkeypatch.setattr(module.time, "monotonic", lambda: next(times))
    with progress("compare", 40, "runs", 10, plain) as advance:
        advance(5)
        advance(5)
    assert plain.file.getvalue() == "compare: 20 of 40 runs, about 12 s left\n"


def test_a_terminal_is_left_as_it_was():
    terminal = Console(file=io.StringIO(), force_terminal=True, no_color=True, width=80)
    with progress("compare", 2, "runs", console=terminal) as advance:
        advance(1)
    told = terminal.file.getvalue()
    assert "runs" in told
    assert "\x1b[3" not in told.replace("\x1b[?25", "")
    assert told.endswith("\x1b[2K")


def test_steps_are_lines(plain):
    with steps("compiling", plain) as tell:
        tell("types")
    assert plain.file.getvalue() == "compiling: types\n"


def test_no_figure_of_a_table_is_broken():
    rows = [("law", "-15 % a"), ("cascade", "1.884 / 156")]
    assert text_table(rows) == "law          -15 % a\ncascade  1.884 / 156"


def test_every_place_of_a_stroke_that_finds_sensitivities_is_told():
    told = []
    identify(resolve(read("steady")), told.append)
    assert sum(told) == len(FRACTIONS)
