"""An engine of ours as a Functional Mock-up Unit: a binary, a description, and C sources.

The sources of a fast-response model (plant/engines/fmu/source) do what plant/engines/fast does,
operation for operation; a detailed engine brings its compiled step (bench/fmu/detailed.py). The
unit needs nothing at run time but the C library.
"""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
import tempfile
import zipfile
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from typing import Final, NamedTuple

from bench.fmu.description import Entry, describe_build, describe_model
from hil.config.engine.models import DETAILED_MODELS
from hil.config.plant import PlantConfig
from hil.errors import ConfigError
from hil.files import Output
from hil.nearest import listed
from plant.engines.fast import shared
from plant.engines.fast.constants import constants_of
from plant.engines.fmu.archive import library
from plant.engines.fmu.contract import BEGINNING, INPUTS, OUTPUTS, PARAMETER, Variable

MODELS: Final = (
    "closed-form", "harmonic", "rectangular", "nonlinear", "two-stroke", "four-stroke", "starting",
)  # fmt: skip
VERSIONS: Final = (2, 3)
_FIRST_INT: Final = 1000
_EXPORTS: Final = ("exports.map", "{ global: fmi*; local: *; };\n")
_FLAGS: Final = (
    "-std=c99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-fno-builtin",
    "-ffp-contract=off", "-Wall", "-Wextra", "-Wl,-z,defs", f"-Wl,--version-script={_EXPORTS[0]}",
)  # fmt: skip
_ZIP_DATE: Final = (1980, 1, 1, 0, 0, 0)


class Exported(NamedTuple):
    """What an export has made."""

    path: Path
    platform: str
    variables: int


class Ingredients(NamedTuple):
    """What is compiled: texts by file name, objects by file name, and whether others may do it."""

    sources: dict[str, str]
    objects: dict[str, bytes]
    open: bool


def export(out: Path, model: str, prototype: str, version: int, *, force: bool = False) -> Exported:
    """Write a unit for co-simulation; the same sources and compiler give the same bytes.

    Raises: ConfigError when the model has no export, there is no compiler, or `out` cannot be made
    """
    if model not in MODELS:
        raise ConfigError(f"--model {model}: accepted for a unit: {listed(model, MODELS)}")
    file = Output("OUT", out, force)
    file.check(".fmu")
    folder = _folder(version)
    config = PlantConfig.model_validate({"model": model, "prototype": prototype})
    detailed = model in DETAILED_MODELS
    entries = _entries(config)
    made = _detailed(config, version) if detailed else _fast(version)
    sources = made.sources | {"variables.h": _header(entries)}
    names = [name for name in sources if name.endswith(".c")]
    identifier = f"fpeg_{model}_{prototype}".replace("-", "_")
    token = _token(model, prototype, version, sources)
    given = {"FMI_VERSION": str(version), "TOKEN": f'"{token}"'}
    given |= {"DETAILED": "1"} if detailed else {"MODEL": model.upper().replace("-", "_")}
    parts: dict[str, bytes] = {
        "modelDescription.xml": describe_model(
            entries, version, name=f"{model}.{prototype}", identifier=identifier, token=token,
            sources=names if made.open else (), detailed=detailed,
        ),
        f"binaries/{folder}/{identifier}.so": _compile(sources, made.objects, given),
    }  # fmt: skip
    if made.open:
        parts |= _source_parts(sources, given, identifier, version)
    _write(file, parts)
    return Exported(out, folder, len(entries))


def _fast(version: int) -> Ingredients:
    sources = _read_sources("engine.c", version) | {"constants.h": shared.header()}
    return Ingredients(sources, {}, open=True)


def _detailed(config: PlantConfig, version: int) -> Ingredients:
    """The engine's arrays and its compiled step; the latter is no source for another machine."""
    module = import_module("bench.fmu.detailed")
    sources = _read_sources("detailed.c", version) | {"arrays.h": module.header(config)}
    return Ingredients(sources, {"step.o": module.step_object()}, open=False)


def _source_parts(
    sources: dict[str, str], given: dict[str, str], identifier: str, version: int
) -> dict[str, bytes]:
    """The sources as they go into the unit, for who builds it for another machine."""
    sources = sources | {"variables.h": _defined(sources["variables.h"], given)}
    parts = {f"sources/{name}": text.encode() for name, text in sources.items()}
    if version > 2:
        names = [name for name in sources if name.endswith(".c")]
        parts["sources/buildDescription.xml"] = describe_build(identifier, names)
    return parts


def _entries(config: PlantConfig) -> list[Entry]:
    """Every variable with its reference: parameters, inputs, outputs, then what counts."""
    own = [] if config.model in DETAILED_MODELS else _figures(config)
    reals = [*own, *BEGINNING, *INPUTS, *(v for v in OUTPUTS if not v.whole)]
    wholes = [v for v in OUTPUTS if v.whole]
    entries = [Entry(variable, number) for number, variable in enumerate(reals, 1)]
    return entries + [Entry(v, number) for number, v in enumerate(wholes, _FIRST_INT)]


