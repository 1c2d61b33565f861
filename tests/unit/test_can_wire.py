"""The timed bus: durations to the bit, arbitration by identifier, errors and bus-off."""

import contextlib
import itertools
import random
import time

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.can.virtual.directory import DIRECTORY_VARIABLE
from drivers.can.virtual.wire import Waiting, arbitration_key, decide, frame_ns
from hil.errors import ConfigError
from hil.wire.busload import (
    BITS_MAX,
    BITS_MIN,
    check_fit,
    classic_bits,
    fd_bits,
    frames_per_tick,
    stuff_bits,
    worst_load,
)


@pytest.fixture
def open_bus(tmp_path_factory, monkeypatch):
    monkeypatch.setenv(DIRECTORY_VARIABLE, str(tmp_path_factory.mktemp("can")))
    with contextlib.ExitStack() as stack:

        def opened(**kwargs):
            return stack.enter_context(
                can.Bus("t", "zenoh", ignore_config=True, timing=True, **kwargs)
            )

        yield opened


def naive_stuffing(text):
    """Stuff a string of bits as the standard describes it, bit by bit."""
    out = ""
    for bit in text:
        out += bit
        if out[-5:] in {"00000", "11111"}:
            out += "1" if bit == "0" else "0"
    return out


@given(st.text("01", min_size=1, max_size=120))
def test_stuffing_counts_the_bits_that_are_stuffed(text):
    assert stuff_bits(int(text, 2), len(text)) == len(naive_stuffing(text)) - len(text)


@given(st.integers(0, 0x7FF), st.binary(min_size=8, max_size=8))
def test_a_standard_frame_of_eight_bytes_has_111_to_135_bits(can_id, data):
    assert BITS_MIN <= classic_bits(can_id, data) <= BITS_MAX


def test_lengths_without_stuffing():
    """44 bits, 64 with an extended identifier, and the gap of 3; 8 a byte."""
    assert classic_bits(0x555, bytes([0x55] * 8)) - 3 >= 44 + 64
    assert classic_bits(0x555, b"", remote=5) < classic_bits(0x555, bytes([0x55] * 5))
    assert classic_bits(0x15555555, bytes([0x55] * 8), extended=True) - 3 >= 64 + 64


def test_fd_frames_have_a_slow_and_a_fast_part():
    slow, fast = fd_bits(0x123, 64, bytes([0x55] * 64))
    assert 25 < slow < 45
    assert 512 + 21 + 4 < fast < 512 + 21 + 40
    classic = frame_ns(1, bytes(8), 8, 500_000)
    assert frame_ns(1, bytes(8), 8, 500_000, data_bitrate_bit_s=5_000_000) < classic


def test_the_loop_fits_1_mbit_at_1_khz_and_says_what_does_not():
    assert frames_per_tick() == 6
    assert worst_load(1000, 1e6) == pytest.approx(0.81)
    check_fit(1234, 1_000_000)
    with pytest.raises(ConfigError, match="accepted up to 617 Hz"):
        check_fit(1000, 500_000)


def test_arbitration_follows_the_bits_on_the_wire():
    def key(can_id, extended=False, remote=False):
        return arbitration_key(can_id, extended=extended, remote=remote)

    order = [key(0x0FF), key(0x100), key(0x100, remote=True), key(0x100 << 18, extended=True),
             key(0x100 << 18, extended=True, remote=True), key((0x100 << 18) + 1, extended=True),
             key(0x101)]  # fmt: skip
    assert order == sorted(order)
    assert len(set(order)) == len(order)


def test_the_wire_goes_to_the_lowest_identifier_of_those_that_wait():
    waiting = {0: Waiting(30, 0, 10), 1: Waiting(10, 5, 10), 2: Waiting(20, 5, 10)}
    assert decide(waiting, 0, 100) == ({0: 10, 1: 20, 2: 30}, 30)


def test_nothing_begins_before_it_is_ready_or_after_now():
    assert decide({0: Waiting(1, 50, 10)}, 0, 49) == ({}, 0)
    assert decide({0: Waiting(1, 50, 10)}, 0, 50) == ({0: 60}, 60)
    assert decide({0: Waiting(1, 0, 10)}, 70, 60) == ({}, 70)


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 99), st.integers(1, 30)), max_size=20))
def test_frames_never_overlap_and_none_that_is_ready_is_passed_by_a_higher_one(rows):
    waiting = {slot: Waiting(*row) for slot, row in enumerate(rows)}
    ends, free = decide(waiting, 0, 10_000)
    assert set(ends) == set(waiting)
    spans = sorted((end - waiting[slot].duration_ns, end, slot) for slot, end in ends.items())
    for (_, end, _), (start, _, _) in itertools.pairwise(spans):
        assert start >= end
    for start, _, slot in spans:
        rivals = [s for b, _, s in spans if b > start and waiting[s].ready_ns <= start]
        assert all(waiting[s].key >= waiting[slot].key for s in rivals)
    assert free == max(ends.values(), default=0)


