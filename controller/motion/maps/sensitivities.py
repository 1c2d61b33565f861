"""The map of sensitivities: a settled stroke, and how it answers to small changes.

X_end = X + a (X_start - X) + b ln(q/q0) + d ln(c/c0)

of a whole stroke, and from a station z along it

X_end = X + S_v (v - v(z)) + S_q ln(q/q0) + S_c ln(c/c0)

and its duration likewise. All are derivatives of the engine itself, whatever it is
(`hil engine sensitivities`); near the settled motion they are exact.
"""

from __future__ import annotations

import math
from typing import Final, final

from mypy_extensions import i64

from controller.motion.maps.stroke_map import StrokeMap
from hil.config.motion.stroke_map import Effects, SensitivitiesConfig

_LEAST: Final = 0.2
_MOST: Final = 3.0
"""Shares of the settled fuel and load beyond which their logarithms are held."""
_BEYOND: Final = 0.7
"""Of what the derivatives add to the ln of the time left, the most that is believed."""


def _ln(share: float) -> float:
    return math.log(min(max(share, _LEAST), _MOST))


@final
class _Gain:
    """What a figure of a whole stroke gains by start, ln fuel and ln load."""

    def __init__(self, effects: Effects) -> None:
        self.start: float = effects.start
        self.fuel: float = effects.fuel
        self.load: float = effects.load

    def of(self, start_m: float, fuel: float, load: float) -> float:
        return self.start * start_m + self.fuel * fuel + self.load * load


@final
class _Station:
    """One place along the settled stroke; `energy` is v^2 / 2, `rise` its slope over z."""

    def __init__(self, config: SensitivitiesConfig, i: int) -> None:
        s = config.stations
        self.z: float = s.z_m[i]
        self.v: float = s.v_m_s[i]
        self.left_s: float = s.left_s[i]
        self.pull: float = s.pull_m_s2[i]
        self.pull_by_fuel: float = s.pull_by_fuel[i]
        self.end_by_v: float = s.end_by_v[i]
        self.end_by_fuel: float = s.end_by_fuel[i]
        self.end_by_load: float = s.end_by_load[i]
        self.left_by_v: float = s.left_by_v[i]
        self.left_by_fuel: float = s.left_by_fuel[i]
        self.left_by_load: float = s.left_by_load[i]
        self.energy: float = 0.5 * self.v * self.v
        self.rise: float = self.pull - config.load_n_s_m / config.mass_kg * self.v


@final
class Table:
    """Section `sensitivities` of the configuration, read once for all ticks."""

    def __init__(self, config: SensitivitiesConfig) -> None:
        self.mass_kg: float = config.mass_kg
        self.tdc_m: float = config.tdc_m
        self.fuel_kg: float = config.fuel_kg
        self.load_n_s_m: float = config.load_n_s_m
        self.stroke_s: float = config.stroke_s
        self.v_mid_m_s: float = config.v_mid_m_s
        self.mid_s: float = config.mid_s
        self.end = _Gain(config.end)
        self.duration = _Gain(config.duration)
        self.at_mid = _Gain(config.speed)
        self.passing = _Gain(config.passing)
        self.stations = [_Station(config, i) for i in range(len(config.stations.z_m))]
        last = self.stations[-1]
        self.braking_m_s2: float = last.energy / max(config.tdc_m - last.z, 1e-5)

    def energy_at(self, z: float) -> float:
        """v^2 / 2 of the settled stroke at z, held beyond the stations [m2/s2]."""
        i, s = self._place(z)
        a, b = self.stations[i], self.stations[i + 1]
        return _hermite(s, b.z - a.z, a.energy, a.rise, b.energy, b.rise)

    def left_at(self, z: float) -> float:
        """Time that the settled stroke has left at z [s]."""
        i, s = self._place(z)
        a, b = self.stations[i], self.stations[i + 1]
        return _hermite(s, b.z - a.z, a.left_s, -1.0 / a.v, b.left_s, -1.0 / b.v)

    def left_behind(self, z: float) -> float:
        """Time that the settled stroke has left at z, behind the last station too [s]."""
        last = self.stations[-1]
        if z <= last.z:
            return self.left_at(z)
        short_m = max(self.tdc_m - z, 0.0)
        return last.left_s * math.sqrt(short_m / max(self.tdc_m - last.z, 1e-5))

    def end_m(self, z: float, v: float, fuel: float, load: float) -> float:
        """Where a stroke ends that is at z with the speed v, by ln fuel and ln load [m]."""
        i, s = self._place(z)
        a, b = self.stations[i], self.stations[i + 1]
        r, energy = 1.0 - s, self.energy_at(z)
        # Of the energy, in which the way that is left is more nearly linear than in the speed.
        dv = (0.5 * v * v - energy) / math.sqrt(2.0 * energy)
        return (
            self.tdc_m
            + (r * a.end_by_v + s * b.end_by_v) * dv
            + (r * a.end_by_fuel + s * b.end_by_fuel) * fuel
            + (r * a.end_by_load + s * b.end_by_load) * load
        )

    def left_s(self, z: float, v: float, fuel: float, load: float, end_m: float) -> float:
        """How long it takes to that end [s].

        In proportion to the way and to 1 / v; ln of what the derivatives say beyond that.
        """
        i, s = self._place(z)
        a, b = self.stations[i], self.stations[i + 1]
        r, v0, left_s = 1.0 - s, math.sqrt(2.0 * self.energy_at(z)), self.left_at(z)
        way_m = max(self.tdc_m - z, 1e-5)
        by_v = (r * a.left_by_v + s * b.left_by_v) / left_s
        by_v -= (r * a.end_by_v + s * b.end_by_v) / way_m - 1.0 / v0
        by_fuel = (r * a.left_by_fuel + s * b.left_by_fuel) / left_s
        by_fuel -= (r * a.end_by_fuel + s * b.end_by_fuel) / way_m
        by_load = (r * a.left_by_load + s * b.left_by_load) / left_s
        by_load -= (r * a.end_by_load + s * b.end_by_load) / way_m
        beyond = by_v * (v - v0) + by_fuel * fuel + by_load * load
        share = max(end_m - z, 0.0) / way_m * v0 / max(v, 1e-3)
        return left_s * share * math.exp(min(max(beyond, -_BEYOND), _BEYOND))

    def _place(self, z: float) -> tuple[i64, float]:
        """The station before z, and which part of the way to the next it is; held at both ends."""
        stations = self.stations
        low: i64 = 0
        high: i64 = len(stations) - 1
        while high - low > 1:
            middle = (low + high) // 2
            if stations[middle].z <= z:
                low = middle
            else:
                high = middle
        a, b = stations[low], stations[high]
        return low, min(max((z - a.z) / (b.z - a.z), 0.0), 1.0)


