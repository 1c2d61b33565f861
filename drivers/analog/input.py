"""Analogue inputs: a small port, and the Linux industrial I/O subsystem behind it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple, Protocol

from hil.errors import ConfigError, RunError

IIO_ROOT: Final = Path("/sys/bus/iio/devices")


class AnalogInput(Protocol):
    """Voltages of some channels, sampled together as nearly as the device can."""

    def read_v(self) -> tuple[float, ...]:
        """Return one voltage a channel [V], in the order in which they were given.

        Raises: RunError when the device fails
        """

    def close(self) -> None:
        """Give the device back."""


class Calibration(NamedTuple):
    """From a voltage to a quantity: y = gain u + offset, valid where low <= u <= high [V]."""

    gain: float
    offset: float = 0.0
    low_v: float = 0.0
    high_v: float = 5.0

    def apply(self, u: float) -> float:
        """Return the quantity, nan for a voltage that no sound sensor gives (a broken wire)."""
        return self.gain * u + self.offset if self.low_v <= u <= self.high_v else float("nan")


class IioInput:
    """Channels of one IIO device: u = (raw + offset) scale / 1000, in the kernel's millivolts.

    Raises: ConfigError when there is no such device or channel
    """

    def __init__(self, device: str, channels: Sequence[int], root: Path = IIO_ROOT) -> None:
        folder = root / device
        self._files: list[int] = []
        self._scales: list[tuple[float, float]] = []
        try:
            for channel in channels:
                name = f"in_voltage{channel}"
                self._files.append(os.open(folder / f"{name}_raw", os.O_RDONLY | os.O_CLOEXEC))
                self._scales.append((_number(folder, name, "offset", 0.0),
                                     _number(folder, name, "scale", None) * 1e-3))  # fmt: skip
        except (OSError, ValueError) as error:
            self.close()
            raise ConfigError(
                f"analogue input {folder}, channels {list(channels)}: {error}"
            ) from None

    def read_v(self) -> tuple[float, ...]:
        """Return one voltage a channel [V].

        Raises: RunError when the device fails
        """
        try:
            raw = [int(os.pread(file, 32, 0)) for file in self._files]
        except (OSError, ValueError) as error:
            raise RunError(f"analogue input: {error}") from None
        return tuple((r + o) * s for r, (o, s) in zip(raw, self._scales, strict=True))

    def close(self) -> None:
        """Give the device back; a second call does nothing."""
        while self._files:
            os.close(self._files.pop())


def _number(folder: Path, channel: str, what: str, default: float | None) -> float:
    """Read a channel's own attribute, or the one that all share."""
    for name in (f"{channel}_{what}", f"in_voltage_{what}"):
        if (folder / name).exists():
            return float((folder / name).read_text())
    if default is None:
        raise ValueError(f"{channel}_{what} is missing")
    return default
