"""TTL lines of a GPIO chip by libgpiod: requested as outputs and low, given back low."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any, Final, Protocol

from hil.config.hardware import OutputsConfig
from hil.errors import ConfigError, MissingExtraError, RunError
from hil.wire.messages import CHANNELS

CONSUMER: Final = "fpeg-hil"
_NUMBERS: Final = {name: number for number, name in CHANNELS.items()}


class Lines(Protocol):
    """Lines by channel number."""

    channels: frozenset[int]

    def set(self, channel: int, high: bool, /) -> None:
        """Change one line.

        Raises: RunError when the device refuses
        """

    def all_low(self) -> None:
        """Change all lines to low."""

    def close(self) -> None:
        """Change all lines to low and give them back."""


class GpiodLines:
    """Lines of one chip.

    Raises: MissingExtraError without gpiod, ConfigError when chip or lines are not to be had
    """

    def __init__(self, config: OutputsConfig, request: Callable[..., Any] | None = None) -> None:
        gpiod = _library()
        self._high, self._low = gpiod.line.Value.ACTIVE, gpiod.line.Value.INACTIVE
        self._offsets = {_NUMBERS[name]: offset for name, offset in config.lines.items()}
        self.channels = frozenset(self._offsets)
        settings = gpiod.LineSettings(
            direction=gpiod.line.Direction.OUTPUT,
            output_value=self._low,
            active_low=config.active_low,
        )
        try:
            self._request = (request or gpiod.request_lines)(
                config.chip,
                config={tuple(self._offsets.values()): settings},
                consumer=CONSUMER,
            )
        except (OSError, ValueError) as error:
            offsets = ", ".join(map(str, self._offsets.values()))
            raise ConfigError(f"outputs: {config.chip}, lines {offsets}: {error}") from None

    def set(self, channel: int, high: bool, /) -> None:
        """Change one line.

        Raises: RunError when the device refuses
        """
        try:
            self._request.set_value(self._offsets[channel], self._high if high else self._low)
        except OSError as error:
            raise RunError(f"outputs: {CHANNELS[channel]}: {error}") from None

    def all_low(self) -> None:
        """Change all lines to low, as far as the device lets us."""
        with contextlib.suppress(OSError):
            self._request.set_values(dict.fromkeys(self._offsets.values(), self._low))

    def close(self) -> None:
        """Change all lines to low and give them back."""
        self.all_low()
        self._request.release()


def _library() -> Any:  # noqa: ANN401
    try:
        import gpiod  # noqa: PLC0415 - an extra, loaded where it is used
        import gpiod.line  # noqa: PLC0415
    except ImportError:
        raise MissingExtraError("gpiod", "gpio", "outputs.chip") from None
    return gpiod
