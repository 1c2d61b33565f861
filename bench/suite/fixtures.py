"""What the pytest plug-in runs: an item of a scenario file, or what a test asks the fixture for."""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from bench.api.result import Run
from bench.api.runs import Given, run
from bench.run.scenarios import Found
from bench.suite.result import Result, result_of
from hil.config.scenario import Scenario

if TYPE_CHECKING:
    import pytest


class UnmetError(AssertionError):
    """A scenario that did not come to its verdict `met`; its text has a line an expectation."""

    def __init__(self, result: Result) -> None:
        lines = [f"{result.label} over {result.link}: {result.verdict}: {result.reason}"]
        for check in result.expectations:
            sign = "met    " if check["met"] else "NOT MET"
            lines.append(f"  {sign} {check['name']}: {check['text']}")
        if result.directory:
            lines.append(f"  logs: {result.directory}")
        super().__init__("\n".join(lines))


class Kept:
    """Where the logs of runs go: into --hil-out, else to a temporary place if they are wanted."""

    def __init__(self, config: pytest.Config) -> None:
        out = config.getoption("--hil-out")
        self._out = None if out is None else Path(out)
        self.report = self._out is not None and bool(config.getoption("--hil-report"))

    def place(self, label: str, link: str) -> Path:
        """Return a directory for a run."""
        if self._out is None:
            return Path(tempfile.mkdtemp(prefix="hil-test-"))
        name = re.sub(r"[^A-Za-z0-9.=_-]+", "-", f"{Path(label).name}-{link}").strip("-")
        return self._out / name

    def settle(self, directory: Path, *, wanted: bool) -> Path | None:
        """Forget a temporary directory that nobody wants to look at; return what is left."""
        if self._out is None and not wanted:
            shutil.rmtree(directory, ignore_errors=True)
            return None
        return directory


def changes_of(link: str, config: pytest.Config) -> dict[str, Any]:
    """Return the options of a run over that link."""
    bus = config.getoption("--hil-bus") if link == "can" else None
    return {"link": link, **({} if bus is None else {"bus": bus})}


def run_item(found: Found, link: str, config: pytest.Config) -> Result:
    """Run a collected scenario.

    Raises: ConfigError when it cannot begin
    """
    kept, label = Kept(config), _relative(found.label, config)
    directory = kept.place(found.label, link)
    done = run(found.scenario(), out=directory, force=True, report=kept.report,
               **changes_of(link, config))  # fmt: skip
    is_good = done.verdict in ("met", "none")
    left = kept.settle(directory, wanted=not is_good)
    return result_of(label, done.summary, left, float(done.summary["run"]["wall_total_s"]))


def _relative(label: str, config: pytest.Config) -> str:
    file, separator, case = label.partition("::")
    path = Path(file)
    if path.is_absolute() and path.is_relative_to(config.rootpath):
        path = path.relative_to(config.rootpath)
    return f"{path}{separator}{case}"


class Runner:
    """The fixture `hil`: called, it runs a scenario over the link of this test.

    link: which that is
    """

    def __init__(self, link: str, config: pytest.Config, tell: Callable[[Result], None]) -> None:
        self.link = link
        self._config = config
        self._tell = tell
        self._kept = Kept(config)
        self._places: list[Path] = []

    def __call__(
        self, scenario: Given = "steady", changes: Mapping[str, Any] | None = None,
        **overrides: Any,  # noqa: ANN401
    ) -> Run:  # fmt: skip
        """Run a scenario as `hil.run` does; a link that is given counts more than --hil-link.

        Raises: ConfigError when it cannot begin
        """
        options = {**changes_of(str(overrides.get("link", self.link)), self._config), **overrides}
        label = scenario.name if isinstance(scenario, Scenario) else str(scenario)
        directory = self._kept.place(label, str(options["link"]))
        self._places.append(directory)
        done = run(
            scenario, changes, out=directory, force=True, report=self._kept.report, **options
        )
        wall_s = float(done.summary["run"]["wall_total_s"])
        self._tell(
            result_of(label, done.summary, self._kept.settle(directory, wanted=True), wall_s)
        )
        return done

    def __enter__(self) -> Runner:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:  # fmt: skip
        for directory in self._places:
            self._kept.settle(directory, wanted=False)
