"""modelDescription.xml of an exported unit, for FMI 2.0 and 3.0."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from plant.engines.fmu.contract import BASE_UNITS, INPUT, ORIGIN, OUTPUT, PARAMETER, Variable

_STEP_S: Final = "0.001"
_STEPPED: Final = ("dc_t_s", "dc_x_m", "fuel_burnt_kg", "dead_centres", "contacts")
_TRUE: Final = "true"


class Entry(NamedTuple):
    """A variable and its value reference."""

    variable: Variable
    reference: int


def describe_model(
    entries: Sequence[Entry],
    version: int,
    *,
    name: str,
    identifier: str,
    token: str,
    sources: Sequence[str],
    detailed: bool = False,
) -> bytes:
    """Return modelDescription.xml; `name` is MODEL.PROTOTYPE."""
    three = version > 2
    root = Element("fmiModelDescription")
    root.set("fmiVersion", "3.0" if three else "2.0")
    root.set("modelName", name)
    root.set("instantiationToken" if three else "guid", token)
    kind = "detailed" if detailed else "fast-response"
    root.set("description", f"Dual-piston free-piston engine generator, {kind} model")
    root.set("license", "Apache-2.0")
    root.set("generationTool", ORIGIN)
    root.set("variableNamingConvention", "flat")
    _co_simulation(root, identifier, sources, three=three)
    units = SubElement(root, "UnitDefinitions")
    for unit in dict.fromkeys(entry.variable.unit for entry in entries):
        base = SubElement(SubElement(units, "Unit", name=unit), "BaseUnit")
        for part, exponent in BASE_UNITS[unit].items():
            base.set(part, str(exponent))
    SubElement(root, "DefaultExperiment", startTime="0.0", stopTime="1.0", stepSize=_STEP_S)
    variables = SubElement(root, "ModelVariables")
    if three:
        _time(variables)
    for entry in entries:
        (_variable_three if three else _variable_two)(variables, entry)
    _structure(root, entries, three=three)
    return _text(root)


def _co_simulation(root: Element, identifier: str, sources: Sequence[str], *, three: bool) -> None:
    unit = SubElement(root, "CoSimulation", modelIdentifier=identifier)
    unit.set("canHandleVariableCommunicationStepSize", _TRUE)
    unit.set("canGetAndSetFMUState" if three else "canGetAndSetFMUstate", _TRUE)
    unit.set("canSerializeFMUState" if three else "canSerializeFMUstate", _TRUE)
    if sources and not three:
        listed = SubElement(unit, "SourceFiles")
        for name in sources:
            SubElement(listed, "File", name=name)


def _time(variables: Element) -> None:
    SubElement(
        variables, "Float64", name="time", valueReference="0", causality="independent",
        variability="continuous", unit="s",
    )  # fmt: skip


def _common(element: Element, entry: Entry) -> None:
    variable = entry.variable
    element.set("name", variable.name)
    element.set("valueReference", str(entry.reference))
    element.set("description", variable.text)
    element.set("causality", variable.causality)
    element.set("variability", _variability(variable))
    if variable.causality == OUTPUT:
        element.set("initial", "calculated")
    elif variable.causality == PARAMETER:
        element.set("initial", "exact")


def _variability(variable: Variable) -> str:
    if variable.causality == PARAMETER:
        return "fixed"
    return "discrete" if variable.name in _STEPPED else "continuous"


def _typed(element: Element, variable: Variable) -> None:
    if not variable.whole:
        element.set("unit", variable.unit)
    if variable.causality in {INPUT, PARAMETER}:
        element.set("start", repr(float(variable.start)))


def _variable_two(variables: Element, entry: Entry) -> None:
    element = SubElement(variables, "ScalarVariable")
    _common(element, entry)
    _typed(SubElement(element, "Integer" if entry.variable.whole else "Real"), entry.variable)


def _variable_three(variables: Element, entry: Entry) -> None:
    element = SubElement(variables, "Int32" if entry.variable.whole else "Float64")
    _common(element, entry)
    _typed(element, entry.variable)


def _structure(root: Element, entries: Sequence[Entry], *, three: bool) -> None:
    """Name the outputs, which are also all that is unknown at the start."""
    structure = SubElement(root, "ModelStructure")
    outputs = [n for n, e in enumerate(entries, 1) if e.variable.causality == OUTPUT]
    if three:
        for kind in ("Output", "InitialUnknown"):
            for n in outputs:
                SubElement(structure, kind, valueReference=str(entries[n - 1].reference))
        return
    for kind in ("Outputs", "InitialUnknowns"):
        listed = SubElement(structure, kind)
        for n in outputs:
            SubElement(listed, "Unknown", index=str(n))


def describe_build(identifier: str, sources: Sequence[str]) -> bytes:
    """Return sources/buildDescription.xml, from which FMI 3.0 builds for other machines."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    build = SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    listed = SubElement(build, "SourceFileSet", language="C99")
    for name in sources:
        SubElement(listed, "SourceFile", name=name)
    return _text(root)


def _text(root: Element) -> bytes:
    indent(root)
    body: str = tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{body}\n'.encode()
