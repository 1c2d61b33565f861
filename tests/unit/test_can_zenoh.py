"""The virtual bus holds what python-can asks of any two buses on one wire."""

import asyncio
import contextlib
import os
import signal
import subprocess
import sys
import time

import can
import pytest

from drivers.can.virtual.directory import DIRECTORY_VARIABLE, channels

TIMEOUT = 20.0
"""Of what must come; a busy machine may take its time."""

LAST = 0x1FFFFFFF
TEXT = bytes(range(8))


@pytest.fixture(autouse=True)
def directory(tmp_path_factory, monkeypatch):
    folder = tmp_path_factory.mktemp("can")
    monkeypatch.setenv(DIRECTORY_VARIABLE, str(folder))
    return folder


@pytest.fixture
def open_bus():
    with contextlib.ExitStack() as stack:

        def opened(channel="t", **kwargs):
            return stack.enter_context(can.Bus(channel, "zenoh", ignore_config=True, **kwargs))

        yield opened


@pytest.fixture
def pair(open_bus):
    return open_bus(fd=True), open_bus(fd=True)


MESSAGES = {
    "standard": {"arbitration_id": 0x100, "is_extended_id": False, "data": TEXT},
    "extended": {"arbitration_id": 0x123456, "data": TEXT},
    "highest": {"arbitration_id": 0x1FFFFFFF, "data": TEXT},
    "remote": {"arbitration_id": 0x200, "is_extended_id": False, "is_remote_frame": True, "dlc": 4},
    "short": {"arbitration_id": 0x300, "is_extended_id": False, "data": b"abc"},
    "empty": {"arbitration_id": 0x301, "is_extended_id": False},
    "error": {"arbitration_id": 0x40, "is_error_frame": True, "data": bytes(8)},
    "fd": {"arbitration_id": 0x56789, "is_fd": True, "data": b"\xff" * 64},
    "fd-brs": {"arbitration_id": 0x5, "is_fd": True, "bitrate_switch": True, "data": bytes(48)},
    "fd-esi": {"arbitration_id": 0x5, "is_fd": True, "error_state_indicator": True, "data": b"1"},
}


@pytest.mark.parametrize("fields", MESSAGES.values(), ids=MESSAGES)
def test_every_kind_of_message_arrives_unchanged_in_both_directions(pair, fields):
    one, two = pair
    sent = can.Message(**fields)
    for sender, receiver in ((one, two), (two, one)):
        sender.send(sent)
        got = receiver.recv(TIMEOUT)
        assert got.equals(sent, timestamp_delta=None, check_channel=False)
        assert got.is_rx
        assert got.channel == "t"
        assert sender.recv(0) is None


def test_without_messages_nothing_is_received_in_the_time_given(pair):
    begin = time.monotonic()
    assert pair[0].recv(0.1) is None
    assert 0.1 <= time.monotonic() - begin < TIMEOUT
    assert pair[0].recv(0) is None


def test_time_stamps_are_absolute_finer_than_a_second_and_of_the_sending(pair):
    before = time.time()
    pair[0].send(can.Message())
    after = time.time()
    time.sleep(0.05)
    pair[0].send(can.Message())
    first, second = (pair[1].recv(TIMEOUT).timestamp for _ in range(2))
    assert before - 1e-3 <= first <= after + 1e-3
    assert 0.05 <= second - first <= 0.05 + TIMEOUT


def test_order_is_kept_in_a_burst_and_what_has_no_room_is_counted(pair):
    """A node that is not run for as long as a send is patient loses frames, and knows how many."""
    for number in range(3000):
        pair[0].send(can.Message(arbitration_id=number, data=number.to_bytes(4, "big")))
    got = received_until_last(*pair)
    assert got == sorted(set(got))
    assert len(got) + pair[1].overruns >= 3000
    assert got == list(range(3000)) or pair[1].overruns > 0


