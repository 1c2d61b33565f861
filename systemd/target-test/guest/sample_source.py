"""A minimal plant on vcan0: frames worked out beforehand, sent at 1 kHz; times the answers.

sample_source.py OUT    until /run/source-may-end exists; OUT: JSON with the round trips [ns]
"""

from __future__ import annotations

import json
import math
import os
import socket
import struct
import sys
import time
from pathlib import Path

from hil.wire.codec import Encoder, iter_frames
from hil.wire.messages import PistonSample, PlantTick

PERIOD_NS = 1_000_000
LOOK_NS = 850_000
"""The answers of a tick are collected this long after its sample, by the kernel's time stamps."""

TDC_M, FREQUENCY_HZ = 0.0155, 20.0
MOST_TICKS = 60_000
FRAME = struct.Struct("<IB3xQ")
SO_TIMESTAMPNS = 35
HEAD = 0x200


def batches() -> list[list[bytes]]:
    """The settled motion as frames, for as long as the test can take."""
    encoder, omega = Encoder(), 2.0 * math.pi * FREQUENCY_HZ
    made = []
    for tick in range(MOST_TICKS):
        angle = omega * tick * 1e-3
        sample = PistonSample(-TDC_M * math.cos(angle), TDC_M * omega * math.sin(angle))
        head = PlantTick(tick, 2, 0, 0.0, math.nan, math.nan)
        batch = encoder.encode((head, sample))
        made.append([FRAME.pack(can_id, 8, word) for can_id, word in iter_frames(batch)])
    return made


def stamp_ns(ancillary: list[tuple[int, int, bytes]]) -> int:
    """The kernel's time of arrival [ns]."""
    seconds, nanoseconds = struct.unpack("=qq", ancillary[0][2][:16])
    return seconds * 1_000_000_000 + nanoseconds


def main() -> None:
    """Send and listen."""
    frames = batches()
    bus = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    bus.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
    bus.bind(("vcan0",))
    bus.setblocking(False)
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(30))
    sent_ns = [0] * MOST_TICKS
    answered_ns = [0] * MOST_TICKS
    end = Path("/run/source-may-end")
    start_ns = time.monotonic_ns() + PERIOD_NS
    tick = 0
    for tick, (first, second) in enumerate(frames):
        due_ns = start_ns + tick * PERIOD_NS
        time.sleep(max(due_ns - time.monotonic_ns(), 0) * 1e-9)
        sent_ns[tick] = time.time_ns()
        bus.send(first)
        bus.send(second)
        time.sleep(max(due_ns + LOOK_NS - time.monotonic_ns(), 0) * 1e-9)
        answer = -1
        while True:
            try:
                data, ancillary, _, _ = bus.recvmsg(16, 32)
            except BlockingIOError:
                break
            can_id, _, word = FRAME.unpack(data)
            if can_id == HEAD:
                answer = (word >> 12) & 0xFFFFFFFF
            if 0 <= answer <= tick:
                answered_ns[answer] = stamp_ns(ancillary)
        if tick % 500 == 0 and end.exists():
            break
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    pairs = list(zip(sent_ns, answered_ns, strict=True))[: tick + 1]
    trips = [answered - sent if answered else -1 for sent, answered in pairs]
    Path(sys.argv[1]).write_text(json.dumps({"trips_ns": trips}))


main()
