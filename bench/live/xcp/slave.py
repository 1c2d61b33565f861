"""The slave's answers: one packet in, one packet out; what a master sees of a running engine.

ASAM MCD-1 XCP 1.x: connect, status, upload, download, dynamic DAQ lists with time stamps.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Final, Protocol

from bench.live.xcp.addresses import STRIDE, Place, places
from bench.live.xcp.daq import EVENTS, DaqList, Rows, cycle_of
from bench.live.xcp.limits import MAX_CTO, MAX_DTO

_MOST_ODTS: Final = 0xFC
_MOST_LISTS: Final = 32
_RESOURCES: Final = 0x05
"""Calibration and DAQ."""

_SYNCH, _BUSY, _UNKNOWN, _SYNTAX, _RANGE = 0x00, 0x10, 0x20, 0x21, 0x22
_ACCESS, _SEQUENCE, _MEMORY = 0x24, 0x29, 0x30
_OK: Final = b"\xff"
_A2L_FILE: Final = 4


class XcpError(Exception):
    """What is wrong with a request, by its number in the standard."""

    def __init__(self, code: int) -> None:
        super().__init__(f"XCP error {code:#x}")
        self.code = code


class Target(Protocol):
    """The engine, as the slave sees it."""

    def read(self, place: Place) -> float:
        """Return the newest value of a signal, or the value in force of a parameter."""

    def write(self, place: Place, value: float | bool) -> bool:
        """Change a parameter; whether that was taken."""

    def period_us(self, side: str) -> int:
        """Return how far the ticks of a process are apart."""

    def description(self) -> str:
        """Return the A2L file."""


class Slave:
    """One master at a time."""

    def __init__(self, target: Target) -> None:
        self.connected = False
        self.lists: list[DaqList] = []
        self._target = target
        self._address = 0
        self._pending = b""
        self._text = b""  # what is uploaded next, in place of what is at the address
        self._pointer = (0, 0, 0)
        self._commands: Mapping[int, Callable[[bytes], bytes]] = {
            0xFF: self._connect, 0xFE: self._disconnect, 0xFD: self._status, 0xFC: self._synch,
            0xFB: self._comm_mode, 0xFA: self._identify, 0xF6: self._set_address,
            0xF5: self._upload, 0xF4: self._short_upload, 0xF0: self._download,
            0xED: self._short_download, 0xE3: self._clear_list, 0xE2: self._set_pointer,
            0xE1: self._write_entry, 0xE0: self._set_mode, 0xDF: self._tell_mode,
            0xDE: self._start_list, 0xDD: self._start_selected, 0xDC: self._clock,
            0xDA: self._processor, 0xD9: self._resolution, 0xD7: self._event_channel,
            0xD6: self._free, 0xD5: self._allocate_lists, 0xD4: self._allocate_tables,
            0xD3: self._allocate_entries,
        }  # fmt: skip

    def answer(self, packet: bytes) -> bytes:
        """Return the response to a command."""
        try:
            command = self._commands.get(packet[0])
            if command is None or (not self.connected and packet[0] != 0xFF):
                raise XcpError(_UNKNOWN)
            return command(packet)
        except XcpError as error:
            return bytes([0xFE, error.code])
        except (IndexError, struct.error):
            return bytes([0xFE, _SYNTAX])

    def packets(self, side: str, rows: Rows) -> Iterator[bytes]:
        """Yield what the running lists send of a batch of records."""
        for daq in self.lists:
            if EVENTS[daq.event] == side:
                yield from daq.packets(rows)

    def _connect(self, _packet: bytes) -> bytes:
        self.connected, self.lists = True, []
        return struct.pack("<BBBBHBB", 0xFF, _RESOURCES, 0x00, MAX_CTO, MAX_DTO, 1, 1)

    def _disconnect(self, _packet: bytes) -> bytes:
        self.connected, self.lists = False, []
        return _OK

    def _status(self, _packet: bytes) -> bytes:
        running = 0x40 if any(daq.running for daq in self.lists) else 0
        return struct.pack("<BBBBH", 0xFF, running, 0, 0, 0)

    def _synch(self, _packet: bytes) -> bytes:
        raise XcpError(_SYNCH)

    def _comm_mode(self, _packet: bytes) -> bytes:
        return struct.pack("<BBBBBBBB", 0xFF, 0, 0, 0, 0, 0, 0, 0x10)

    def _identify(self, packet: bytes) -> bytes:
        if packet[1] == _A2L_FILE:
            self._text = self._target.description().encode()
            return struct.pack("<BBHI", 0xFF, 0, 0, len(self._text))
        name = b"fpeg-hil" if packet[1] in (0, 1) else b""
        return struct.pack("<BBHI", 0xFF, 1, 0, len(name)) + name

    def _set_address(self, packet: bytes) -> bytes:
        (self._address,) = struct.unpack_from("<I", packet, 4)
        self._pending = self._text = b""
        return _OK

    def _upload(self, packet: bytes) -> bytes:
        if self._text:
            data, self._text = self._text[: packet[1]], self._text[packet[1] :]
            return _OK + data
        data = self._bytes_at(self._address, packet[1])
        self._address += len(data)
        return _OK + data

    def _short_upload(self, packet: bytes) -> bytes:
        self._set_address(packet)
        return self._upload(packet)

    def _bytes_at(self, address: int, count: int) -> bytes:
        """Bytes of one value, or of a part of it.

        Raises: XcpError when nothing is there
        """
        place = _place(address)
        start = address - place.address
        if count > place.size - start:
            raise XcpError(_RANGE)
        return place.pack(self._target.read(place))[start : start + count]

    def _download(self, packet: bytes) -> bytes:
        return self._stored(packet[2 : 2 + packet[1]], packet[1])

    def _short_download(self, packet: bytes) -> bytes:
        self._set_address(packet)
        return self._stored(packet[8 : 8 + packet[1]], packet[1])

    def _stored(self, data: bytes, count: int) -> bytes:
        """Take bytes; with the last one of a value the parameter changes.

        Raises: XcpError when it does not, or there is none
        """
        place = _place(self._address - len(self._pending))
        if place.parameter is None:
            raise XcpError(_ACCESS)
        self._pending += data
        self._address += count
        if len(data) != count or len(self._pending) > place.size:
            raise XcpError(_SYNTAX)
        if len(self._pending) == place.size:
            raw, self._pending = self._pending, b""
            if not self._target.write(place, place.unpack(raw)):
                raise XcpError(_RANGE)
        return _OK

    def _list(self, number: int) -> DaqList:
        if not number < len(self.lists):
            raise XcpError(_RANGE)
        return self.lists[number]

    def _clear_list(self, packet: bytes) -> bytes:
        daq = self._list(struct.unpack_from("<H", packet, 2)[0])
        daq.running = False
        daq.tables = [[None] * len(table) for table in daq.tables]
        return _OK

    def _free(self, _packet: bytes) -> bytes:
        self.lists = []
        return _OK

    def _allocate_lists(self, packet: bytes) -> bytes:
        (count,) = struct.unpack_from("<H", packet, 2)
        if count > _MOST_LISTS:
            raise XcpError(_MEMORY)
        self.lists = [DaqList() for _ in range(count)]
        return _OK

    def _allocate_tables(self, packet: bytes) -> bytes:
        number, count = struct.unpack_from("<HB", packet, 2)
        if sum(len(daq.tables) for daq in self.lists) + count > _MOST_ODTS:
            raise XcpError(_MEMORY)
        self._list(number).tables = [[] for _ in range(count)]
        return _OK

    def _allocate_entries(self, packet: bytes) -> bytes:
        number, table, count = struct.unpack_from("<HBB", packet, 2)
        self._list(number).tables[table] = [None] * count
        return _OK

    def _set_pointer(self, packet: bytes) -> bytes:
        number, table, entry = struct.unpack_from("<HBB", packet, 2)
        if not entry < len(self._list(number).tables[table]):
            raise XcpError(_RANGE)
        self._pointer = (number, table, entry)
        return _OK

    def _write_entry(self, packet: bytes) -> bytes:
        _, size, _, address = struct.unpack_from("<BBBI", packet, 1)
        number, table, entry = self._pointer
        place = _place(address)
        if place.signal is None or place.address != address or place.size != size:
            raise XcpError(_RANGE)
        entries = self._list(number).tables[table]
        if not entry < len(entries):
            raise XcpError(_SEQUENCE)
        used = 5 + size + sum(other.size for other in entries if other is not None)
        if used > MAX_DTO:
            raise XcpError(_MEMORY)
        entries[entry] = place
        self._pointer = (number, table, entry + 1)
        return _OK

    def _set_mode(self, packet: bytes) -> bytes:
        mode, number, event, _, _ = struct.unpack_from("<BHHBB", packet, 1)
        if event >= len(EVENTS) or mode & 0x02:
            raise XcpError(_RANGE)
        daq = self._list(number)
        daq.event, daq.stamped = event, bool(mode & 0x10)
        return _OK

    def _tell_mode(self, packet: bytes) -> bytes:
        daq = self._list(struct.unpack_from("<H", packet, 2)[0])
        mode = daq.selected | daq.stamped << 4 | daq.running << 6
        return struct.pack("<BBHHBB", 0xFF, mode, 0, daq.event, 1, 0)

    def _start_list(self, packet: bytes) -> bytes:
        mode, number = struct.unpack_from("<BH", packet, 1)
        daq = self._list(number)
        if mode == 2:
            daq.selected = True
        else:
            daq.running = mode == 1
        self._number_tables()
        return bytes([0xFF, daq.first_pid])

    def _start_selected(self, packet: bytes) -> bytes:
        mode = packet[1]
        for daq in self.lists:
            if mode == 0 or daq.selected:
                daq.running = mode == 1
                daq.selected = False
        self._number_tables()
        return _OK

    def _number_tables(self) -> None:
        """Packets are told apart by the number of their table, counted over all lists."""
        first = 0
        for daq in self.lists:
            daq.first_pid = first
            first += len(daq.tables)

    def _clock(self, _packet: bytes) -> bytes:
        now_us = time.monotonic_ns() // 1000 & 0xFFFFFFFF
        return struct.pack("<BBBBI", 0xFF, 0, 0, 0, now_us)

    def _processor(self, _packet: bytes) -> bytes:
        dynamic_and_stamped = 0x01 | 0x10
        return struct.pack("<BBHHBB", 0xFF, dynamic_and_stamped, 0, len(EVENTS), 0, 0)

    def _resolution(self, _packet: bytes) -> bytes:
        stamps_of_4_bytes_1_us = 0x04 | 0x30
        return struct.pack("<BBBBBBH", 0xFF, 1, STRIDE, 1, 0, stamps_of_4_bytes_1_us, 1)

    def _event_channel(self, packet: bytes) -> bytes:
        (number,) = struct.unpack_from("<H", packet, 2)
        if number >= len(EVENTS):
            raise XcpError(_RANGE)
        self._text = EVENTS[number].encode()
        cycle, unit = cycle_of(self._target.period_us(EVENTS[number]))
        return struct.pack("<BBBBBBB", 0xFF, 0x04, 0xFF, len(self._text), cycle, unit, 0)


def _place(address: int) -> Place:
    """The value that has an address.

    Raises: XcpError when none has
    """
    place = places().get(address - address % STRIDE)
    if place is None:
        raise XcpError(_RANGE)
    return place
