"""Options that several commands have, and how a group of commands reads and explains itself."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Annotated, Any, Final, TypeVar

import typer
from typer.core import TyperCommand, TyperGroup

from bench.cli.choices import with_choices
from hil.errors import ConfigError

RUNS, LOGS, LIVE = "Runs", "Logs of a run", "A running engine"
STUDIES, MACHINE = "Studies", "Bench and machine"
HEADINGS: Final = (RUNS, LOGS, LIVE, STUDIES, MACHINE)
"""Under which headings `hil --help` lists the commands, in this order."""

_UNBROKEN: Final = "\N{NON-BREAKING HYPHEN}"

_Function = TypeVar("_Function", bound=Callable[..., Any])


class Arguments(TyperGroup):
    """A group of commands: an empty argument is none, not the directory that one is in."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:  # noqa: ANN401
        """Read the arguments; a server beside a run that is given no port takes any.

        Raises: ConfigError when one of them is empty
        """
        for before, word in zip(["", *args], args, strict=False):
            if not word or re.fullmatch(r"--[a-z-]+=", word):
                name = word.rstrip("=") or before
                raise ConfigError(f"{name} '': accepted is a value that is not empty".lstrip())
        return super().parse_args(ctx, list(_with_ports(args)))

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ANN401
        """List the commands under their headings, each on one line of 80 columns."""
        width = max(map(len, self.commands))
        for heading in (*HEADINGS, None):
            rows = [
                (name.ljust(width), command.get_short_help_str(200))
                for name, command in self.commands.items()
                if getattr(command, "rich_help_panel", None) == heading
            ]
            if rows:
                with formatter.section(heading or "Commands"):
                    formatter.write_dl(rows)


def _with_ports(args: list[str]) -> Iterator[str]:
    for word, after in zip(args, [*args[1:], ""], strict=True):
        yield word
        if word in ("--panel", "--foxglove") and not re.fullmatch(r"-?\d+", after):
            yield "0"


class Explained(TyperCommand):
    """A command whose help names what there is to choose from."""

    def get_help(self, ctx: Any) -> str:  # noqa: ANN401
        """Return the help; no name is broken at its hyphen."""
        parameters: list[Any] = self.params
        for parameter in parameters:
            parameter.help = with_choices(parameter.help or "").replace("-", _UNBROKEN)
        return super().get_help(ctx).replace(_UNBROKEN, "-")


class Commands(typer.Typer):
    """A group of commands: without terminal magic, without traceback, with -h."""

    def __init__(self, name: str, text: str) -> None:
        super().__init__(
            name=name, help=text, cls=Arguments, rich_markup_mode=None, add_completion=False,
            pretty_exceptions_enable=False, no_args_is_help=True,
            context_settings={"help_option_names": ["-h", "--help"]},
        )  # fmt: skip

    def command(  # type: ignore[override]  # no more than is used
        self, name: str | None = None, heading: str | None = None
    ) -> Callable[[_Function], _Function]:
        """Add a command, under a heading of `hil --help`."""
        return super().command(name, cls=Explained, rich_help_panel=heading)


Force = Annotated[bool, typer.Option("--force", help="Replace a file that is there already.")]
Assignments = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change a value; may be repeated."),
]
