"""Options that several commands have."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from hil.errors import ConfigError


class Arguments(TyperGroup):
    """The root of all commands: an empty argument is none, not the directory that one is in."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:  # noqa: ANN401
        """Read the arguments; a server beside a run that is given no port takes any.

        Raises: ConfigError when one of them is empty
        """
        for before, word in zip(["", *args], args, strict=False):
            if not word or re.fullmatch(r"--[a-z-]+=", word):
                name = word.rstrip("=") or before
                raise ConfigError(f"{name} '': accepted is a value that is not empty".lstrip())
        return super().parse_args(ctx, list(_with_ports(args)))


def _with_ports(args: list[str]) -> Iterator[str]:
    for word, after in zip(args, [*args[1:], ""], strict=True):
        yield word
        if word in ("--panel", "--foxglove") and not re.fullmatch(r"-?\d+", after):
            yield "0"


Force = Annotated[bool, typer.Option("--force", help="Replace a file that is there already.")]
Assignments = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change a value; may be repeated."),
]
