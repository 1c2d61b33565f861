"""The variables of the contract found in a unit's own description, with their types and units."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from hil.errors import ConfigError
from plant.engines.fmu.contract import ALL, BASE_UNITS, DEAD_CENTRE, PARAMETER, Variable

_REALS: Final = ("Real", "Float64")
_WHOLES: Final = ("Integer", "Int32")
_EXPONENTS: Final = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


class Bound(NamedTuple):
    """One variable of a unit: the contract's value is factor * its value + offset."""

    name: str
    reference: int
    kind: str
    factor: float = 1.0
    offset: float = 0.0


Binding = dict[str, Bound]


def bind(description: Any, names: Mapping[str, str], origin: str) -> Binding:  # noqa: ANN401
    """Find what the contract names, under the names that the map gives.

    Parameters: description : ModelDescription of FMPy; names : contract's name -> unit's name
    Raises: ConfigError naming the variable that is missing or of another kind
    """
    known = {variable.name: variable for variable in ALL}
    for name in names:
        if name not in known:
            raise ConfigError(f"{origin}: plant.fmu.names.{name}: accepted: {', '.join(known)}")
    there = {variable.name: variable for variable in description.modelVariables}
    units = {unit.name: unit.baseUnit for unit in description.unitDefinitions}
    found: Binding = {}
    for name, wanted in known.items():
        own = names.get(name, name)
        if own in there:
            found[name] = _bound(wanted, there[own], units, origin)
        elif wanted.needed or name in names:
            raise ConfigError(
                f"{origin}: has no variable {own} ({wanted.causality}, {wanted.text}); name its own"
                f" with plant.fmu.names.{name}; it has: {_listed(there, wanted.causality)}"
            )
    if any(name not in found for name in DEAD_CENTRE):
        return {name: bound for name, bound in found.items() if name not in DEAD_CENTRE}
    return found


def _listed(there: Mapping[str, Any], causality: str) -> str:
    """Name what could have been meant."""
    return ", ".join(n for n, v in there.items() if v.causality == causality) or "none"


def _bound(wanted: Variable, there: Any, units: Mapping[str, Any], origin: str) -> Bound:  # noqa: ANN401
    text = f"{origin}: variable {there.name}"
    if there.causality != wanted.causality:
        raise ConfigError(f"{text}: is {there.causality}; accepted: {wanted.causality}")
    kinds = (*_WHOLES, *_REALS) if wanted.whole else _REALS
    if there.type not in kinds or there.dimensions:
        kind = f"an array of {there.type}" if there.dimensions else f"of type {there.type}"
        raise ConfigError(f"{text}: is {kind}; accepted: {' or '.join(kinds)}")
    declared = there.declaredType
    unit = there.unit or (declared.unit if declared is not None else None)
    factor, offset = _conversion(wanted, unit, units, text)
    return Bound(there.name, there.valueReference, there.type, factor, offset)


def _conversion(
    wanted: Variable, unit: str | None, units: Mapping[str, Any], text: str
) -> tuple[float, float]:
    """Factor and offset to the contract's unit; a unit without a base is taken for it."""
    base = units.get(unit) if unit else None
    if base is None:
        return 1.0, 0.0
    given = {name: getattr(base, name) for name in _EXPONENTS if getattr(base, name)}
    if given != BASE_UNITS[wanted.unit]:
        raise ConfigError(f"{text}: is in {unit}; accepted: {wanted.unit} or a multiple of it")
    try:
        factor, offset = float(base.factor), float(base.offset)
    except (TypeError, ValueError):
        factor = offset = math.nan
    if not (math.isfinite(factor) and math.isfinite(offset)) or factor == 0.0:
        told = f"{unit} is {base.factor} times its base unit, offset {base.offset}"
        raise ConfigError(f"{text}: {told}; accepted: finite numbers, the factor not 0")
    return factor, offset


def parameters(description: Any, given: Mapping[str, float], origin: str) -> list[Bound]:  # noqa: ANN401
    """Find the unit's own parameters that the configuration sets, in its own units.

    Raises: ConfigError when there is none of that name, or it is no number
    """
    there = {v.name: v for v in description.modelVariables if v.causality == PARAMETER}
    for name in given:
        if name not in there:
            known = ", ".join(there) or "none"
            raise ConfigError(f"{origin}: plant.fmu.parameters.{name}: it has: {known}")
        if there[name].type not in _REALS:
            kind = there[name].type
            raise ConfigError(f"{origin}: parameter {name} is of type {kind}; accepted: Real")
    return [Bound(name, there[name].valueReference, there[name].type) for name in given]
