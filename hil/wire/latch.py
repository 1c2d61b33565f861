"""The latch of the safe state: what lets lines and machine act again after a silence.

A controller leaves its own safe state by an operator's start alone. So whoever was left without
answers waits until it has heard the controller at rest, in a mode in which nothing may fire, and
then in one in which something may: between the two lies the start.
"""

from __future__ import annotations

from typing import Final

RELEASED: Final = 0
LATCHED: Final = 1
AT_REST: Final = 2
"""Latched still; the controller has been heard in a mode that fires nothing."""


def after_answer(latch: int, fires: bool) -> int:
    """The latch after an answer whose mode lets a line be high, or does not."""
    if latch == RELEASED:
        return RELEASED
    if not fires:
        return AT_REST
    return RELEASED if latch == AT_REST else LATCHED
