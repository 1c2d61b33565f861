"""The orders of a scenario, each at its tick."""

from __future__ import annotations

from typing import final

from mypy_extensions import i64

from hil.values import NEVER
from hil.wire.commands import OperatorCommand


@final
class Schedule:
    """What is still to be ordered; `next_tick` is that of the next order, NEVER after the last."""

    def __init__(self, orders: dict[int, OperatorCommand]) -> None:
        self.next_tick: i64 = min(orders, default=NEVER)
        self._orders = orders

    def pass_over(self, before: i64) -> None:
        """Leave out what was due before a tick."""
        self.next_tick = min((tick for tick in self._orders if tick >= before), default=NEVER)

    def due(self, *, may_start: bool) -> OperatorCommand | None:
        """Take the next order, which may be late: the first sample can be later than it.

        A start waits for samples, as an operator would.
        """
        order = self._orders[self.next_tick]
        if order.kind == "start" and not may_start:
            return None
        self.pass_over(self.next_tick + 1)
        return order
