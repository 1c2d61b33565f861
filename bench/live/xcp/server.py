"""The slave's process: TCP and UDP at one port of this machine, records of both processes behind.

It is an operator under the same access control as `hil set`, and takes its place in no loop.
"""

from __future__ import annotations

import contextlib
import selectors
import socket
import struct
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Final, NamedTuple

from bench.live.engines import Engine, engine_of
from bench.live.ports import HOST, bound
from bench.live.steer import Operator, set_parameters, values_of
from bench.live.taps import SIDES
from bench.live.xcp import a2l
from bench.live.xcp.addresses import Place
from bench.live.xcp.daq import EVENTS
from bench.live.xcp.limits import MAX_DTO
from bench.live.xcp.slave import Slave
from drivers.recorder.tap import Tap
from hil.errors import HilError, LinkError

_HEAD: Final = struct.Struct("<HH")
_POLL_S: Final = 0.01
_MOST_BYTES: Final = 4096
_MOST_SENT: Final = MAX_DTO + _HEAD.size
"""Bytes of a message: what an Ethernet frame holds, and the longest packet."""

_CONNECT: Final = 0xFF
_BUSY: Final = bytes([0xFE, 0x10])


class Bench:
    """The engine, as the slave sees it: newest records, parameters over the command path."""

    def __init__(self, engine: Engine) -> None:
        self.port = 0
        self.taps: dict[str, Tap] = {}
        with contextlib.ExitStack() as opening:
            for side in SIDES:
                self.taps[side] = tap = Tap.join(engine.records_of(side))
                opening.callback(tap.close)
            self._operator: Operator = engine.operator("hil xcp")
            opening.callback(self._operator.close)
            self._leave = opening.pop_all()
        self._newest: dict[tuple[str, str], Any] = {}

    def rows(self, side: str) -> dict[str, Any]:
        """Return what a process has recorded since the last time."""
        tap = self.taps[side]
        data = tap.read()
        rows = tap.rows(data) if data else {}
        for topic, found in rows.items():
            self._newest[side, topic] = found[-1]
        return rows

    @property
    def ended(self) -> bool:
        """Whether nothing more will come."""
        return any(tap.ended for tap in self.taps.values())

    def read(self, place: Place) -> float:
        """Return the newest value of a signal, or the value in force of a parameter."""
        if place.parameter is not None:
            key = place.parameter.key
            value = values_of(self._operator, key).get(key)
            return float("nan") if value is None else float(value)
        assert place.signal is not None
        row = self._newest.get((place.signal.side, place.signal.topic))
        if row is None:
            return 0.0
        value = row[place.signal.field]
        return float(value if place.signal.item is None else value[place.signal.item])

    def write(self, place: Place, value: float | bool) -> bool:
        """Change a parameter; whether that was taken."""
        assert place.parameter is not None
        try:
            answers = set_parameters(self._operator, {place.parameter.key: value})
        except HilError:
            return False
        return all(answer.taken for answer in answers)

    def period_us(self, side: str) -> int:
        """Return how far the ticks of a process are apart."""
        return round(1e6 / max(self.taps[side].rate_hz, 1))

    def description(self) -> str:
        """Return the A2L file of this slave."""
        return a2l.text(self.port)

    def close(self) -> None:
        """Leave."""
        self._leave.close()


class Master(NamedTuple):
    """Who measures and calibrates: where it is, and what sends to it."""

    where: object
    send: Callable[[bytes], object]


class Server:
    """Both sockets at one port; the master that connected last is the one that is served."""

    def __init__(self, bench: Bench, port: int) -> None:
        self._bench = bench
        self._slave = Slave(bench)
        self._master: Master | None = None
        self._count = 0
        self._selector = selectors.DefaultSelector()
        self._listener = bound(port)
        self.port: int = self._listener.getsockname()[1]
        bench.port = self.port
        self._datagrams = bound(self.port, socket.SOCK_DGRAM)
        self._selector.register(self._listener, selectors.EVENT_READ, self._accept)
        self._selector.register(self._datagrams, selectors.EVENT_READ, self._datagram)

    def serve(self) -> None:
        """Serve until the engine's records end."""
        next_s = time.monotonic()
        while not self._bench.ended:
            for key, _ in self._selector.select(max(next_s - time.monotonic(), 0.0)):
                key.data()
            if time.monotonic() >= next_s:
                next_s = time.monotonic() + _POLL_S
                for side in EVENTS:
                    self._measure(side)

    def _measure(self, side: str) -> None:
        rows = self._bench.rows(side)
        self._transmit(self._slave.packets(side, rows))

    def _transmit(self, packets: Iterable[bytes]) -> None:
        """Send packets, as many as fit in each message; a master that takes none is left."""
        waiting = b""
        for packet in packets:
            if len(waiting) + _HEAD.size + len(packet) > _MOST_SENT:
                self._send(waiting)
                waiting = b""
            waiting += _HEAD.pack(len(packet), self._count) + packet
            self._count = self._count + 1 & 0xFFFF
        if waiting:
            self._send(waiting)

    def _send(self, message: bytes) -> None:
        if self._master is None:
            return
        try:
            self._master.send(message)
        except OSError:
            self._leave(self._master.where)

    def _leave(self, where: object) -> None:
        """Forget a master, if it is the one that is served."""
        if self._master is not None and self._master.where == where:
            self._master = None
            self._slave = Slave(self._bench)

    def _accept(self) -> None:
        connection, sender = self._listener.accept()
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.settimeout(1.0)
        received = bytearray()
        master = Master(("TCP", sender), connection.sendall)

        def take() -> None:
            try:
                data = connection.recv(_MOST_BYTES)
            except OSError:
                data = b""
            if not data:
                self._selector.unregister(connection)
                connection.close()
                self._leave(master.where)
                return
            received.extend(data)
            self._hear(received, master)

        self._selector.register(connection, selectors.EVENT_READ, take)

    def _datagram(self) -> None:
        data, sender = self._datagrams.recvfrom(_MOST_BYTES)

        def send(message: bytes) -> None:
            self._datagrams.sendto(message, sender)

        self._hear(bytearray(data), Master(("UDP", sender), send))

    def _hear(self, received: bytearray, master: Master) -> None:
        """Answer every whole command among the bytes."""
        while len(received) >= _HEAD.size:
            length, _ = _HEAD.unpack_from(received)
            if len(received) < _HEAD.size + length or not length:
                return
            packet = bytes(received[_HEAD.size : _HEAD.size + length])
            del received[: _HEAD.size + length]
            self._answer(packet, master)

    def _answer(self, packet: bytes, master: Master) -> None:
        """Answer a command; one who has not connected, or not last, hears nothing."""
        if packet[0] == _CONNECT:
            self._count, self._master, self._slave = 0, master, Slave(self._bench)
        if self._master is None or self._master.where != master.where:
            return
        try:
            response = self._slave.answer(packet)
        except LinkError:
            response = _BUSY
        self._transmit([response])

    def close(self) -> None:
        """Give both sockets back."""
        self._selector.close()
        for each in (self._listener, self._datagrams):
            with contextlib.suppress(OSError):
                each.close()


def run(port: int, directory: Path | None) -> int:
    """Serve a running engine to an XCP master.

    Raises: ConfigError, LinkError when no engine records
    """
    bench = Bench(engine_of(directory))
    server = Server(bench, port)
    try:
        print(f"XCP on {HOST}:{server.port}, TCP and UDP", flush=True)
        server.serve()
    finally:
        server.close()
        bench.close()
    return 0
