"""The links under contract: one row each, and how both ends of it are opened in this process."""

import contextlib
import itertools
import os
import socket
from typing import NamedTuple

import pytest

from drivers.links import open_link, open_memory
from hil.config.process import LinkConfig, LoopConfig, ZenohConfig

_numbers = itertools.count()


class Pair(NamedTuple):
    """Both connections, the plant's first, and what is asked of them.

    burst: batches under way at once; turns: questions and answers of one test.
    """

    plant: object
    controller: object
    burst: int
    turns: int


def free_tcp_endpoints():
    """Two ports that nobody has by now; both are held until both are known."""
    with contextlib.ExitStack() as stack:
        held = [stack.enter_context(socket.socket()) for _ in range(2)]
        for one in held:
            one.bind(("127.0.0.1", 0))
        return [f"tcp/127.0.0.1:{one.getsockname()[1]}" for one in held]


def unix_endpoints(folder):
    return [f"unixsock-stream/{folder}/{os.getpid()}-{next(_numbers)}-{end}" for end in "pc"]


def zenoh_config(endpoints, engine="contract"):
    plant, controller = endpoints
    zenoh = ZenohConfig(engine=engine, plant_endpoint=plant, controller_endpoint=controller)
    return LinkConfig(zenoh=zenoh)


@contextlib.contextmanager
def memory(_folder):
    plant, controller = open_memory()
    yield Pair(plant, controller, 2000, 1000)
    plant.close()
    controller.close()


def zenoh(endpoints, clock, burst, turns):
    @contextlib.contextmanager
    def opened(folder):
        config, loop = zenoh_config(endpoints(folder)), LoopConfig(clock=clock)
        plant = open_link("plant", config, loop)
        controller = open_link("controller", config, loop)
        plant.link.wait_for_peer(5.0)
        controller.link.wait_for_peer(5.0)
        yield Pair(plant, controller, burst, turns)
        controller.close()
        plant.close()

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
