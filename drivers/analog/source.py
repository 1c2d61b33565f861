"""The plant's end of the link for an engine that is there: its sensors, told as the plant tells.

The controller's process notices no difference; what it commands goes out by its TTL lines, and the
orders to machine and throttle by analogue outputs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

from drivers.analog.counter import EncoderInput
from drivers.analog.input import AnalogInput, Calibration, IioInput
from drivers.analog.output import AnalogOutputs
from drivers.analog.velocity import PositionVelocity
from drivers.links import open_link
from drivers.system.clock import SystemClock
from drivers.system.process import Stop, last_words
from drivers.system.realtime import pin, prepare
from drivers.system.service import Heart, Service
from hil.config.hardware import InputsConfig, SensorConfig
from hil.config.ranges import stale_ticks
from hil.config.resolved import Resolved
from hil.config.terms import terms_of
from hil.errors import ConfigError
from hil.pacing import Pacer, RealTimePacer
from hil.ports import Link
from hil.wire.codec import Decoder, Encoder
from hil.wire.fields import most_of
from hil.wire.messages import ELECTRIC_POWER, SLOW_ORDER, MachineCommand, PistonSample, PlantTick

_NAN: Final = float("nan")
_X_MOST, _V_MOST = most_of(PistonSample, "x_m"), most_of(PistonSample, "v_m_s")
_POWER_MOST = most_of(PlantTick, "electric_power_w")
_P_MOST = most_of(PlantTick, "p_left_pa")
Open = Callable[[str, Sequence[int]], AnalogInput]


class AnalogSource:
    """Voltages to the frames of a tick.

    Raises: ConfigError when the device is not to be had
    """

    def __init__(
        self, config: InputsConfig, open_input: Open = IioInput, *, period_ns: int = 1_000_000,
        encoder: EncoderInput | None = None,
    ) -> None:  # fmt: skip
        if config.device is None:
            raise ConfigError("inputs.device: the name of an analogue device is needed")
        motion = [sensor for sensor in (config.x_m, config.v_m_s) if sensor is not None]
        slow = [config.electric_power_w, config.p_left_pa, config.p_right_pa]
        sensors = [sensor for sensor in (*motion, *slow) if sensor is not None]
        self._calibrations = [_calibration(sensor) for sensor in sensors]
        self._slow_order = SLOW_ORDER if config.p_left_pa is not None else (ELECTRIC_POWER,)
        self._has_x, self._encoder_input = config.x_m is not None, encoder
        self._velocity = None
        if config.v_m_s is None:
            step_m = config.encoder.metres_per_count if config.encoder else config.resolution_m
            self._velocity = PositionVelocity(period_ns * 1e-9, step_m)
        self._input = open_input(config.device, [sensor.channel for sensor in sensors])
        self._encoder = Encoder()
        self.broken = 0

    def measure(self, tick: int) -> bytes:
        """Read all sensors once; a tick with one that tells nothing has no sample.

        Raises: RunError when the device fails
        """
        volts = self._input.read_v()
        values = [c.apply(u) for c, u in zip(self._calibrations, volts, strict=True)]
        x_m, v_m_s = self._motion(values)
        which = self._slow_order[tick % len(self._slow_order)]
        value = values[which]
        if math.isnan(value) or not (abs(x_m) <= _X_MOST and abs(v_m_s) <= _V_MOST):
            self.broken += 1
            return b""
        told = [_NAN, _NAN, _NAN]
        told[which] = _within(value, which)
        head = PlantTick(tick & 0xFFFFFFFF, 2, which, *told)
        return self._encoder.encode((head, PistonSample(x_m, v_m_s)))

    def _motion(self, values: list[float]) -> tuple[float, float]:
        """Take position and velocity off the front of the values, from wherever they come."""
        if self._has_x:
            x_m = values.pop(0)
        else:
            assert self._encoder_input is not None, "the configuration has one or the other"
            x_m = self._encoder_input.read_m()
        return (x_m, values.pop(0)) if self._velocity is None else self._velocity.push(x_m)

    def close(self) -> None:
        """Give the devices back."""
        self._input.close()
        if self._encoder_input is not None:
            self._encoder_input.close()


def _calibration(sensor: SensorConfig) -> Calibration:
    return Calibration(sensor.gain, sensor.offset, sensor.low_v, sensor.high_v)


def _within(value: float, which: int) -> float:
    """A pressure below nought is nought, and the end of a range is the end of a range."""
    if which == ELECTRIC_POWER:
        return max(-_POWER_MOST, min(value, _POWER_MOST))
    return max(0.0, min(value, _P_MOST))


class SourceLoop:
    """Samples at the loop's rate; of what the controller answers the machine's order is put out.

    After so many ticks without an answer the outputs are at rest.
    """

    def __init__(
        self, source: AnalogSource, link: Link, pacer: Pacer,
        outputs: AnalogOutputs | None = None, stale_ticks: int = 10,
    ) -> None:  # fmt: skip
        self.answered = self.missed = 0
        self._source = source
        self._link = link
        self._pacer = pacer
        self._outputs = outputs
        self._stale_ticks = stale_ticks
        self._silent = 0
        self._decoder = Decoder("controller")

    def turn(self, tick: int) -> int:
        """Measure and send at the tick's instant, or that of the one due by now; return the next.

        Raises: RunError when the device fails, LinkError when the link is broken
        """
        slot = self._pacer.wait(tick)
        self.missed += slot.missed
        frames = self._source.measure(slot.tick)
        if frames:
            self._link.send(frames)
        self._silent += 1
        while (batch := self._link.receive()) is not None:
            self.answered += 1
            self._silent = 0
            if self._outputs is not None:
                self._put_out(batch, self._outputs)
        if self._outputs is not None and self._silent > self._stale_ticks:
            self._outputs.rest()
        return slot.tick + 1

    def _put_out(self, batch: bytes, outputs: AnalogOutputs) -> None:
        """Put out the order to the machine that an answer holds."""
        for message in self._decoder.decode(batch):
            if isinstance(message, MachineCommand):
                outputs.write(message)


def run(scenario: Resolved, service: Service, open_input: Open = IioInput) -> int:
    """Stand in for the plant until asked to end.

    Raises: ConfigError, LinkError, RunError
    """
    stop = Stop()
    stop.listen()
    period_ns = scenario.loop.period_ns
    source = _open_source(scenario.inputs, open_input, period_ns)
    outputs = AnalogOutputs(scenario.outputs.analog)
    granted = prepare(scenario.realtime)
    connection = open_link("plant", scenario.link, scenario.loop, terms_of(scenario))
    try:
        granted |= pin(scenario.realtime)
        service.wait_for_peer(connection.link, "controller", scenario.loop.peer_timeout_s, stop)
        clock = SystemClock(scenario.realtime.spin_s)
        patience = stale_ticks(scenario.plant.stale_s, period_ns)
        pacer = RealTimePacer(clock, period_ns)
        loop = SourceLoop(source, connection.link, pacer, outputs, patience)
        ticks = _turn_until(loop, source, service.heart, stop)
        last_words({"ticks": ticks, "answered": loop.answered, "missed": loop.missed,
                    "broken": source.broken, "granted": granted})  # fmt: skip
    finally:
        if stop.requested:
            service.ends()
        connection.close()
        outputs.close()
        source.close()
    return 0


def _open_source(config: InputsConfig, open_input: Open, period_ns: int) -> AnalogSource:
    """Open the encoder, if there is one, and the analogue sensors."""
    encoder = None
    if config.encoder is not None:
        given = config.encoder
        encoder = EncoderInput(given.device, given.count, given.metres_per_count, given.offset_m)
    return AnalogSource(config, open_input, period_ns=period_ns, encoder=encoder)


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
