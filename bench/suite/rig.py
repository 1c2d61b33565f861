"""The fixture `rig`: a running engine that a test steers and waits for.

Over memory time passes only while the test waits, so that a test is exact and the same every time.
"""

from __future__ import annotations

import operator
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol

from bench.api.runs import Given, given_keys, resolve, scenario_of
from bench.run.checks.signals import source_of
from bench.run.memory.pair import Pair
from bench.suite.fixtures import changes_of
from hil.errors import ConfigError
from hil.names.parameters import parameter_of
from hil.wire import changes, commands

if TYPE_CHECKING:
    import pytest

_COMPARED: Final[dict[str, Callable[[float, float], bool]]] = {
    "<=": operator.le, ">=": operator.ge, "<": operator.lt, ">": operator.gt,
}  # fmt: skip
_HALF_A_TICK_S: Final = 5e-6
_LONGEST_S: Final = 3600.0
"""Of a run in real time beside a test: it is ended with the test."""

_CONDITION: Final = re.compile(r"\s*(\S+)\s*(<=|>=|<|>)\s*(\S+)\s*")


class Engine(Protocol):
    """What holds an engine running: both loops in memory, or two processes."""

    @property
    def t_s(self) -> float:
        """Time of the run [s]."""

    def step(self) -> object:
        """Let a tick pass, or wait for the next that is heard of."""

    def value(self, signal: str, /) -> float:
        """Return the newest value of a signal; nan while there is none."""

    def order(self, command: Mapping[str, object], to: str, /) -> None:
        """Give a command to who acts on it."""

    def set(self, values: Mapping[str, object], /) -> None:
        """Change parameters."""


class InMemory:
    """An engine in memory and lockstep."""

    def __init__(self, pair: Pair) -> None:
        self.pair = pair
        self.step = pair.advance
        self.value = pair.value

    @property
    def t_s(self) -> float:
        """Time of the run [s]."""
        return self.pair.t_s

    def order(self, command: Mapping[str, object], _to: str) -> None:
        """Put a command on the key that both sides read."""
        self.pair.order(command, "test")

    def set(self, values: Mapping[str, object]) -> None:
        """Change parameters, each side its own.

        Raises: ConfigError for a key of neither side, or a value out of its range
        """
        for key, value in values.items():
            parameter_of(key).checked(value)
        self.pair.order(changes.encode(changes.SET, values), "test")


class Rig:
    """A running engine.

    engine: what holds it; over memory `engine.pair` has both loops, and time passes in `wait` and
        `wait_for` only; over other links it passes by itself
    """

    def __init__(self, engine: Engine) -> None:
        self.engine = engine

    @property
    def t_s(self) -> float:
        """Time of the run [s]."""
        return self.engine.t_s

    def order(self, kind: str, **fields: Any) -> None:  # noqa: ANN401
        """Give an operator's command: start, stop, set-point, law (docs/commands.md).

        Raises: ConfigError when it is none, is refused, or a field is out of its range
        """
        try:
            command = commands.read({"kind": kind, **fields}, "test")
        except ValueError as error:
            raise ConfigError(f"{kind}: {error}") from None
        self.engine.order(command.table(), command.to)

    def fault(self, kind: str, **fields: Any) -> None:  # noqa: ANN401
        """Let something fail: misfire, pre-ignition, sensor-fault, load-scale, efficiency.

        Raises: ConfigError as `order`
        """
        self.order(kind, **fields)

    def set(self, values: Mapping[str, object] | None = None, **set_points: float) -> None:
        """Change parameters, `rig.set({"controller.cascade.outer.kp": 30.0})`, and set points.

        A set point has a short name: `rig.set(tdc_ref_m=0.0152)`.

        Raises: ConfigError as `order`
        """
        if values:
            self.engine.set(values)
        if set_points:
            self.order("set-point", **set_points)

    def read(self, signal: str) -> float:
        """Return the newest value of a signal; nan while there is none.

        Raises: ConfigError when there is no such signal
        """
        return self.engine.value(signal)

    def wait(self, duration_s: float) -> None:
        """Let so much time pass [s]."""
        end_s = self.t_s + duration_s
        while self.t_s < end_s - _HALF_A_TICK_S:
            self.engine.step()

    def wait_for(self, condition: str | Callable[[Rig], bool], timeout_s: float = 1.0) -> float:
        """Wait until a condition holds; return the time that it took [s].

        Parameters: condition : as in "plant.truth.x_m > 0.01", or a function of the rig

        Raises: TimeoutError with the last value when it does not hold in time
        """
        holds = condition if callable(condition) else _condition(condition)
        begin_s = self.t_s
        while not holds(self):
            if self.t_s - begin_s >= timeout_s:
                last = "" if callable(condition) else f": {self.read(condition.split()[0]):.6g}"
                raise TimeoutError(f"{condition} within {timeout_s:g} s{last}")
            self.engine.step()
        return self.t_s - begin_s


def _condition(text: str) -> Callable[[Rig], bool]:
    """Read a condition.

    Raises: ConfigError when it is none
    """
    found = _CONDITION.fullmatch(text)
    try:
        signal, compared, bound = found[1], _COMPARED[found[2]], float(found[3])  # type: ignore[index]
    except (TypeError, ValueError):
        raise ConfigError(f"{text!r}: accepted is SIGNAL < NUMBER, or with <=, > or >=") from None
    source_of(signal)
    return lambda rig: compared(rig.read(signal), bound)


@contextmanager
def open_rig(
    link: str, config: pytest.Config, scenario: Given = "steady", **overrides: Any,  # noqa: ANN401
) -> Iterator[Rig]:  # fmt: skip
    """Hold the engine of a scenario running.

    Raises: ConfigError when it cannot begin
    """
    changes = {**overrides, **changes_of(link, config)}
    if link == "memory":
        with Pair(resolve(scenario, **changes)) as pair:
            yield Rig(InMemory(pair))
        return
    from bench.suite.background import Background

    given = {"loop.clock": "realtime", "run.duration_s": _LONGEST_S, "link.kind": link}
    asked = scenario_of(scenario, given_keys(None, {**changes, **given}))
    with tempfile.TemporaryDirectory(prefix="hil-rig-") as directory:
        background = Background(asked, Path(directory))
        try:
            yield Rig(background)
        finally:
            background.close()
