"""The reference page has all that exists, as the parser and the checker of scenarios have it."""

import re
from typing import get_args, get_origin

import pytest
import typer

from bench.cli import app
from bench.dev.reference_page import page
from bench.judge.figure_table import FIGURES
from hil.config.scenario import Expectation, Scenario
from hil.wire import reference
from hil.wire.commands import BY_KIND

PAGE, ORDERS = page(), reference.text()
UNITS = {
    "mm": "mm", "mg": "mg", "hz": "Hz", "us": "us", "ticks": "ticks", "w": "W", "j": "J", "s": "s",
}  # fmt: skip


def parser_tree(command, words=("hil",)):
    """Every command of the parser that typer makes, with its options."""
    yield " ".join(words), command
    for name, inner in getattr(command, "commands", {}).items():
        yield from parser_tree(inner, (*words, name))


COMMANDS = dict(parser_tree(typer.main.get_command(app)))


def section_of(command):
    found = re.search(rf"^### `{command}(?: [^a-z`][^`]*)?`\n(.*?)(?=^##|\Z)", PAGE, re.M | re.S)
    assert found, f"{command} is not in the reference"
    return found[1]


@pytest.mark.parametrize("name", [n for n, c in COMMANDS.items() if not hasattr(c, "commands")])
def test_every_option_of_the_parser_is_there_and_no_other(name):
    options = [
        option for parameter in COMMANDS[name].params
        for option in (*parameter.opts, *parameter.secondary_opts) if option.startswith("-")
    ]  # fmt: skip
    found = re.findall(r"^\| `(-[^`]*)`", section_of(name), re.M)
    told = [word for cell in found for word in cell.replace(",", "").split() if word[0] == "-"]
    assert sorted(told) == sorted(options)


def keys_of(section, prefix=""):
    """Dotted keys, by walking the classes themselves."""
    for name, field in section.model_fields.items():
        kinds = [k for k in (field.annotation, *get_args(field.annotation)) if isinstance(k, type)]
        inner = [kind for kind in kinds if hasattr(kind, "model_fields")]
        if inner and get_origin(field.annotation) is not dict:
            yield from keys_of(inner[0], f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}"


def test_every_configuration_key_is_there_once():
    keys = list(keys_of(Scenario))
    assert len(keys) > 150
    assert [key for key in keys if PAGE.count(f"| `{key}` |") != 1] == []


def test_every_kind_of_event_and_every_expectation_is_there():
    assert set(re.findall(r"^### `([a-z-]+)` \(to the", ORDERS, re.M)) == set(BY_KIND)
    expectations = PAGE[PAGE.index("## Expectations") : PAGE.index("## Event codes")]
    assert re.findall(r"^\| `(\w+)`", expectations, re.M) == list(Expectation.model_fields)


def test_ranges_and_defaults_are_those_that_are_checked():
    assert "| `run.duration_s` | number | s | `2.0` | above 0 to 86400 |" in PAGE
    assert '| `plant.model` | choice |  | `"harmonic"` | `closed-form`, `harmonic`,' in PAGE


def test_the_unit_of_a_figure_is_that_of_its_name():
    for figure in FIGURES:
        unit = UNITS.get(figure.name.rpartition("_")[2])
        assert figure.unit == unit or unit is None or figure.name in {
            "last_speed_m_s", "speed_sim_s_per_wall_s",
        }, figure.name  # fmt: skip
    assert len({figure.name for figure in FIGURES}) == len(FIGURES)
