"""Which stimuli are in force in a tick, and what they make of the parameters of one side.

The side's loop asks once a tick, for the tick that comes next; what is remembered is a value, so a
replay, or a run that goes on from a snapshot, does the same.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Final, NamedTuple, final

from mypy_extensions import i64

from hil.config.base import value_of
from hil.config.scenario import Scenario
from hil.config.suite.stimulus import Condition, Stimulus
from hil.stimuli.courses import own_end_s, value_at
from hil.values import Value, replace
from hil.wire.commands import TimedCommand

CODE: Final = "stimulus"
"""Of the events that tell of beginnings and ends."""

_NONE: Final = -1
Reading = Callable[[str], float]


@final
class Progress(Value):
    """How far one stimulus has come.

    begin_ns: when it began, -1 while it waits; done: how often it has ended
    when_ns, until_ns: since when each condition has been met, -1 before
    last_when, last_until: what their signals were in the tick before
    """

    __slots__ = ("begin_ns", "done", "when_ns", "until_ns", "last_when", "last_until")

    def __init__(
        self, begin_ns: i64 = _NONE, done: i64 = 0, when_ns: i64 = _NONE, until_ns: i64 = _NONE,
        last_when: float | None = None, last_until: float | None = None,
    ) -> None:  # fmt: skip
        self.begin_ns = begin_ns
        self.done = done
        self.when_ns = when_ns
        self.until_ns = until_ns
        self.last_when = last_when
        self.last_until = last_until


@final
class PlayerMemory(Value):
    """All that the next tick's stimuli depend on: progress of each, in order of beginning, values.

    begun: numbers of those in force, the one begun last at the end
    values: what each parameter that was ever touched was last given
    """

    __slots__ = ("progress", "begun", "values")

    def __init__(
        self, progress: tuple[Progress, ...], begun: tuple[int, ...] = (),
        values: tuple[tuple[str, float], ...] = (),
    ) -> None:  # fmt: skip
        self.progress = progress
        self.begun = begun
        self.values = values


class Taken(NamedTuple):
    """What a tick's stimuli come to.

    changes: parameters with their new values
    commands: events of the scenario that begin now, by name
    told: lines for the log
    """

    changes: dict[str, float]
    commands: list[tuple[str, TimedCommand]]
    told: list[str]


class Player:
    """The stimuli of one side."""

    def __init__(
        self, stimuli: Mapping[str, Stimulus], period_ns: int, seed: int,
        base: Mapping[str, float],
    ) -> None:  # fmt: skip
        self._names: Sequence[str] = tuple(stimuli)
        self._stimuli: Sequence[Stimulus] = tuple(stimuli.values())
        self._period_ns, self._seed, self._base = period_ns, seed, base
        self._ends_ns = [_ns(own_end_s(one)) for one in self._stimuli]
        self.memory = PlayerMemory(tuple(Progress() for _ in self._stimuli))

    @property
    def values(self) -> dict[str, float]:
        """What each parameter that was ever touched has now."""
        return dict(self.memory.values)

    def take(self, tick: int, read: Reading, happened: Collection[str]) -> Taken:
        """Return what changes with a tick.

        Parameters: read : the value of a signal at the start of that tick
            happened : names and codes of what has happened in the tick before
        """
        now_ns = tick * self._period_ns
        taken = Taken({}, [], [])
        progress, begun = list(self.memory.progress), list(self.memory.begun)
        names = set(happened)
        for number, given in enumerate(self._stimuli):
            before = progress[number]
            at = self._step(number, given, before, now_ns, read, names)
            progress[number] = at
            if at.begin_ns >= 0 and before.begin_ns != at.begin_ns:
                self._begin(number, given, begun, names, taken)
            if at.done > before.done and number in begun:
                begun.remove(number)
                taken.told.append(f"{self._names[number]} ends")
        values = self._values(tick, now_ns, progress, begun)
        self._compare(values, taken)
        kept = tuple(values.items())
        self.memory = PlayerMemory(tuple(progress), tuple(begun), kept)
        return taken

    def _begin(
        self, number: int, given: Stimulus, begun: list[int], names: set[str], taken: Taken
    ) -> None:
        name = self._names[number]
        names.add(name)
        taken.told.append(f"{name} ({given.kind}) begins")
        if given.command is not None:
            taken.commands.append((name, given.command))
        else:
            begun.append(number)

    def _step(
        self, number: int, given: Stimulus, at: Progress, now_ns: int, read: Reading,
        names: Collection[str],
    ) -> Progress:  # fmt: skip
        """Let one stimulus wait, begin, go on or end."""
        if at.begin_ns >= 0 and self._is_over(number, given, at, now_ns):
            at = _ended(given, at)
        at = _watched(given, at, now_ns, read, names)
        if at.begin_ns >= 0:
            met = at.until_ns >= 0 and now_ns >= at.until_ns + _ns(_after_s(given.until))
            return _ended(given, at) if met else at
        if at.done >= given.repeat or not self._is_due(given, at, now_ns):
            return at
        return replace(at, begin_ns=self._begin_ns(given, at, now_ns), until_ns=_NONE)

    def _is_due(self, given: Stimulus, at: Progress, now_ns: int) -> bool:
        if given.when is not None:
            return at.when_ns >= 0 and now_ns >= at.when_ns + _ns(given.when.after_s)
        return now_ns >= self._planned_ns(given, at)

    def _planned_ns(self, given: Stimulus, at: Progress) -> int:
        return _ns(given.at_s) + int(at.done) * _ns(given.every_s or 0.0)

    def _begin_ns(self, given: Stimulus, at: Progress, now_ns: int) -> int:
        """Its own instant where that is planned, so that a course does not depend on the tick."""
        return now_ns if given.when is not None else self._planned_ns(given, at)

    def _is_over(self, number: int, given: Stimulus, at: Progress, now_ns: int) -> bool:
        ends = [at.begin_ns + self._ends_ns[number]]
        if given.duration_s is not None:
            ends.append(at.begin_ns + _ns(given.duration_s))
        if given.until_s is not None:
            ends.append(_ns(given.until_s))
        if given.every_s is not None and at.done + 1 < given.repeat and given.when is None:
            ends.append(at.begin_ns + _ns(given.every_s))
        return now_ns >= min(ends)

    def _values(
        self, tick: int, now_ns: int, progress: Sequence[Progress], begun: Sequence[int]
    ) -> dict[str, float]:
        """The value of each parameter that was ever touched; the stimulus begun last counts."""
        values = {
            key: value if self._stays(key, progress) else self._base[key]
            for key, value in self.memory.values
        }
        for number in begun:
            given, base = self._stimuli[number], self._base[self._stimuli[number].parameter]
            t_s = float(now_ns - progress[number].begin_ns) * 1e-9
            inner = 0.0 if given.added else base
            value = value_at(given, t_s, inner, tick, self._seed, number)
            if given.added:
                value += values.get(given.parameter, base)
            values[given.parameter] = value
        return values

    def _stays(self, key: str, progress: Sequence[Progress]) -> bool:
        """Whether a stimulus that is over leaves its last value behind."""
        return any(
            given.hold and given.parameter == key and at.done > 0
            for given, at in zip(self._stimuli, progress, strict=True)
        )

    def _compare(self, values: Mapping[str, float], taken: Taken) -> None:
        """Tell what is another value than in the tick before."""
        before = dict(self.memory.values)
        for key, value in values.items():
            if value != before.get(key, self._base[key]):
                taken.changes[key] = value


def player_of(scenario: Scenario, side: str) -> Player | None:
    """Return the stimuli of a side, None when it has none."""
    own = {name: given for name, given in scenario.stimuli.items() if given.side == side}
    if not own:
        return None
    keys = {given.parameter for given in own.values() if given.parameter}
    base = {key: float(value_of(scenario, key)) for key in keys}
    return Player(own, scenario.loop.period_ns, scenario.run.seed, base)


def _ns(seconds: float) -> int:
    return round(seconds * 1e9) if seconds < 1e9 else 1 << 62


def _after_s(condition: Condition | None) -> float:
    return 0.0 if condition is None else condition.after_s


def _ended(given: Stimulus, at: Progress) -> Progress:
    when_ns = _NONE if given.when is not None else at.when_ns
    return replace(at, begin_ns=_NONE, done=at.done + 1, when_ns=when_ns, until_ns=_NONE)


def _watched(
    given: Stimulus, at: Progress, now_ns: int, read: Reading, names: Collection[str]
) -> Progress:
    """Look at the conditions: that of the beginning while it waits, that of the end afterwards."""
    waits = at.begin_ns < 0 and at.done < given.repeat and now_ns >= _ns(given.at_s)
    if given.when is not None and waits:
        value, met = _met(given.when, at.last_when, read, names)
        since = at.when_ns if at.when_ns >= 0 else now_ns if met else _NONE
        at = replace(at, last_when=value, when_ns=since)
    if given.until is not None and at.begin_ns >= 0:
        value, met = _met(given.until, at.last_until, read, names)
        since = at.until_ns if at.until_ns >= 0 else now_ns if met else _NONE
        at = replace(at, last_until=value, until_ns=since)
    return at


def _met(
    condition: Condition, last: float | None, read: Reading, names: Collection[str]
) -> tuple[float | None, bool]:
    """Return the value of a condition's signal, and whether the condition holds."""
    if condition.signal is None:
        return None, condition.event in names
    value = read(condition.signal)
    if condition.above is not None:
        return value, value > condition.above
    if condition.below is not None:
        return value, value < condition.below
    if condition.rises_through is not None:
        return value, last is not None and last < condition.rises_through <= value
    assert condition.falls_through is not None
    return value, last is not None and last > condition.falls_through >= value
