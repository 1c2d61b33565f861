"""Commands from the page: one after the other, answered, and undone.

They go the way of every operator's command, over the key, and are refused there if at all.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final, Protocol

from hil.errors import HilError, LinkError
from hil.wire.answers import STOPS, CommandAnswer
from hil.wire.commands import DECLARED, read
from hil.wire.quantities import Choice, Number

Answer = dict[str, Any]
Values = Mapping[str, Any]

PATIENCE_S: Final = 2.0
_MOST_UNDONE: Final = 100


class Operator(Protocol):
    """What is asked of the view of two processes."""

    def ask(self, command: Mapping[str, object], to: str, timeout_s: float) -> CommandAnswer:
        """Send one command and return what its addressee says."""


SetParameters = Callable[[Any, Values, float], tuple[CommandAnswer, ...]]
GetParameters = Callable[[Any, float], dict[str, Any]]


class Steering:
    """The one hand on a running pair.

    values: parameters as they were last heard; undoable: changes that can be taken back
    """

    def __init__(
        self, operator: Operator | None, set_values: SetParameters, get_values: GetParameters,
        values: Values = MappingProxyType({}),
    ) -> None:  # fmt: skip
        self._operator = operator
        self._set, self._get = set_values, get_values
        self._turn = asyncio.Lock()
        self._changed: set[str] = set()
        self.values: dict[str, Any] = dict(values)
        self.undoable: list[dict[str, Any]] = []

    @property
    def is_possible(self) -> bool:
        """Whether there is a key to command over."""
        return self._operator is not None

    async def order(self, table: Mapping[str, object]) -> Answer:
        """Give one command; returns what its addressee says, or why it was not sent."""
        return await self._asked(lambda operator: _order(operator, table))

    async def change(self, values: Values) -> Answer:
        """Change parameters, all or none; what they were before can be had back."""
        before = {key: self.values.get(key) for key in values}
        answer = await self._asked(lambda operator: _told(self._set(operator, values, PATIENCE_S)))
        if answer["taken"]:
            self.values.update(values)
            self._changed.update(values)
            self.undoable = [*self.undoable, before][-_MOST_UNDONE:]
        return answer

    async def undo(self) -> Answer:
        """Take back the last change that was made here."""
        if not self.undoable:
            return _refused("nothing to undo")
        before = self.undoable[-1]
        answer = await self.change(before)
        if answer["taken"]:
            self.undoable = self.undoable[:-2]
        return answer

    async def look(self) -> bool:
        """Ask for the parameters in force; whether they differ from those last heard.

        No order waits for it: to ask for all takes some questions, each of them ten ticks. What is
        changed meanwhile is known better.
        """
        if self._operator is None:
            return False
        self._changed.clear()
        try:
            asked = await asyncio.to_thread(self._get, self._operator, PATIENCE_S)
        except HilError:
            return False
        found = {key: value for key, value in asked.items() if key not in self._changed}
        is_new = any(self.values.get(key) != value for key, value in found.items())
        self.values |= found
        return is_new

    async def _asked(self, ask: Callable[[Operator], Answer]) -> Answer:
        if self._operator is None:
            return _refused("a run in memory has no keys to ask it over")
        try:
            async with self._turn:
                return await asyncio.to_thread(ask, self._operator)
        except (HilError, ValueError) as error:
            return _refused(str(error))


def _order(operator: Operator, table: Mapping[str, object]) -> Answer:
    command = read(table, "hil panel")
    return _told((operator.ask(command.table(), command.to, PATIENCE_S),))


def _told(answers: tuple[CommandAnswer, ...]) -> Answer:
    """One answer for those of both processes: taken when all took it."""
    if not answers:
        raise LinkError("nobody answered")
    refused = next((answer for answer in answers if not answer.taken), None)
    if refused is not None:
        return {**_refused(refused.text), "process": refused.process, "tick": refused.tick}
    last = max(answers, key=lambda answer: answer.tick)
    return {"taken": True, "text": last.text, "process": last.process, "tick": last.tick}


def _refused(text: str) -> Answer:
    return {"taken": False, "text": text, "process": "", "tick": None}


def offered() -> list[dict[str, Any]]:
    """Return every command as a page offers it: kind, meaning, fields with what they accept."""
    return [
        {
            "kind": declared.kind,
            "to": declared.to,
            "meaning": declared.meaning,
            "fields": [_field(field) for field in declared.fields],
        }
        for declared in DECLARED
    ]


def _field(field: Any) -> dict[str, Any]:  # noqa: ANN401
    told = {
        "name": field.name,
        "unit": field.unit,
        "meaning": field.meaning,
        "default": field.default,
        "optional": field.optional,
        "accepted": field.accepted,
    }
    if isinstance(field, Choice):
        told["choices"] = list(field.names)
    elif isinstance(field, Number):
        told |= {"low": field.low, "high": field.high, "whole": field.whole}
    return told


def is_urgent(table: Mapping[str, object]) -> bool:
    """Whether a command is one that everybody may give: what ends the motion."""
    return table.get("kind") in STOPS
