"""Changes of the parameters of a running side: checked whole, and in force from one tick on.

A loop asks for what has come between two ticks, behind everything that is in a hurry: there a
change is checked and its parameters are made. At the start of the tick from which it acts they are
put in the place of the old ones. What is remembered is a value, so a replay, or a run that goes on
from a snapshot, makes the same parameters of the same keys.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final, Generic, NamedTuple, Protocol, TypeVar, final

from hil.config.base import value_of
from hil.errors import ConfigError
from hil.log import topics
from hil.names.leaves import Value as Leaf
from hil.names.parameters import live, matches
from hil.ports import CommandSource
from hil.values import NEVER, Value
from hil.wire import changes as wire
from hil.wire.changes import CHECK, GET, MOST_VALUES, ChangeRequest

CODE: Final = "parameters"
"""Of the events that tell of a change."""

REFUSED: Final = "command-refused"
_WARNINGS: Final = (REFUSED, "sample-doubted")


class Tuned(Protocol):
    """Parameters of a loop that know the configuration that they follow from."""

    config: Any
    period_ns: Any


ParamsT = TypeVar("ParamsT", bound=Tuned)


@final
class Waiting(Value):
    """A change that is to come: the tick from which it acts, its values as JSON, who asked."""

    __slots__ = ("tick", "values", "origin")

    def __init__(self, tick: int, values: str, origin: str) -> None:
        self.tick = tick
        self.values = values
        self.origin = origin


@final
class ChangesMemory(Value):
    """The last value of each key that was changed, as JSON; what is to come; the count of both."""

    __slots__ = ("given", "waiting", "count")

    def __init__(
        self, given: str = "{}", waiting: tuple[Waiting, ...] = (), count: int = 0
    ) -> None:
        self.given = given
        self.waiting = waiting
        self.count = count


class Reply(NamedTuple):
    """What is to be answered to a request."""

    is_taken: bool
    tick: int
    text: str
    values: Mapping[str, Leaf] | None = None


class Change(NamedTuple):
    """What came in force: keys whose change the state has to follow, (code, text) for the log."""

    keys: tuple[str, ...]
    events: tuple[tuple[str, str], ...]


class Changes(Generic[ParamsT]):
    """The changes of one side.

    next_tick: from which the next one acts, NEVER when none is to come
    count: how many have come in force
    requests: (origin, raw) of what came over the command key and waits for an answer
    """

    def __init__(
        self, side: str, retuned: Callable[[ParamsT, Mapping[str, object]], ParamsT]
    ) -> None:
        self.next_tick = NEVER
        self.count = 0
        self._side = side
        self._retuned = retuned
        self._given: dict[str, Leaf] = {}
        self._waiting: tuple[Waiting, ...] = ()
        self._ready: tuple[Waiting, ParamsT, ParamsT] | None = None
        self.requests: list[tuple[str, bytes]] = []

    def attend(self, tick: int, params: ParamsT, commands: CommandSource | None) -> bytes:
        """Answer the requests behind a tick, and make the parameters of the next one.

        Returns: records of what was refused
        """
        refused = []
        for origin, raw in self.requests:
            reply = self.ask(raw, origin, tick, params)
            if reply is not None and commands is not None:
                commands.answer(reply.is_taken, reply.tick, reply.text, reply.values)
                refused += [] if reply.is_taken else [(REFUSED, reply.text)]
        self.requests.clear()
        self.prepare(params)
        return packed(tick, params.period_ns, refused)

    def ask(self, raw: bytes, origin: str, tick: int, params: ParamsT) -> Reply | None:
        """Take a request behind a tick; None when it is none of this side's."""
        try:
            request = wire.parse(raw, origin, self._side)
            if request is None:
                return None
            if request.kind == GET:
                return Reply(True, tick, "", self._values(params, request))
            return self._asked(request, tick, params)
        except ConfigError as error:
            return Reply(False, tick, str(error))

    def _asked(self, request: ChangeRequest, tick: int, params: ParamsT) -> Reply:
        """Check a change against the parameters in force, and have it wait for its tick.

        Raises: ConfigError
        """
        made = self._retuned(params, request.values)
        if request.kind == CHECK:
            return Reply(True, tick, "accepted")
        at_tick = max(tick + 1, request.at_tick)
        self.plan(at_tick, request.values, request.origin)
        if len(self._waiting) == 1:
            self._ready = self._waiting[0], params, made
        return Reply(True, at_tick, _told(params, made, request.values))

    def plan(self, tick: int, values: Mapping[str, object], origin: str) -> int:
        """Have a change act from a tick on; without an origin the state has followed it already.

        Returns: the tick of the next change
        """
        if values:
            waiting = Waiting(tick, json.dumps(dict(values)), origin)
            self._waiting = tuple(sorted((*self._waiting, waiting), key=lambda each: each.tick))
            self.next_tick = self._waiting[0].tick
        return self.next_tick

    def prepare(self, params: ParamsT) -> None:
        """Make the parameters of the next change, if that is not done yet."""
        if self._ready is None and len(self._waiting) == 1:
            waiting = self._waiting[0]
            try:
                made = self._retuned(params, json.loads(waiting.values))
            except ConfigError:
                return  # told when it is due
            self._ready = waiting, params, made

    def take(self, tick: int, params: ParamsT) -> tuple[ParamsT, Change]:
        """Return the parameters from this tick on, and what has changed."""
        keys: list[str] = []
        events: list[tuple[str, str]] = []
        due = [waiting for waiting in self._waiting if waiting.tick <= tick]
        self._waiting = self._waiting[len(due) :]
        self.next_tick = self._waiting[0].tick if self._waiting else NEVER
        for waiting in due:
            values = json.loads(waiting.values)
            try:
                made = self._made(waiting, params, values)
            except ConfigError as error:
                events.append((REFUSED, f"{error} (from {waiting.origin})"))
                continue
            if waiting.origin:
                told = f"{_told(params, made, values)}; from {waiting.origin}"
                events.append((CODE, told))
                keys += values
            self.count += 1
            self._given |= values
            params = made
        self._ready = None
        return params, Change(tuple(keys), tuple(events))

    def _made(self, waiting: Waiting, params: ParamsT, values: dict[str, Any]) -> ParamsT:
        if self._ready is not None and self._ready[0] is waiting and self._ready[1] is params:
            return self._ready[2]
        return self._retuned(params, values)

    def _values(self, params: ParamsT, request: ChangeRequest) -> dict[str, Leaf]:
        """A page of the values in force, in the order of the keys."""
        own = (f"{self._side}.own.settings.{name}" for name in params.config.own.settings)
        known = (*live(self._side), *own)
        chosen = sorted(k for k in known if k > request.after and matches(k, request.keys))
        return {key: _value(params, key) for key in chosen[:MOST_VALUES]}

    def remember(self) -> ChangesMemory:
        """Return all that later parameters depend on."""
        return ChangesMemory(json.dumps(self._given), self._waiting, self.count)

    def recall(self, memory: ChangesMemory, params: ParamsT) -> ParamsT:
        """Go on from what `remember` returned; returns the parameters that were in force."""
        self._given = json.loads(memory.given)
        self._waiting, self.count, self._ready = memory.waiting, memory.count, None
        self.next_tick = self._waiting[0].tick if self._waiting else NEVER
        return self._retuned(params, self._given) if self._given else params


def packed(tick: int, period_ns: int, events: Iterable[tuple[str, str]]) -> bytes:
    """Return events of a tick as records."""
    return b"".join(
        topics.EVENT.pack(
            tick, tick * period_ns, topics.WARNING if code in _WARNINGS else topics.INFO, code, text
        )
        for code, text in events
    )


def _value(params: Tuned, key: str) -> Any:  # noqa: ANN401
    return value_of(params.config, key.partition(".")[2])


def _told(before: Tuned, after: Tuned, values: Mapping[str, object]) -> str:
    """What changes, each number with all its digits."""
    return ", ".join(
        f"{key} = {_value(after, key)!r} (was {_value(before, key)!r})" for key in values
    )
