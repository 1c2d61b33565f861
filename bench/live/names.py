"""What there is to set and to see: `hil parameters` and `hil signals`."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Sequence
from typing import Final

from rich.console import Console
from rich.table import Table

from hil.names import parameters, signals
from hil.names.leaves import Parameter
from hil.names.signals import Signal

_WIDTH_IN_A_PIPE: Final = 200


def show_parameters(pattern: str, *, live: bool, as_json: bool) -> int:
    """List the parameters that a pattern names.

    Raises: ConfigError when there is none
    """
    found = [p for p in parameters.find(pattern) if p.live or not live]
    if as_json:
        return _print_json(found)
    rows = ((p.key, p.unit, _default(p), p.accepted, "live" if p.live else "") for p in found)
    return _print_table(("parameter", "unit", "default", "accepted", ""), rows)


def show_signals(pattern: str, *, as_json: bool) -> int:
    """List the signals that a pattern names.

    Raises: ConfigError when there is none
    """
    found = signals.find(pattern)
    if as_json:
        return _print_json(found)
    rows = ((s.name, s.type, s.unit, s.rate, s.meaning) for s in found)
    return _print_table(("signal", "type", "unit", "rate", "meaning"), rows)


def _default(parameter: Parameter) -> str:
    value = parameter.default
    return "" if value in (None, {}) else json.dumps(value)


def _print_json(found: Sequence[Parameter] | Sequence[Signal]) -> int:
    print(json.dumps([each.table() for each in found], indent=1))
    return 0


def _print_table(titles: Sequence[str], rows: Iterable[tuple[str, ...]]) -> int:
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for number, title in enumerate(titles):
        table.add_column(title, no_wrap=number == 0)
    for row in rows:
        table.add_row(*row)
    width = None if sys.stdout.isatty() else _WIDTH_IN_A_PIPE
    Console(highlight=False, markup=False, width=width).print(table)
    return 0
