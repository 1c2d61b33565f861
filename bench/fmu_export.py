"""A fast-response engine of ours as a Functional Mock-up Unit: C sources, a binary, a description.

The sources (plant/fmu/source) do what plant/step.py does, operation for operation. The unit needs
nothing at run time but the C library.
"""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
import tempfile
import zipfile
from importlib.resources import files
from pathlib import Path
from typing import Final, NamedTuple

from bench.fmu_description import Entry, describe_build, describe_model
from hil.config.plant import PlantConfig
from hil.errors import ConfigError
from plant.fmu.archive import library
from plant.fmu.contract import BEGINNING, INPUTS, OUTPUTS, PARAMETER, Variable
from plant.params import engine_of

MODELS: Final = ("closed-form", "harmonic", "rectangular", "nonlinear")
VERSIONS: Final = (2, 3)
_FIRST_INT: Final = 1000
_FLAGS: Final = (
    "-std=c99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-fno-builtin",
    "-ffp-contract=off", "-Wall", "-Wextra", "-Wno-unused-parameter",
)  # fmt: skip
_SOURCES: Final = ("engine.c", "refused.c")
_ZIP_DATE: Final = (1980, 1, 1, 0, 0, 0)


class Exported(NamedTuple):
    """What an export has made."""

    path: Path
    platform: str
    variables: int


def export(out: Path, model: str, prototype: str, version: int) -> Exported:
    """Write a unit for co-simulation; the same sources and compiler give the same bytes.

    Raises: ConfigError when the model has no export, there is no compiler, or `out` cannot be made
    """
    if model not in MODELS:
        raise ConfigError(f"--model {model}: accepted for a unit: {', '.join(MODELS)}")
    entries = _entries(model, prototype)
    identifier = f"fpeg_{model.replace('-', '_')}_{prototype}"
    header = _header(entries)
    sources = _read_sources(version)
    sources["variables.h"] = header
    token = _token(model, prototype, version, sources)
    folder = _folder(version)
    defines = [f"-DMODEL={model.upper().replace('-', '_')}", f"-DFMI_VERSION={version}"]
    defines.append(f'-DTOKEN="{token}"')
    names = [name for name in sources if name.endswith(".c")]
    parts: dict[str, bytes] = {
        "modelDescription.xml": describe_model(
            entries, version, name=f"{model}.{prototype}", identifier=identifier, token=token,
            sources=names,
        ),
        f"binaries/{folder}/{identifier}.so": _compile(sources, names, defines),
    }  # fmt: skip
    given = {"MODEL": model.upper().replace("-", "_"), "FMI_VERSION": str(version)}
    sources["variables.h"] = _defined(header, given | {"TOKEN": f'"{token}"'})
    if version > 2:
        parts["sources/buildDescription.xml"] = describe_build(identifier, names)
    parts |= {f"sources/{name}": text.encode() for name, text in sources.items()}
    _write(out, parts)
    return Exported(out, folder, len(entries))


def _entries(model: str, prototype: str) -> list[Entry]:
    """Every variable with its reference: parameters, inputs, outputs, then what counts."""
    config = PlantConfig.model_validate({"model": model, "prototype": prototype})
    engine = engine_of(config.resolved_prototype(), model, config.contact_restitution)
    own = [
        _own("moving_mass_kg", "kg", "moving mass", engine.mass_kg),
        _own("area_m2", "m2", "area of a piston", engine.area_m2),
        _own("half_stroke_m", "m", "half of the full stroke", engine.half_stroke_m),
        _own("contact_m", "m", "position at which a head is touched", engine.contact_m),
        _own("gamma", "1", "ratio of the heat capacities", engine.gamma),
        _own("p0_pa", "Pa", "pressure at mid-stroke", engine.p0_pa),
        _own("energy_j_kg", "J/kg", "energy released for a mass of fuel", engine.energy_j_kg),
        _own("restitution", "1", "speed kept at a contact", engine.restitution),
        _own("spark_window_s", "s", "longest time from spark to dead centre",
             config.spark_window_s),
    ]  # fmt: skip
    reals = [*own, *BEGINNING, *INPUTS, *(v for v in OUTPUTS if not v.whole)]
    wholes = [v for v in OUTPUTS if v.whole]
    entries = [Entry(variable, number) for number, variable in enumerate(reals, 1)]
    return entries + [Entry(v, number) for number, v in enumerate(wholes, _FIRST_INT)]


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


def _read_sources(version: int) -> dict[str, str]:
    folder = files("plant.fmu") / "source"
    names = ("engine.h", *_SOURCES, f"fmi{version}.c")
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


def _compile(sources: dict[str, str], names: list[str], defines: list[str]) -> bytes:
    """Compile and link.

    Raises: ConfigError when there is no compiler, or it fails
    """
    headers = Path(library().__file__).parent / "c-code"
    compiler = os.environ.get("CC", "cc")
    with tempfile.TemporaryDirectory(prefix="fmu-") as directory:
        for name, text in sources.items():
            Path(directory, name).write_text(text, encoding="utf-8")
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


def _write(out: Path, parts: dict[str, bytes]) -> None:
    try:
        with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as unit:
            for name, data in parts.items():
                unit.writestr(zipfile.ZipInfo(name, _ZIP_DATE), data, zipfile.ZIP_DEFLATED)
    except OSError as error:
        raise ConfigError(f"{out}: {error.strerror or error}") from None
