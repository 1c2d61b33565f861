"""The ring: bytes come out as they went in, whole puts only, whatever the order of calls."""

from collections import deque

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.recorder import ring

CAPACITY = ring.PAGE

CALLS = st.lists(
    st.one_of(
        st.tuples(st.just("put"), st.integers(0, CAPACITY + 5)),
        st.tuples(st.just("read"), st.integers(0, 2 * CAPACITY)),
        st.tuples(st.just("final"), st.integers(0, 2 * CAPACITY)),
    ),
    max_size=60,
)


def both_ends(capacity=CAPACITY):
    import os

    fd = ring.create(capacity)
    ends = ring.Producer(fd), ring.Consumer(fd)
    os.close(fd)
    return ends


def pattern(start, count):
    """Bytes that tell their own place in the stream."""
    return bytes((start + k) * 37 % 251 for k in range(count))


@given(calls=CALLS)
def test_the_ring_behaves_like_a_bounded_queue(calls):
    producer, consumer = both_ends()
    model = deque()
    written = visible = 0
    for call, size in calls:
        if call == "put":
            data = pattern(written, size)
            fits = len(model) + size <= CAPACITY
            assert producer.put(data) is fits
            if fits:
                model.extend(data)
                written += size
        else:
            limit = written if call == "final" else visible
            already = written - len(model)
            expected = min(size, limit - already)
            got = consumer.read(size, final=call == "final")
            assert got == bytes(model.popleft() for _ in range(expected))
            visible = written
        assert consumer.waiting == len(model)


def test_a_put_over_the_end_arrives_whole():
    producer, consumer = both_ends()
    assert producer.put(bytes(CAPACITY - 10))
    assert consumer.read(CAPACITY, final=True) == bytes(CAPACITY - 10)
    data = pattern(0, 100)
    assert producer.put(data)
    assert consumer.read(CAPACITY, final=True) == data


def test_bytes_become_readable_one_call_after_their_put():
    producer, consumer = both_ends()
    producer.put(b"tick")
    assert consumer.read(100) == b""
    assert consumer.read(100) == b"tick"


def test_a_full_ring_refuses_and_takes_again_after_a_read():
    producer, consumer = both_ends()
    assert producer.put(bytes(CAPACITY))
    assert not producer.put(b"x")
    consumer.read(1, final=True)
    assert producer.put(b"x")


def test_counts_and_the_end_reach_the_other_side():
    producer, consumer = both_ends()
    assert not consumer.closed
    producer.count_dropped()
    producer.count_dropped()
    producer.close()
    assert consumer.dropped == producer.dropped == 2
    assert consumer.closed


@pytest.mark.parametrize("capacity", [0, 100, ring.PAGE + 1, 3 * ring.PAGE])
def test_a_capacity_that_cannot_be_masked_is_refused(capacity):
    with pytest.raises(ValueError, match="a power of two"):
        ring.create(capacity)


def test_another_consumer_begins_with_what_the_one_before_had_not_written():
    fd = ring.create(ring.PAGE)
    producer, lost = ring.Producer(fd), ring.Consumer(fd)
    producer.put(b"written" + b"read only")
    lost.read(ring.PAGE, final=True)
    lost.note_written(len(b"read only"))
    producer.put(b" and waiting")
    producer.rewind()
    assert ring.Consumer(fd).read(ring.PAGE, final=True) == b"read only and waiting"


def test_what_was_overwritten_meanwhile_is_given_up_at_the_bound_of_a_put():
    fd = ring.create(ring.PAGE)
    producer, lost = ring.Producer(fd), ring.Consumer(fd)
    producer.put(b"a" * 100)
    lost.read(ring.PAGE, final=True)
    lost.note_written(100)
    producer.put(b"b" * (ring.PAGE - 50))
    producer.rewind()
    producer.put(b"next")
    assert ring.Consumer(fd).read(ring.PAGE, final=True) == b"next"
