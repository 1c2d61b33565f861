"""Frames of one tick come together, whatever the bus does to them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.can.assembly import MAX_FRAMES, Assembler
from hil.wire.codec import Decoder, Encoder, iter_frames, pack_frame
from hil.wire.messages import ControllerTick, MachineCommand, PistonSample, PlantTick, Pulse

QUIET = 250
NAN = math.nan


def plant_ticks(first, count):
    """Batches of a plant that has always been there."""
    encoder = Encoder()
    batches = {}
    for tick in range(first + count):
        head = PlantTick(tick, 2, 0, 100.0, NAN, NAN)
        batches[tick] = encoder.encode((head, PistonSample(tick * 1e-6, 1.0)))
    return [list(iter_frames(batches[tick])) for tick in range(first, first + count)]


def answers(count, pulses=2):
    encoder = Encoder()
    ticks = []
    for tick in range(count):
        sent = [Pulse(0, 1000 * tick, 500), Pulse(2, 1000 * tick + 700, 500)][:pulses]
        batch = (ControllerTick(tick, 2 + len(sent), 2), MachineCommand(2, 0.0, 810.0, 1.0), *sent)
        ticks.append(list(iter_frames(encoder.encode(batch))))
    return ticks


def joined(*frames):
    return b"".join(pack_frame(*frame) for frame in frames)


class Bench:
    def __init__(self, sender="plant"):
        self.assembler = Assembler(sender, QUIET)
        self.now = 0

    def push(self, *frames):
        for frame in frames:
            self.assembler.push(*frame, self.now)

    def pop(self, later=0):
        self.now += later
        return self.assembler.pop(self.now)


def test_a_tick_is_over_with_the_frame_that_its_head_counts():
    for ticks, sender in ((plant_ticks(0, 5), "plant"), (answers(5), "controller")):
        bench = Bench(sender)
        for frames in ticks:
            bench.push(*frames[:-1])
            assert bench.pop() is None
            bench.push(frames[-1])
            assert bench.pop() == joined(*frames)
        assert bench.assembler.counters == {"incomplete": 0, "strays": 0}


def test_the_order_within_a_tick_does_not_matter():
    bench = Bench()
    for head, body in plant_ticks(0, 3):
        bench.push(body, head)
        assert bench.pop() == joined(body, head)


def test_a_lost_tail_is_waited_for_no_longer_than_the_bus_is_quiet():
    bench = Bench()
    (head, _), second = plant_ticks(0, 2)
    bench.push(head)
    assert bench.pop(QUIET - 1) is None
    assert bench.pop(1) == joined(head)
    bench.push(*second)
    assert bench.pop() == joined(*second)
    assert bench.assembler.counters["incomplete"] == 1


def test_the_next_head_ends_a_tick_that_lacks_frames():
    bench = Bench()
    (head, _), second = plant_ticks(0, 2)
    bench.push(head, *second)
    assert bench.pop() == joined(head)
    assert bench.pop() == joined(*second)


def test_a_body_whose_head_is_lost_stays_apart_from_the_next_tick():
    bench = Bench()
    _, (_, body), third = plant_ticks(0, 3)
    bench.push(body, *third)
    assert bench.pop() == joined(body)
    assert bench.pop() == joined(*third)


def test_a_damaged_frame_counts_as_the_one_that_it_was():
    bench = Bench()
    first, (head, (can_id, word)) = plant_ticks(0, 2)
    bench.push(*first, head, (can_id, word ^ 1 << 40))
    assert bench.pop() == joined(*first)
    assert bench.pop() == joined(head, (can_id, word ^ 1 << 40))


def test_repeated_frames_travel_with_the_next_tick_and_are_counted_there():
    bench, decoder = Bench(), Decoder("plant")
    first, second = plant_ticks(0, 2)
    bench.push(*first, *first)
    assert bench.pop() == joined(*first)
    assert bench.pop(10 * QUIET) is None
    bench.push(*second)
    assert bench.pop() == joined(*first, *second)
    assert len(decoder.decode(joined(*first))) == 2
    assert len(decoder.decode(joined(*first, *second))) == 2
    assert decoder.repeated == 2


def test_a_late_frame_is_no_part_of_the_tick_that_it_comes_in():
    bench = Bench()
    (head, body), second = plant_ticks(0, 2)
    bench.push(head)
    assert bench.pop(QUIET) == joined(head)
    bench.push(second[0], body, second[1])
    assert bench.pop() == joined(second[0], body, second[1])
    assert bench.assembler.counters["strays"] == 1


def test_a_sender_that_repeats_one_tick_for_ever_fills_no_memory():
    bench = Bench()
    (frames,) = plant_ticks(0, 1)
    bench.push(*frames)
    bench.pop()
    taken = 0
    for _ in range(1000):
        bench.push(*frames)
        while (batch := bench.pop(QUIET)) is not None:
            taken += len(batch) // 10
    rest = bench.assembler.rest()
    assert taken + (len(rest) // 10 if rest else 0) == 2000
    assert bench.assembler.counters["strays"] == 2000


def test_strays_alone_are_handed_over_when_nothing_else_comes():
    bench = Bench()
    (frames,) = plant_ticks(0, 1)
    bench.push(*frames, frames[1])
    assert bench.assembler.rest() is None or bench.pop() is not None
    bench = Bench()
    bench.push(*frames)
    bench.pop()
    bench.push(frames[1])
    assert bench.assembler.rest() == joined(frames[1])
    assert bench.assembler.rest() is None


def test_a_sender_that_starts_again_is_heard_after_a_silence():
    bench = Bench()
    old, fresh = plant_ticks(5000, 1)[0], plant_ticks(0, 1)[0]
    bench.push(*old)
    bench.pop()
    bench.now += 2_000_000_000
    bench.push(*fresh)
    assert bench.pop() == joined(*fresh)


def test_a_gap_of_any_length_is_no_obstacle():
    for gap in (1, 7, 8, 15, 16, 17, 50, 1000):
        bench = Bench()
        ticks = plant_ticks(0, gap + 2)
        bench.push(*ticks[0])
        bench.pop()
        bench.push(*ticks[gap + 1])
        assert bench.pop() == joined(*ticks[gap + 1])


def test_ticks_go_on_past_their_32_bits():
    encoder, bench = Encoder(), Bench()
    for tick in (2**32 - 2, 2**32 - 1, 0, 1):
        head = PlantTick(tick, 2, 0, 100.0, NAN, NAN)
        frames = list(iter_frames(encoder.encode((head, PistonSample(0.0, 0.0)))))
        bench.push(*frames)
        assert bench.pop() == joined(*frames)


def test_frames_of_others_are_passed_over():
    bench = Bench()
    (frames,) = plant_ticks(0, 1)
    bench.push((0x200, 1), (0x7FF, 2), frames[0], (0x123, 3), frames[1])
    assert bench.pop() == joined(*frames)


@given(st.data())
def test_nothing_is_made_up_lost_or_held_back(data):
    """Whatever comes in whatever order: each frame comes out once, in its place."""
    ticks = answers(6)
    pool = [frame for frames in ticks for frame in frames]
    fed = data.draw(st.lists(st.sampled_from(pool), max_size=60))
    bench, out = Bench("controller"), []
    for frame in fed:
        bench.push(frame)
        while (batch := bench.pop(data.draw(st.sampled_from([0, QUIET])))) is not None:
            out += iter_frames(batch)
    while (batch := bench.pop(QUIET) or bench.assembler.rest()) is not None:
        out += iter_frames(batch)
    assert out == fed


@pytest.mark.parametrize("sender", ["plant", "controller"])
def test_a_babbler_is_cut_into_batches(sender):
    bench = Bench(sender)
    can_id = 0x101 if sender == "plant" else 0x202
    for word in range(10 * MAX_FRAMES):
        bench.push((can_id, word << 32))
    sizes = []
    while (batch := bench.pop()) is not None:
        sizes.append(len(batch) // 10)
    assert sizes == [MAX_FRAMES] * 10


FATES = st.lists(st.sampled_from(["pass", "lost", "twice", "first", "after", "flipped"]))


def arrived(frames, before, fates):
    """What becomes of a tick's frames on a bus that loses, repeats, swaps and alters them."""
    came = []
    for can_id, word in frames:
        fate = fates.pop() if fates else "pass"
        frame = (can_id, word ^ 1 << 40) if fate == "flipped" else (can_id, word)
        copies = {"lost": 0, "twice": 2}.get(fate, 1)
        came += [before, frame] if fate == "after" else [frame] * copies
        if fate == "first":
            came.insert(0, came.pop())
    return came


