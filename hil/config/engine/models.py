"""Which model of an engine: one of ours, a Functional Mock-up Unit, or what a user brings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field

from hil.brought import ENGINES, SUFFIX, is_brought, name_of
from hil.config.base import OneOf, Section
from hil.config.prototypes import PROTOTYPES, model_files

FAST_MODELS = ("closed-form", "harmonic", "rectangular", "nonlinear")
DETAILED_MODELS = tuple(dict.fromkeys(model for name in PROTOTYPES for model in model_files(name)))
"""Models of the gas in full: compiled, with a calibration of their own."""

OWN_MODELS = (*FAST_MODELS, *DETAILED_MODELS)
OwnModel = Annotated[str, OneOf(OWN_MODELS)]
MODELS = (*OWN_MODELS, "fmu")
KNOWN = OneOf(MODELS, lambda name: is_brought(ENGINES, name))
Model = Annotated[str, KNOWN]
"""One of ours, a unit, or what a user brings: a .py file, or an installed package's engine."""

_FMU = "fmu:"


class FmuConfig(Section):
    """A Functional Mock-up Unit as the engine: `model = "fmu"`, or `model = "fmu:FILE"`.

    like: the model of ours whose fuel, set point, load and spark a run with the unit begins with
    names: the contract's names by the unit's own ones; parameters: start values, in its own units
    """

    file: str = ""
    sha256: str = ""
    like: OwnModel = "harmonic"
    names: dict[str, str] = Field(default_factory=dict)
    parameters: dict[str, float] = Field(default_factory=dict)


class OwnEngineConfig(Section):
    """An engine of the user's own: other figures, or other physics.

    `prototype = "./my.toml"`: what differs from the prototype that it is like. Plant and controller
    both believe it; `plant.engine` is what only the plant has.
    `model = "./my_engine.py"`, or the name that an installed package offers: it moves the piston.

    name: the prototype file's; figures: keys of an engine.toml; models: tables of models in full
    file, sha256: where the model is, and of what content; settings: what its `Settings` declares
    like: the model of ours whose fuel, set point, load and spark a run with it begins with
    """

    name: str = ""
    figures: dict[str, float | int] = Field(default_factory=dict)
    models: dict[str, dict[str, dict[str, Any]]] = Field(default_factory=dict)
    file: str = ""
    sha256: str = ""
    like: OwnModel = "nonlinear"
    settings: dict[str, float | bool | str] = Field(default_factory=dict)


def table_of(given: Any) -> Mapping[str, Any]:  # noqa: ANN401
    """Return what is given of a section, as a table or as the section itself."""
    return given.model_dump(exclude_unset=True) if isinstance(given, Section) else given or {}


def with_file(given: Mapping[str, Any]) -> Mapping[str, Any]:
    """Read `fmu:FILE` as the model fmu and its file, `./my.py` as the engine of that file."""
    model = given.get("model")
    if not isinstance(model, str):
        return given
    if model.endswith(SUFFIX):
        own = {**table_of(given.get("own")), "file": model}
        return {**given, "model": name_of(model), "own": own}
    if not model.startswith(_FMU):
        return given
    fmu, file = given.get("fmu") or {}, model.removeprefix(_FMU)
    return {**given, "model": "fmu", "fmu": {**fmu, "file": file} if file else fmu}
