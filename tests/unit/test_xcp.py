"""The XCP slave: what a master asks for is what it gets, and nothing else."""

import socket
import struct
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from bench.live.xcp import a2l
from bench.live.xcp.addresses import address_of, places
from bench.live.xcp.server import Server
from bench.live.xcp.slave import Slave
from hil.log import topics
from hil.names.parameters import live

KP = "controller.cascade.outer.kp"
NAMES = ("plant.truth.tick", "plant.truth.x_m", "plant.truth.contacts", "plant.timing.missed")


class Target:
    def __init__(self):
        self.values, self.takes = {KP: 39.0}, True

    def read(self, place):
        name = place.parameter.key if place.parameter else place.signal.name
        return self.values.get(name, 0.0)

    def write(self, place, value):
        if self.takes:
            self.values[place.parameter.key] = value
        return self.takes

    def period_us(self, side):
        return {"plant": 1000, "controller": 200}[side]

    def description(self):
        return a2l.text(7777)


@pytest.fixture
def slave():
    made = Slave(Target())
    assert made.answer(b"\xff\x00") == struct.pack("<BBBBHBB", 0xFF, 0x05, 0, 255, 1400, 1, 1)
    return made


def ask(slave, form, *values):
    return slave.answer(struct.pack(f"<{form}", *values))


def ticks(first, count):
    """Records of some ticks, as arrays."""
    truth = np.zeros(count, np.dtype(topics.TRUTH.layout.numpy_spec))
    timing = np.zeros(count, np.dtype(topics.TIMING.layout.numpy_spec))
    for rows in (truth, timing):
        rows["tick"] = np.arange(first, first + count)
        rows["t_ns"] = rows["tick"].astype(np.int64) * 1_000_000
    truth["x_m"] = truth["tick"] * 1e-5
    return {"/truth": truth, "/timing": timing}


def test_a_value_is_uploaded_and_downloaded(slave):
    address = address_of(KP)
    assert ask(slave, "BBBBI", 0xF4, 8, 0, 0, address) == b"\xff" + struct.pack("<d", 39.0)
    ask(slave, "BBBBI", 0xF6, 0, 0, 0, address)
    raw = struct.pack("<d", 41.5)
    assert slave.answer(b"\xf0\x05" + raw[:5]) == b"\xff"
    assert slave.answer(b"\xf0\x03" + raw[5:]) == b"\xff"
    assert slave._target.values[KP] == 41.5


def test_what_the_engine_refuses_is_out_of_range(slave):
    slave._target.takes = False
    ask(slave, "BBBBI", 0xF6, 0, 0, 0, address_of(KP))
    assert slave.answer(b"\xf0\x08" + struct.pack("<d", 1e9)) == b"\xfe\x22"


def test_a_signal_cannot_be_written_and_nothing_is_where_nothing_is(slave):
    ask(slave, "BBBBI", 0xF6, 0, 0, 0, address_of(NAMES[1]))
    assert slave.answer(b"\xf0\x08" + bytes(8)) == b"\xfe\x24"
    assert ask(slave, "BBBBI", 0xF4, 1, 0, 0, 0x123) == b"\xfe\x22"
    assert slave.answer(b"\xc0") == b"\xfe\x20"
    assert slave.answer(b"\xf6") == b"\xfe\x21"
    assert slave.answer(b"\xfc") == b"\xfe\x00"


def uploaded(slave, size):
    data = b""
    while len(data) < size:
        count = min(254, size - len(data))
        answer = slave.answer(bytes([0xF5, count]))
        assert answer[:1] == b"\xff"
        data += answer[1:]
    return data


def test_the_slave_hands_out_its_own_description(slave):
    _, mode, _, size = struct.unpack("<BBHI", slave.answer(b"\xfa\x04"))
    assert mode == 0
    assert uploaded(slave, size).decode() == a2l.text(7777)


