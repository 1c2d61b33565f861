"""SocketCAN against sockets that play the kernel: drained, filtered, full, down, in error."""

import errno
import itertools
import socket
import struct
import time

import pytest

from drivers.can import socket as can_socket
from drivers.can.assembly import head_place
from drivers.can.frames import Wanted
from drivers.can.link import CanLink, wanted_by
from drivers.can.socket import FRAME, SocketFrames, filters, open_socket
from hil.errors import ConfigError, LinkError
from hil.wire.codec import Encoder, iter_frames
from hil.wire.messages import PistonSample, PlantTick

NAN = float("nan")
STAMP = struct.Struct("=qq")
REMOTE, ERROR = 1 << 30, 1 << 29


class Kernel:
    """A raw socket whose other end is the test's."""

    def __init__(self):
        self.arrived = []
        self.written = []
        self.refusals = []
        self.closed = False

    def arrive(self, can_id, data, t_ns=1_700_000_000_123_456_789):
        stamp = STAMP.pack(*divmod(t_ns, 10**9))
        frame = struct.pack("<IB3x", can_id, len(data)) + data.ljust(8, b"\0")
        self.arrived.append((frame, [(socket.SOL_SOCKET, 35, stamp)], 0, ("vcan0",)))

    def recvmsg(self, size, ancillary):
        assert size == 16
        assert ancillary >= socket.CMSG_SPACE(STAMP.size)
        if not self.arrived:
            raise BlockingIOError
        item = self.arrived.pop(0)
        if isinstance(item, OSError):
            raise item
        return item

    def recv(self, size):
        return self.recvmsg(size, 32)[0]

    def send(self, frame):
        if self.refusals and (error := self.refusals.pop(0)):
            raise OSError(error, "refused")
        self.written.append(frame)
        return len(frame)

    def fileno(self):
        return 0

    def close(self):
        self.closed = True


@pytest.fixture
def kernel():
    return Kernel()


@pytest.fixture
def port(kernel):
    return SocketFrames(kernel, "vcan0", lambda _: None)


def batch():
    return Encoder().encode((PlantTick(7, 2, 0, 1.0, NAN, NAN), PistonSample(0.01, 1.0)))


def soon():
    return time.monotonic_ns() + 50_000_000


def test_a_batch_goes_out_frame_by_frame_as_the_kernel_wants_it(kernel, port):
    port.send(batch(), soon())
    expected = [
        struct.pack("<IB3x", can_id, 8) + word.to_bytes(8, "little")
        for can_id, word in iter_frames(batch())
    ]
    assert kernel.written == expected


def test_everything_that_has_come_is_read_at_once_with_whole_nanoseconds(kernel, port):
    for number in range(5):
        kernel.arrive(0x100, number.to_bytes(8, "little"), 1_700_000_000_000_000_001 + number)
    got = port.receive()
    assert got == [(0x100, n, 1_700_000_000_000_000_001 + n) for n in range(5)]
    assert port.receive() == []


def test_a_tick_that_is_whole_is_not_looked_behind(kernel):
    port = SocketFrames(kernel, "vcan0", lambda _: None, head_place("plant"))
    for can_id, word in (*iter_frames(batch()), *iter_frames(batch())):
        kernel.arrive(can_id, word.to_bytes(8, "little"))
    assert len(port.receive()) == 2
    assert len(kernel.arrived) == 2
    assert len(port.receive()) == 2
    head, body = iter_frames(batch())
    kernel.arrive(*body[:1], body[1].to_bytes(8, "little"))
    kernel.arrive(*head[:1], head[1].to_bytes(8, "little"))
    assert [can_id for can_id, _, _ in port.receive()] == [0x101, 0x100]


def test_a_flood_is_read_in_portions(kernel, port):
    for _ in range(2000):
        kernel.arrive(0x100, bytes(8))
    sizes = [len(port.receive()) for _ in range(4)]
    assert max(sizes) <= 512
    assert sum(sizes) == 2000


def test_a_full_queue_is_tried_again_until_there_is_room(kernel, port):
    kernel.refusals = [errno.ENOBUFS, errno.ENOBUFS, errno.EAGAIN, 0]
    port.send(batch(), soon())
    assert len(kernel.written) == 2
    assert port.counters()["send_retried"] == 3
    assert port.counters()["send_full"] == 0


def test_a_queue_that_stays_full_costs_the_frames_and_not_the_tick(kernel, port):
    kernel.refusals = [errno.ENOBUFS] * 1000
    begin = time.monotonic_ns()
    port.send(batch(), begin - 1)
    assert kernel.written == []
    assert port.counters()["send_full"] == 2


def test_error_frames_become_notices(kernel, port):
    kernel.arrive(ERROR | 0x40, bytes(8))
    kernel.arrive(ERROR | 0x204, bytes([0, 0x20, 0, 0, 0, 0, 130, 7]))
    kernel.arrive(ERROR | 0x100, bytes(8))
    kernel.arrive(0x100, bytes(8))
    assert len(port.receive()) == 1
    assert port.notices() == [
        ("can-bus-off", "bus-off"),
        ("can-error", "controller problem, transmit error passive,"
                      " transmit errors 130, receive errors 7"),
        ("can-restarted", "restarted"),
    ]  # fmt: skip
    assert port.notices() == []
    assert port.counters()["bus_off"] == 1
    assert port.counters()["bus_errors"] == 3


def test_a_flood_of_error_frames_fills_no_memory(kernel, port):
    for _ in range(500):
        kernel.arrive(ERROR | 0x80, bytes(8))
    port.receive()
    assert port.counters()["bus_errors"] == 500
    assert len(port.notices()) == 64


