"""How a running pair is, and commands to it: what `hil status`, `set`, `start` and `stop` do."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final, Protocol

from bench.live.engines import engine_of
from hil.errors import LinkError
from hil.wire.answers import CommandAnswer
from hil.wire.status import SHOWN, Status

PROCESSES: Final = ("plant", "controller")
REACHED_S: Final = 2.0
"""Status is published ten times a second; who is silent for this long is not there."""

_POLL_S: Final = 0.02


class Operator(Protocol):
    """What is asked of the view of two processes."""

    def alive(self) -> set[str]:
        """Return the processes that take part by now."""

    def poll_status(self) -> tuple[str, dict[str, Any]] | None:
        """Return (process, status) of the oldest status not yet taken, or None."""

    def ask(self, command: Mapping[str, object], to: str, timeout_s: float) -> CommandAnswer:
        """Send one command and return what its addressee says."""

    def close(self) -> None:
        """Leave."""


def operator_of(run: Path | None) -> Operator:
    """Join the pair of a run, or the one that is there.

    Raises: ConfigError, LinkError
    """
    return engine_of(run).operator("hil")


def gather(operator: Operator, timeout_s: float | None = None) -> dict[str, Status]:
    """Return the newest status of each process that is there.

    Raises: LinkError when none tells anything within the time
    """
    found: dict[str, Status] = {}
    timeout_s = REACHED_S if timeout_s is None else timeout_s
    end_s = time.monotonic() + timeout_s
    while len(found) < len(PROCESSES) and time.monotonic() < end_s:
        while (told := operator.poll_status()) is not None:
            found[told[0]] = told[1]
        time.sleep(_POLL_S)
    if not found:
        raise LinkError(f"no plant and no controller told their status within {timeout_s:g} s")
    return found


def rows(statuses: Mapping[str, Status]) -> list[tuple[str, str, str]]:
    """Return (what, plant, controller) as text; counters of reception come last."""
    lines = []
    for key, shown in SHOWN.items():
        plant, controller = (_cell(statuses.get(p, {}), key) for p in PROCESSES)
        if plant or controller:
            lines.append((shown.label, plant, controller))
    counted = [statuses.get(process, {}).get("reception") or {} for process in PROCESSES]
    for name in dict.fromkeys(name for counters in counted for name in counters):
        left, right = (str(counters.get(name, "")) for counters in counted)
        lines.append((f"frames {name}", left, right))
    return lines


def _cell(status: Status, key: str) -> str:
    value = status.get(key)
    return "" if value is None else SHOWN[key].text(value)


def _table(statuses: Mapping[str, Status]) -> Any:  # noqa: ANN401
    from rich.table import Table

    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for title in ("", *map(partial(_title, statuses), PROCESSES)):
        table.add_column(title, no_wrap=True)
    for row in rows(statuses):
        table.add_row(*row)
    return table


def show(config: Path | None, *, as_json: bool) -> int:
    """Show the status once.

    Raises: LinkError when nobody is there
    """
    operator = operator_of(config)
    try:
        statuses = gather(operator)
    finally:
        operator.close()
    if as_json:
        print(json.dumps(statuses, indent=1))
    else:
        _print(statuses)
    return 0


def _print(statuses: Mapping[str, Status]) -> None:
    """Print the table once; to draw one with colours would take longer than to hear the status."""
    lines = [("", *map(partial(_title, statuses), PROCESSES)), *rows(statuses)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        padded = (cell.ljust(width) for cell, width in zip(line, widths, strict=True))
        print("  ".join(padded).rstrip())


def _title(statuses: Mapping[str, Status], process: str) -> str:
    return process if process in statuses else f"{process}: not there"


def watch(config: Path | None, *, as_json: bool) -> int:
    """Show the status until interrupted or nobody is there any more."""
    operator = operator_of(config)
    try:
        statuses = gather(operator)
        (_watch_lines if as_json else _watch_table)(operator, statuses)
    finally:
        operator.close()
    return 0


def _news(operator: Operator) -> Iterable[tuple[str, Status]]:
    """Yield statuses as they come, as long as somebody is there."""
    while operator.alive():
        while (told := operator.poll_status()) is not None:
            yield told
        time.sleep(_POLL_S)


def _watch_lines(operator: Operator, _statuses: dict[str, Status]) -> None:
    for process, status in _news(operator):
        print(json.dumps({"process": process, **status}), flush=True)


def _watch_table(operator: Operator, statuses: dict[str, Status]) -> None:
    from rich.console import Console
    from rich.live import Live

    with Live(_table(statuses), console=Console(highlight=False), auto_refresh=False) as live:
        for process, status in _news(operator):
            statuses[process] = status
            live.update(_table(statuses), refresh=True)
