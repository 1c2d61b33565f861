"""Commands to a running pair: start, stop, and parameters that change or are asked for."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, Protocol

from bench.live.engines import engine_of
from hil.errors import BlockedError, ConfigError, LinkError
from hil.files import Output
from hil.toml import assignments_of
from hil.wire import changes
from hil.wire.answers import CommandAnswer
from hil.wire.commands import BY_PARAMETER, CONTROLLER, PLANT
from hil.wire.quantities import Scalar

REACHED_S: Final = 2.0
"""A process that says nothing for so long is not there."""

_LEAD_TICKS: Final = 50
"""From the check on both sides to the tick in which both change; each takes a command every ten."""

_POLL_S: Final = 0.002
_SIDES: Final = (PLANT, CONTROLLER)
_SHORT: Final = {name: key for key, (_, name) in BY_PARAMETER.items()}
"""Set points by the names that they have in their command."""


class Operator(Protocol):
    """What is asked of the view of two processes."""

    def alive(self) -> set[str]:
        """Return the processes that take part by now."""

    def ask_all(
        self, command: Mapping[str, object], to: Sequence[str], timeout_s: float
    ) -> list[CommandAnswer]:
        """Send one command and return what each of its addressees says."""

    def close(self) -> None:
        """Leave."""


def set_parameters(
    operator: Operator, values: Mapping[str, object], timeout_s: float = REACHED_S
) -> list[CommandAnswer]:
    """Change parameters in one transaction; returns what each side that has some of them says.

    Of both sides, both are asked first whether they would take it, and then change at one tick.

    Raises: ConfigError for a key of neither side, LinkError when a side does not answer
    """
    sides = sides_of(values)
    if len(sides) == 1:
        return operator.ask_all(changes.encode(changes.SET, values), sides, timeout_s)
    checked = operator.ask_all(changes.encode(changes.CHECK, values), sides, timeout_s)
    if not all(answer.taken for answer in checked):
        return checked
    at_tick = max(answer.tick for answer in checked) + _LEAD_TICKS
    return operator.ask_all(changes.encode(changes.SET, values, at_tick), sides, timeout_s)


def sides_of(values: Mapping[str, object]) -> tuple[str, ...]:
    """Return whose the keys are.

    Raises: ConfigError for a key of neither side
    """
    for key in values:
        if key.partition(".")[0] not in _SIDES:
            raise ConfigError(
                f"{key}: no parameter of a running engine; accepted: plant. and controller. keys"
                f" (`hil parameters --live`), {', '.join(_SHORT)}"
            )
    return tuple(side for side in _SIDES if any(key.startswith(f"{side}.") for key in values))


def values_of(
    operator: Operator, keys: str = "", timeout_s: float = REACHED_S
) -> dict[str, Scalar | None]:
    """Return the values in force of the parameters that a pattern names, of both sides.

    Raises: LinkError when a side does not answer
    """
    found: dict[str, Scalar | None] = {}
    for side in _SIDES:
        for page in _pages(operator, side, keys, timeout_s):
            found |= page
    return found


def _pages(
    operator: Operator, side: str, keys: str, timeout_s: float
) -> Iterator[Mapping[str, Scalar | None]]:
    after = ""
    while True:
        table = changes.encode(changes.GET, {"keys": keys, "after": after})
        (answer,) = operator.ask_all(table, (side,), timeout_s)
        yield answer.values
        if len(answer.values) < changes.MOST_VALUES:
            return
        after = max(answer.values)


def joined(run: Path | None, sides: Sequence[str]) -> Operator:
    """Join the engine that is meant, once those sides take part.

    Raises: ConfigError, LinkError
    """
    operator = engine_of(run).operator("hil")
    end_s = time.monotonic() + REACHED_S
    while not set(sides) <= operator.alive():
        if time.monotonic() > end_s:
            missing = " and no ".join(s for s in sides if s not in operator.alive())
            operator.close()
            raise LinkError(f"no {missing} takes commands, waited {REACHED_S:g} s")
        time.sleep(_POLL_S)
    return operator


def change(assignments: Sequence[str], save: Path | None, run: Path | None, force: bool) -> int:
    """Change parameters, and write the set in force; 1 when the change is refused.

    Raises: ConfigError, LinkError
    """
    given = {_SHORT.get(key, key): value for key, value in assignments_of(assignments)}
    if not given and save is None:
        raise ConfigError("hil set: nothing to set; accepted: KEY=VALUE, @FILE or --save FILE")
    file = None if save is None else Output("--save", save, force)
    if file is not None:
        file.check(".toml")
    sides = _SIDES if save is not None else sides_of(given)
    operator = joined(run, sides)
    try:
        answers = set_parameters(operator, given) if given else []
        taken = all(answer.taken for answer in answers)
        _tell(answers, given, taken=taken)
        if file is not None and taken:
            file.write(toml_of(values_of(operator)))
    finally:
        operator.close()
    return 0 if taken else 1


def _tell(answers: Sequence[CommandAnswer], given: Iterable[str], *, taken: bool) -> None:
    """Say what each side has made of it; where one refuses, neither has changed."""
    for answer in answers:
        if not answer.taken:
            why = _unknown(given) or answer.text
            print(f"{answer.process} refused it: {why}", file=sys.stderr, flush=True)
        elif taken:
            print(f"{answer.process}: {answer.text}; from tick {answer.tick}", flush=True)


def _unknown(keys: Iterable[str]) -> str:
    """Name the first key that is none, and what is like it: a loop has no time to look for that."""
    from hil.names.parameters import parameter_of  # only a refusal is worth its time

    for key in keys:
        try:
            parameter_of(key)
        except ConfigError as error:
            return str(error)
    return ""


def toml_of(values: Mapping[str, Scalar | None]) -> str:
    """Return parameters as a set that --set @FILE takes; what is open is left open."""
    lines = [f"{key} = {json.dumps(v)}" for key, v in sorted(values.items()) if v is not None]
    return "\n".join(lines) + "\n"


def tell_values(keys: Sequence[str], run: Path | None, *, as_json: bool) -> int:
    """Print the values in force of parameters.

    Raises: ConfigError for a key that none of a running engine has, LinkError
    """
    operator = joined(run, _SIDES)
    try:
        found: dict[str, Scalar | None] = {}
        for key in keys or [""]:
            named = values_of(operator, _SHORT.get(key, key))
            if not named:
                raise ConfigError(
                    f"{key}: no parameter of a running engine (`hil parameters --live`)"
                )
            found |= {key: named[key]} if key in named else named
    finally:
        operator.close()
    if as_json:
        print(json.dumps(found, indent=1))
        return 0
    for key, value in found.items():
        print(f"{key} = {json.dumps(value) if value is not None else 'none'}")
    return 0


def order(kind: str, run: Path | None) -> int:
    """Send `start`, `stop` or another command without fields to the controller.

    Raises: BlockedError when it is refused, LinkError when nobody answers
    """
    operator = joined(run, (CONTROLLER,))
    try:
        (answer,) = operator.ask_all({"kind": kind}, (CONTROLLER,), REACHED_S)
        if not answer.taken:
            raise BlockedError(f"{answer.process} refused {kind}: {answer.text}")
        print(f"{answer.process}: {answer.text}; taken at tick {answer.tick}", flush=True)
    finally:
        operator.close()
    return 0
