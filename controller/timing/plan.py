"""The edges planned for the dead centre ahead, on the plant's clock."""

from __future__ import annotations

from typing import Final, final

from hil.values import Value

US: Final = 1000


@final
class PlannedPulse(Value):
    """One pulse of a TTL line on the plant's clock [ns], on whole microseconds."""

    __slots__ = ("channel", "open_ns", "duration_ns")

    def __init__(self, channel: int, open_ns: int, duration_ns: int) -> None:
        self.channel = channel
        self.open_ns = open_ns
        self.duration_ns = duration_ns

    @property
    def close_ns(self) -> int:
        """The instant at which the line goes low [ns]."""
        return self.open_ns + self.duration_ns


@final
class Plan(Value):
    """The edges for the dead centre that ends this stroke; `fuel_kg` is what it will burn."""

    __slots__ = ("injection", "spark", "fuel_kg")

    def __init__(
        self, injection: PlannedPulse | None = None, spark: PlannedPulse | None = None,
        fuel_kg: float = 0.0,
    ) -> None:  # fmt: skip
        self.injection = injection
        self.spark = spark
        self.fuel_kg = fuel_kg


NO_PLAN: Final = Plan()


def whole_us(t_ns: int) -> int:
    """The next whole microsecond [ns]."""
    return -(-t_ns // US) * US
