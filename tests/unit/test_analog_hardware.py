"""Encoder, velocity from positions, and analogue outputs, on files that look like the devices."""

import math

import numpy as np
import pytest

from controller.observe.estimate import crossing_between
from drivers.analog.counter import EncoderInput
from drivers.analog.output import AnalogOutputs
from drivers.analog.source import AnalogSource, SourceLoop
from drivers.analog.velocity import PositionVelocity
from drivers.links import open_memory
from hil.config.hardware import AnalogOutputsConfig, InputsConfig
from hil.errors import ConfigError
from hil.pacing import LockstepPacer
from hil.wire.codec import Decoder, Encoder
from hil.wire.messages import GENERATOR, MOTOR, ControllerTick, MachineCommand

STEP_M, TICK_S = 10e-6, 1e-3


def counter(tmp_path, text):
    folder = tmp_path / "counter0" / "count0"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "count").write_text(text)
    return EncoderInput("counter0", 0, STEP_M, -0.02, root=tmp_path)


@pytest.mark.parametrize(
    ("text", "x_m"),
    [
        ("2000\n", 0.0),
        ("3550\n", 0.0155),
        (f"{2**32 - 5}\n", -0.02005),
        (f"{2**64 - 5}\n", -0.02005),
    ],
)
def test_a_count_is_a_position_below_nought_too(tmp_path, text, x_m):
    assert counter(tmp_path, text).read_m() == pytest.approx(x_m, abs=1e-12)


def test_a_device_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"inputs\.encoder: .*count0/count: No such file"):
        EncoderInput("counter0", 0, STEP_M, root=tmp_path)


def swing(phase, seconds=3.0, amplitude_m=15.5e-3, hz=19.94):
    t = TICK_S * np.arange(int(seconds / TICK_S)) + phase
    w = 2.0 * math.pi * hz
    return amplitude_m * np.sin(w * t), amplitude_m * w * np.cos(w * t)


def test_velocity_at_mid_stroke_is_within_5_mm_s_at_10_um():
    """The thesis's engine of eq. 5.60, sampled at 1 kHz; the first half second is learning."""
    errors = []
    for phase in (0.0, 3.1e-4, 7.7e-4):
        x, v = swing(phase)
        velocity = PositionVelocity(TICK_S, STEP_M)
        seen = [velocity.push(STEP_M * round(at / STEP_M)) for at in x]
        for k in range(500, len(x)):
            (x1, v1), (x2, v2) = seen[k - 1], seen[k]
            if x1 * x2 < 0.0:
                told = crossing_between(0, x1, v1, 1_000_000, x2, v2)[1]
                true = crossing_between(0, x[k - 1], v[k - 1], 1_000_000, x[k], v[k])[1]
                errors.append(abs(told) - abs(true))
    assert len(errors) > 250
    assert max(map(abs, errors)) < 5e-3
    assert np.std(errors) < 2.5e-3


def test_nothing_is_made_up_where_positions_are_missing():
    velocity = PositionVelocity(TICK_S, STEP_M)
    assert math.isnan(velocity.push(0.0)[1])
    assert velocity.push(1e-3) == (1e-3, 1.0)
    assert math.isnan(velocity.push(math.nan)[1])
    assert math.isnan(velocity.push(3e-3)[1])


class Device:
    def __call__(self, _device, channels):
        return self

    def read_v(self):
        return (0.8,)

    def close(self):
        pass


def test_encoder_and_velocity_make_the_frames_of_a_plant(tmp_path):
    config = InputsConfig.model_validate({
        "device": "iio:device0", "encoder": {"offset_m": -0.02},
        "electric_power_w": {"channel": 0, "gain": 1000.0},
    })  # fmt: skip
    source = AnalogSource(config, Device(), encoder=counter(tmp_path, "2000"))
    assert source.measure(0) == b""  # one position has no velocity
    (tmp_path / "counter0" / "count0" / "count").write_text("2100")
    _, sample = Decoder("plant").decode(source.measure(1))
    assert (sample.x_m, sample.v_m_s) == (pytest.approx(1e-3), pytest.approx(1.0))


OUTPUTS = {
    "device": "iio:device1",
    "force_n": {"channel": 0, "gain": 0.00125, "offset": 5.0, "high_v": 10.0, "rest_v": 5.0},
    "load_coefficient_n_s_m": {"channel": 1, "gain": 0.005},
    "throttle": {"channel": 2, "gain": 5.0},
}  # fmt: skip


def outputs(tmp_path):
    folder = tmp_path / "iio:device1"
    folder.mkdir()
    for channel in range(3):
        (folder / f"out_voltage{channel}_raw").write_text("")
    (folder / "out_voltage_scale").write_text("0.5\n")  # millivolts a step

    def volts():
        return [
            int((folder / f"out_voltage{n}_raw").read_text().split()[0]) * 0.5e-3 for n in range(3)
        ]

    return AnalogOutputs(AnalogOutputsConfig.model_validate(OUTPUTS), root=tmp_path), volts


def test_orders_are_voltages_within_their_limits(tmp_path):
    put, volts = outputs(tmp_path)
    assert volts() == [5.0, 0.0, 0.0]
    put.write(MachineCommand(MOTOR, -800.0, 0.0, 1.0))
    assert volts() == pytest.approx([4.0, 0.0, 5.0])
    put.write(MachineCommand(GENERATOR, 0.0, 810.0, 0.5))
    assert volts() == pytest.approx([5.0, 4.05, 2.5])
    put.write(MachineCommand(GENERATOR, 0.0, 5000.0, 0.5))
    assert volts()[1] == 5.0
    put.close()
    assert volts() == [5.0, 0.0, 0.0]


def test_answers_reach_the_outputs_and_silence_puts_them_at_rest(tmp_path):
    put, volts = outputs(tmp_path)
    plant_end, controller_end = (end.link for end in open_memory())
    config = InputsConfig.model_validate({
        "device": "iio:device0", "encoder": {}, "electric_power_w": {"channel": 0, "gain": 1.0},
    })  # fmt: skip
    source = AnalogSource(config, Device(), encoder=counter(tmp_path, "0"))
    pacer = LockstepPacer(1_000_000, 0)
    loop = SourceLoop(source, plant_end, pacer, put, stale_ticks=3)
    answer = (ControllerTick(0, 2, 2), MachineCommand(GENERATOR, 0.0, 400.0, 1.0))
    controller_end.send(Encoder().encode(answer))
    tick = loop.turn(0)
    assert volts() == pytest.approx([5.0, 2.0, 5.0])
    for _ in range(4):
        tick = loop.turn(tick)
    assert volts() == [5.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"device": None}, "together or not at all"),
        ({"throttle": {"channel": 2, "gain": 5.0, "rest_v": 6.0}}, "rest_v = 6"),
    ],
)
def test_outputs_are_given_whole(change, text):
    with pytest.raises(ValueError, match=text):
        AnalogOutputsConfig.model_validate(OUTPUTS | change)
