"""cyclictest of rt-tests: how punctual the machine lets anybody be."""

from __future__ import annotations

import re
import shutil
import subprocess
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hil.errors import RunError

HINT: Final = "apt install rt-tests"
_LARGEST_US: Final = 20_000
_ROW: Final = re.compile(r"^(\d+)\s+(\d+)", re.MULTILINE)
_OVERFLOWS: Final = re.compile(r"^# Histogram Overflows:\s+(\d+)", re.MULTILINE)


def installed() -> bool:
    """Whether it is there."""
    return shutil.which("cyclictest") is not None


def measure(rate_hz: int, seconds: float, priority: int) -> NDArray[np.float64]:
    """Run it at a rate and priority; return the lateness of each cycle [us].

    Raises: RunError when it fails
    """
    words = ["cyclictest", "--quiet", "--mlockall", f"--priority={priority}",
             f"--interval={round(1e6 / rate_hz)}", f"--loops={round(seconds * rate_hz)}",
             f"--histogram={_LARGEST_US}"]  # fmt: skip
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        last = (done.stderr or done.stdout).strip().splitlines()[-1:]
        raise RunError(f"cyclictest: {' '.join(last) or done.returncode}")
    return parse(done.stdout)


def parse(text: str) -> NDArray[np.float64]:
    """Return the lateness of each cycle from the histogram it prints [us]."""
    found = [(int(late_us), int(count)) for late_us, count in _ROW.findall(text)]
    rows = np.array(found, dtype=np.int64).reshape(-1, 2)
    beyond = sum(int(count) for count in _OVERFLOWS.findall(text))
    within = np.repeat(rows[:, 0], rows[:, 1])
    return np.concatenate([within, np.full(beyond, _LARGEST_US)]).astype(float)
