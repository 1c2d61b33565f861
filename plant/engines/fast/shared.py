"""The numbers that the C sources of an exported unit share with these models: constants.h."""

from __future__ import annotations

from types import ModuleType
from typing import Final

from hil import roots
from plant.engines.fast import linear, model, nonlinear

_SHARED: Final[tuple[tuple[ModuleType, tuple[str, ...]], ...]] = (
    (linear, (
        "NO_STOP", "DEAD_CENTRE", "CONTACT", "UNDERDAMPED", "CRITICAL", "OVERDAMPED",
        "UNDAMPED_BELOW_N_S_M", "CRITICAL_BAND",
    )),
    (nonlinear, (
        "STEP_PER_GAP_S_M", "MAX_STEP_S", "GAP_SHARE", "MIN_STEP_S", "STEP_TOLERANCE_S",
    )),
    (roots, ("TIME_TOLERANCE_S", "MOST_ITERATIONS")),
    (model, ("REST_M", "REST_M_S", "NEAREST_M", "MOST_PARTS")),
)  # fmt: skip


def header() -> str:
    """Return constants.h."""
    lines = ["/* Written by the export from plant/engines/fast. */"]
    for module, names in _SHARED:
        lines += [f"#define {name} {getattr(module, name)!r}" for name in names]
    return "\n".join([*lines, ""])
