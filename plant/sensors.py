"""From truth to sample: noise, resolution and faults, so that the model knows of none of them."""

from __future__ import annotations

from typing import final

from hil.randoms import SENSOR, normal_pair
from hil.values import Value
from hil.wire.commands import TimedCommand
from hil.wire.messages import VALVES, ValveMove
from hil.wire.pulses import wrap_us
from plant.engines.protocol import SLOW_SIGNALS, Sensed
from plant.rig.params import PlantParams
from plant.rig.state import PlantState


@final
class Sample(Value):
    """What the sensors say at the start of a tick."""

    __slots__ = ("x_m", "v_m_s")

    def __init__(self, x_m: float, v_m_s: float) -> None:
        self.x_m = x_m
        self.v_m_s = v_m_s


def sample(p: PlantParams, s: PlantState) -> Sample:
    """Measure position and velocity at the start of tick s.tick."""
    truth = Sample(s.motion.x_m, s.motion.v_m_s)
    if p.noisy:
        truth = _blur(p, s.tick, truth)
    return _substitute(p, s, truth) if s.disturbances.faults else truth


def sensed(p: PlantParams, s: PlantState) -> Sensed:
    """Measure pressures and electric power at the start of tick s.tick."""
    true = p.engine.sensed(s.motion, s.machine)
    return _substitute_slow(p, s, true) if s.disturbances.faults else true


def _substitute_slow(p: PlantParams, s: PlantState, true: Sensed) -> Sensed:
    told = {signal: true.of(signal) for signal in SLOW_SIGNALS}
    for index, held in s.disturbances.faults:
        event = p.events[index]
        signal = event.text("signal")
        if signal in told:
            told[signal] = _replaced(event, told[signal], held.slow)
    return Sensed(told["p_left"], told["p_right"], told["power"])


def valve_move(p: PlantParams, s: PlantState) -> ValveMove | None:
    """What the valves' position switches tell with the sample of tick s.tick, one move at a time.

    Only of valves that a controller moves; the piston's programme is no actuator.
    """
    told = s.pulses.valves.told
    if not told or not p.valves.by_lines:
        return None
    return ValveMove(VALVES[0] + told[0].line, int(told[0].is_open), wrap_us(told[0].t_ns))


def _blur(p: PlantParams, tick: int, true: Sample) -> Sample:
    """Add the offset and the noise of that tick, then round to the resolution."""
    x, v, sensors = true.x_m, true.v_m_s, p.sensors
    if sensors.offset_x_m or sensors.offset_v_m_s:
        x, v = x + sensors.offset_x_m, v + sensors.offset_v_m_s
    if sensors.noise_x_m or sensors.noise_v_m_s:
        first, second = normal_pair(p.seed, SENSOR, tick)
        x, v = x + sensors.noise_x_m * first, v + sensors.noise_v_m_s * second
    return Sample(_on_grid(x, sensors.resolution_x_m), _on_grid(v, sensors.resolution_v_m_s))


def _on_grid(value: float, grid: float) -> float:
    return grid * round(value / grid) if grid else value


def _substitute(p: PlantParams, s: PlantState, true: Sample) -> Sample:
    x, v = true.x_m, true.v_m_s
    for index, held in s.disturbances.faults:
        event = p.events[index]
        if event.text("signal") == "x":
            x = _replaced(event, x, held.x_m)
        elif event.text("signal") == "v":
            v = _replaced(event, v, held.v_m_s)
    return Sample(x, v)


def _replaced(event: TimedCommand, true: float, held: float) -> float:
    substitute = event.text("substitute")
    if substitute == "hold":
        return held
    value = event.number("value")
    return value if substitute == "value" else true + value
