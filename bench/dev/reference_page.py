"""docs/reference.md: commands, configuration, events, expectations and figures as declared."""

from __future__ import annotations

from bench.dev.command_tables import command_sections
from bench.dev.key_tables import Keys
from bench.dev.markdown import table
from bench.judge.figure_table import FIGURES
from hil.config.scenario import Scenario
from hil.event_codes import MEANINGS

_HEAD = """\
# Reference

Generated from the declarations by `python -m bench.dev.generate`; do not edit. What belongs
together and why is in [operations.md](operations.md).
"""
_KEYS = """\
A scenario is a TOML file of these keys; `--set KEY=VALUE` changes any of them for one run. An
unknown key is an error. A key without a default stays open, or is filled in before the run.
"""
_EVENTS = """\
A table `[events.NAME]` each, with any name: a command of [commands.md](commands.md) with its
fields, and `at_s`.
"""
_EXPECTATIONS = """\
A table `[expect.NAME]` each, with any name and one or more of these keys.
"""
_CODES = """\
Codes of the topic `/event`, which an expectation may name as it names an event of the scenario.
"""
_FIGURES = """\
Under `figures` in `summary.json`; one without a value is null. All positions and dead centres are
those of the plant, exact to the model; dead centres are distances from mid-stroke.
"""


def page() -> str:
    """Return the page."""
    keys = Keys(Scenario)
    figures = [(f"`{figure.name}`", figure.unit, figure.meaning) for figure in FIGURES]
    parts = [
        _HEAD,
        "## Commands\n",
        *command_sections(),
        f"## Configuration keys\n\n{_KEYS}",
        *keys.sections(),
        f"## Events\n\n{_EVENTS}",
        f"## Expectations\n\n{_EXPECTATIONS}",
        *keys.entries("expect"),
        f"## Event codes\n\n{_CODES}",
        table(("code", "meaning"), [(f"`{code}`", text) for code, text in MEANINGS.items()]),
        f"## Figures\n\n{_FIGURES}",
        table(("figure", "unit", "meaning"), figures),
    ]
    return "\n".join(parts)