def received_until_last(sender, receiver):
    """Return the identifiers up to a last message, which is sent until one of it has come."""
    got = []
    while True:
        sender.send(can.Message(arbitration_id=LAST))
        while (message := receiver.recv(0.2)) is not None:
            if message.arbitration_id == LAST:
                return got
            got.append(message.arbitration_id)


def test_own_messages_come_back_only_where_they_are_wanted(open_bus):
    plain, own = open_bus(), open_bus(receive_own_messages=True)
    own.send(can.Message(arbitration_id=1, data=b"12"))
    mine, theirs = own.recv(TIMEOUT), plain.recv(TIMEOUT)
    assert not mine.is_rx
    assert theirs.is_rx
    mine.data[0] = 0
    assert theirs.data == b"12"
    plain.send(can.Message(arbitration_id=2))
    assert own.recv(TIMEOUT).arbitration_id == 2
    assert plain.recv(0.02) is None


def test_filters_by_identifier_mask_and_format(open_bus):
    sender = open_bus()
    receiver = open_bus(can_filters=[{"can_id": 0x100, "can_mask": 0x7F0, "extended": False}])
    ids = [(0x0FF, False), (0x100, False), (0x100, True), (0x10F, False), (0x110, False)]
    for can_id, extended in ids:
        sender.send(can.Message(arbitration_id=can_id, is_extended_id=extended))
    assert [receiver.recv(TIMEOUT).arbitration_id for _ in range(2)] == [0x100, 0x10F]
    assert receiver.recv(0.05) is None
    receiver.set_filters(None)
    sender.send(can.Message(arbitration_id=0x7FF))
    assert receiver.recv(TIMEOUT).arbitration_id == 0x7FF


def test_fd_frames_are_for_buses_opened_with_fd(open_bus):
    classic, fast = open_bus(), open_bus(fd=True)
    assert classic.protocol is can.CanProtocol.CAN_20
    assert fast.protocol is can.CanProtocol.CAN_FD
    fast.send(can.Message(is_fd=True, data=bytes(12)))
    fast.send(can.Message(arbitration_id=5))
    assert classic.recv(TIMEOUT).arbitration_id == 5
    with pytest.raises(can.CanOperationError, match="without fd"):
        classic.send(can.Message(is_fd=True))


@pytest.mark.parametrize("broken", [{"data": bytes(9)}, {"arbitration_id": 0x800,
                                                         "is_extended_id": False}])  # fmt: skip
def test_a_message_that_no_bus_could_carry_is_refused(pair, broken):
    with pytest.raises(ValueError, match=r"\w"):
        pair[0].send(can.Message(**broken))


def test_channels_are_apart(open_bus):
    here, there = open_bus("a"), open_bus("b")
    here.send(can.Message())
    assert there.recv(0.05) is None


def test_shutting_down_twice_is_once_and_a_bus_that_is_shut_says_so(open_bus):
    bus = open_bus()
    bus.shutdown()
    bus.shutdown()
    for use in (lambda: bus.send(can.Message()), lambda: bus.recv(0)):
        with pytest.raises(can.CanOperationError, match="shut down"):
            use()


def test_who_comes_later_hears_what_is_sent_after_that(open_bus):
    first = open_bus()
    first.send(can.Message(arbitration_id=1))
    for number in range(5):
        late = open_bus()
        first.send(can.Message(arbitration_id=100 + number))
        assert late.recv(TIMEOUT).arbitration_id == 100 + number


def test_periodic_messages_stop_at_their_time(pair):
    task = pair[0].send_periodic(can.Message(arbitration_id=1), 0.01, 0.1)
    task.thread.join(TIMEOUT)
    assert 1 <= len(received_until_last(*pair)) + pair[1].overruns <= 12


