"""Stands in for libgpiod, as the guest has no chip: the lines are bytes of a file.

`told` says which process asked for them; both files are there beforehand.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from gpiod import line

PLACE = "/run/fpeg-lines"


class LineSettings:
    """How lines are to be driven."""

    def __init__(
        self, direction: line.Direction, output_value: line.Value, active_low: bool
    ) -> None:
        self.output_value = output_value


class Request:
    """Lines that one process holds."""

    def __init__(self) -> None:
        self._fd = os.open(f"{PLACE}/lines", os.O_WRONLY)

    def set_value(self, offset: int, value: line.Value) -> None:
        """Change one line."""
        os.pwrite(self._fd, b"1" if value is line.Value.ACTIVE else b"0", offset)

    def set_values(self, values: Mapping[int, line.Value]) -> None:
        """Change lines."""
        for offset, value in values.items():
            self.set_value(offset, value)

    def release(self) -> None:
        """Give the lines back as they are."""
        os.close(self._fd)


def request_lines(
    _chip: str, config: Mapping[tuple[int, ...], LineSettings], consumer: str
) -> Request:
    """Take the lines and set them as they are to be at first."""
    with Path(PLACE, "told").open("a") as told:
        told.write(f"{consumer}\n")
    request = Request()
    for offsets, settings in config.items():
        request.set_values(dict.fromkeys(offsets, settings.output_value))
    return request
