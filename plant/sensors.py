"""From truth to sample: noise, resolution and faults, so that the model knows of none of them."""

from __future__ import annotations

from typing import NamedTuple

from hil.config.plant import SensorFaultEvent
from plant.params import Engine, PlantParams
from plant.rig.disturbances import Held
from plant.rig.randoms import SENSOR, normal_pair
from plant.rig.state import PlantState

# Volume at the head itself is nought; pressures are told as at this distance from it.
_NEAREST_M = 1.0e-4


class Sample(NamedTuple):
    """What the sensors say at the start of a tick."""

    x_m: float
    v_m_s: float


def sample(p: PlantParams, s: PlantState) -> Sample:
    """Measure position and velocity at the start of tick s.tick."""
    x, v = s.x_m, s.v_m_s
    if p.noisy:
        x, v = _blur(p, s.tick, x, v)
    if s.disturbances.faults:
        x, v = _substitute(p, s, x, v)
    return Sample(x, v)


def _blur(p: PlantParams, tick: int, x: float, v: float) -> tuple[float, float]:
    """Add the noise of that tick, then round to the resolution."""
    noise_x, noise_v, grid_x, grid_v = (
        p.sensors.noise_x_m,
        p.sensors.noise_v_m_s,
        p.sensors.resolution_x_m,
        p.sensors.resolution_v_m_s,
    )
    if noise_x or noise_v:
        first, second = normal_pair(p.seed, SENSOR, tick)
        x, v = x + noise_x * first, v + noise_v * second
    if grid_x:
        x = grid_x * round(x / grid_x)
    if grid_v:
        v = grid_v * round(v / grid_v)
    return x, v


def _substitute(p: PlantParams, s: PlantState, x: float, v: float) -> tuple[float, float]:
    for index, held in s.disturbances.faults:
        event = p.events[index]
        if isinstance(event, SensorFaultEvent):
            if event.signal == "x":
                x = _replaced(event, x, held, 0)
            else:
                v = _replaced(event, v, held, 1)
    return x, v


def _replaced(event: SensorFaultEvent, true: float, held: Held, which: int) -> float:
    if event.substitute == "hold":
        return held[which]
    return event.value if event.substitute == "value" else true + event.value


def pressures_pa(engine: Engine, s: PlantState) -> tuple[float, float]:
    """Gas pressures p = p0 (V0/V)^gamma + dp (Vc/V)^gamma, dp where it fired: (left, right) [Pa].

    dp = E CR^gamma / (A Ls)     (thesis eqs. 5.9 to 5.19, exponents corrected)
    """
    if s.gas is not None:
        return s.gas.p_left_pa, s.gas.p_right_pa
    size, gamma = engine.half_stroke_m, engine.gamma
    left = (size / max(size + s.x_m, _NEAREST_M)) ** gamma
    right = (size / max(size - s.x_m, _NEAREST_M)) ** gamma
    burnt = s.stroke.energy_j / (engine.area_m2 * size)
    p_left = engine.p0_pa + (burnt if s.stroke.direction > 0 else 0.0)
    p_right = engine.p0_pa + (burnt if s.stroke.direction < 0 else 0.0)
    return float(p_left * left), float(p_right * right)


def electric_power_w(s: PlantState) -> float:
    """Power P = c v^2 - F v: delivered as generator, taken up (negative) as motor."""
    if s.gas is not None:
        return s.gas.electric_power_w
    v = s.v_m_s
    return s.machine.load_coefficient_n_s_m * v * v - s.machine.force_n * v
