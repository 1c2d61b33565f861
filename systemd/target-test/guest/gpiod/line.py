"""The words that libgpiod has for lines."""

from __future__ import annotations

from enum import Enum


class Direction(Enum):
    """Which way a line goes."""

    OUTPUT = 1


class Value(Enum):
    """What a line is set to."""

    INACTIVE = 0
    ACTIVE = 1
