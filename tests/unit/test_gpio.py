"""Frames in, levels of a fake chip out: order, safe state, silence, death, refusals."""

import os
import signal
import subprocess
import sys
import time

import pytest

from drivers.analog.input import Calibration, IioInput
from drivers.gpio import low as gpio_low
from drivers.gpio.lines import GpiodLines
from drivers.gpio.link import OutputLink, OutputProcess, open_outputs, with_outputs
from drivers.gpio.process import HEAD, EdgeDriver, drive, split
from drivers.links import open_memory
from drivers.recorder import ring
from hil.config.hardware import OutputsConfig
from hil.config.load import build
from hil.errors import ConfigError, RunError
from hil.wire.codec import Encoder
from hil.wire.messages import ControllerTick, MachineCommand, Pulse

MS = 1_000_000
CONFIG = OutputsConfig(
    chip="/dev/gpiochip9", lines={"injector_left": 4, "spark_left": 17}, late_us=300
)
OFF, _, GENERATING, STOPPING, SAFE = range(5)


class FakeLines:
    channels = frozenset({0, 2})

    def __init__(self):
        self.edges = []
        self.levels = {0: False, 2: False}

    def set(self, channel, high):
        self.edges.append((channel, high))
        self.levels[channel] = high

    def all_low(self):
        self.levels = dict.fromkeys(self.levels, False)

    def close(self):
        self.all_low()


class Frames:
    """Answers as a controller encodes them."""

    def __init__(self):
        self._encoder = Encoder()

    def answer(self, tick, *pulses, mode=GENERATING):
        head = ControllerTick(tick, 2 + len(pulses), mode)
        return self._encoder.encode((head, MachineCommand(2, 0.0, 800.0, 1.0), *pulses))


@pytest.fixture
def driver():
    lines = FakeLines()
    made = EdgeDriver(lines, CONFIG, MS, 10)
    made.lines = lines
    return made


def test_frames_become_edges_on_the_monotonic_clock(driver):
    """Tick k arrived at 500 ms + k; a pulse at plant time 5 ms is an edge at 505 ms."""
    frames = Frames()
    for tick in range(1, 4):
        arrived_ns = (500 + tick) * MS
        answer = frames.answer(tick, Pulse(0, 5000, 2000))
        driver.take(arrived_ns, arrived_ns + 200_000, answer)
    assert driver.act(503 * MS) == 503 * MS + 250_000  # a nap, the edge is farther away
    driver.act(504 * MS + 990_000)
    assert driver.lines.edges == []
    driver.act(505 * MS + 1)
    assert driver.lines.edges == [(0, True)]
    driver.act(507 * MS + 1)
    assert driver.lines.edges == [(0, True), (0, False)]
    assert driver.late == 0


@pytest.mark.parametrize("mode", [OFF, STOPPING, SAFE])
def test_a_mode_that_does_not_fire_lets_the_lines_be_low_and_forgets_what_was_ordered(driver, mode):
    """Nothing is sent after it: what was ordered is cleared, and not only what is repeated."""
    frames = Frames()
    ordered = Pulse(0, 1900, 9000), Pulse(2, 6000, 500)
    driver.take(500 * MS, 500 * MS + 1, frames.answer(0, *ordered))
    driver.act(502 * MS)
    assert driver.lines.levels[0]
    driver.take(502 * MS, 502 * MS + 1, frames.answer(2, mode=mode))
    driver.act(503 * MS)
    assert not any(driver.lines.levels.values())
    driver.act(507 * MS)
    assert driver.lines.edges == [(0, True), (0, False)]


@pytest.mark.parametrize(("silence_s", "low_ms"), [(None, 511), (0.005, 506), (0.02, 511)])
def test_silence_lets_the_lines_be_low_when_it_does_in_the_plant_or_sooner(silence_s, low_ms):
    """Ten ticks after the one in which the last answer acted, unless told otherwise."""
    lines = FakeLines()
    driver = EdgeDriver(lines, CONFIG.model_copy(update={"silence_s": silence_s}), MS, 10)
    driver.take(500 * MS, 500 * MS, Frames().answer(0, Pulse(2, 1000, 20_000)))
    driver.act(501 * MS)
    driver.act(low_ms * MS - 1)
    assert lines.levels[2]
    driver.act(low_ms * MS)
    assert lines.edges == [(2, True), (2, False)]