def _figures(config: PlantConfig) -> list[Variable]:
    """The figures of a fast-response engine, as parameters."""
    engine = constants_of(config.resolved_prototype(), config.model, config.contact_restitution)
    return [
        _own("moving_mass_kg", "kg", "moving mass", engine.mass_kg),
        _own("area_m2", "m2", "area of a piston", engine.area_m2),
        _own("half_stroke_m", "m", "half of the full stroke", engine.half_stroke_m),
        _own("contact_m", "m", "position at which a head is touched", engine.contact_m),
        _own("gamma", "1", "ratio of the heat capacities", engine.gamma),
        _own("p0_pa", "Pa", "pressure at mid-stroke", engine.p0_pa),
        _own("energy_j_kg", "J/kg", "energy released for a mass of fuel", engine.energy_j_kg),
        _own("restitution", "1", "speed kept at a contact", engine.restitution),
        _own("spark_window_s", "s", "longest time from spark to dead centre",
             config.spark_window_s or 0.05),
    ]  # fmt: skip


def _own(name: str, unit: str, text: str, start: float) -> Variable:
    return Variable(name, PARAMETER, unit, text, start=start)


def _header(entries: list[Entry]) -> str:
    """variables.h: where each variable stands in the engine's arrays, and its start value."""
    reals = [entry for entry in entries if not entry.variable.whole]
    wholes = [entry for entry in entries if entry.variable.whole]
    first_output = next(e.reference for e in reals if e.variable.causality == "output")
    named = [f"    {e.variable.name.upper()} = {e.reference}," for e in reals]
    counted = [f"    {e.variable.name.upper()}," for e in wholes]
    starts = ", ".join(["0.0", *(repr(float(e.variable.start)) for e in reals)])
    return "\n".join(
        [
            "/* Written by the export: references of the variables and their start values. */",
            "#ifndef VARIABLES_H",
            "#define VARIABLES_H",
            "",
            "enum { CLOSED_FORM, HARMONIC, RECTANGULAR, NONLINEAR };",
            "enum {",
            "    TIME = 0,",
            *named,
            f"    N_REALS = {len(reals) + 1},",
            f"    FIRST_OUTPUT = {first_output},",
            f"    FIRST_INT = {_FIRST_INT},",
            "};",
            "enum {",
            *counted,
            "    N_INTS,",
            "};",
            f"#define REAL_STARTS {{{starts}}}",
            "#endif",
            "",
        ]
    )


def _defined(header: str, values: dict[str, str]) -> str:
    """Put into the header what was given to the compiler, for those who compile it again."""
    lines = "".join(
        f"#ifndef {name}\n#define {name} {value}\n#endif\n" for name, value in values.items()
    )
    return header.removesuffix("#endif\n") + lines + "#endif\n"


def _read_sources(engine: str, version: int) -> dict[str, str]:
    folder = files("plant.engines.fmu") / "source"
    names = ("engine.h", engine, "refused.c", f"fmi{version}.c")
    return {name: (folder / name).read_text(encoding="utf-8") for name in names}


def _token(model: str, prototype: str, version: int, sources: dict[str, str]) -> str:
    """Name the unit by what it is made of, in the form of a GUID."""
    text = "\0".join([model, prototype, str(version), *sources.values()])
    digest = hashlib.sha256(text.encode()).hexdigest()
    parts = (digest[0:8], digest[8:12], digest[12:16], digest[16:20], digest[20:32])
    return "{" + "-".join(parts) + "}"


def _folder(version: int) -> str:
    """Where the standard wants a binary of this machine.

    Raises: ConfigError on a machine that is not a 64-bit Linux one
    """
    machine, system = platform.machine().lower(), platform.system().lower()
    if system != "linux" or machine not in {"x86_64", "aarch64"}:
        raise ConfigError(f"export of a unit: {system} on {machine}; accepted: 64-bit Linux")
    return f"{machine}-linux" if version > 2 else str(library().platform)


def _compile(sources: dict[str, str], objects: dict[str, bytes], given: dict[str, str]) -> bytes:
    """Compile and link.

    Raises: ConfigError when there is no compiler, or it fails
    """
    defines = [f"-D{name}={value}" for name, value in given.items()]
    names = [name for name in sources if name.endswith(".c")] + list(objects)
    headers = Path(library().__file__).parent / "c-code"
    compiler = os.environ.get("CC", "cc")
    with tempfile.TemporaryDirectory(prefix="fmu-") as directory:
        for name, text in (*sources.items(), _EXPORTS):
            Path(directory, name).write_text(text, encoding="utf-8")
        for name, data in objects.items():
            Path(directory, name).write_bytes(data)
        command = [compiler, *_FLAGS, f"-I{headers}", *defines, *names, "-o", "unit.so", "-lm"]
        try:
            done = subprocess.run(
                command, cwd=directory, capture_output=True, text=True, check=False
            )
        except OSError:
            raise ConfigError(
                f"export of a unit needs a C compiler ({compiler}): install gcc, or set CC"
            ) from None
        if done.returncode:
            line = (done.stderr.strip() or "no message").splitlines()[0]
            raise ConfigError(f"export of a unit: {compiler}: {line}")
        return Path(directory, "unit.so").read_bytes()


def _write(file: Output, parts: dict[str, bytes]) -> None:
    with file.writing() as out, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as unit:
        for name, data in parts.items():
            unit.writestr(zipfile.ZipInfo(name, _ZIP_DATE), data, zipfile.ZIP_DEFLATED)
