"""What `hil run` shows while it runs: a bar with live figures, or a few plain lines."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, Protocol

from bench.run.processes import Status
from hil.config.resolved import Resolved
from hil.wire.status import SHOWN

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

_REFRESH_S = 0.1
_LINE_EVERY_S = 5.0


class View(Protocol):
    """Shows how a run goes on."""

    def update(self, status: Status) -> None:
        """Take the newest status of a process."""

    def __enter__(self) -> View:
        """Begin to show."""

    def __exit__(self, *_: object) -> None:
        """Leave the screen as it was, or say nothing more."""


class Newest:
    """The newest figures of both processes."""

    def __init__(self, scenario: Resolved) -> None:
        self._real_time = scenario.loop.clock == "realtime"
        self._by_process: dict[str, Status] = {}

    def take(self, status: Status) -> None:
        """Keep a status."""
        self._by_process[str(status.get("process"))] = status

    def get(self, process: str, key: str) -> Any:  # noqa: ANN401
        """Return a figure of a process, None while there is none."""
        return self._by_process.get(process, {}).get(key)

    @property
    def t_s(self) -> float:
        """How far the run has come [s]."""
        return max((float(s.get("t_s") or 0.0) for s in self._by_process.values()), default=0.0)

    def figures(self) -> list[tuple[str, str]]:
        """Return the live figures as (name, text); what is not known yet is left out."""
        tdc, ref = self.get("controller", "tdc_mm"), self.get("controller", "tdc_ref_mm")
        tdc = self.get("plant", "tdc_mm") if tdc is None else tdc
        found: list[tuple[str, str]] = []
        if tdc is not None:
            error = f" ({tdc - ref:+.3f})" if ref is not None else ""
            found.append(("TDC", f"{tdc:6.3f} mm{error}"))
        if (fuel := self.get("controller", "fuel_mg")) is not None:
            found.append(("fuel", SHOWN["fuel_mg"].text(fuel)))
        if (mode := self.get("controller", "mode")) is not None:
            found.append(("", str(mode)))
        if self._real_time and (late := self.get("plant", "late_us")) is not None:
            found.append(("late", SHOWN["late_us"].text(late)))
        return found


class Silent:
    """Shows nothing: for a run that is a call of a program."""

    def __enter__(self) -> View:
        """Begin to show nothing."""
        return self

    def __exit__(self, *_: object) -> None:
        """Leave nothing."""

    def update(self, status: Status) -> None:
        """Take no notice."""


class PlainView:
    """A few plain lines, for a pipe or a log file."""

    def __init__(self, scenario: Resolved, console: Console) -> None:
        self._scenario = scenario
        self._console = console
        self._newest = Newest(scenario)
        self._told_s = time.monotonic()

    def __enter__(self) -> View:
        """Say what is run."""
        s = self._scenario
        parts = [s.plant.model, s.controller.name, s.link.kind, s.loop.clock]
        text = ", ".join([*parts, f"{s.loop.rate_hz} Hz", f"{s.run.duration_s:g} s"])
        self._console.print(f"{s.name}: {text}", highlight=False, soft_wrap=True)
        return self

    def __exit__(self, *_: object) -> None:
        """Say nothing more."""

    def update(self, status: Status) -> None:
        """Say every few seconds how far it has come."""
        self._newest.take(status)
        if time.monotonic() - self._told_s < _LINE_EVERY_S:
            return
        self._told_s = time.monotonic()
        figures = "  ".join(f"{name} {text}".strip() for name, text in self._newest.figures())
        line = f"{self._newest.t_s:.1f} of {self._scenario.run.duration_s:g} s  {figures}"
        self._console.print(line, highlight=False, soft_wrap=True)


class LiveView:
    """A bar and a line of figures that are redrawn in place, by nobody but `update`."""

    def __init__(self, scenario: Resolved, console: Console) -> None:
        from rich.live import Live

        self._scenario = scenario
        self._newest = Newest(scenario)
        self._drawn_s = 0.0
        self._live = Live(console=console, auto_refresh=False, transient=True)

    def __enter__(self) -> View:
        """Begin to draw."""
        self._live.__enter__()
        self._live.update(self._render(), refresh=True)
        return self

    def __exit__(self, *_: object) -> None:
        """Take the bar away."""
        self._live.__exit__(None, None, None)

    def update(self, status: Status) -> None:
        """Draw the newest figures, ten times a second at most."""
        self._newest.take(status)
        now_s = time.monotonic()
        if now_s - self._drawn_s >= _REFRESH_S:
            self._drawn_s = now_s
            self._live.update(self._render(), refresh=True)

    def _render(self) -> RenderableType:
        from rich.console import Group
        from rich.progress_bar import ProgressBar
        from rich.table import Table
        from rich.text import Text

        duration_s, t_s = self._scenario.run.duration_s, self._newest.t_s
        bar = Table.grid(padding=(0, 2), expand=True)
        bar.add_column(no_wrap=True)
        bar.add_column(ratio=1)
        bar.add_column(no_wrap=True, justify="right")
        share = min(t_s / duration_s, 1.0)
        bar.add_row(
            Text(self._scenario.name, style="bold"),
            ProgressBar(total=1.0, completed=share, complete_style="green"),
            f"{t_s:.1f} / {duration_s:g} s",
        )
        line = Text("starting plant and controller", style="dim")
        if figures := self._newest.figures():
            line = Text("   ").join(_pair(name, text) for name, text in figures)
        line.no_wrap, line.overflow = True, "ellipsis"
        return Group(bar, line)


def _pair(name: str, text: str) -> Any:  # noqa: ANN401
    from rich.text import Text

    return Text.assemble((f"{name} ", "dim") if name else "", text)


def view_for(scenario: Resolved, console: Console) -> PlainView | LiveView:
    """Return the view that suits where the output goes."""
    return LiveView(scenario, console) if console.is_terminal else PlainView(scenario, console)
