"""The last limit: whatever the layers above want, this is what leaves the controller."""

from __future__ import annotations

import math
from typing import final

from controller.actuator import Machine
from controller.motion.law import Demand
from controller.supervision.performance import LOAD_MAX_N_S_M
from hil.config.controller import LimitsConfig


@final
class Limits:
    """Section `limits` of the configuration, read once for all ticks."""

    def __init__(self, config: LimitsConfig) -> None:
        self.fuel_min_kg = config.fuel_min_kg
        self.fuel_max_kg = config.fuel_max_kg
        self.force_n = config.force_n


def limit_fuel(limits: Limits, most_kg: float, demand: Demand) -> Demand:
    """Keep the fuel within what an injector can do, and throttle or air admit."""
    most = max(most_kg, limits.fuel_min_kg)
    fuel = min(max(demand.fuel_kg, limits.fuel_min_kg), most)
    return demand if fuel == demand.fuel_kg else demand.of(fuel)


def limit_machine(limits: Limits, machine: Machine) -> Machine:
    """Keep force and load within the machine's limits; a number that is none becomes zero."""
    most = limits.force_n
    if -most <= machine.force_n <= most and 0.0 <= machine.load_n_s_m <= LOAD_MAX_N_S_M:
        return machine
    force = machine.force_n if -most <= machine.force_n <= most else _clamped(machine.force_n, most)
    load = machine.load_n_s_m if 0.0 <= machine.load_n_s_m <= LOAD_MAX_N_S_M else 0.0
    return Machine(machine.mode, force, load)


def _clamped(force_n: float, most: float) -> float:
    """The force at its limit, or none when it is nan."""
    return 0.0 if math.isnan(force_n) else min(max(force_n, -most), most)