@given(st.sampled_from([plant_ticks(0, 20), answers(20)]), FATES)
def test_frames_that_came_in_one_piece_make_the_same_batch_as_one_by_one(ticks, fates):
    sender = "plant" if ticks[0][0][0] == 0x100 else "controller"
    short, long = Assembler(sender, QUIET), Assembler(sender, QUIET)
    before = ticks[0][-1]
    for now, frames in enumerate(ticks):
        came = arrived(frames, before, fates)
        before = frames[-1]
        taken = short.whole([(*frame, now) for frame in came], now) if came else None
        for frame in came:
            long.push(*frame, now)
            if taken is None:
                short.push(*frame, now)
        assert long.pop(now + QUIET) == (taken or short.pop(now + QUIET))
        assert long.idle == short.idle


def test_a_tick_in_one_piece_needs_no_second_look():
    bench = Bench("controller")
    for frames in answers(3):
        assert bench.assembler.whole([(*frame, 0) for frame in frames], 0) == joined(*frames)
        assert bench.assembler.idle
    (skipped, (head, body)) = plant_ticks(0, 2)
    late = Bench()
    assert late.assembler.whole([(*body, 0), (*head, 0)], 0) is None
    assert late.assembler.whole([(*head, 0)], 0) is None
    assert late.assembler.whole([(*head, 0), (*head, 0)], 0) is None
    assert late.assembler.whole([(*head, 0), (*skipped[1], 0)], 0) is None
    assert late.assembler.idle
