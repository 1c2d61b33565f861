"""`--help`: grouped, on lines of 80 columns, with what there is to choose from."""

import re

from typer.main import get_command
from typer.testing import CliRunner

from bench.cli import app
from bench.cli.options import HEADINGS
from controller.motion.laws import LAWS
from hil.config.engine.models import OWN_MODELS
from hil.config.prototypes import PROTOTYPES


def _help(*words):
    return CliRunner().invoke(app, [*words, "--help"], terminal_width=80).output


def _commands(group, *words):
    """Yield the words of every command, of those in groups too."""
    for name, command in group.commands.items():
        yield (*words, name)
        if hasattr(command, "commands"):
            yield from _commands(command, *words, name)


COMMANDS = list(_commands(get_command(app)))


def test_every_command_stands_under_a_heading_on_one_line():
    told = _help()
    assert "\nCommands:" not in told
    found = [told.index(f"\n{heading}:\n") for heading in HEADINGS]
    assert found == sorted(found)
    for name in get_command(app).commands:
        (line,) = re.findall(rf"^  {name} .*$", told, re.MULTILINE)
        assert line.endswith((".", "suite to begin from.")), line
        assert len(line) <= 80


def test_no_line_of_any_help_is_longer_than_a_terminal_of_80_columns():
    for words in COMMANDS:
        told = _help(*words)
        assert told.startswith("Usage: "), words
        assert max(map(len, told.splitlines())) <= 80, told
        assert "\N{NON-BREAKING HYPHEN}" not in told


def test_the_help_of_a_run_names_models_engines_and_laws_unbroken():
    told = _help("run")
    for name in (*OWN_MODELS, *PROTOTYPES, *LAWS):
        assert re.search(rf"(?<![\w-]){name}\b", told), name
