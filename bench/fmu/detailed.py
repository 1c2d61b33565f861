"""What a unit of a detailed engine is made of: its arrays as a header, its step as an object file.

The step is not written again in C: numba compiles the plant's own, for any processor of this kind.
"""

from __future__ import annotations

import platform
from importlib import import_module
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hil.config.detailed import Calibration
from hil.config.plant import PlantConfig
from plant.engines.detailed import layout as at
from plant.engines.detailed.engine import Motion, at_rest, begin, engine_of
from plant.engines.detailed.kernel import electric_power
from plant.engines.detailed.settle import calibration_of, settle
from plant.engines.detailed.solver import advance, scratch

SYMBOL: Final = "fpeg_advance"
_CPU: Final = {"x86_64": "x86-64", "aarch64": "generic"}
_INDICES: Final = (
    "TIME_UP", "FAILED", "X", "V", "U", "GAS_STRIDE", "LOAD", "FORCE", "LOAD_SCALE", "DIRECTION",
    "DC_T", "DC_X", "CONTACTS", "CYL", "CYL_STRIDE", "SPARK_T", "Q_IN", "GAMMA", "CYL_P",
    "CYL_P_STRIDE", "SIGN", "AREA", "LENGTH",
)  # fmt: skip


def header(config: PlantConfig) -> str:
    """arrays.h: constants, programme, and the states in which a run begins.

    Raises: ConfigError when the model has no calibration for the prototype
    """
    c = calibration_of(config)
    engine = engine_of(c, self_timed=False)
    rest = at_rest(engine)
    settled = _settled(c)
    rows, columns, _ = engine.programme.shape
    numbers: dict[str, Any] = {
        "N_Y": at.N_Y, "N_D": at.N_D, "N_RECORD": at.N_REC, "WORK": scratch().size,
        "PROGRAMME_ROWS": rows, "PROGRAMME_COLUMNS": columns,
        "PROGRAMMED_DRIVE": int(c.cycle.kind == "four-stroke"),
        "NOMINAL_LOAD": repr(c.machine.load_coefficient_n_s_m),
        "HEATING_VALUE": repr(c.heat.heating_value_j_kg),
        "LEAST_PRESSURE": repr(c.cycle.ignition_least_pa),
    }  # fmt: skip
    numbers |= {f"AT_{name}": getattr(at, name) for name in _INDICES}
    arrays = {
        "CONSTANTS": engine.p, "PROGRAMME": engine.programme, "REST_Y": rest.y, "REST_D": rest.d,
        "SETTLED_Y": settled.y, "SETTLED_D": settled.d,
    }  # fmt: skip
    lines = ["/* Written by the export: the engine's arrays (plant/engines/detailed/layout.py). */"]
    lines += [f"#define {name} {value}" for name, value in numbers.items()]
    lines += ["#ifdef ENGINE_ARRAYS"]
    lines += [_array(name, values) for name, values in arrays.items()]
    return "\n".join([*lines, "#endif", ""])


def _settled(c: Calibration) -> Motion:
    """Return the calibration's own settled running at the left dead centre, as a run begins."""
    found = settle(c, nominal_fuel_kg(c), c.machine.load_coefficient_n_s_m)
    motion = Motion(found.y.copy(), found.d.copy(), np.zeros((8, at.N_REC)))
    begin(engine_of(c, self_timed=False), motion, 1)
    return motion


def nominal_fuel_kg(c: Calibration) -> float:
    """Fuel of the calibration's charge."""
    return c.heat.energy_j / c.heat.heating_value_j_kg


def _array(name: str, values: NDArray[np.float64]) -> str:
    text = ", ".join(repr(float(value)) for value in values.ravel())
    return f"static const double {name}[{values.size}] = {{{text}}};"


def step_object() -> bytes:
    """Compile the plant's step into a relocatable object with one C function."""
    llvm: Any = import_module("llvmlite.binding")
    numba: Any = import_module("numba")
    carray, types = numba.carray, numba.types
    reals = types.CPointer(types.float64)
    n_p, n_d, n_y, n_rec = at.N_P, at.N_D, at.N_Y, at.N_REC
    work_shape = scratch().shape

    @numba.cfunc(
        types.int64(reals, reals, reals, reals, types.intp, types.intp, reals, reals, types.intp,
                    types.float64, types.int64),
        error_model="numpy",
    )  # fmt: skip
    def unit(p, d, y, programme, rows, columns, work, record, records, t_end, stop):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        constants, now, state = carray(p, (n_p,)), carray(d, (n_d,)), carray(y, (n_y,))
        told = carray(record, (records, n_rec))
        if stop < 0:
            told[0, 0] = electric_power(constants, now, state, carray(work, work_shape)[7])
            return 0
        return advance(
            constants, now, state, carray(programme, (rows, columns, 3)),
            carray(work, work_shape), told, t_end, stop != 0,
        )  # fmt: skip

    compiled = unit._library  # noqa: SLF001  # numba has no public way to the code
    text = compiled.get_llvm_str().replace(unit.native_name, SYMBOL)
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=_CPU[platform.machine()], features="", opt=2, reloc="pic", codemodel="default"
    )
    return bytes(machine.emit_object(llvm.parse_assembly(text)))
