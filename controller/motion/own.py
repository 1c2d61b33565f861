"""A law that a user has brought: any class with a `step`, worked as one of ours.

It derives from nothing: `step(state, view)` gives its next state and the fuel [kg], or a Demand.
It may have `initial()`, `watch(state, view, planned_kg)`, `taken_over(view)`, `restarted(state)`,
and a pydantic model `Settings`, which `__init__` is then given.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

from pydantic import BaseModel, ValidationError

from controller.motion.law import NO_TRIM, Demand, Law, Trim, View
from hil.brought import SUFFIX, Brought, class_with, installed, load_file, load_installed, told
from hil.config.controller import ControllerConfig
from hil.errors import ConfigError, RunError

GROUP = "fpeg_hil.laws"
"""The entry points by which an installed package offers laws."""


class OwnLaw(Law[Any]):
    """The class of somebody else behind the interface of a law."""

    parameters: ClassVar[tuple[str, ...]] = ()

    def __init__(self, config: ControllerConfig, brought: Any, file: str) -> None:  # noqa: ANN401
        self.config = config
        self._law = brought
        self._file = file
        self.watches = callable(getattr(brought, "watch", None))

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


def is_own(name: str) -> bool:
    """Tell whether a name is a file's, or is of an installed package."""
    return name.endswith(SUFFIX) or name in installed(GROUP)


def own_source(config: ControllerConfig) -> tuple[Any, Brought] | None:
    """Return the class that a configuration brings, and where it comes from; None without one.

    Raises: ConfigError when it cannot be loaded, or is not the one of the run
    """
    own = config.own
    if own.file:
        brought = load_file(own.file, own.sha256)
        return class_with(brought, ("step",)), brought
    if config.name in installed(GROUP):
        return load_installed(GROUP, config.name, own.sha256)
    return None


def own_settings(kind: Any, config: ControllerConfig, brought: Brought) -> BaseModel | None:  # noqa: ANN401
    """Return the law's own settings, whole; None for a law that declares none.

    Raises: ConfigError naming the key
    """
    model, given = getattr(kind, "Settings", None), config.own.settings
    if model is None:
        if given:
            raise ConfigError(
                f"controller.own.settings: {brought.path} declares no Settings; accepted: nothing"
            )
        return None
    known = ", ".join(model.model_fields)
    for key in given.keys() - model.model_fields.keys():
        raise ConfigError(f"controller.own.settings.{key}: unknown; {brought.path} has: {known}")
    try:
        found: BaseModel = model.model_validate(given)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(("controller.own.settings", *map(str, first["loc"])))
        raise ConfigError(f"{key} = {first['input']!r}: {first['msg']}") from None
    return found


def make_own(config: ControllerConfig) -> dict[str, OwnLaw]:
    """Return the law that a configuration brings by its name, or nothing.

    Raises: ConfigError when it cannot be made
    """
    source = own_source(config)
    if source is None:
        return {}
    kind, brought = source
    settings = own_settings(kind, config, brought)
    try:
        law = kind() if settings is None else kind(settings)
    except Exception as error:
        raise ConfigError(told(error, str(brought.path.resolve()))) from None
    return {config.own.name or config.name: OwnLaw(config, law, str(brought.path.resolve()))}