def test_events_have_the_name_and_the_period_of_their_process(slave):
    for number, name, cycle, unit in ((0, b"plant", 100, 4), (1, b"controller", 200, 3)):
        answer = ask(slave, "BBH", 0xD7, 0, number)
        assert answer[1:] == bytes([0x04, 0xFF, len(name), cycle, unit, 0])
        assert uploaded(slave, len(name)) == name


def test_before_a_connection_nothing_is_answered():
    assert Slave(Target()).answer(b"\xfd") == b"\xfe\x20"


def listed(slave, names=NAMES, *, stopped=False):
    found = [places()[address_of(name)] for name in names]
    slave.answer(b"\xd6")
    ask(slave, "BBH", 0xD5, 0, 1)
    ask(slave, "BBHB", 0xD4, 0, 0, 1)
    ask(slave, "BBHBB", 0xD3, 0, 0, 0, len(found))
    ask(slave, "BBHBB", 0xE2, 0, 0, 0, 0)
    for place in found:
        assert ask(slave, "BBBBI", 0xE1, 0xFF, place.size, 0, place.address) == b"\xff"
    ask(slave, "BBHHBB", 0xE0, 0x10, 0, 0, 1, 0)
    assert ask(slave, "BBH", 0xDE, 2, 0) == b"\xff\x00"
    assert stopped or slave.answer(b"\xdd\x01") == b"\xff"
    return "<BI" + "".join(place.code for place in found)


def test_every_tick_is_measured_with_its_time(slave):
    form = listed(slave)
    assert slave.answer(b"\xfd")[1] == 0x40
    packets = [p for first in (100, 117) for p in slave.packets("plant", ticks(first, 17))]
    rows = [struct.unpack(form, packet) for packet in packets]
    assert [row[2] for row in rows] == list(range(100, 134))
    assert [row[1] for row in rows] == [1000 * tick for tick in range(100, 134)]
    assert rows[5][3] == 105 * 1e-5
    assert list(slave.packets("controller", ticks(0, 3))) == []
    assert slave.answer(b"\xdd\x00") == b"\xff"
    assert list(slave.packets("plant", ticks(134, 3))) == []


def test_what_is_not_put_every_tick_holds(slave):
    form = listed(slave, ("controller.stroke.tdc_m",))
    ask(slave, "BBHHBB", 0xE0, 0x10, 0, 1, 1, 0)
    rows = ticks(10, 6)
    stroke = np.zeros(1, np.dtype(topics.STROKE.layout.numpy_spec))
    stroke["tick"], stroke["tdc_m"] = 13, 0.0155
    packets = list(slave.packets("controller", rows | {"/stroke": stroke}))
    values = [struct.unpack(form, packet)[2] for packet in packets]
    assert values == [0.0, 0.0, 0.0, 0.0155, 0.0155, 0.0155]
    (later, *_) = slave.packets("controller", ticks(16, 2))
    assert struct.unpack(form, later)[2] == 0.0155


def test_a_packet_is_never_longer_than_what_was_told(slave):
    ask(slave, "BBH", 0xD5, 0, 1)
    ask(slave, "BBHB", 0xD4, 0, 0, 1)
    ask(slave, "BBHBB", 0xD3, 0, 0, 0, 250)
    ask(slave, "BBHBB", 0xE2, 0, 0, 0, 0)
    address = address_of(NAMES[1])
    answers = [ask(slave, "BBBBI", 0xE1, 0xFF, 8, 0, address) for _ in range(250)]
    assert answers.count(b"\xff") == (1400 - 5) // 8
    assert answers[-1] == b"\xfe\x30"


def test_the_a2l_file_has_every_number_at_its_address():
    text = a2l.text()
    assert text.count("/begin") == text.count("/end")
    assert f"VALUE 0x{address_of(KP):08X} FLOAT64 0 NO_COMPU_METHOD -1000.0 1000.0" in text
    assert "/begin MEASUREMENT plant.actuator.pulse_channel[3]" in text
    numbers = [p for side in ("plant", "controller") for p in live(side).values()
               if p.kind in ("number", "boolean")]  # fmt: skip
    assert text.count("/begin CHARACTERISTIC") == len(numbers)


