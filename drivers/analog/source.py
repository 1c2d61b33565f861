"""The plant's end of the link for an engine that is there: its sensors, told as the plant tells.

The controller's process notices no difference; what it commands goes out by its TTL lines.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

from drivers.analog.input import AnalogInput, Calibration, IioInput
from drivers.links import open_link
from drivers.system.clock import SystemClock
from drivers.system.process import Stop, last_words
from drivers.system.realtime import pin, prepare
from drivers.system.service import Heart, Service
from hil.config.hardware import InputsConfig, SensorConfig
from hil.config.resolved import Resolved
from hil.config.terms import terms_of
from hil.errors import ConfigError
from hil.pacing import Pacer, RealTimePacer
from hil.ports import Link
from hil.wire.codec import Encoder
from hil.wire.fields import most_of
from hil.wire.messages import ELECTRIC_POWER, SLOW_ORDER, PistonSample, PlantTick

_NAN: Final = float("nan")
_X_MOST, _V_MOST = most_of(PistonSample, "x_m"), most_of(PistonSample, "v_m_s")
_POWER_MOST = most_of(PlantTick, "electric_power_w")
_P_MOST = most_of(PlantTick, "p_left_pa")
Open = Callable[[str, Sequence[int]], AnalogInput]


class AnalogSource:
    """Voltages to the frames of a tick.

    Raises: ConfigError when the device is not to be had
    """

    def __init__(self, config: InputsConfig, open_input: Open = IioInput) -> None:
        motion = [config.x_m, config.v_m_s, config.electric_power_w]
        pressures = [config.p_left_pa, config.p_right_pa]
        sensors = [sensor for sensor in motion + pressures if sensor is not None]
        if config.device is None:
            raise ConfigError("inputs.device: the name of an analogue device is needed")
        self._calibrations = [_calibration(sensor) for sensor in sensors]
        with_pressures = len(sensors) > len(motion)
        self._slow_order = SLOW_ORDER if with_pressures else (ELECTRIC_POWER,)
        self._input = open_input(config.device, [sensor.channel for sensor in sensors])
        self._encoder = Encoder()
        self.broken = 0

    def measure(self, tick: int) -> bytes:
        """Read all sensors once; a tick with one that tells nothing has no sample.

        Raises: RunError when the device fails
        """
        volts = self._input.read_v()
        x_m, v_m_s, *slow = (
            calibration.apply(u) for calibration, u in zip(self._calibrations, volts, strict=True)
        )
        which = self._slow_order[tick % len(self._slow_order)]
        value = slow[which]
        if math.isnan(value) or not (abs(x_m) <= _X_MOST and abs(v_m_s) <= _V_MOST):
            self.broken += 1
            return b""
        values = [_NAN, _NAN, _NAN]
        values[which] = _within(value, which)
        head = PlantTick(tick & 0xFFFFFFFF, 2, which, *values)
        return self._encoder.encode((head, PistonSample(x_m, v_m_s)))

    def close(self) -> None:
        """Give the device back."""
        self._input.close()


def _calibration(sensor: SensorConfig) -> Calibration:
    return Calibration(sensor.gain, sensor.offset, sensor.low_v, sensor.high_v)


def _within(value: float, which: int) -> float:
    """A pressure below nought is nought, and the end of a range is the end of a range."""
    if which == ELECTRIC_POWER:
        return max(-_POWER_MOST, min(value, _POWER_MOST))
    return max(0.0, min(value, _P_MOST))


class SourceLoop:
    """Samples at the loop's rate; what the controller answers is only counted."""

    def __init__(self, source: AnalogSource, link: Link, pacer: Pacer) -> None:
        self.answered = self.missed = 0
        self._source = source
        self._link = link
        self._pacer = pacer

    def turn(self, tick: int) -> int:
        """Measure and send at the tick's instant, or that of the one due by now; return the next.

        Raises: RunError when the device fails, LinkError when the link is broken
        """
        slot = self._pacer.wait(tick)
        self.missed += slot.missed
        frames = self._source.measure(slot.tick)
        if frames:
            self._link.send(frames)
        while self._link.receive() is not None:
            self.answered += 1
        return slot.tick + 1


def run(scenario: Resolved, service: Service, open_input: Open = IioInput) -> int:
    """Stand in for the plant until asked to end.

    Raises: ConfigError, LinkError, RunError
    """
    stop = Stop()
    stop.listen()
    source = AnalogSource(scenario.inputs, open_input)
    granted = prepare(scenario.realtime)
    connection = open_link("plant", scenario.link, scenario.loop, terms_of(scenario))
    try:
        granted |= pin(scenario.realtime)
        service.wait_for_peer(connection.link, "controller", scenario.loop.peer_timeout_s, stop)
        clock = SystemClock(scenario.realtime.spin_s)
        loop = SourceLoop(source, connection.link, RealTimePacer(clock, scenario.loop.period_ns))
        ticks = _turn_until(loop, source, service.heart, stop)
        last_words({"ticks": ticks, "answered": loop.answered, "missed": loop.missed,
                    "broken": source.broken, "granted": granted})  # fmt: skip
    finally:
        if stop.requested:
            service.ends()
        connection.close()
        source.close()
    return 0


def _turn_until(loop: SourceLoop, source: AnalogSource, heart: Heart, stop: Stop) -> int:
    def describe() -> str:
        return f"{loop.missed} ticks missed, {source.broken} without a sample"

    tick = 0
    heart.start(tick)
    while not stop.requested:
        tick = loop.turn(tick)
        if tick >= heart.next_tick:
            heart.beat(tick, loop.answered > 0, describe)
    return tick
