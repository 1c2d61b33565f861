"""A user's class of an engine, asked: what it gives is checked, what fails in it is told."""

from __future__ import annotations

import math
from typing import Any, Final, final

from hil.brought import ENGINES, Brought, class_with, load_file, load_installed, told
from hil.config.plant import PlantConfig
from hil.errors import RunError
from hil.values import Value
from plant.engines.machine import Machine
from plant.engines.protocol import Inputs

State = tuple[Any, ...]
"""Position [m] and velocity [m/s], and what else the user's engine has put behind them."""

_LEAST: Final = 2


@final
class OwnState(Value):
    """The state of a user's engine, as it gave it."""

    __slots__ = ("of",)

    def __init__(self, of: tuple[Any, ...]) -> None:
        self.of = of


def source_of(config: PlantConfig) -> tuple[Any, Brought]:
    """Return the class that a configuration brings, and where it comes from.

    Raises: ConfigError when it cannot be loaded, or is not the one of the run
    """
    own = config.own
    if own.file:
        brought = load_file(own.file, own.sha256)
        return class_with(brought, ("begin", "advance", "sensed")), brought
    return load_installed(ENGINES, config.model, own.sha256)


@final
class Physics:
    """One of a user's class.

    lights: whether a spark lights its charges, else they burn at the dead centre
    """

    def __init__(self, engine: Any, file: str) -> None:  # noqa: ANN401
        self._engine = engine
        self._file = file
        self._turns = callable(getattr(engine, "turn", None))
        self.lights = callable(getattr(engine, "light", None))

    def begin(self, x_m: float) -> State:
        """The state in which it stands there."""
        return self._checked("begin", self._asked("begin", x_m))

    def advance(self, state: State, inputs: Inputs, span_s: float) -> State:
        """The state so much later."""
        return self._checked("advance", self._asked("advance", state, inputs, span_s))

    def turn(self, state: State, side: int, fuel_kg: float) -> State:
        """The state behind a dead centre; the same where the engine has nothing to do there."""
        if not self._turns:
            return state
        return self._checked("turn", self._asked("turn", state, side, fuel_kg))

    def light(self, state: State, side: int, fuel_kg: float) -> State | None:
        """The state behind a spark, None where its charge does not burn."""
        given = self._asked("light", state, side, fuel_kg)
        return None if given is None else self._checked("light", given)

    def sensed(self, state: State, machine: Machine) -> list[float]:
        """Pressures, and the electric power where it tells one.

        Raises: RunError when it gives something else
        """
        given = self._asked("sensed", state, machine)
        try:
            found = [float(one) for one in given]
        except (TypeError, ValueError):
            found = []
        if len(found) not in (_LEAST, _LEAST + 1):
            accepted = "p_left_pa, p_right_pa, and electric_power_w where it knows it"
            raise RunError(f"{self._file}: sensed gave {given!r}; accepted: {accepted}")
        return found

    def _asked(self, method: str, *arguments: Any) -> Any:  # noqa: ANN401
        """Call a method of the user's.

        Raises: RunError naming file and line when it fails
        """
        try:
            return getattr(self._engine, method)(*arguments)
        except Exception as error:
            raise RunError(told(error, self._file)) from None

    def _checked(self, method: str, given: Any) -> State:  # noqa: ANN401
        """Return a state.

        Raises: RunError when it is none
        """
        if not isinstance(given, tuple) or len(given) < _LEAST or not _is_finite(given):
            accepted = "a tuple, position [m] and velocity [m/s] first"
            raise RunError(f"{self._file}: {method} gave {given!r}; accepted: {accepted}")
        return given


def _is_finite(state: State) -> bool:
    return all(isinstance(one, float) and math.isfinite(one) for one in state[:_LEAST])
