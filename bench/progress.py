"""How far a long command is: a bar in a terminal, elsewhere a line every few seconds.

It goes to standard error, so that what a command prints can be piped, and leaves nothing behind on
a terminal. A command that takes no longer than such a line says nothing.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final, TypeVar

if TYPE_CHECKING:
    from rich.console import Console

Advance = Callable[[int], None]
"""Is told how many more are done."""

LINE_EVERY_S: Final = 5.0
_T = TypeVar("_T")


def unseen(_count: int) -> None:
    """Take no notice: for what is called by a program."""


@contextmanager
def progress(
    name: str, total: int, unit: str, done: int = 0, console: Console | None = None
) -> Iterator[Advance]:
    """Show how many of so many are done, of which some were before."""
    from rich.console import Console

    console = console or Console(stderr=True, highlight=False)
    if not console.is_terminal or console.is_dumb_terminal:
        yield _Lines(name, total, unit, done, console).advance
        return
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn(name), BarColumn(), MofNCompleteColumn(), TextColumn(unit),
               TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn())  # fmt: skip
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("", total=total, completed=done)
        yield lambda count: bar.advance(task, count)


def counted(items: Iterable[_T], advance: Advance) -> Iterator[_T]:
    """Yield each, and tell that it is done when the next one is asked for."""
    for item in items:
        yield item
        advance(1)


@contextmanager
def steps(name: str, console: Console | None = None) -> Iterator[Callable[[str], None]]:
    """Say which step is taken: in a terminal on one line that changes, elsewhere a line a step."""
    from rich.console import Console

    console = console or Console(stderr=True, highlight=False)
    if not console.is_terminal or console.is_dumb_terminal:
        yield lambda text: console.print(f"{name}: {text}", markup=False, soft_wrap=True)
        return
    with console.status(name) as status:
        yield lambda text: status.update(f"{name}: {text}")


class _Lines:
    """A line every few seconds, with the time that is left by what the others took."""

    def __init__(self, name: str, total: int, unit: str, done: int, console: Console) -> None:
        self._name, self._total, self._unit, self._console = name, total, unit, console
        self._before = self._done = done
        self._begun_s = self._told_s = time.monotonic()

    def advance(self, count: int) -> None:
        """Take that more are done."""
        self._done += count
        now_s = time.monotonic()
        if now_s - self._told_s < LINE_EVERY_S:
            return
        self._told_s = now_s
        each_s = (now_s - self._begun_s) / max(self._done - self._before, 1)
        left = f"about {each_s * (self._total - self._done):.0f} s left"
        line = f"{self._name}: {self._done} of {self._total} {self._unit}, {left}"
        self._console.print(line, markup=False, soft_wrap=True)
