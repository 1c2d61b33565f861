"""Every command of `hil` with its arguments and options, read off the declarations in bench/cli."""

from __future__ import annotations

import inspect
import types
from collections.abc import Callable, Iterator
from typing import Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

import typer
from typer.models import ArgumentInfo, OptionInfo, ParameterInfo

from bench.cli import app
from bench.cli.choices import with_choices
from bench.dev.markdown import number, table


class Parameter(NamedTuple):
    """An argument or option as it is declared."""

    name: str
    kind: Any
    declared: ParameterInfo
    default: Any

    @property
    def repeats(self) -> bool:
        """Whether it may be given several times."""
        return get_origin(self.kind) is list


def commands(group: typer.Typer = app, prefix: str = "hil") -> Iterator[tuple[str, Any]]:
    """Yield (words, function) of every command, those of groups last."""
    for info in group.registered_commands:
        function: Any = info.callback
        yield f"{prefix} {info.name or function.__name__.replace('_', '-')}", function
    for sub in group.registered_groups:
        inner = sub.typer_instance
        assert inner is not None
        yield from commands(inner, f"{prefix} {inner.info.name}")


def parameters(function: Callable[..., Any]) -> list[Parameter]:
    """Return the arguments and options of a command, in their order."""
    hints = get_type_hints(function, include_extras=True)
    found = []
    for name, parameter in inspect.signature(function).parameters.items():
        kind, declared = get_args(hints[name])[:2]
        found.append(Parameter(name, _without_none(kind), declared, parameter.default))
    return found


def words(parameter: Parameter) -> str:
    """How a parameter is written: `SCENARIO`, `--seed`, `--link`, `--set KEY=VALUE`."""
    declared, metavar = parameter.declared, parameter.declared.metavar or ""
    if isinstance(declared, ArgumentInfo):
        return metavar or parameter.name.upper()
    assert isinstance(declared, OptionInfo)
    given = (declared.default, *(declared.param_decls or ()))  # the first stands as a default
    names = [name for name in given if isinstance(name, str)]
    flag = parameter.name.replace("_", "-")
    own = [f"--{flag}", f"--no-{flag}"] if parameter.kind is bool else [f"--{flag}"]
    return f"{', '.join(names or own)} {metavar}".rstrip()


def command_sections() -> Iterator[str]:
    """Yield the section of each command."""
    root: Any = app.registered_callback and app.registered_callback.callback
    yield _section("hil", root, [])
    for name, function in commands():
        arguments = [p for p in parameters(function) if isinstance(p.declared, ArgumentInfo)]
        yield _section(name, function, arguments)


def _section(name: str, function: Any, arguments: list[Parameter]) -> str:  # noqa: ANN401
    """Heading, docstring and table of a command."""
    rows = [
        (f"`{words(p)}`", with_choices(p.declared.help or ""), _accepted(p), _default(p))
        for p in parameters(function)
    ]
    titles = ("option", "meaning", "accepted", "default")
    head = f"### `{' '.join([name, *map(words, arguments)])}`\n\n{inspect.getdoc(function)}\n"
    return f"{head}\n{table(titles, rows)}" if rows else head


def _without_none(kind: Any) -> Any:  # noqa: ANN401
    """The type of a value that is given."""
    if get_origin(kind) not in (Union, types.UnionType):
        return kind
    return next(part for part in get_args(kind) if part is not type(None))


def _accepted(parameter: Parameter) -> str:
    """Choices, range, or kind of value."""
    kind = get_args(parameter.kind)[0] if parameter.repeats else parameter.kind
    more = "; may be repeated" if parameter.repeats else ""
    if get_origin(kind) is Literal:
        return ", ".join(f"`{choice}`" for choice in get_args(kind)) + more
    low, high = parameter.declared.min, parameter.declared.max
    limits = [f"from {number(low)}"] if low is not None else []
    limits += [f"to {number(high)}"] if high is not None else []
    names = {bool: "", str: "text", int: "whole number", float: "number"}
    return " ".join([names.get(kind, "path"), *limits]) + more


def _default(parameter: Parameter) -> str:
    """The value without the option; nothing for a flag, and where the scenario has one."""
    value = parameter.default
    if value is inspect.Parameter.empty:
        return "required"
    if value is None or isinstance(value, bool):
        return ""
    return f"`{value}`"
