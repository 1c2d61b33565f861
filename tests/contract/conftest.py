"""The links under contract: one row each, and how both ends of it are opened in this process."""

import contextlib
import itertools
import os
import random
import socket
from typing import NamedTuple

import pytest

from drivers.can.virtual.directory import DIRECTORY_VARIABLE
from drivers.links import open_link, open_memory
from hil.config.process import LinkConfig, LoopConfig, ZenohConfig
from hil.wire.codec import Encoder
from hil.wire.messages import ControllerTick, MachineCommand, PistonSample, PlantTick, Pulse

_numbers = itertools.count()


class AnyBytes:
    """What a link that takes whole batches carries: anything."""

    def batch(self, _side, number, frames=6):
        """A batch that no other number gives."""
        return random.Random(number).randbytes(10 * frames)

    def various(self, side):
        """Batches of all lengths."""
        lengths = [0, 1, 2, 6, 100, 6, 0, 3]
        return [self.batch(side, number, length) for number, length in enumerate(lengths)]


class RealTicks:
    """What a link that takes batches apart carries: the ticks of a run, in their order."""

    def __init__(self):
        self.encoders = {"plant": Encoder(), "controller": Encoder()}
        self.ticks = {"plant": itertools.count(), "controller": itertools.count()}
        self.batches = {}

    def batch(self, side, number, pulses=1):
        """The batch of that number; the first time it is asked for, the next tick's."""
        if (side, number) not in self.batches:
            tick = next(self.ticks[side])
            make = plant_messages if side == "plant" else controller_messages
            self.batches[side, number] = self.encoders[side].encode(make(tick, pulses))
        return self.batches[side, number]

    def various(self, side):
        """Batches of all lengths."""
        return [self.batch(side, number, number % 4) for number in range(8)]


def plant_messages(tick, _pulses):
    head = PlantTick(tick, 2, 0, 1.0, float("nan"), float("nan"))
    return head, PistonSample(1e-6 * (tick % 1000), 1.0)


def controller_messages(tick, pulses):
    pulse = [Pulse(channel, 1000 * tick % 2**20, 500) for channel in range(pulses)]
    return ControllerTick(tick, 2 + pulses, 2), MachineCommand(2, 0.0, 810.0, 1.0), *pulse


class Pair(NamedTuple):
    """Both connections, the plant's first, and what is asked of them.

    burst: batches under way at once; turns: questions and answers of one test; talk: what is said
    """

    plant: object
    controller: object
    burst: int
    turns: int
    talk: object


def free_tcp_endpoints():
    """Two ports that nobody has by now; both are held until both are known."""
    with contextlib.ExitStack() as stack:
        held = [stack.enter_context(socket.socket()) for _ in range(2)]
        for one in held:
            one.bind(("127.0.0.1", 0))
        return [f"tcp/127.0.0.1:{one.getsockname()[1]}" for one in held]


def unix_endpoints(folder):
    return [f"unixsock-stream/{folder}/{os.getpid()}-{next(_numbers)}-{end}" for end in "pc"]


def zenoh_config(endpoints, engine="contract", kind="zenoh", bus=None):
    plant, controller = endpoints
    zenoh = ZenohConfig(engine=engine, plant_endpoint=plant, controller_endpoint=controller)
    return LinkConfig(kind=kind, zenoh=zenoh, bus=bus)


@contextlib.contextmanager
def memory(_folder):
    plant, controller = open_memory()
    yield Pair(plant, controller, 2000, 1000, AnyBytes())
    plant.close()
    controller.close()


def zenoh(endpoints, clock, burst, turns, kind="zenoh", bus=None):
    @contextlib.contextmanager
    def opened(folder):
        config = zenoh_config(endpoints(folder), kind=kind, bus=bus)
        loop = LoopConfig(clock=clock)
        plant = open_link("plant", config, loop)
        controller = open_link("controller", config, loop)
        plant.link.wait_for_peer(5.0)
        controller.link.wait_for_peer(5.0)
        talk = RealTicks() if kind == "can" else AnyBytes()
        yield Pair(plant, controller, burst, turns, talk)
        controller.close()
        plant.close()

    return opened


def shm(clock, burst, turns):
    return zenoh(unix_endpoints, clock, burst, turns, kind="shm")


def can(clock, burst, turns, interface="zenoh"):
    @contextlib.contextmanager
    def opened(folder):
        bus = f"{interface}:c{next(_numbers)}"
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv(DIRECTORY_VARIABLE, str(folder / "can"))
            with zenoh(unix_endpoints, clock, burst, turns, "can", bus)(folder) as pair:
                yield pair

    return opened


def tcp(_folder):
    return free_tcp_endpoints()


# In real time a sender drops rather than waits, so its bursts are those of a few skipped ticks.
LINKS = {
    "memory": memory,
    "zenoh-tcp-lockstep": zenoh(tcp, "lockstep", 2000, 1000),
    "zenoh-tcp-realtime": zenoh(tcp, "realtime", 12, 100),
    "zenoh-unix-lockstep": zenoh(unix_endpoints, "lockstep", 2000, 1000),
    "zenoh-unix-realtime": zenoh(unix_endpoints, "realtime", 12, 100),
    "shm-lockstep": shm("lockstep", 2000, 1000),
    "shm-realtime": shm("realtime", 2000, 100),
    "can-zenoh-lockstep": can("lockstep", 500, 500),
    "can-zenoh-realtime": can("realtime", 12, 100),
    "can-virtual-lockstep": can("lockstep", 500, 500, "virtual"),
    "can-virtual-realtime": can("realtime", 12, 100, "virtual"),
}


@pytest.fixture(scope="session")
def sockets(tmp_path_factory):
    """A folder for unix sockets; their paths are limited to about a hundred characters."""
    return tmp_path_factory.mktemp("s")


@pytest.fixture(params=LINKS)
def pair(request, sockets):
    """A link with both ends open."""
    with LINKS[request.param](sockets) as opened:
        yield opened


@pytest.fixture(params=LINKS)
def links(request, sockets):
    """Both ends of a link, drained."""
    with LINKS[request.param](sockets) as opened:
        yield opened.plant.link, opened.controller.link


@pytest.fixture
def config():
    """A link on two free ports."""
    return zenoh_config(free_tcp_endpoints())


@pytest.fixture
def socket_config(sockets):
    """A link on two unix sockets."""
    return zenoh_config(unix_endpoints(sockets))


@pytest.fixture
def ticks():
    """The ticks of a run."""
    return RealTicks()


@pytest.fixture
def strangers(sockets, monkeypatch):
    """Makes configurations of nodes on one bus whose sessions do not know each other."""
    monkeypatch.setenv(DIRECTORY_VARIABLE, str(sockets / "can"))
    channel = f"m{next(_numbers)}"

    def node():
        return zenoh_config(unix_endpoints(sockets), kind="can", bus=f"zenoh:{channel}")

    return node