def test_notifier_in_an_event_loop(pair):
    async def listen():
        reader = can.AsyncBufferedReader()
        loop = asyncio.get_running_loop()
        with can.Notifier(pair[1], [reader], timeout=0.05, loop=loop):
            for number in range(20):
                pair[0].send(can.Message(arbitration_id=number))
            return [
                (await asyncio.wait_for(reader.get_message(), TIMEOUT)).arbitration_id
                for _ in range(20)
            ]

    assert asyncio.run(listen()) == list(range(20))


def test_a_bus_ends_while_a_notifier_reads_it(open_bus):
    bus = open_bus()
    errors = []

    class Listener(can.Listener):
        def on_message_received(self, msg):
            pass

        def on_error(self, exc):
            errors.append(exc)
            time.sleep(0.01)

    notifier = can.Notifier(bus, [Listener()], timeout=0.05)
    bus.shutdown()
    notifier.stop(1.0)
    assert not any(reader.is_alive() for reader in notifier._readers)


def test_state_is_told_and_a_listener_only_listens(pair):
    one, two = pair
    assert one.state is can.BusState.ACTIVE
    one.state = can.BusState.PASSIVE
    with pytest.raises(can.CanOperationError, match="only listens"):
        one.send(can.Message())
    two.send(can.Message(arbitration_id=7))
    assert one.recv(TIMEOUT).arbitration_id == 7
    one.state = can.BusState.ACTIVE
    one.send(can.Message())
    with pytest.raises(NotImplementedError):
        one.state = can.BusState.ERROR


def test_the_interface_is_known_and_finds_its_channels(open_bus):
    assert "zenoh" in can.VALID_INTERFACES
    assert can.detect_available_configs("zenoh") == []
    open_bus("one")
    open_bus("two")
    found = can.detect_available_configs("zenoh")
    assert [config["channel"] for config in found] == ["one", "two"]
    assert all(config["interface"] == "zenoh" for config in found)


@pytest.mark.parametrize("channel", ["", "..", "a/b", "x" * 40, "ä"])
def test_a_channel_that_is_no_name_is_refused(channel):
    with pytest.raises(can.CanInitializationError):
        can.Bus(channel, "zenoh", ignore_config=True)


@pytest.mark.parametrize("wrong", [{"bitrate": 5}, {"error_rate": 2.0, "timing": True},
                                   {"error_rate": 0.1}])  # fmt: skip
def test_a_medium_that_cannot_be_is_refused(wrong):
    with pytest.raises(ValueError, match=r"accepted|timing"):
        can.Bus("t", "zenoh", ignore_config=True, **wrong)
    assert channels() == {}


OTHER = """
import can, sys, time
bus = can.Bus("t", "zenoh", ignore_config=True)
print("open", flush=True)
while True:
    message = bus.recv(1.0)
    if message is not None:
        message.arbitration_id += 1
        bus.send(message)
"""


def test_another_process_answers_and_is_swept_away_when_it_is_killed(open_bus, directory):
    other = subprocess.Popen([sys.executable, "-c", OTHER], stdout=subprocess.PIPE)
    try:
        assert other.stdout.readline() == b"open\n"
        bus = open_bus()
        bus.send(can.Message(arbitration_id=41))
        assert bus.recv(TIMEOUT).arbitration_id == 42
        assert channels() == {"t": 2}
    finally:
        os.kill(other.pid, signal.SIGKILL)
        other.wait()
        other.stdout.close()
    assert channels() == {"t": 1}
    bus.send(can.Message())
    newcomer = open_bus()
    bus.send(can.Message(arbitration_id=9))
    assert newcomer.recv(TIMEOUT).arbitration_id == 9
    assert len(list((directory / "t").glob("*.sock"))) == 2


def test_nothing_is_left_of_a_bus_that_was_shut(open_bus, directory):
    open_bus().shutdown()
    assert [path.name for path in (directory / "t").iterdir()] == ["lock"]


def test_a_directory_that_others_may_write_is_refused(directory):
    directory.chmod(0o777)
    with pytest.raises(can.CanInitializationError, match="has the mode 0777; accepted is"):
        can.Bus("t", "zenoh", ignore_config=True)