def test_frames_take_their_time_on_the_wire(open_bus):
    sender, receiver = open_bus(bitrate=125_000), open_bus(bitrate=125_000)
    data = [random.Random(i).randbytes(8) for i in range(10)]
    for payload in data:
        sender.send(can.Message(arbitration_id=0x123, is_extended_id=False, data=payload))
    got = [receiver.recv(2.0) for _ in data]
    for before, message, payload in zip(got, got[1:], data[1:], strict=False):
        wire_s = classic_bits(0x123, payload) / 125_000
        assert message.timestamp - before.timestamp > 0.9 * wire_s


def test_the_lower_identifier_wins_the_bus(open_bus):
    low, high, receiver = (open_bus(bitrate=20_000) for _ in range(3))
    for _ in range(6):  # 6 ms each: both queues stay full
        high.send(can.Message(arbitration_id=0x200, is_extended_id=False, data=bytes(8)))
    for _ in range(3):
        low.send(can.Message(arbitration_id=0x100, is_extended_id=False, data=bytes(8)))
    order = [receiver.recv(2.0).arbitration_id for _ in range(9)]
    assert order[:2].count(0x200) <= 2
    assert order.index(0x100) <= 1
    assert max(i for i, can_id in enumerate(order) if can_id == 0x100) <= 5


def test_errors_are_repaired_counted_and_seen_by_all(open_bus):
    sender, receiver = open_bus(error_rate=0.3, seed=3), open_bus()
    for number in range(20):
        sender.send(can.Message(arbitration_id=number), timeout=1.0)
    data, errors = [], 0
    while len(data) < 20:
        message = receiver.recv(2.0)
        errors += message.is_error_frame
        if not message.is_error_frame:
            data.append(message.arbitration_id)
    assert data == list(range(20))
    assert errors > 0
    assert sum(1 for _ in range(errors) if sender.recv(1.0).is_error_frame) == errors


def test_too_many_errors_end_in_bus_off_and_a_restart_mends_it(open_bus):
    sender, receiver = open_bus(error_rate=1.0), open_bus()
    states = set()
    sender.send(can.Message(arbitration_id=1))
    end = time.monotonic() + 3.0
    while sender.state is not can.BusState.ERROR and time.monotonic() < end:
        states.add(sender.state)
        time.sleep(1e-4)
    assert sender.state is can.BusState.ERROR
    assert sender.error_count >= 256
    with pytest.raises(can.CanOperationError, match="off the bus"):
        sender.send(can.Message())
    frames = []
    while (message := sender.recv(0.1)) is not None:
        frames.append(message)
    assert frames[-1].arbitration_id & 0x40
    sender.state = can.BusState.ACTIVE
    assert sender.state is can.BusState.ACTIVE
    assert sender.error_count == 0
    assert all(message.is_error_frame for message in iter(lambda: receiver.recv(0.05), None))


def test_a_node_comes_back_by_itself_after_its_restart_time(open_bus):
    sender, receiver = open_bus(restart_s=0.1), open_bus()
    sender.state = can.BusState.ERROR
    end = time.monotonic() + 3.0
    while sender.state is can.BusState.ERROR and time.monotonic() < end:
        time.sleep(0.01)
    sender.send(can.Message(arbitration_id=5))
    assert receiver.recv(2.0).arbitration_id == 5


def test_a_full_queue_is_an_error_and_can_be_flushed(open_bus):
    sender = open_bus(bitrate=10_000)
    with contextlib.suppress(can.CanOperationError):
        for _ in range(100):
            sender.send(can.Message(data=bytes(8)))
    with pytest.raises(can.CanOperationError, match="queue full"):
        sender.send(can.Message(data=bytes(8)))
    sender.flush_tx_buffer()
    sender.send(can.Message())


def test_all_nodes_run_at_one_bit_rate(open_bus):
    open_bus(bitrate=500_000)
    with pytest.raises(can.CanInitializationError, match="runs at 500000"):
        open_bus(bitrate=250_000)