def test_the_a2l_file_is_what_calibration_tools_accept(tmp_path):
    tool = Path(sys.executable).with_name("a2ltool")
    if not tool.exists():
        pytest.skip("needs a2ltool (extra test)")
    file = tmp_path / "hil.a2l"
    file.write_text(a2l.text(7777))
    done = subprocess.run(
        [tool, "--check", "--strict", file], check=False, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "No problems found" in done.stdout
    if_data = file.read_text().partition("/begin IF_DATA XCP")[2].partition("/end IF_DATA")[0]
    assert 'XCP_ON_UDP_IP 0x0100 7777 ADDRESS "127.0.0.1"' in if_data
    commands = {0xFB: "GET_COMM_MODE_INFO", 0xD3: "ALLOC_ODT_ENTRY", 0xED: "SHORT_DOWNLOAD"}
    assert set(commands) <= set(Slave(Target())._commands)
    assert all(f"OPTIONAL_CMD {name}" in if_data for name in commands.values())


class Bench(Target):
    """An engine whose plant records seventeen ticks a look, and that ends when it is told."""

    def __init__(self):
        super().__init__()
        self.ended, self.port, self.tick = False, 0, 0

    def rows(self, side):
        self.tick += 17 * (side == "plant")
        return ticks(self.tick, 17) if side == "plant" else {}


@pytest.fixture
def port():
    """Where a slave serves."""
    bench = Bench()
    server = Server(bench, 0)
    thread = threading.Thread(target=server.serve)
    thread.start()
    yield server.port
    bench.ended = True
    thread.join()
    server.close()


def sent(connection, packet):
    """Send a command as it goes over Ethernet; returns the response, empty when there is none."""
    connection.settimeout(5.0 if packet[0] == 0xFF else 1.0)
    connection.send(struct.pack("<HH", len(packet), 0) + packet)
    try:
        return connection.recv(2000)[4:]
    except TimeoutError:
        return b""


def test_who_connected_last_is_served_whoever_else_comes_and_goes(port):
    stream = socket.create_connection(("127.0.0.1", port))
    assert sent(stream, b"\xff\x00")[:1] == b"\xff"
    datagrams = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    with stream, datagrams:
        datagrams.connect(("127.0.0.1", port))
        assert sent(datagrams, b"\xfd") == b""
        assert sent(datagrams, b"\xff\x00")[:1] == b"\xff"
        assert sent(datagrams, b"\xd5\x00\x03\x00") == b"\xff"
        assert sent(stream, b"\xfd") == b""
        stream.close()
        assert sent(datagrams, b"\xd4\x00\x02\x00\x01") == b"\xff"  # its lists are still there


class Remote:
    """A slave behind a socket, for what a slave at hand is asked."""

    def __init__(self, connection):
        self.answer = lambda packet: sent(connection, packet)


def test_over_udp_every_tick_comes_in_packets_counted_one_by_one(port):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as datagrams:
        datagrams.connect(("127.0.0.1", port))
        assert sent(datagrams, b"\xff\x00")[:1] == b"\xff"
        form = listed(Remote(datagrams), stopped=True)
        datagrams.send(struct.pack("<HH", 2, 0) + b"\xdd\x01")
        counts, rows = [], []
        while len(rows) < 300:
            message = datagrams.recv(2000)
            assert len(message) <= 1404
            while message:
                length, count = struct.unpack_from("<HH", message)
                packet, message = message[4 : 4 + length], message[4 + length :]
                counts.append(count)
                if packet != b"\xff":
                    rows.append(struct.unpack(form, packet))
    assert counts == list(range(counts[0], counts[0] + len(counts)))
    assert [row[2] for row in rows] == list(range(rows[0][2], rows[0][2] + len(rows)))
    assert all(row[3] == row[2] * 1e-5 for row in rows)
