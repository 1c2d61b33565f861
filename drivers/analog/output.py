"""Analogue outputs: the orders to machine and throttle as voltages of IIO channels.

u = gain y + offset, within the channel's own limits; raw = 1000 u / scale - offset_raw, in the
kernel's millivolts. Where nothing is ordered any more every channel has its voltage of rest.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import Final

from drivers.analog.input import IIO_ROOT
from hil.config.hardware import AnalogOutputsConfig, VoltageConfig
from hil.errors import ConfigError, RunError
from hil.wire.messages import GENERATOR, MOTOR, MachineCommand

NAMES: Final = ("force_n", "load_coefficient_n_s_m", "throttle")


class _Channel:
    """One channel that is written when its value changes."""

    def __init__(self, folder: Path, config: VoltageConfig) -> None:
        name = f"out_voltage{config.channel}"
        self._config = config
        self._file = os.open(folder / f"{name}_raw", os.O_WRONLY | os.O_CLOEXEC)
        self._scale_v = _number(folder, name, "scale", None) * 1e-3
        self._offset = _number(folder, name, "offset", 0.0)
        self._raw: int | None = None

    def write(self, value: float) -> None:
        """Put out the voltage of a value."""
        c = self._config
        self._put(min(max(c.gain * value + c.offset, c.low_v), c.high_v))

    def rest(self) -> None:
        """Put out the voltage of rest."""
        self._put(self._config.rest_v)

    def _put(self, u: float) -> None:
        raw = round(u / self._scale_v - self._offset)
        if raw != self._raw:
            os.pwrite(self._file, f"{raw}\n".encode(), 0)
            self._raw = raw

    def close(self) -> None:
        os.close(self._file)


class AnalogOutputs:
    """Machine force, load coefficient and throttle on the channels that are configured.

    Raises: ConfigError when there is no such device or channel
    """

    def __init__(self, config: AnalogOutputsConfig, root: Path = IIO_ROOT) -> None:
        self._channels: dict[str, _Channel] = {}
        if config.device is None:
            return
        folder = root / config.device
        for name in NAMES:
            channel: VoltageConfig | None = getattr(config, name)
            if channel is None:
                continue
            try:
                self._channels[name] = _Channel(folder, channel)
            except (OSError, ValueError) as error:
                self.close()
                raise ConfigError(f"outputs.analog.{name}: {folder}: {error}") from None
        self.rest()

    def write(self, order: MachineCommand) -> None:
        """Put out an order: a force where the machine motors, a load where it generates.

        Raises: RunError when the device fails
        """
        values = {
            "force_n": order.force_n if order.mode == MOTOR else 0.0,
            "load_coefficient_n_s_m": (
                order.load_coefficient_n_s_m if order.mode == GENERATOR else 0.0
            ),
            "throttle": order.throttle,
        }
        try:
            for name, channel in self._channels.items():
                channel.write(values[name])
        except OSError as error:
            raise RunError(f"analogue output: {error}") from None

    def rest(self) -> None:
        """Put every channel at rest.

        Raises: RunError when the device fails
        """
        try:
            for channel in self._channels.values():
                channel.rest()
        except OSError as error:
            raise RunError(f"analogue output: {error}") from None

    def close(self) -> None:
        """Leave every channel at rest, and give the device back."""
        for channel in self._channels.values():
            with contextlib.suppress(OSError):  # of a device that has gone
                channel.rest()
            channel.close()
        self._channels.clear()


def _number(folder: Path, channel: str, what: str, default: float | None) -> float:
    """Read a channel's own attribute, or the one that all share."""
    for name in (f"{channel}_{what}", f"out_voltage_{what}"):
        if (folder / name).exists():
            return float((folder / name).read_text())
    if default is None:
        raise ValueError(f"{channel}_{what} is missing")
    return default