def test_an_opening_that_comes_to_be_placed_too_late_is_left_out(driver):
    driver.take(500 * MS, 500 * MS, Frames().answer(0, Pulse(0, 2000, 5000), Pulse(2, 1900, 5000)))
    driver.act(502 * MS + 299_000)
    assert (driver.lines.edges, driver.late) == ([(0, True)], 1)


def test_a_tick_that_is_answered_without_its_sample_does_not_move_the_plants_clock(driver):
    """Its arrival is 0: that of the sample before would say that the tick was early by one."""
    frames = Frames()
    driver.take(500 * MS, 500 * MS + 1, frames.answer(0))
    for tick in range(1, 4):
        driver.take(0, 500 * MS + tick * MS + 500_000, frames.answer(tick, Pulse(0, 6000, 1000)))
    driver.act(506 * MS - 1)
    assert driver.lines.edges == []
    driver.act(506 * MS)
    assert driver.lines.edges == [(0, True)]


def test_a_link_tells_the_arrival_of_the_sample_that_is_answered_and_none_without():
    shown = []

    class Outputs:
        put = staticmethod(lambda data: shown.append(HEAD.unpack_from(data)))

    plant, controller = open_memory()
    link = OutputLink(controller.link, Outputs())
    plant.link.send(b"s" * 20)
    link.wait(0)
    link.send(b"1")
    assert link.wait(0) is None
    link.send(b"2")
    (arrived, sent, _), (none, later, _) = shown
    assert 0 < arrived <= sent <= later
    assert none == 0


def test_a_plant_that_begins_anew_finds_the_lines_low(driver):
    frames = Frames()
    driver.take(500 * MS, 500 * MS, frames.answer(1000, Pulse(2, 1_001_900, 20_000)))
    driver.act(502 * MS)
    assert driver.lines.levels[2]
    driver.take(503 * MS, 503 * MS, frames.answer(0))
    assert not any(driver.lines.levels.values())


def test_corrupted_frames_move_no_line(driver):
    batch = bytearray(Frames().answer(0, Pulse(2, 1000, 5000)))
    batch[25] ^= 0x40
    driver.take(500 * MS, 500 * MS, bytes(batch))
    driver.act(502 * MS)
    assert driver.lines.edges == []


def test_the_rings_bytes_are_cut_into_answers():
    data = b"".join(HEAD.pack(i, i + 1, 20) + bytes([i]) * 20 for i in range(3))
    records, rest = split(data + b"\x01\x02")
    assert records == [(i, i + 1, bytes([i]) * 20) for i in range(3)]
    assert rest == b"\x01\x02"
    assert split(data[:33]) == ([], data[:33])


def test_the_drive_reads_acts_and_ends():
    """The pulse is far ahead, and little of it too late, so that a busy machine has time for it."""
    patient = CONFIG.model_copy(update={"late_us": 60_000_000})
    fd = ring.create(1 << 14)
    producer, consumer = ring.Producer(fd), ring.Consumer(fd)
    os.close(fd)
    lines, now = FakeLines(), time.monotonic_ns()
    batch = Frames().answer(0, Pulse(0, 50_000, 1000))
    producer.put(HEAD.pack(now, now, len(batch)) + batch)
    end = now + 60_000 * MS
    drive(EdgeDriver(lines, patient, MS, 60_000), consumer, 100_000,
          lambda: len(lines.edges) < 2 and time.monotonic_ns() < end)  # fmt: skip
    assert lines.edges == [(0, True), (0, False)]


class FakeRequest:
    def __init__(self, broken=False):
        self.values, self.released, self.broken = {}, False, broken

    def __call__(self, chip, config, consumer):
        self.chip, self.consumer = chip, consumer
        ((offsets, self.settings),) = config.items()
        self.values = dict.fromkeys(offsets, self.settings.output_value)
        return self

    def set_value(self, offset, value):
        if self.broken:
            raise OSError(5, "Input/output error")
        self.values[offset] = value

    def set_values(self, values):
        self.values |= values

    def release(self):
        self.released = True


