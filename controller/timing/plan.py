"""The edges planned for the dead centre ahead, on the plant's clock."""

from __future__ import annotations

from typing import Final, final

from mypy_extensions import i64

from hil.config.controller import ControllerConfig
from hil.values import Value

US: Final = 1000


@final
class Timings:
    """Sections `timing` and `injector` of the configuration, read once for all ticks."""

    def __init__(self, config: ControllerConfig) -> None:
        timing, injector = config.timing, config.injector
        self.spark_position_m = timing.spark_position_m
        self.fires = timing.fires
        self.spark_advance_s = timing.spark_advance_s
        self.spark_trim = timing.spark_trim and len(timing.spark_lead_s) > 1
        self.leads_s, self.factors = timing.spark_lead_s, timing.spark_factor
        self.spark_duration_s = timing.spark_duration_s
        self.spark_ahead_s = timing.spark_ahead_s
        self.injection_lead_ticks: i64 = timing.injection_lead_ticks
        self.injection_margin_s = timing.injection_margin_s
        self.act_ticks: i64 = timing.act_ticks
        self.trim_reserve = timing.trim_reserve
        self.trim_margin_s = timing.trim_margin_s
        self.static_flow_kg_s = injector.static_flow_kg_s
        self.dead_time_s = injector.dead_time_s

    def lead_for(self, work: float) -> tuple[float, float]:
        """The lead of the spark with which a charge does so much of its planned work, or nearest.

        Of the rising side of the map, up to the most work. Returns: lead [s], and that work
        """
        leads, factors = self.leads_s, self.factors
        if work <= factors[0]:
            return leads[0], factors[0]
        for n in range(len(leads) - 1):
            low, high = factors[n], factors[n + 1]
            if high <= low:
                return leads[n], low
            if work <= high:
                return leads[n] + (work - low) / (high - low) * (leads[n + 1] - leads[n]), work
        return leads[-1], factors[-1]

    def fire(self, stroke: i64) -> bool:
        """Whether a stroke ends in a combustion; one of a four-stroke gas exchange does not."""
        return self.fires[stroke % len(self.fires)]


@final
class PlannedPulse(Value):
    """One pulse of a TTL line on the plant's clock [ns], on whole microseconds."""

    __slots__ = ("channel", "open_ns", "duration_ns")

    def __init__(self, channel: i64, open_ns: i64, duration_ns: i64) -> None:
        self.channel = channel
        self.open_ns = open_ns
        self.duration_ns = duration_ns

    @property
    def close_ns(self) -> i64:
        """The instant at which the line goes low [ns]."""
        return self.open_ns + self.duration_ns


@final
class Plan(Value):
    """The edges of a stroke; `fuel_kg` is what the dead centre that ends it will burn.

    later_kg: what the injection is for, where it burns at the dead centre after that; below 0 where
        it burns at the dead centre ahead
    work: of that fuel by the spark's place, as a share of its planned one
    """

    __slots__ = ("injection", "spark", "fuel_kg", "later_kg", "work")

    def __init__(
        self, injection: PlannedPulse | None = None, spark: PlannedPulse | None = None,
        fuel_kg: float = 0.0, later_kg: float = -1.0, work: float = 1.0,
    ) -> None:  # fmt: skip
        self.injection = injection
        self.spark = spark
        self.fuel_kg = fuel_kg
        self.later_kg = later_kg
        self.work = work

    @property
    def asked_kg(self) -> float:
        """The fuel that its injection is for."""
        return self.fuel_kg if self.later_kg < 0.0 else self.later_kg

    @property
    def is_set(self) -> bool:
        """Whether there is fuel in it, to be injected or to be lit."""
        return self.fuel_kg > 0.0 or self.later_kg > 0.0

    @property
    def successor(self) -> Plan:
        """The plan that a dead centre begins with: what has been injected already is in it."""
        return NO_PLAN if self.later_kg < 0.0 else Plan(None, None, self.later_kg, 0.0)


NO_PLAN: Final = Plan()


def whole_us(t_ns: i64) -> i64:
    """The next whole microsecond [ns]."""
    return -(-t_ns // US) * US
