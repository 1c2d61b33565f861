"""The picture of `hil bench soak`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from bench.report.style import canvas, style
from hil.errors import MissingExtraError


def write_picture(told: dict[str, Any], path: Path) -> None:
    """Draw growth of memory, handles and the age of samples over the run.

    Raises: MissingExtraError without matplotlib
    """
    try:
        with style():
            figure, (memory, handles, age) = canvas(9.0, 8.0, rows=3)
            for name, found in told["processes"].items():
                minutes = [t_s / 60.0 for t_s in found["t_s"]]
                memory.plot(minutes, [b / 2**20 for b in found["resident_bytes"]], label=name)
                handles.plot(minutes, found["handles"], label=name)
            ages = told["ages"]
            minutes = [t_s / 60.0 for t_s in ages["t_s"]]
            age.plot(minutes, ages["sample_us"], label="sample, against the first")
            memory.set(ylabel="resident [MiB]")
            memory.set_title(f"{told['minutes']:g} minutes, {told['rate_hz']} Hz over "
                             f"{told['link']}")  # fmt: skip
            handles.set(ylabel="open handles")
            age.set(xlabel="minutes", ylabel="age [µs]", xlim=memory.get_xlim())
            for axes in (memory, handles, age):
                axes.legend()
            figure.savefig(path, dpi=130)
    except ImportError:
        raise MissingExtraError("matplotlib", "desk", "a picture") from None
