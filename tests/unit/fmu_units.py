"""Units for the tests: exports of ours, and one that another hand could have made."""

from __future__ import annotations

import atexit
import shutil
import subprocess
import zipfile
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from tempfile import mkdtemp

import fmpy

from bench.fmu.export import export

MODELS = ("closed-form", "harmonic", "rectangular", "nonlinear")
FOREIGN_NAMES = {
    "machine_force_n": "motor_force",
    "load_coefficient_n_s_m": "brake",
    "fuel_left_kg": "fuel_a",
    "fuel_right_kg": "fuel_b",
    "spark_left_s": "spark_a",
    "spark_right_s": "spark_b",
    "x_m": "piston_position",
    "v_m_s": "piston_speed",
}
_STARTS = {"spark_a": -1.0, "spark_b": -1.0}
_UNITS = {"piston_position": "mm", "piston_speed": "mm/s"}
_HERE = Path(__file__).parent
_TOKEN = "{foreign}"


@lru_cache
def folder() -> Path:
    """One directory for all units of a test session."""
    directory = mkdtemp(prefix="fmu-tests-")
    atexit.register(shutil.rmtree, directory, ignore_errors=True)
    return Path(directory)


@lru_cache
def ours(model: str, version: int, prototype: str = "nu") -> Path:
    """Export once a session."""
    path = folder() / f"{model}-{prototype}-{version}.fmu"
    return path if path.exists() else export(path, model, prototype, version).path


@lru_cache
def foreign(version: int) -> Path:
    """Build the unit of another hand: its names, millimetres, a fixed step, no state to be had."""
    names = list(FOREIGN_NAMES.values())
    text = _foreign_two(names) if version == 2 else _foreign_three(names)
    place = fmpy.platform if version == 2 else fmpy.platform_tuple
    path = folder() / f"foreign{version}.fmu"
    with zipfile.ZipFile(path, "w") as unit:
        unit.writestr("modelDescription.xml", text)
        unit.writestr(f"binaries/{place}/foreign.so", _foreign_binary(names, version))
    return path


def _foreign_binary(names: list[str], version: int) -> bytes:
    source = files("plant.engines.fmu") / "source"
    directory = folder() / f"build{version}"
    shutil.rmtree(directory, ignore_errors=True)
    directory.mkdir()
    for name in ("engine.h", "refused.c", f"fmi{version}.c"):
        (directory / name).write_text((source / name).read_text())
    shutil.copy(_HERE / "foreign_unit" / "engine.c", directory)
    enum = "".join(f"{name.upper()} = {n}, " for n, name in enumerate(names, 1))
    starts = ", ".join(["0.0", *(str(_STARTS.get(name, 0.0)) for name in names)])
    (directory / "variables.h").write_text(
        f"enum {{ TIME, {enum} N_REALS, FIRST_OUTPUT = 7, FIRST_INT = 100, N_INTS = 1 }};\n"
        f"#define REAL_STARTS {{ {starts} }}\n"
    )
    headers = Path(fmpy.__file__).parent / "c-code"
    defines = [f"-DFMI_VERSION={version}", f'-DTOKEN="{_TOKEN}"']
    sources = ["engine.c", "refused.c", f"fmi{version}.c"]
    subprocess.run(
        ["cc", "-std=c99", "-O2", "-fPIC", "-shared", f"-I{headers}", *defines, *sources,
         "-o", "foreign.so", "-lm"],
        cwd=directory, check=True,
    )  # fmt: skip
    return (directory / "foreign.so").read_bytes()


def _causality(name: str) -> str:
    return "output" if name in _UNITS else "input"


def _foreign_two(names: list[str]) -> str:
    lines = []
    for n, name in enumerate(names, 1):
        start = f' start="{_STARTS.get(name, 0.0)}"' if name not in _UNITS else ""
        unit = f' unit="{_UNITS[name]}"' if name in _UNITS else ""
        lines.append(
            f'<ScalarVariable name="{name}" valueReference="{n}" causality="{_causality(name)}"'
            f' variability="continuous"><Real{start}{unit}/></ScalarVariable>'
        )
    unknown = '<Unknown index="7"/><Unknown index="8"/>'
    return (
        f'<?xml version="1.0"?><fmiModelDescription fmiVersion="2.0" modelName="foreign" '
        f'guid="{_TOKEN}"><CoSimulation modelIdentifier="foreign"/>{_UNIT_DEFINITIONS}'
        f"<ModelVariables>{''.join(lines)}</ModelVariables><ModelStructure>"
        f"<Outputs>{unknown}</Outputs><InitialUnknowns>{unknown}</InitialUnknowns>"
        f"</ModelStructure></fmiModelDescription>"
    )


def _foreign_three(names: list[str]) -> str:
    lines = ['<Float64 name="time" valueReference="0" causality="independent" '
             'variability="continuous"/>']  # fmt: skip
    for n, name in enumerate(names, 1):
        start = f' start="{_STARTS.get(name, 0.0)}"' if name not in _UNITS else ""
        unit = f' unit="{_UNITS[name]}"' if name in _UNITS else ""
        lines.append(
            f'<Float64 name="{name}" valueReference="{n}" causality="{_causality(name)}"'
            f' variability="continuous"{start}{unit}/>'
        )
    known = "".join(f'<{k} valueReference="{n}"/>' for k in _KINDS for n in (7, 8))
    return (
        f'<?xml version="1.0"?><fmiModelDescription fmiVersion="3.0" modelName="foreign" '
        f'instantiationToken="{_TOKEN}"><CoSimulation modelIdentifier="foreign"/>'
        f"{_UNIT_DEFINITIONS}<ModelVariables>{''.join(lines)}</ModelVariables>"
        f"<ModelStructure>{known}</ModelStructure></fmiModelDescription>"
    )


_KINDS = ("Output", "InitialUnknown")
_UNIT_DEFINITIONS = (
    '<UnitDefinitions><Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit>'
    '<Unit name="mm/s"><BaseUnit m="1" s="-1" factor="0.001"/></Unit></UnitDefinitions>'
)


def changed(path: Path, name: str, replacements: dict[str, str]) -> Path:
    """Copy a unit with its description changed, each text found at least once."""
    out = folder() / name
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(out, "w") as new:
        for entry in old.namelist():
            data = old.read(entry)
            if entry == "modelDescription.xml":
                text = data.decode()
                for this, that in replacements.items():
                    assert this in text, this
                    text = text.replace(this, that)
                data = text.encode()
            new.writestr(entry, data)
    return out


def renamed(path: Path, name: str, this: str, that: str) -> Path:
    """Copy a unit with a folder of it renamed."""
    out = folder() / name
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(out, "w") as new:
        for entry in old.namelist():
            new.writestr(entry.replace(this, that), old.read(entry))
    return out
