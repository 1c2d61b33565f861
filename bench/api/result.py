"""What a run came to, as values: verdict, figures, signals as numpy arrays and pandas frames."""

from __future__ import annotations

import shutil
import weakref
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from bench.judge.checks import Check, judge
from bench.judge.events import Happening
from bench.judge.figures import RunData, read_run
from bench.judge.strokes import Floats, Strokes
from bench.judge.summary import Summary
from bench.judge.traces import Trace, read_trace
from bench.run.checks.signals import check_expectations
from bench.run.directory import RunFiles
from hil import log as logs
from hil.config.load import build
from hil.config.resolved import Resolved
from hil.errors import LogError

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

_SIDES: Final = {
    "truth": "plant", "sensor": "plant", "timing": "plant",
    "stroke": "controller", "demand": "controller", "actuator": "controller",
}  # fmt: skip


class ExpectationError(AssertionError):
    """An expectation that was not met; its text says what was found."""


class Columns:
    """The fields of a topic, each a numpy array of one value a message; `t_ns` are their times."""

    def __init__(self, path: Path, topic: str) -> None:
        self._path, self._topic = path, topic

    @cached_property
    def _rows(self) -> Any:  # noqa: ANN401
        with logs.open(self._path) as log:
            return log.array(self._topic)

    @property
    def t_s(self) -> Floats:
        """Times of the messages [s]."""
        times: Floats = self._rows["t_ns"] * 1e-9
        return times

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._rows.dtype.names]

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        if name.startswith("_"):
            raise AttributeError(name)
        if name not in self._rows.dtype.names:
            known = ", ".join(self._rows.dtype.names)
            raise AttributeError(f"{self._topic} has no {name}; it has: {known}")
        return self._rows[name]


class Side:
    """The log of one side: its topics by name, as in `run.plant.sensor.x_m`."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __getattr__(self, name: str) -> Columns:
        if name.startswith("_"):
            raise AttributeError(name)
        with logs.open(self._path) as log:
            if f"/{name}" not in log.topics:
                known = ", ".join(topic.removeprefix("/") for topic in log.topics)
                raise AttributeError(f"{self._path.name} has no topic {name}; it has: {known}")
        columns = Columns(self._path, f"/{name}")
        self.__dict__[name] = columns
        return columns


class Run:
    """A finished run.

    scenario: the whole configuration as it was run
    summary: what summary.json says
    plant, controller: the logs of both sides by topic: `run.plant.sensor.x_m` is an array
    truth, sensor, timing; stroke, demand, actuator: topics of the plant; of the controller
    passing: whether its directory goes when nobody holds the run any more
    """

    def __init__(
        self, scenario: Resolved, files: RunFiles, summary: Summary, *, passing: bool = False
    ) -> None:
        self.scenario = scenario
        self.summary = summary
        self.plant, self.controller = Side(files.plant_log), Side(files.controller_log)
        self._files = files
        if passing:
            weakref.finalize(self, shutil.rmtree, files.directory, ignore_errors=True)

    def __getattr__(self, name: str) -> Columns:
        if name not in _SIDES:
            raise AttributeError(f"a run has no {name}")
        columns: Columns = getattr(getattr(self, _SIDES[name]), name)
        return columns

    def __repr__(self) -> str:
        return f"<{self.summary['scenario']}: {self.verdict}, {self.summary['exit_reason']}>"

    @property
    def directory(self) -> Path:
        """Where its logs are; a temporary directory is gone with the run."""
        return self._files.directory

    @property
    def verdict(self) -> str:
        """One of met, not met, blocked, none, fault."""
        return str(self.summary["verdict"])

    @property
    def reason(self) -> str:
        """Why, in one line."""
        return str(self.summary["exit_reason"])

    @property
    def figures(self) -> dict[str, Any]:
        """Every figure of the summary by name, units in the names; None where it has no value."""
        return dict(self.summary["figures"])

    @property
    def checks(self) -> list[Check]:
        """Every expectation of the scenario with what was found."""
        return [Check(**check) for check in self.summary["expectations"]]

    @property
    def events(self) -> tuple[Happening, ...]:
        """What both sides told, in order of time: t_ns, source, severity, code, text."""
        return self._data.happenings.lines

    @property
    def dead_centre(self) -> Strokes:
        """Every dead centre exactly, as the plant had it: t_ns, x_m, fuel_kg, tdc_m, error_m."""
        return self._data.strokes

    @cached_property
    def _data(self) -> RunData:
        return read_run(self.scenario, self._files)

    def signal(self, name: str) -> Trace:
        """Return a signal by its name (`hil signals`): t_ns [ns] and value, arrays of one length.

        Raises: ConfigError naming the nearest ones when there is no such signal
        """
        files, strokes = self._files, self._data.truth.strokes
        with logs.open(files.plant_log) as plant, logs.open(files.controller_log) as controller:
            return read_trace({"plant": plant, "controller": controller}, strokes, name)

    def pandas(self, topic: str) -> pandas.DataFrame:
        """Return a topic as a pandas frame, `attrs["units"]` by column: "stroke", "plant.sensor".

        Raises: LogError when there is no such topic, MissingExtraError without pandas
        """
        side, _, name = topic.rpartition(".")
        side = side or _SIDES.get(name, "plant")
        if side not in ("plant", "controller"):
            raise LogError(f"{topic}: accepted is plant.TOPIC or controller.TOPIC")
        path = self._files.plant_log if side == "plant" else self._files.controller_log
        with logs.open(path) as log:
            return log.pandas(f"/{name}")

    def check(self, **expectation: Any) -> list[Check]:  # noqa: ANN401
        """Hold the run against an expectation, by the keys of [expect.NAME]; return its checks.

        Raises: ConfigError when it cannot be judged
        """
        tree = self.scenario.model_dump() | {"expect": {"asked": expectation}}
        scenario = build(tree, "expect")
        check_expectations(scenario)
        whole = self.scenario.model_copy(update={"expect": scenario.expect})
        asked = scenario.expect["asked"]
        traces = {name: self.signal(name) for name in asked.signals}
        return judge(self._data._replace(scenario=whole, traces=traces))

    def expect(self, **expectation: Any) -> list[Check]:  # noqa: ANN401
        """Demand what `check` judges.

        Raises: ExpectationError with what was found when it was not met
        """
        checks = self.check(**expectation)
        failed = [check.text for check in checks if not check.met]
        if failed:
            raise ExpectationError("; ".join(failed))
        return checks

    def plot(self) -> Figure:
        """Draw piston, dead centres and fuel over time; needs the extra `desk`."""
        from bench.api.picture import overview

        title = f"{self.scenario.name}: {self.verdict}"
        return overview(title, self.signal("plant.truth.x_m"), self.dead_centre)
