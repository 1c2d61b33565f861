"""Analogue sensors in place of the plant: voltages in, the plant's frames out."""

import math
import os
import signal
import socket
import threading
import time

import pytest

from bench.run import service as bench_service
from drivers.analog import source as analog_source
from drivers.analog.source import AnalogSource, SourceLoop, run
from drivers.links import open_memory
from drivers.system.service import Service
from hil.config.load import build
from hil.errors import ConfigError
from hil.pacing import LockstepPacer
from hil.wire.codec import Decoder

SENSORS = {
    "inputs.device": "iio:device0",
    "inputs.x_m": {"channel": 4, "gain": 0.01, "offset": -0.025, "low_v": 0.2, "high_v": 4.8},
    "inputs.v_m_s": {"channel": 2, "gain": 2.0, "offset": -5.0},
    "inputs.electric_power_w": {"channel": 0, "gain": 1000.0},
}
PRESSURES = {
    "inputs.p_left_pa": {"channel": 6, "gain": 1.0e6, "offset": -0.5e6},
    "inputs.p_right_pa": {"channel": 7, "gain": 1.0e6, "offset": -0.5e6},
}


class Device:
    def __init__(self, *volts):
        self.volts = volts
        self.asked = None
        self.closed = False

    def __call__(self, device, channels):
        self.asked = (device, list(channels))
        return self

    def read_v(self):
        return self.volts

    def close(self):
        self.closed = True


def scenario(**more):
    tree = {}
    for key, value in {**SENSORS, **more}.items():
        section, _, name = key.partition(".")
        tree.setdefault(section, {})[name] = value
    return build(tree, "engine.toml")


def test_voltages_become_the_frames_that_the_plant_would_send():
    device = Device(3.0, 3.5, 0.8)
    source = AnalogSource(scenario().inputs, device)
    assert device.asked == ("iio:device0", [4, 2, 0])
    head, sample = Decoder("plant").decode(source.measure(7))
    assert (head.tick, head.frame_count, head.slow) == (7, 2, 0)
    assert head.electric_power_w == pytest.approx(800.0)
    assert (sample.x_m, sample.v_m_s) == pytest.approx((0.005, 2.0))
    source.close()
    assert device.closed


def test_slow_signals_take_turns_and_stay_in_their_range():
    device = Device(3.0, 3.5, 50.0 / 10.0, 2.5, 0.1)
    source = AnalogSource(scenario(**PRESSURES).inputs, device)
    decoder = Decoder("plant")
    heads = [decoder.decode(source.measure(tick))[0] for tick in range(4)]
    assert [head.slow for head in heads] == [0, 1, 0, 2]
    assert heads[1].p_left_pa == pytest.approx(2.0e6)
    assert heads[3].p_right_pa == 0.0
    assert heads[0].electric_power_w == pytest.approx(5000.0)


@pytest.mark.parametrize("volts", [(0.1, 3.5, 1.0), (3.0, 5.1, 1.0), (3.0, 3.5, -0.1)])
def test_a_broken_wire_is_a_tick_without_a_sample(volts):
    source = AnalogSource(scenario().inputs, Device(*volts))
    assert source.measure(0) == b""
    assert source.broken == 1


def test_what_the_wire_cannot_carry_is_no_sample():
    wide = {"inputs.x_m": {"channel": 0, "gain": 1.0}}
    assert AnalogSource(scenario(**wide).inputs, Device(4.0, 3.5, 1.0)).measure(0) == b""


def test_a_turn_sends_and_counts_the_answers():
    plant, controller = open_memory()
    source = AnalogSource(scenario().inputs, Device(3.0, 3.5, 0.8))
    loop = SourceLoop(source, plant.link, LockstepPacer(1_000_000))
    assert loop.turn(0) == 1
    assert math.isclose(Decoder("plant").decode(controller.link.receive())[1].x_m, 0.005)
    controller.link.send(b"answer")
    assert loop.turn(1) == 2
    assert loop.answered == 1


def test_sensors_are_given_whole():
    for change, line in (
        ({"inputs.device": None}, "belong to a device"),
        ({"inputs.electric_power_w": None}, "needs x_m or an encoder, and electric_power_w"),
        ({"inputs.p_left_pa": PRESSURES["inputs.p_left_pa"]}, "together"),
        ({"inputs.x_m": {"channel": 0, "gain": 1.0, "low_v": 5.0}}, "less than high_v"),
        ({"inputs.device": "../x"}, "inputs.device"),
    ):
        with pytest.raises(ConfigError, match=line):
            scenario(**change)
    with pytest.raises(ConfigError, match=r"inputs\.device"):
        AnalogSource(build({}, "engine.toml").inputs, Device())


class PeerIsThere(Service):
    """A service that waits for nobody."""

    def wait_for_peer(self, link, peer, timeout_s, stop):
        assert peer == "controller"


def test_it_serves_until_it_is_asked_to_end(tmp_path, monkeypatch, capsys):
    manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    manager.bind(str(tmp_path / "notify"))
    manager.settimeout(5.0)
    plant, controller = open_memory()
    monkeypatch.setattr(analog_source, "open_link", lambda *_: plant)
    for name in ("prepare", "pin"):  # which would change this very process
        monkeypatch.setattr(analog_source, name, lambda _: {})
    some = scenario(**{"loop.rate_hz": 500, "realtime.priority": 0})
    service = PeerIsThere("sensors", 500, {"NOTIFY_SOCKET": str(tmp_path / "notify")})
    device = Device(3.0, 3.5, 0.8)

    def end_after_an_answer():
        while controller.link.receive() is None:
            time.sleep(1e-3)
        controller.link.send(b"answer")
        while not service.heart.ready:
            time.sleep(1e-3)
        os.kill(os.getpid(), signal.SIGTERM)

    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT,
                                                              signal.SIGHUP)}  # fmt: skip
    ending = threading.Thread(target=end_after_an_answer)
    ending.start()
    try:
        assert run(some, service, device) == 0
    finally:
        ending.join()
        service.notifier.close()
        for number, handler in before.items():
            signal.signal(number, handler)
    with manager:
        while b"READY=1" not in manager.recv(4096):
            pass
    assert device.closed
    assert '"broken": 0' in capsys.readouterr().out


def test_the_service_needs_its_device(tmp_path):
    config = tmp_path / "engine.toml"
    config.write_text("[loop]\nrate_hz = 500\n")
    with pytest.raises(ConfigError, match=r"inputs\.device"):
        bench_service.run(["sensors", "--config", str(config)])
