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
_LATE: Final = 0.65
"""Of the greatest speed: slower than this behind mid-stroke the way left tells the time left."""


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
        fastest = max([station.v for station in self.stations])
        slow = [i for i in range(len(self.stations)) if self._is_late(i, fastest)]
        self.late: i64 = slow[0] if slow else len(self.stations) - 1

    def _is_late(self, i: int, fastest: float) -> bool:
        return self.stations[i].z > 0.0 and self.stations[i].v < _LATE * fastest

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

    def pull_by_fuel_at(self, z: float) -> float:
        """What twice the fuel adds to the acceleration [m/s2]."""
        i, s = self._place(z)
        a, b = self.stations[i], self.stations[i + 1]
        return a.pull_by_fuel + s * (b.pull_by_fuel - a.pull_by_fuel)

    def end_gained(self, z: float, dv: float, fuel: float, load: float) -> float:
        """What the distance of the end gains by changes of speed, ln fuel and ln load at z [m]."""
        i, s = self._place(z)
        a, b = self.stations[i], self.stations[i + 1]
        r = 1.0 - s
        return (
            (r * a.end_by_v + s * b.end_by_v) * dv
            + (r * a.end_by_fuel + s * b.end_by_fuel) * fuel
            + (r * a.end_by_load + s * b.end_by_load) * load
        )

    def left_s(
        self, z: float, v: float, more: float, c: float, end_m: float, stop_m: float
    ) -> float:
        """Time to an end that is known, or a stop before it, from z at the speed v [s].

        From station to station while it is fast,  u' = f_q (q/q0 - 1) - (c v - c0 v0) / m  over z
        with v^2 = v0^2 + 2 u, v0 as settled; then in proportion to way and speed.

        Parameters: more : q/q0 - 1; c : load coefficient
        """
        m, c0 = self.mass_kg, self.load_n_s_m
        i, _ = self._place(z)
        v0 = math.sqrt(2.0 * self.energy_at(z))
        u, f, settled_s = 0.5 * v * v - 0.5 * v0 * v0, self.pull_by_fuel_at(z), self.left_at(z)
        spent = 0.0
        while i < self.late:
            b = self.stations[i + 1]
            if stop_m < b.z:
                break
            h = b.z - z
            lost = (c * v - c0 * v0) / m
            guess = u + h * (f * more - lost)
            v_next = math.sqrt(max(2.0 * (b.energy + guess), 0.0))
            lost = 0.5 * (lost + (c * v_next - c0 * b.v) / m)
            u += h * (0.5 * (f + b.pull_by_fuel) * more - lost)
            if b.energy + u <= 0.0 or b.z >= end_m:
                break
            v_next = math.sqrt(2.0 * (b.energy + u))
            spent += (settled_s - b.left_s) * (v0 + b.v) / (v + v_next)
            z, v, v0, f, settled_s = b.z, v_next, b.v, b.pull_by_fuel, b.left_s
            i += 1
        return spent + self.slowing_s(z, v, end_m, stop_m)

    def slowing_s(self, z: float, v: float, end_m: float, stop_m: float) -> float:
        """Time from z to a stop, the way to the end as settled but in proportion [s]."""
        there = min(z, self.stations[-1].z)
        settled_m = max(self.tdc_m - there, 1e-5)
        shape = self.left_at(there) * math.sqrt(2.0 * self.energy_at(there)) / settled_m
        whole = shape * max(end_m - z, 0.0) / max(v, 1e-3)
        if stop_m >= end_m:
            return whole
        beyond = (end_m - stop_m) / max(end_m - z, 1e-9)
        return whole * max(1.0 - math.sqrt(beyond), 0.0)

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
        end_m = self._end(q, c, z, v)
        return end_m, self._left_s(q, c, z, v, end_m, end_m)

    def reach(self, q: float, c: float, z: float, v: float, tau: float, position_m: float) -> float:
        """Seconds until the piston is at a position ahead, or at its dead centre before it."""
        if z < self.table.stations[0].z or v <= 0.0:
            end_m, left_s = self.travel(q, c, z, v, tau)
            short_m = max(end_m - position_m, 0.0)
            return left_s * max(1.0 - math.sqrt(short_m / max(end_m - z, 1e-9)), 0.0)
        return self._left_s(q, c, z, v, self._end(q, c, z, v), position_m)

    def _end(self, q: float, c: float, z: float, v: float) -> float:
        """Where a stroke that is among the stations, or behind them, ends."""
        t = self.table
        last = t.stations[-1].z
        there, v_there = min(z, last), self.pace * v
        if z > last:  # as it was at the last station, braked evenly since
            v_there = math.sqrt(v_there * v_there + 2.0 * t.braking_m_s2 * (z - last))
        dv = v_there - math.sqrt(2.0 * t.energy_at(there))
        fuel, load = _ln(q / t.fuel_kg), _ln(c / t.load_n_s_m)
        return max(t.tdc_m + t.end_gained(there, dv, fuel, load), z)

    def _left_s(self, q: float, c: float, z: float, v: float, end_m: float, stop_m: float) -> float:
        """Time from there to the end, or to a stop before it."""
        t = self.table
        if stop_m <= z:
            return 0.0
        if z > t.stations[-1].z:
            return t.slowing_s(z, v, end_m, stop_m)
        return self.pace * t.left_s(z, self.pace * v, q / t.fuel_kg - 1.0, c, end_m, stop_m)

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
