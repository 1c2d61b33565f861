"""docs/commands.md: commands and status as tables, from their declarations."""

from __future__ import annotations

import inspect
from typing import Final, get_type_hints

from hil.wire import commands, status
from hil.wire.answers import MAX_WAITING, CommandAnswer
from hil.wire.changes import MOST_VALUES
from hil.wire.commands import Declaration
from hil.wire.quantities import Field

_HEAD: Final = """# Commands and status

Generated from `hil/wire/commands.py` and `hil/wire/status.py` by `python -m bench.dev.generate`;
do not edit.

## Commands

On the Zenoh key `hil/ENGINE/command` (ENGINE is `link.zenoh.engine`, `fpeg` by default) a command
is one JSON object in UTF-8 of at most {most} bytes, as
`{{"kind": "set-point", "tdc_ref_m": 0.0152}}`, and acts at once. In a scenario the same table with
`at_s` ({at}) is an event; a command to the plant may leave it out and acts from the start. What is
not accepted is refused in one line by the addressee, what is for nobody by the controller; either
way it is logged with where it came from.

What is put on the key is taken or refused without a word to its sender. What is asked there (a
Zenoh query whose payload is the command) is answered by the addressee with the object below, as it
is for `hil set`, `hil start` and `hil stop`. Of the commands that wait, one is taken every ten
ticks; more than {waiting} are refused with that reason. Whatever comes on `hil/ENGINE/stop`, put or
asked, is a stop, and comes before everything that waits.
"""
_PARAMETERS: Final = """### Parameters: `set`, `check`, `get`

`{{"kind": "set", "controller.cascade.outer.kp": 41.0, "plant.sensors.noise_x_m": 1e-5}}` changes
parameters while the engine runs, by the keys that a scenario has. Each process takes those that are
its own, all of them or none: they are checked as a whole, put in force at the start of the next
tick, and logged with all digits as an event `parameters`. `at_tick` puts that off to a later tick,
so that both processes change in the same one; `check` in the place of `set` changes nothing.
`{{"kind": "get", "keys": "controller.cascade.*"}}` is answered with the values in force, at most
{page} of them, in the order of their keys; `after` names the key behind which the next page begins.
What may change and what is accepted: `hil parameters --live`.

"""
_ANSWER: Final = """## Answer

| field | value | meaning |
|---|---|---|
"""
_STATUS: Final = """## Status

Each process publishes how it is on `hil/ENGINE/status/PROCESS` as one JSON object, ten times a
second. A number that is not known yet is null.
"""
_KINDS: Final = {float: "number", int: "whole number", str: "text", bool: "true, false"}


def text() -> str:
    """Return docs/commands.md."""
    at = f"{commands.AT_S.accepted} s"
    head = _HEAD.format(most=commands.MAX_BYTES, at=at, waiting=MAX_WAITING)
    lines = [head, *(line for declared in commands.DECLARED for line in _command(declared))]
    lines += [_PARAMETERS.format(page=MOST_VALUES)]
    lines += [_ANSWER + "\n".join(_answer()), "", _STATUS]
    for process in status.DECLARED:
        lines += _status(process)
    return "\n".join(lines)


def _command(declared: Declaration) -> list[str]:
    """Section of one command."""
    lines = [
        f"### `{declared.kind}` (to the {declared.to})",
        "",
        f"{declared.meaning}.".capitalize(),
    ]
    lines += [""]
    if not declared.fields:
        return lines
    return [
        *lines, "| field | unit | accepted | default | meaning |", "|---|---|---|---|---|",
        *(_row(field) for field in declared.fields), "",
    ]  # fmt: skip


def _row(field: Field) -> str:
    default = (
        "not given" if field.optional else "needed" if field.default is None else str(field.default)
    )
    also = f"; changes `{field.parameter}`" if field.parameter else ""
    unit, accepted = field.unit, field.accepted
    return f"| `{field.name}` | {unit} | {accepted} | {default} | {field.meaning}{also} |"


def _answer() -> list[str]:
    """Rows of the answer to a command."""
    doc = inspect.getdoc(CommandAnswer) or ""
    kinds = get_type_hints(CommandAnswer)
    rows = (line.split(": ", 1) for line in doc.splitlines() if ": " in line)
    return [
        f"| `{name}` | {_KINDS.get(kinds[name], 'values by key')} | {meaning} |"
        for name, meaning in rows
    ]


def _status(process: str) -> list[str]:
    """Section of one process's status."""
    doc = inspect.getdoc(status.DECLARED[process]) or ""
    meanings = dict(line.split(": ", 1) for line in doc.splitlines() if ": " in line)
    rows = [
        f"| `{name}` | {figure.shown.unit} | {_KINDS.get(figure.kind, 'counts by name')} |"
        f" {figure.shown.label} | {meanings[name]} |"
        for name, figure in status.FIGURES[process].items()
    ]
    return [
        f"### {process}", "", "| field | unit | value | shown as | meaning |",
        "|---|---|---|---|---|", *rows, "",
    ]  # fmt: skip
