"""A law that a user has brought: any class with a `step`, worked as one of ours.

It derives from nothing: `step(state, view)` gives its next state and the fuel [kg], or a Demand.
It may have `initial()`, `watch(state, view, planned_kg)`, `taken_over(view)`, `restarted(state)`,
and a pydantic model `Settings`, which `__init__` is then given.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

from pydantic import BaseModel

from controller.motion.law import NO_TRIM, Demand, Law, Trim, View
from hil.brought import (
    LAWS,
    Brought,
    class_with,
    installed,
    load_file,
    load_installed,
    make,
    settings_of,
    told,
)
from hil.config.controller import ControllerConfig
from hil.errors import RunError


class OwnLaw(Law[Any]):
    """The class of somebody else behind the interface of a law."""

    parameters: ClassVar[tuple[str, ...]] = ()

    def __init__(self, config: ControllerConfig, kind: Any, brought: Brought) -> None:  # noqa: ANN401
        self.config = config
        self._kind = kind
        self._brought = brought
        self._law = make(kind, brought, own_settings(kind, config, brought))
        self._file = str(brought.path.resolve())
        self.watches = callable(getattr(self._law, "watch", None))

    def remade(self, config: ControllerConfig) -> OwnLaw:
        """The same by the settings of another configuration.

        Raises: ConfigError naming a key that it does not accept
        """
        same = config.own.settings == self.config.own.settings
        return self if same else OwnLaw(config, self._kind, self._brought)

    def initial(self) -> Any:  # noqa: ANN401
        """The state of a run's beginning; None for a law that remembers nothing."""
        return self._asked("initial") if hasattr(self._law, "initial") else None

    def step(self, state: Any, view: View) -> tuple[Any, Demand]:  # noqa: ANN401
        """Ask for the fuel.

        Raises: RunError naming file and line when the law fails, or asks for no number
        """
        given = self._asked("step", state, view)
        try:
            after, wanted = given
            demand = wanted if isinstance(wanted, Demand) else Demand(float(wanted))
        except (TypeError, ValueError):
            demand = Demand(math.nan)
        if not math.isfinite(demand.fuel_kg):
            raise RunError(
                f"{self._file}: step gave {given!r}; accepted: its next state and the fuel [kg]"
            )
        return after, demand.of(view.limited_kg(demand.fuel_kg))

    def watch(self, state: Any, view: View, planned_kg: float) -> tuple[Any, Trim]:  # noqa: ANN401
        """Let it look at a tick: its next state, and None or a Trim.

        Raises: RunError naming file and line when the law fails
        """
        given = self._asked("watch", state, view, planned_kg)
        try:
            after, trim = given
        except (TypeError, ValueError):
            raise RunError(
                f"{self._file}: watch gave {given!r}; accepted: its next state and None or a Trim"
            ) from None
        return after, NO_TRIM if trim is None else trim

    def signals(self, state: Any) -> tuple[float, ...]:  # noqa: ANN401
        """What it tells of itself, in the order in which it declares it.

        Raises: RunError naming file and line when the law fails, or tells no such numbers
        """
        given = self._asked("tell", state)
        try:
            return tuple([float(given[name]) for name in self.config.own.signals])
        except (TypeError, ValueError, KeyError, IndexError):
            known = ", ".join(self.config.own.signals)
            raise RunError(
                f"{self._file}: tell gave {given!r}; accepted: a number for each of {known}"
            ) from None

    def taken_over(self, view: View) -> Any:  # noqa: ANN401
        """The state with which it goes on from another law."""
        if hasattr(self._law, "taken_over"):
            return self._asked("taken_over", view)
        return self.initial()

    def restarted(self, state: Any) -> Any:  # noqa: ANN401
        """What it keeps when the engine has been restarted."""
        if hasattr(self._law, "restarted"):
            return self._asked("restarted", state)
        return self.initial()

    def _asked(self, method: str, *arguments: Any) -> Any:  # noqa: ANN401
        try:
            return getattr(self._law, method)(*arguments)
        except Exception as error:
            raise RunError(told(error, self._file)) from None


def own_source(config: ControllerConfig) -> tuple[Any, Brought] | None:
    """Return the class that a configuration brings, and where it comes from; None without one.

    Raises: ConfigError when it cannot be loaded, or is not the one of the run
    """
    own = config.own
    if own.file:
        brought = load_file(own.file, own.sha256)
        return class_with(brought, ("step",)), brought
    if own.sha256 or config.name in installed(LAWS):
        return load_installed(LAWS, own.name or config.name, own.sha256)
    return None


def own_settings(kind: Any, config: ControllerConfig, brought: Brought) -> BaseModel | None:  # noqa: ANN401
    """Return the law's own settings, whole; None for a law that declares none.

    Raises: ConfigError naming the key
    """
    return settings_of(kind, config.own.settings, "controller.own.settings", brought.path)


def make_own(config: ControllerConfig) -> dict[str, OwnLaw]:
    """Return the law that a configuration brings by its name, or nothing.

    Raises: ConfigError when it cannot be made
    """
    source = own_source(config)
    if source is None:
        return {}
    kind, brought = source
    return {config.own.name or config.name: OwnLaw(config, kind, brought)}
