"""Whatever comes over the bus: no exception, no growth, nothing acted on that is not protected."""

import random
import tracemalloc

import pytest

from bench.bus.fuzz import THEORY, fuzz, mutated_frames, random_frames
from bench.bus.rig import Clock, RigPacer
from bench.run import scenarios
from bench.run.resolve import resolve
from controller.build import make_loop as make_controller
from drivers.can.assembly import Assembler
from drivers.channels import MemoryCommands, MemoryStatus
from drivers.links import Connection
from drivers.recorder.client import NullRecorder
from hil import ports
from hil.wire.codec import pack_frame
from plant.build import make_loop as make_plant

FEW, MANY = 20_000, 1_000_000


@pytest.mark.parametrize(
    "frames", [FEW, pytest.param(MANY, marks=[pytest.mark.slow, pytest.mark.timeout(600)])]
)
def test_random_frames_pass_the_crc_as_rarely_as_theory_has_it(frames):
    found = fuzz("random", frames // 2)
    expected = found.own * THEORY
    assert abs(found.passed_crc - expected) < 5.0 * expected**0.5
    assert found.acted_on <= found.passed_crc
    assert fuzz("mutated", frames // 2).acted_on > 0


class Link(ports.Link):
    """Sends into the void; gives what it was loaded with."""

    def __init__(self):
        self.batches = []

    def send(self, batch):
        pass

    def receive(self):
        return self.batches.pop(0) if self.batches else None

    def peer_alive(self):
        return True


def loops():
    scenario = resolve(scenarios.read("steady"))
    pacer = RigPacer(Clock(), scenario.loop.period_ns)

    def connection(link):
        return Connection(link, MemoryCommands(), MemoryStatus(), lambda: None)

    links = Link(), Link()
    plant = make_plant(scenario, connection(links[0]), NullRecorder(), pacer)
    controller = make_controller(scenario, connection(links[1]), NullRecorder(), pacer)
    return plant, controller, *links


@pytest.mark.parametrize("kind", [random_frames, mutated_frames])
@pytest.mark.parametrize(
    "turns", [300, pytest.param(20_000, marks=[pytest.mark.slow, pytest.mark.timeout(600)])]
)
def test_both_loops_survive_any_frames_and_stay_within_their_limits(kind, turns):
    plant, controller, plant_link, _ = loops()
    stream = kind(random.Random(5))
    assemblers = {side: Assembler(side, 250_000) for side in ("plant", "controller")}
    tick = 0
    for turn in range(turns):
        for _ in range(10):
            frame = next(stream)
            for assembler in assemblers.values():
                assembler.push(*frame, turn * 1_000_000)
        plant_link.batches = popped(assemblers["controller"], turn)
        tick = plant.turn(tick)
        for batch in popped(assemblers["plant"], turn) or [None]:
            before = controller.tick
            controller.turn(batch)
            # The first tick that it hears may be any; from there on it follows none that is far.
            assert before < 0 or controller.tick - before <= 60_000
        order = plant.state.machine.order
        assert abs(order.force_n) <= 5000.0
        assert 0.0 <= order.load_coefficient_n_s_m <= 10_000.0
        assert abs(plant.state.x_m) < 0.1
        motion = controller.state.motion
        assert abs(motion.x_m) <= 0.08
        assert abs(motion.v_m_s) <= 8.0


def popped(assembler, turn):
    batches = []
    while (batch := assembler.pop(turn * 1_000_000 + 500_000)) is not None:
        batches.append(batch)
    return batches


def test_memory_does_not_grow_with_what_comes_in():
    stream = mutated_frames(random.Random(2))
    frames = [next(stream) for _ in range(4000)]
    assemblers = [Assembler(side, 250_000) for side in ("plant", "controller")]

    def feed():
        for number, frame in enumerate(frames):
            for assembler in assemblers:
                assembler.push(*frame, number * 100_000)
                while assembler.pop(number * 100_000) is not None:
                    pass

    feed()
    tracemalloc.start()
    feed()
    before = tracemalloc.get_traced_memory()[0]
    for _ in range(3):
        feed()
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert grown < 20_000


@pytest.mark.parametrize("length", range(1, 30))
def test_batches_of_any_length_are_taken(length):
    _, controller, *_ = loops()
    controller.turn(random.Random(length).randbytes(length))
    assert controller.tick == -1
    assert pack_frame(0x100, 0)