def test_lines_are_requested_as_outputs_and_low_and_given_back_low():
    from gpiod.line import Direction, Value

    request = FakeRequest()
    lines = GpiodLines(CONFIG, request)
    assert (request.chip, request.consumer) == ("/dev/gpiochip9", "fpeg-hil")
    assert request.settings.direction is Direction.OUTPUT
    assert request.values == {4: Value.INACTIVE, 17: Value.INACTIVE}
    lines.set(2, True)
    assert request.values == {4: Value.INACTIVE, 17: Value.ACTIVE}
    lines.close()
    assert request.values == {4: Value.INACTIVE, 17: Value.INACTIVE}
    assert request.released


def test_a_device_that_fails_is_named():
    with pytest.raises(RunError, match=r"outputs: spark_left: .*Input/output"):
        GpiodLines(CONFIG, FakeRequest(broken=True)).set(2, True)


def test_a_chip_that_is_not_there_is_named():
    with pytest.raises(ConfigError, match=r"outputs: /dev/gpiochip9, lines 4, 17: .*No such file"):
        GpiodLines(CONFIG)


@pytest.mark.parametrize(
    ("outputs", "text"),
    [
        ({"chip": "/dev/gpiochip0"}, "given together"),
        ({"lines": {"spark_left": 1}}, "given together"),
        ({"chip": "/dev/gpiochip0", "lines": {"spark_left": 1, "spark_right": 1}}, "one line"),
        ({"chip": "/dev/gpiochip0", "lines": {"spork": 1}}, "lines"),
    ],
)
def test_a_map_that_cannot_be_is_refused(outputs, text):
    with pytest.raises(ConfigError, match=text):
        build({"outputs": outputs}, "file")


def scenario(clock="realtime"):
    tree = {"outputs": {**CONFIG.model_dump(), "late_us": 10_000}, "loop": {"clock": clock}}
    return build(tree, "file")


FAKE_CHIP = """
import json, sys, time
import gpiod
class Request:
    def __init__(self, path, config, consumer):
        self.out = open({log!r}, "w", buffering=1)
        self.note("requested")
    def note(self, text): self.out.write(f"{{time.monotonic_ns()}} {{text}}\\n")
    def set_value(self, offset, value): self.note(f"{{offset}} {{value.value}}")
    def set_values(self, values): self.note("low")
    def release(self): self.note("released")
gpiod.request_lines = Request
from drivers.gpio.process import main
sys.exit(main())
"""


@pytest.fixture
def outputs(tmp_path):
    """A real process on a fake chip that writes down its edges."""
    log = tmp_path / "edges"
    command = (sys.executable, "-c", FAKE_CHIP.format(log=str(log)))
    made = OutputProcess(scenario(), command)
    made.edges = lambda: [line.split(" ", 1) for line in log.read_text().splitlines()]
    yield made
    made.close()


def test_a_link_shows_its_frames_to_the_lines(outputs):
    plant, controller = open_memory()
    shown = with_outputs(controller, outputs)
    frames = Frames()
    for tick in range(30):
        plant.link.send(b"s" * 20)
        assert shown.link.wait(0) == b"s" * 20
        if tick == 0:
            begin = time.monotonic_ns()
        shown.link.send(frames.answer(tick, *([Pulse(2, 20_000, 3_000)] if tick < 8 else [])))
        assert plant.link.receive() is not None
        while time.monotonic_ns() < begin + (tick + 1) * MS:
            pass
    shown.close()
    told = outputs.edges()
    assert [text for _, text in told if text[0] == "1"] == ["17 1", "17 0"]
    assert [text for _, text in told[-2:]] == ["low", "released"]
    assert shown.link.counters()["sent"] >= 8


def test_a_process_of_lines_that_died_is_told(outputs):
    link = OutputLink(open_memory()[1].link, outputs)
    os.kill(outputs._process.pid, signal.SIGKILL)
    outputs._process.wait()
    for _ in range(63):
        link.send(b"")
    with pytest.raises(RunError, match="outputs: the process of the lines ended with -9"):
        link.send(b"")  # every 64th send looks


def test_asked_to_end_it_leaves_the_lines_low(outputs):
    os.kill(outputs._process.pid, signal.SIGTERM)
    outputs._process.wait(5.0)
    assert [text for _, text in outputs.edges()] == ["requested", "low", "released"]


