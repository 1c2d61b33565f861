"""Port injection: which stroke a mass burns in, and how much of it the wall keeps.

What is injected in a stroke goes in as the intake closes, early in the next one, and burns at the
end of that: at the dead centre after the one ahead, on the other side. Of a mass m a share X wets
the wall, and evaporates with the time constant tau. From closing to closing

    F' = a F + X b m,   m_in = (1 - a) F + (1 - X b) m,   a = exp(-T/tau), b = exp(-d/tau)

F the film as the intake closes, T since it closed last, d from the injection to the closing.
"""

from __future__ import annotations

import math
from typing import Final, final

from mypy_extensions import i64

from controller.observe.estimate import Motion
from controller.timing.injection import plan_injection, retime_injection
from controller.timing.plan import Plan, PlannedPulse, Timings
from hil.config.charge.injection import InjectorKnowledge
from hil.rounding import nearest
from hil.values import Value

_LEAST_M: Final = 1e-3


@final
class Port:
    """What is believed of the intake ports: section `injector`, read once for all ticks.

    closes_m: where an intake closes, in the direction of motion from mid-stroke
    """

    def __init__(self, config: InjectorKnowledge, half_stroke_m: float) -> None:
        self.share = config.film_share
        self.tau_ns = config.film_time_s * 1e9
        self.closes_m = half_stroke_m - config.intake_closes_m
        self.film_kg = config.film_kg or 0.0

    def closes_ns(self, tdc_m: float, stroke_s: float) -> i64:
        """From a dead centre to the closing, by  z = -X cos(pi t / T)."""
        share = -self.closes_m / max(tdc_m, _LEAST_M)
        return nearest(1e9 * stroke_s / math.pi * math.acos(min(max(share, -1.0), 1.0)))

    def kept(self, lasts_ns: i64) -> float:
        """What is left of a film after a time, as a share."""
        return math.exp(-float(lasts_ns) / self.tau_ns)


@final
class Film(Value):
    """Film of the left and the right port [kg] as the intake closed, and when that was [ns]."""

    __slots__ = ("kg", "shut_ns")

    def __init__(self, kg: tuple[float, float], shut_ns: tuple[i64, i64]) -> None:
        self.kg = kg
        self.shut_ns = shut_ns

    def evaporated_kg(self, port: Port, side: i64, shut_ns: i64) -> float:
        """What the film gives to the charge that the intake closes on then."""
        film_kg = self.kg[0] if side == 0 else self.kg[1]
        since_ns = self.shut_ns[0] if side == 0 else self.shut_ns[1]
        return film_kg * (1.0 - port.kept(shut_ns - since_ns))

    def fed(self, port: Port, side: i64, mass_kg: float, wets: float, shut_ns: i64) -> Film:
        """The film once the intake has closed on an injection of which a share has stayed."""
        film_kg = self.kg[0] if side == 0 else self.kg[1]
        left_kg = film_kg - self.evaporated_kg(port, side, shut_ns) + wets * mass_kg
        if side == 0:
            return Film((left_kg, self.kg[1]), (shut_ns, self.shut_ns[1]))
        return Film((self.kg[0], left_kg), (self.shut_ns[0], shut_ns))


def initial(port: Port, closes_ns: i64, stroke_ns: i64) -> Film:
    """The films of a settled motion that begins at the left dead centre."""
    return Film((port.film_kg, port.film_kg), (closes_ns - stroke_ns, closes_ns))


def _wets(port: Port, timings: Timings, pulse: PlannedPulse, shut_ns: i64) -> float:
    """Share of an injection that is on the wall as the intake closes: X b."""
    middle_ns = (pulse.open_ns + nearest(timings.dead_time_s * 1e9) + pulse.close_ns) // 2
    return port.share * port.kept(max(shut_ns - middle_ns, 0))


def plan(
    port: Port, timings: Timings, film: Film, before: Plan, motion: Motion, t_ns: i64,
    period_ns: i64, stroke_s: float, fuel_kg: float, shut_ns: i64,
) -> Plan:  # fmt: skip
    """Place the injection for the dead centre after the one ahead, at mid-stroke.

    Parameters: shut_ns : when the intake should close on it
    """
    side = 1 - motion.side_ahead
    about = plan_injection(timings, motion, t_ns, period_ns, stroke_s, fuel_kg)
    assert about.injection is not None
    evaporates_kg = film.evaporated_kg(port, side, shut_ns)
    mass_kg = max(fuel_kg - evaporates_kg, 0.0)
    mass_kg /= 1.0 - _wets(port, timings, about.injection, shut_ns)
    pulse = plan_injection(timings, motion, t_ns, period_ns, stroke_s, mass_kg).injection
    assert pulse is not None
    placed = PlannedPulse(side, pulse.open_ns, pulse.duration_ns)
    return Plan(placed, before.spark, before.fuel_kg, fuel_kg, before.work)


def retime(
    port: Port, timings: Timings, film: Film, before: Plan, motion: Motion, dead_centre_ns: i64,
    period_ns: i64, fuel_kg: float, shut_ns: i64,
) -> Plan:  # fmt: skip
    """Give an injection that may still be trimmed another fuel."""
    old = before.injection
    assert old is not None
    evaporates_kg = film.evaporated_kg(port, 1 - motion.side_ahead, shut_ns)
    goes_in = 1.0 - _wets(port, timings, old, shut_ns)
    mass_kg = max(fuel_kg - evaporates_kg, 0.0) / goes_in
    after = retime_injection(timings, before, dead_centre_ns, motion.t_ns, period_ns, mass_kg)
    if after is before:  # nothing can reach it any more
        return before
    fed_kg = fuel_kg if after.fuel_kg == mass_kg else evaporates_kg + goes_in * after.fuel_kg
    return Plan(after.injection, before.spark, before.fuel_kg, fed_kg, before.work)


def after_dead_centre(
    port: Port, timings: Timings, film: Film, done: Plan, motion: Motion, stroke_s: float
) -> Film:
    """The film, once the intake of the stroke that begins has closed on what was injected."""
    shut_ns = motion.dc_t_ns + port.closes_ns(motion.tdc_m, stroke_s)
    mass_kg, wets, pulse = 0.0, 0.0, done.injection
    if pulse is not None and pulse.channel == motion.side_ahead:
        flows_s = float(pulse.duration_ns) * 1e-9 - timings.dead_time_s
        mass_kg = timings.static_flow_kg_s * max(flows_s, 0.0)
        wets = _wets(port, timings, pulse, shut_ns)
    return film.fed(port, motion.side_ahead, mass_kg, wets, shut_ns)