def _hermite(s: float, h: float, y0: float, d0: float, y1: float, d1: float) -> float:
    """The cubic through both ends with both slopes, at the part s of the way h."""
    r = 1.0 - s
    return r * r * ((1.0 + 2.0 * s) * y0 + s * h * d0) + s * s * ((1.0 + 2.0 * r) * y1 - r * h * d1)


@final
class SensitivityMap(StrokeMap):
    """The settled stroke, `pace` times as long with the mass m as with that of the table."""

    def __init__(self, table: Table, m: float) -> None:
        super().__init__(m, table.stroke_s, 1.0, True, False)
        self.table = table
        self.pace: float = math.sqrt(m / table.mass_kg)

    def with_mass(self, m: float) -> SensitivityMap:
        """The map of another moving mass over the same springs."""
        return SensitivityMap(self.table, m)

    def travel(self, q: float, c: float, z: float, v: float, tau: float) -> tuple[float, float]:
        """Where and when the stroke under way ends: (distance [m], seconds from now).

        By the stations; before the first of them by the whole stroke.
        """
        t = self.table
        if z < t.stations[0].z or v <= 0.0:
            fuel, load = _ln(q / t.fuel_kg), _ln(c / t.load_n_s_m)
            start_m = -z - t.tdc_m if tau == 0.0 else 0.0
            lasts_s = t.stroke_s + t.duration.of(start_m, fuel, load)
            return t.tdc_m + t.end.of(start_m, fuel, load), max(self.pace * lasts_s - tau, 0.0)
        fuel, load = _ln(q / t.fuel_kg), _ln(c / t.load_n_s_m)
        last, paced = t.stations[-1].z, self.pace * v
        if z <= last:
            end_m = max(t.end_m(z, paced, fuel, load), z)
            return end_m, self.pace * t.left_s(z, paced, fuel, load, end_m)
        # As it was at the last station, braked evenly since.
        there = math.sqrt(paced * paced + 2.0 * t.braking_m_s2 * (z - last))
        end_m = max(t.end_m(last, there, fuel, load), z)
        whole_s = self.pace * t.left_s(last, there, fuel, load, max(end_m, last))
        return end_m, whole_s * math.sqrt((end_m - z) / max(end_m - last, 1e-9))

    def reach(self, q: float, c: float, z: float, v: float, tau: float, position_m: float) -> float:
        """Seconds until the piston is at a position ahead, or at its dead centre before it.

        Behind the position it is braked as the settled stroke is there, to its own end.
        """
        end_m, left_s = self.travel(q, c, z, v, tau)
        if position_m >= end_m:
            return left_s
        t = self.table
        settled_m = t.tdc_m - (end_m - position_m)
        return max(left_s - self.pace * t.left_behind(settled_m), 0.0)

    def pass_mid(self, q: float, c: float, start_m: float) -> tuple[float, float]:
        """Speed [m/s] at mid-stroke, and when [s], of a stroke from the distance `start_m`."""
        t = self.table
        fuel, load = _ln(q / t.fuel_kg), _ln(c / t.load_n_s_m)
        v = t.v_mid_m_s + t.at_mid.of(start_m - t.tdc_m, fuel, load)
        s = t.mid_s + t.passing.of(start_m - t.tdc_m, fuel, load)
        return max(v, 0.0) / self.pace, s * self.pace

    def speed_at(self, q: float, c: float, start_m: float, tau: float) -> float:
        """Velocity so long after the dead centre at the distance `start_m` [m/s].

        That of the settled stroke then, its energy less what the charge lacks of the settled one.
        """
        t, left_s = self.table, self.table.stroke_s - tau / self.pace
        z, lacks = t.stations[0].z, 0.0
        for station in t.stations:
            lacks += station.pull_by_fuel * (station.z - z)
            z = station.z
            if station.left_s <= left_s:
                break
        energy = t.energy_at(z) + lacks * (q / t.fuel_kg - 1.0)
        return math.sqrt(2.0 * max(energy, 0.0)) * (start_m / t.tdc_m) / self.pace

    def charge_for(self, c: float, start_m: float, target_m: float, guess_kg: float) -> float:
        """The effective fuel that ends the next stroke at the target [kg]."""
        t = self.table
        rest = t.end.of(start_m - t.tdc_m, 0.0, _ln(c / t.load_n_s_m))
        fuel = (target_m - t.tdc_m - rest) / t.end.fuel
        return t.fuel_kg * min(max(math.exp(fuel), _LEAST), _MOST)
