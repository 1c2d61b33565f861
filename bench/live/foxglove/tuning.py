"""Parameters in a viewer: those in force, changed over the command key like any operator's."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from threading import Lock
from typing import Any, Final

from bench.live.steer import Operator, set_parameters, values_of
from hil.errors import HilError

Values = Mapping[str, Any]
_NOTHING: Final[Values] = {}


class Tuning:
    """What the library's server asks of its owner; it asks in threads of its own.

    Parameters: complain : told why a change was refused
    """

    def __init__(self, operator: Operator, complain: Callable[[str], None]) -> None:
        self._operator = operator
        self._complain = complain
        self._turn = Lock()
        self._values: dict[str, Any] = {}

    def look(self) -> Values:
        """Ask for the parameters in force; returns those that differ from what was last heard."""
        try:
            with self._turn:
                found = values_of(self._operator)
        except HilError:  # it has gone, and will be asked again
            return _NOTHING
        news = {key: v for key, v in found.items() if self._values.get(key) != v}
        self._values.update(found)
        return news

    def on_get_parameters(
        self, client: object, param_names: list[str], request_id: str | None = None
    ) -> list[Any]:
        """Return the parameters in force that are asked for; all when none is named."""
        if not self._values:
            self.look()
        return shown({key: self._values.get(key) for key in param_names or self._values})

    def on_set_parameters(
        self, client: object, parameters: list[Any], request_id: str | None = None
    ) -> list[Any]:
        """Change parameters, all or none; returns what is in force of them then."""
        given = {each.name: each.get_value() for each in parameters}
        try:
            with self._turn:
                answers = set_parameters(self._operator, given)
            refused = [answer for answer in answers if not answer.taken]
            problem = f"{refused[0].process} refused it: {refused[0].text}" if refused else ""
        except (HilError, ValueError) as error:
            problem = str(error)
        if problem:
            self._complain(problem)
        self.look()
        return shown({key: self._values.get(key) for key in given})

    def on_subscribe(self, client: object, _channel: object) -> None:
        """Take it: records are handed on to whoever has subscribed."""

    on_unsubscribe = on_subscribe

    def on_parameters_subscribe(self, _names: list[str]) -> None:
        """Take it: changes are told to whoever has subscribed."""

    on_parameters_unsubscribe = on_parameters_subscribe


def shown(values: Values) -> list[Any]:
    """Return parameters as the library has them; one that is open has no value, and is not told."""
    from foxglove.websocket import Parameter

    return [Parameter(key, value=value) for key, value in values.items()]