def test_an_interface_that_is_down_is_counted_and_may_come_back(kernel, port):
    kernel.refusals = [errno.ENETDOWN, 0]
    port.send(batch(), soon())
    assert port.counters()["errors"] == 1
    assert len(kernel.written) == 1
    kernel.arrived.append(OSError(errno.ENETDOWN, "down"))
    assert port.receive() == []


def test_an_interface_that_is_gone_is_a_link_error(kernel, port):
    kernel.refusals = [errno.ENODEV]
    with pytest.raises(LinkError, match="socketcan:vcan0: cannot send"):
        port.send(batch(), soon())
    kernel.arrived.append(OSError(errno.ENODEV, "gone"))
    with pytest.raises(LinkError, match="cannot receive"):
        port.receive()


def test_the_kernel_filters_the_peers_frames_and_the_question(kernel):
    raw = filters(Wanted((0x100, 0x101), 0x200))
    rows = list(struct.iter_unpack("=II", raw))
    mask = 0x7FF | 1 << 31 | 1 << 30
    assert rows == [(0x100, mask), (0x101, mask), (0x200 | REMOTE, mask)]
    assert wanted_by("controller") == Wanted(
        (0x100, 0x101, 0x102, 0x103, 0x0F0, 0x0F1, 0x200), 0x200
    )
    plants = Wanted((0x200, 0x201, 0x202, 0x0F0, 0x0F1, 0x100), 0x100)
    assert wanted_by("plant") == plants


class Presence:
    lockstep = False

    def __init__(self, role):
        self.role, self.noted = role, []

    def alive(self):
        return set()

    def ready(self):
        pass

    def note(self, *told):
        self.noted.append(told)

    def notices(self):
        taken, self.noted = self.noted, []
        return taken


def test_plant_and_controller_find_each_other_by_remote_frames(kernel, port):
    kernel.arrive(0x200 | REMOTE, bytes(8), time.time_ns())
    controller = CanLink(port, Presence("controller"), 1_000_000)
    controller.wait_for_peer(1.0)
    assert kernel.written == [FRAME.pack(0x100 | REMOTE, 8, 0)]
    assert controller.peer_alive()
    other = Kernel()
    plant = CanLink(SocketFrames(other, "vcan0", lambda _: None), Presence("plant"), 1_000_000)
    with pytest.raises(LinkError, match=r"no controller on socketcan:vcan0 after 0\.05 s"):
        plant.wait_for_peer(0.05)
    assert set(other.written) == {FRAME.pack(0x200 | REMOTE, 8, 0)}
    other.arrive(0x100 | REMOTE, bytes(8), time.time_ns())
    plant.wait_for_peer(1.0)


def test_the_link_gives_back_whole_ticks_and_logs_the_bus(kernel, port):
    link = CanLink(port, Presence("controller"), 1_000_000)
    now = time.time_ns()
    kernel.arrive(ERROR | 0x40, bytes(8))
    for can_id, word in iter_frames(batch()):
        kernel.arrive(can_id, word.to_bytes(8, "little"), now)
    assert link.wait(1_000_000) == batch()
    assert link.arrived_ns == now
    assert link.notices() == [("can-bus-off", "bus-off")]
    link.close()
    assert kernel.closed
    assert link.receive() is None


def test_what_has_come_is_not_looked_for_before_the_kernel_was_asked(kernel):
    looks = []
    kernel.recvmsg = lambda *of: looks.append(of) or Kernel.recvmsg(kernel, *of)
    port = SocketFrames(kernel, "vcan0", lambda _: None, head_place("plant"))
    link = CanLink(port, Presence("controller"), 1_000_000)
    for tick in range(3):
        encoder = Encoder()
        for _ in range(tick + 1):
            sent = encoder.encode((PlantTick(tick, 2, 0, 1.0, NAN, NAN), PistonSample(0.01, 1.0)))
        for can_id, word in iter_frames(sent):
            kernel.arrive(can_id, word.to_bytes(8, "little"))
        assert link.wait(1_000_000) == sent
    assert len(looks) == 6


def test_a_kernel_without_can_or_the_interface_is_told_in_one_line(monkeypatch):
    def refuse(*_):
        raise OSError(errno.EAFNOSUPPORT, "Address family not supported by protocol")

    monkeypatch.setattr(can_socket.socket, "socket", refuse)
    with pytest.raises(ConfigError, match="this kernel has no SocketCAN"):
        open_socket("vcan0", wanted_by("plant"))


def test_the_socket_is_set_up_before_it_is_bound(monkeypatch):
    calls = []

    class Raw:
        def setsockopt(self, level, option, value):
            calls.append((level, option, value))

        def bind(self, address):
            calls.append(address)
            if address == ("nope",):
                raise OSError(errno.ENODEV, "No such device")

        def setblocking(self, flag):
            calls.append(flag)

        def close(self):
            calls.append("closed")

    monkeypatch.setattr(can_socket.socket, "socket", lambda *_: Raw())
    open_socket("vcan0", wanted_by("plant"))
    assert (101, 2, 0x1FFFFFFF) in calls
    assert (socket.SOL_SOCKET, 35, 1) in calls
    assert calls[-2:] == [("vcan0",), False]
    with pytest.raises(ConfigError, match="socketcan:nope: No such device"):
        open_socket("nope", wanted_by("plant"))
    assert calls[-1] == "closed"
    assert len(list(itertools.takewhile(lambda c: c != ("vcan0",), calls))) == 4
