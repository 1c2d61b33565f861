"""`python -m bench.fmu.trial`: a unit loaded and stepped once, by a process that it may kill."""

from __future__ import annotations

import json
import math
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from hil.errors import ConfigError, HilError
from plant.engines.fmu.archive import open_archive
from plant.engines.fmu.contract import INPUTS
from plant.engines.fmu.unit import Unit

_STEP_S: Final = 0.001
_PATIENCE_S: Final = 60.0


def trial(file: Path, names: Mapping[str, str]) -> str:
    """Load and step a unit in a process of its own; return why it cannot, empty when it can."""
    command = [sys.executable, "-m", "bench.fmu.trial", str(file), json.dumps(dict(names))]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", timeout=_PATIENCE_S,
            stdin=subprocess.DEVNULL, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return f"{file}: a step takes more than {_PATIENCE_S:g} s"
    if done.returncode == 0:
        return ""
    if done.returncode < 0:
        return f"{file}: ends its process ({signal.Signals(-done.returncode).name})"
    lines = done.stderr.strip().splitlines() or [f"ends its process with {done.returncode}"]
    return " ".join(lines[-1].split())


def step_once(file: Path, names: Mapping[str, str]) -> None:
    """Load a unit, begin at rest, take one step.

    Raises: ConfigError, RunError with what does not work
    """
    unit = Unit(open_archive(file), names, {})
    inputs = [variable.start for variable in INPUTS]
    outputs = unit.start(inputs, 0.0, 0.0)
    unit.read_all()
    outputs |= unit.step(inputs, 0.0, _STEP_S)
    strange = [name for name, value in outputs.items() if not math.isfinite(value)]
    if strange:
        raise ConfigError(f"{file}: after a step {', '.join(strange)} is no finite number")


def main() -> int:
    """Try the unit that the arguments name."""
    try:
        step_once(Path(sys.argv[1]), json.loads(sys.argv[2]))
    except HilError as error:
        print(" ".join(str(error).split()), file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
