"""A running unit: values in, a step, values out, and its state where it can be set back."""

from __future__ import annotations

import ctypes
import shutil
import tempfile
import weakref
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from typing import Any, NamedTuple

from hil.errors import ConfigError, RunError
from plant.engines.fmu.archive import Archive, library
from plant.engines.fmu.binding import Binding, Bound, bind, parameters
from plant.engines.fmu.contract import BEGINNING, INPUTS, OUTPUTS

_REALS = ("Real", "Float64")


class Column(NamedTuple):
    """Variables of one type that are read or written together."""

    names: tuple[str, ...]
    references: Any
    values: Any
    bounds: tuple[Bound, ...]
    plain: bool


class Unit:
    """One instance of a unit on this machine; values by the contract's names, in its units."""

    def __init__(
        self, archive: Archive, names: Mapping[str, str], given: Mapping[str, float]
    ) -> None:
        """Check the unit against the contract; `start` brings it to life.

        Raises: ConfigError
        """
        self.path = archive.path
        description = archive.description
        origin = str(archive.path)
        self.bound: Binding = bind(description, names, origin)
        self._given = dict(given)
        self._settings = parameters(description, given, origin)
        can = description.coSimulation
        self.splits = bool(can.canHandleVariableCommunicationStepSize)
        self.restores = bool(can.canGetAndSetFMUstate and can.canSerializeFMUstate)
        self._three = archive.version > 2
        self._archive = archive
        self._fmu: Any = None
        self._state = ctypes.c_void_p()
        self._fault: Any = import_module("fmpy.fmi1").FMICallException
        self._inputs = self._column([v.name for v in INPUTS])
        reals = [v.name for v in OUTPUTS if self._is(v.name, real=True)]
        self._outputs = self._column(reals)
        self._wholes = self._column([v.name for v in OUTPUTS if self._is(v.name, real=False)])

    def _is(self, name: str, *, real: bool) -> bool:
        return name in self.bound and (self.bound[name].kind in _REALS) == real

    def _column(self, names: Sequence[str]) -> Column:
        bounds = tuple(self.bound[name] for name in names)
        whole = bool(bounds) and bounds[0].kind not in _REALS
        kind = ctypes.c_int32 if whole else ctypes.c_double
        references = (ctypes.c_uint32 * len(bounds))(*(b.reference for b in bounds))
        plain = all(b.factor == 1.0 and b.offset == 0.0 for b in bounds)
        return Column(tuple(names), references, (kind * len(bounds))(), bounds, plain)

    @property
    def begins_settled(self) -> bool:
        """Whether it can be told where to begin."""
        return all(v.name in self.bound for v in BEGINNING)

    def start(self, inputs: Sequence[float], x_m: float, fuel_kg: float) -> dict[str, float]:
        """Begin anew at t = 0; return the outputs there.

        Raises: ConfigError when it does not come to life
        """
        self._load()
        fmu = self._fmu
        try:
            if not self._three:
                fmu.setupExperiment(startTime=0.0)
            self._set(self._settings, list(self._given.values()))
            begin = [self.bound[v.name] for v in BEGINNING if v.name in self.bound]
            values = {"start_x_m": x_m, "start_fuel_kg": fuel_kg}
            there = [v.name for v in BEGINNING if v.name in self.bound]
            self._set(begin, [values[name] for name in there])
            fmu.enterInitializationMode()
            self._put(inputs)
            fmu.exitInitializationMode()
            return self._get()
        except self._fault as error:
            raise ConfigError(f"{self.path}: cannot begin: {error}") from None

    def _load(self) -> None:
        """Unpack and instantiate; an instance that has run before begins anew.

        Raises: ConfigError
        """
        fmpy = library()
        if self._fmu is not None:
            self._fmu.reset()
            return
        directory = tempfile.mkdtemp(prefix="fmu-")
        fmpy.extract(str(self.path), directory)
        description = self._archive.description
        module = import_module("fmpy.fmi3" if self._three else "fmpy.fmi2")
        kind = module.FMU3Slave if self._three else module.FMU2Slave
        try:
            fmu = kind(
                guid=description.guid,
                unzipDirectory=directory,
                modelIdentifier=description.coSimulation.modelIdentifier,
                instanceName="plant",
            )
            fmu.instantiate()
        except Exception as error:  # the loader's, the linker's or the unit's own
            shutil.rmtree(directory, ignore_errors=True)
            line = str(error).partition("\n")[0]
            raise ConfigError(f"{self.path}: cannot be loaded: {line}") from None
        self._fmu = fmu
        weakref.finalize(self, _release, fmu, directory)

    def _set(self, bounds: Sequence[Bound], values: Sequence[float]) -> None:
        if not bounds:
            return
        references = [b.reference for b in bounds]
        own = [(v - b.offset) / b.factor for b, v in zip(bounds, values, strict=True)]
        if self._three:
            self._fmu.setFloat64(references, own)
        else:
            self._fmu.setReal(references, own)

    def _put(self, inputs: Sequence[float]) -> None:
        _, references, values, bounds, plain = self._inputs
        if plain:
            values[:] = inputs
        else:
            values[:] = [(v - b.offset) / b.factor for b, v in zip(bounds, inputs, strict=True)]
        fmu, n = self._fmu, len(bounds)
        if self._three:
            fmu.fmi3SetFloat64(fmu.component, references, n, values, n)
        else:
            fmu.fmi2SetReal(fmu.component, references, n, values)

    def _get(self) -> dict[str, float]:
        fmu = self._fmu
        found: dict[str, float] = {}
        for column in (self._outputs, self._wholes):
            names, references, values, bounds, plain = column
            n = len(names)
            if not n:
                continue
            if self._three:
                get = fmu.fmi3GetFloat64 if column is self._outputs else fmu.fmi3GetInt32
                get(fmu.component, references, n, values, n)
            else:
                get = fmu.fmi2GetReal if column is self._outputs else fmu.fmi2GetInteger
                get(fmu.component, references, n, values)
            if plain:
                found.update(zip(names, values, strict=True))
            else:
                own = zip(names, bounds, values, strict=True)
                found.update({name: b.factor * v + b.offset for name, b, v in own})
        return found

    def step(self, inputs: Sequence[float], t_s: float, h_s: float) -> dict[str, float]:
        """Take the inputs, move on from t_s by h_s, return the outputs.

        Raises: RunError when the unit fails or will not go on
        """
        try:
            self._put(inputs)
            told = self._fmu.doStep(t_s, h_s)
            if told is not None and (told[1] or told[2]):
                what = "ends the simulation" if told[1] else "returns early"
                raise RunError(f"{self.path}: {what} in the step from {t_s:.6f} s")
            return self._get()
        except self._fault as error:
            raise RunError(f"{self.path}: the step from {t_s:.6f} s failed: {error}") from None

    def read_all(self) -> None:
        """Read every real variable that the description names, once it has begun.

        Raises: ConfigError naming the one that is not there
        """
        get = self._fmu.getFloat64 if self._three else self._fmu.getReal
        for variable in self._archive.description.modelVariables:
            if variable.type in _REALS and not variable.dimensions:
                try:
                    get([variable.valueReference])
                except self._fault as error:
                    told = f"{self.path}: variable {variable.name} cannot be read: {error}"
                    raise ConfigError(told) from None

    def remember(self) -> bytes:
        """Return its whole state, b"" when it cannot give it."""
        if not self.restores:
            return b""
        fmu, state = self._fmu, self._state
        if self._three:
            fmu.fmi3GetFMUState(fmu.component, ctypes.byref(state))
            return bytes(fmu.serializeFMUState(state))
        fmu.fmi2GetFMUstate(fmu.component, ctypes.byref(state))
        return bytes(fmu.serializeFMUstate(state))

    def recall(self, state: bytes) -> dict[str, float]:
        """Go on from what `remember` returned; returns the outputs there.

        Raises: RunError when it cannot be set back
        """
        if not self.restores or not state:
            raise RunError(
                f"{self.path}: cannot be set back to an earlier state (canGetAndSetFMUstate and "
                "canSerializeFMUstate): replay it from its start"
            )
        if self._fmu is None:
            self.start([v.start for v in INPUTS], 0.0, 0.0)
        fmu = self._fmu
        try:
            if self._three:
                self._state = fmu.deserializeFMUState(state, self._state)
                fmu.setFMUState(self._state)
            else:
                self._state = fmu.deSerializeFMUstate(state, self._state)
                fmu.setFMUstate(self._state)
            return self._get()
        except self._fault as error:
            raise RunError(f"{self.path}: does not take its own state back: {error}") from None


def _release(fmu: Any, directory: str) -> None:  # noqa: ANN401
    """End an instance and remove what was unpacked."""
    with suppress(Exception):  # it ends anyway; nobody can act on this
        fmu.terminate()
        fmu.freeInstance()
    shutil.rmtree(directory, ignore_errors=True)
