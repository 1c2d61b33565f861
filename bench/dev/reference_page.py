"""docs/reference.md: commands, configuration, events, expectations and figures as declared."""

from __future__ import annotations

from collections.abc import Iterator

from bench.dev.command_tables import command_sections
from bench.dev.key_tables import section_table, section_tables
from bench.dev.markdown import table
from bench.judge.figure_table import FIGURES
from hil.config.scenario import Expectation, Scenario
from hil.event_codes import MEANINGS
from hil.names.signals import signals

_HEAD = """\
# Reference

Generated from the declarations by `python -m bench.dev.generate`; do not edit. What belongs
together and why is in [operations.md](operations.md).
"""
_KEYS = """\
A scenario is a TOML file of these keys; `--set KEY=VALUE` changes any of them for one run. An
unknown key is an error. A key without a default stays open, or is filled in before the run. What
is marked live can be changed while the engine runs: `hil set KEY=VALUE`. `hil parameters` lists
them all.
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
_SIGNALS = """\
Every field of a logged topic, by process, topic and field; `hil signals` lists them all. There is a
value every tick, every stroke, or when there is occasion.
"""
_FIGURES = """\
Under `figures` in `summary.json`; one without a value is null. All positions and dead centres are
those of the plant, exact to the model; dead centres are distances from mid-stroke.
"""


def page() -> str:
    """Return the page."""
    figures = [(f"`{figure.name}`", figure.unit, figure.meaning) for figure in FIGURES]
    parts = [
        _HEAD,
        "## Commands\n",
        *command_sections(),
        f"## Configuration keys\n\n{_KEYS}",
        *section_tables(Scenario),
        f"## Events\n\n{_EVENTS}",
        f"## Expectations\n\n{_EXPECTATIONS}",
        section_table(Expectation),
        f"## Event codes\n\n{_CODES}",
        table(("code", "meaning"), [(f"`{code}`", text) for code, text in MEANINGS.items()]),
        f"## Signals\n\n{_SIGNALS}",
        table(("signal", "type", "unit", "rate", "meaning"), _signal_rows()),
        f"## Figures\n\n{_FIGURES}",
        table(("figure", "unit", "meaning"), figures),
    ]
    return "\n".join(parts)


def _signal_rows() -> Iterator[tuple[str, ...]]:
    """A row a field; the items of an array are told by how many there are."""
    for signal in signals().values():
        if not signal.item:
            name = signal.name if signal.item is None else f"{signal.name.rpartition('.')[0]}.N"
            yield f"`{name}`", signal.type, signal.unit, signal.rate, signal.meaning
