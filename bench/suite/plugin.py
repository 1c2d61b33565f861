"""Scenarios as tests: the pytest plug-in (entry point `pytest11`).

Files *.scenario.toml are collected, each of their cases an item; a table *.scenario.csv has a case
a row. Fixtures: `hil` runs a scenario, `rig` holds a running engine. `--hil-link` says over which
links, several side by side. What is heavy is imported when the first scenario is collected.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from bench.suite.fixtures import Runner
    from bench.suite.result import Result
    from bench.suite.rig import Rig

LINKS = ("memory", "zenoh", "shm", "can")
_RESULT = "hil-result"
_ENDINGS = (".scenario.toml", ".scenario.csv")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    group = parser.getgroup("hil", "scenarios of a hardware-in-the-loop bench")
    group.addoption(
        "--hil-link", default=None, metavar="LINK[,LINK...]",
        help="run scenarios over memory (one process, lockstep; the default), zenoh or shm (two"
        " processes, lockstep), can (real time); several of them side by side",
    )  # fmt: skip
    group.addoption(
        "--hil-bus", default=None, metavar="INTERFACE:CHANNEL", help="the CAN bus of --hil-link can"
    )
    group.addoption(
        "--hil-out", default=None, metavar="DIR",
        help="keep the logs of every run in it, and write suite.html and suite.json",
    )  # fmt: skip
    group.addoption("--hil-report", action="store_true", help="with --hil-out: draw every report")


def pytest_configure(config: pytest.Config) -> None:
    """Check the options, and gather results where no worker does."""
    config.addinivalue_line("markers", "hil_scenario(name, **options): of the fixture `rig`")
    for link in links_of(config):
        if link not in LINKS:
            raise pytest.UsageError(f"--hil-link {link}: accepted are {', '.join(LINKS)}")
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(Gathering(config), "hil-results")


def links_of(config: pytest.Config) -> list[str]:
    """Return the links that are asked for, in their order."""
    given = config.getoption("--hil-link") or "memory"
    return list(dict.fromkeys(link.strip() for link in str(given).split(",")))


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Collect the scenarios of a file."""
    if not file_path.name.endswith(_ENDINGS):
        return None
    return ScenarioFile.from_parent(parent, path=file_path)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run a test that asks for `hil` or `rig` over each link."""
    if "hil_link" in metafunc.fixturenames:
        metafunc.parametrize("hil_link", links_of(metafunc.config))


class ScenarioFile(pytest.File):
    """A file of scenarios."""

    def collect(self) -> Iterator[pytest.Item]:
        """Yield an item a case and link."""
        from bench.run.scenarios import read_cases
        from hil.errors import HilError

        try:
            found = read_cases(str(self.path))
        except HilError as error:
            raise self.CollectError(str(error)) from None
        links = links_of(self.config)
        for one in found:
            for link in links:
                parts = [one.case.name, *([link] if len(links) > 1 else [])]
                name = "-".join(filter(None, parts)) or self.path.name.partition(".")[0]
                yield ScenarioItem.from_parent(self, name=name, found=one, link=link)


class ScenarioItem(pytest.Item):
    """One scenario over one link: run, judged, told."""

    def __init__(self, *, found: Any, link: str, **given: Any) -> None:  # noqa: ANN401
        super().__init__(**given)
        self._found = found
        self._link = link

    def runtest(self) -> None:
        """Run it.

        Raises: UnmetError when an expectation is not met, or there is no verdict
        """
        from bench.suite.fixtures import UnmetError, run_item

        result = run_item(self._found, self._link, self.config)
        record(self, result)
        if result.verdict not in ("met", "none"):
            raise UnmetError(result)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:  # noqa: ANN401
        """Tell what was not met, a line an expectation."""
        from bench.suite.fixtures import UnmetError
        from hil.errors import HilError

        if isinstance(excinfo.value, UnmetError | HilError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int, str]:
        """Where it is."""
        return self.path, 0, f"{self.name} of {self.path.name}"  # no end of the node, which is cut


def record(item: pytest.Item, result: Result) -> None:
    """Carry a result to whoever writes the report: figures and requirements are properties."""
    item.user_properties.append((_RESULT, json.dumps(result._asdict())))
    item.user_properties += [(name, str(value)) for name, value in result.figures.items()]
    for name, met in result.requirements.items():
        item.user_properties.append(("requirement", f"{name}: {'met' if met else 'not met'}"))


class Gathering:
    """Collects the results of all workers, and tells them at the end."""

    def __init__(self, config: pytest.Config) -> None:
        self._out = config.getoption("--hil-out")
        self._results: list[Result] = []

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Take the results of a test; they are for this table, not for the JUnit file."""
        from_runs = [str(text) for name, text in report.user_properties if name == _RESULT]
        if not from_runs:
            return
        report.user_properties[:] = [p for p in report.user_properties if p[0] != _RESULT]
        if report.when == "call":
            from bench.suite.result import Result

            self._results += [Result(**json.loads(text)) for text in from_runs]

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:  # noqa: ANN401
        """Show verdicts side by side, and write the page."""
        if not self._results:
            return
        from bench.suite import outputs

        if len({result.link for result in self._results}) > 1:
            terminalreporter.section("scenarios by link")
            for line in outputs.side_by_side(self._results):
                terminalreporter.write_line(line)
        if self._out is not None:
            page = write_pages(Path(self._out), self._results)
            terminalreporter.write_line(f"scenarios: {page}")


def write_pages(directory: Path, results: list[Result]) -> Path:
    """Write suite.html and suite.json; return the page."""
    from bench.suite import outputs
    from hil.files import Output

    page = directory / "suite.html"
    Output("--hil-out", page, force=True).write(outputs.html_page(results, page))
    Output("--hil-out", directory / "suite.json", force=True).write(outputs.json_text(results))
    return page


@pytest.fixture
def hil(hil_link: str, request: pytest.FixtureRequest) -> Iterator[Runner]:
    """Run scenarios over the links of --hil-link.

    A test calls it: `run = hil("load-decrease", model="nonlinear")`.
    """
    from bench.suite.fixtures import Runner

    with Runner(hil_link, request.config, lambda result: record(request.node, result)) as runner:
        yield runner


@pytest.fixture
def rig(hil_link: str, request: pytest.FixtureRequest) -> Iterator[Rig]:
    """Hold a running engine: `rig.set(...)`, `rig.wait_for(...)`, `rig.fault(...)`.

    A mark `hil_scenario("steady", model=...)` says of which scenario.
    """
    from bench.suite.rig import open_rig

    mark = request.node.get_closest_marker("hil_scenario")
    args, options = ((), {}) if mark is None else (mark.args, mark.kwargs)
    with open_rig(hil_link, request.config, *args, **options) as opened:
        yield opened