def test_orphaned_it_leaves_the_lines_low(tmp_path):
    """The loop's process is killed: nobody tells the lines' process, which notices by itself."""
    log = tmp_path / "edges"
    code = FAKE_CHIP.format(log=str(log))
    parent = (
        "import sys, time\n"
        "from drivers.gpio.link import OutputProcess\n"
        "from hil.config.scenario import Scenario\n"
        "OutputProcess(Scenario.model_validate_json(sys.argv[1]),"
        " (sys.executable, '-c', sys.argv[2]))\n"
        "print('up', flush=True)\n"
        "time.sleep(60)\n"
    )
    words = [sys.executable, "-c", parent, scenario().model_dump_json(), code]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "up\n"
    process.kill()
    process.communicate()
    end = time.monotonic() + 5.0
    while "released" not in log.read_text():
        assert time.monotonic() < end
    assert log.read_text().splitlines()[-2].endswith("low")


def test_a_chip_that_is_missing_ends_the_start_with_its_line():
    with pytest.raises(RunError, match=r"^outputs: /dev/gpiochip9, lines 4, 17: "):
        OutputProcess(scenario())


def test_lockstep_drives_no_lines():
    with pytest.raises(ConfigError, match="realtime"):
        open_outputs(scenario("lockstep"))


def test_without_a_chip_nothing_is_started():
    assert open_outputs(build({}, "file")) is None
    connection = open_memory()[0]
    assert with_outputs(connection, None) is connection


LINE = """
class Direction: OUTPUT = "out"
class Value: INACTIVE = "low"
"""
CHIP = """
class LineSettings:
    def __init__(self, **given): self.given = given
class request_lines:
    def __init__(self, chip, config, consumer):
        for offsets, settings in config.items():
            print(chip, offsets, sorted(settings.given.items()))
    def release(self): print("released")
"""


def set_low(tmp_path, config):
    (tmp_path / "gpiod").mkdir()
    (tmp_path / "gpiod" / "__init__.py").write_text(CHIP)
    (tmp_path / "gpiod" / "line.py").write_text(LINE)
    (tmp_path / "engine.toml").write_text(config)
    return subprocess.run(
        [sys.executable, "-P", gpio_low.__file__, tmp_path / "engine.toml"], check=True,
        env={"PYTHONPATH": str(tmp_path)}, capture_output=True, text=True,
    ).stdout.splitlines()  # fmt: skip


def test_lines_can_be_set_low_by_a_process_that_loads_next_to_nothing(tmp_path):
    outputs = '[outputs]\nchip = "/dev/gpiochip0"\nlines = { spark_left = 17, spark_right = 4 }\n'
    told = set_low(tmp_path, outputs + "active_low = true\n")
    settings = [("active_low", True), ("direction", "out"), ("output_value", "low")]
    assert told == [f"/dev/gpiochip0 (17, 4) {settings}", "released"]


def test_without_lines_there_is_nothing_to_set_low(tmp_path):
    assert set_low(tmp_path, "[loop]\nrate_hz = 500\n") == []


def test_an_iio_device_gives_volts(tmp_path):
    folder = tmp_path / "iio:device0"
    folder.mkdir()
    for name, text in {
        "in_voltage0_raw": "2048\n", "in_voltage1_raw": "-10", "in_voltage1_offset": "110",
        "in_voltage_scale": "1.22", "in_voltage1_scale": "2.0",
    }.items():  # fmt: skip
        (folder / name).write_text(text)
    device = IioInput("iio:device0", (0, 1), tmp_path)
    assert device.read_v() == pytest.approx((2048 * 1.22e-3, 0.2))
    (folder / "in_voltage0_raw").write_text("4095\n")
    assert device.read_v()[0] == pytest.approx(4095 * 1.22e-3)
    (folder / "in_voltage0_raw").write_text("oops\n")
    with pytest.raises(RunError, match="analogue input"):
        device.read_v()
    device.close()
    device.close()
    with pytest.raises(ConfigError, match="No such file"):
        IioInput("iio:device0", (7,), tmp_path)
    (folder / "in_voltage1_scale").unlink()
    (folder / "in_voltage_scale").unlink()
    with pytest.raises(ConfigError, match="in_voltage1_scale is missing"):
        IioInput("iio:device0", (1,), tmp_path)


def test_a_broken_wire_is_not_a_number():
    pressure = Calibration(gain=2.0e6, offset=-1.0e6, low_v=0.4, high_v=4.6)
    assert pressure.apply(2.5) == pytest.approx(4.0e6)
    assert pressure.apply(0.1) != pressure.apply(0.1)
