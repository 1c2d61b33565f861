"""The last limit: whatever the layers above want, this is what leaves the controller."""

from __future__ import annotations

import math

from controller.actuator import Machine
from controller.motion.law import Demand
from hil.config.controller import LimitsConfig
from hil.values import replace

LOAD_MAX_N_S_M = 10_000.0
"""What the wire carries at the most."""


def limit_fuel(limits: LimitsConfig, throttle: float, demand: Demand) -> Demand:
    """Keep the fuel within what an injector can do and the throttle admits."""
    most = max(limits.fuel_max_kg * throttle, limits.fuel_min_kg)
    fuel = min(max(demand.fuel_kg, limits.fuel_min_kg), most)
    return demand if fuel == demand.fuel_kg else replace(demand, fuel_kg=fuel)


def limit_machine(limits: LimitsConfig, machine: Machine) -> Machine:
    """Keep force and load within the machine's limits; a number that is none becomes zero."""
    most = limits.force_n
    if -most <= machine.force_n <= most and 0.0 <= machine.load_n_s_m <= LOAD_MAX_N_S_M:
        return machine
    force = machine.force_n if -most <= machine.force_n <= most else _clamped(machine.force_n, most)
    load = machine.load_n_s_m if 0.0 <= machine.load_n_s_m <= LOAD_MAX_N_S_M else 0.0
    return replace(machine, force_n=force, load_n_s_m=load)


def _clamped(force_n: float, most: float) -> float:
    """The force at its limit, or none when it is nan."""
    return 0.0 if math.isnan(force_n) else min(max(force_n, -most), most)
