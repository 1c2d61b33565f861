"""End-to-end protection against an implementation of AUTOSAR's that nobody here wrote."""

import random
from itertools import combinations

import pytest
from e2e import p02

from hil.wire import messages
from hil.wire.e2e import COUNTER_MODULO, counter_marks, crc_of, is_intact, protect
from hil.wire.fields import LAYOUTS

BITS = 64
LAYOUT_PARAMS = pytest.mark.parametrize("layout", LAYOUTS.values(), ids=lambda x: x.name)
assert messages.PlantTick in {layout.make for layout in LAYOUTS.values()}


def words(seed, count):
    chance = random.Random(seed)
    return [chance.getrandbits(52) << 12 for _ in range(count)]


@LAYOUT_PARAMS
@pytest.mark.parametrize("counter", range(COUNTER_MODULO))
def test_crc_is_that_of_autosar_profile_2(layout, counter):
    marks = counter_marks(layout.data_ids)
    for payload in [0, (1 << BITS) - (1 << 12), *words(counter, 50)]:
        word = protect(payload, counter, marks)
        data = bytearray((payload | counter << 8).to_bytes(8, "little"))
        p02.e2e_p02_protect(data, layout.data_ids, length=8, increment_counter=False)
        assert word.to_bytes(8, "little") == bytes(data)
        assert p02.e2e_p02_check(word.to_bytes(8, "little"), layout.data_ids, length=8)
        assert is_intact(word, marks)


@LAYOUT_PARAMS
@pytest.mark.parametrize("counter", range(COUNTER_MODULO))
def test_one_or_two_wrong_bits_never_pass(layout, counter):
    marks = counter_marks(layout.data_ids)
    (payload,) = words(counter, 1)
    word = protect(payload, counter, marks)
    masks = [1 << bit for bit in range(BITS)]
    masks += [1 << first | 1 << second for first, second in combinations(range(BITS), 2)]
    assert not any(is_intact(word ^ mask, marks) for mask in masks)


@LAYOUT_PARAMS
def test_three_wrong_bits_never_pass(layout):
    marks = counter_marks(layout.data_ids)
    chance = random.Random(layout.can_id)
    for payload in words(layout.can_id, 4):
        word = protect(payload, chance.randrange(COUNTER_MODULO), marks)
        for _ in range(3000):
            mask = sum(1 << bit for bit in chance.sample(range(BITS), 3))
            assert not is_intact(word ^ mask, marks)


@LAYOUT_PARAMS
def test_wrong_counter_bits_are_no_weaker_than_others(layout):
    """A counter bit chooses the data identifier too, so these flips are tried one and all."""
    marks = counter_marks(layout.data_ids)
    word = protect(words(1, 1)[0], 6, marks)
    for counter_bit in range(8, 12):
        for first, second in combinations(range(BITS), 2):
            assert not is_intact(word ^ (1 << counter_bit) ^ (1 << first | 1 << second), marks) or (
                counter_bit in (first, second)
            )


def sent_order(burst, start):
    """A pattern of wrong bits that begins with this bit as a bus sends them: high bits first."""
    places = (start + offset for offset in range(8) if burst >> offset & 1)
    return sum(1 << (place - place % 8 + 7 - place % 8) for place in places)


@LAYOUT_PARAMS
def test_a_burst_of_up_to_eight_payload_bits_never_passes(layout):
    marks = counter_marks(layout.data_ids)
    word = protect(words(2, 1)[0], 9, marks)
    for start in range(16, BITS - 7):
        masks = (sent_order(burst, start) for burst in range(1, 256, 2))
        assert not any(is_intact(word ^ mask, marks) for mask in masks)


def test_a_frame_never_passes_for_another_message():
    by_name = {layout.name: counter_marks(layout.data_ids) for layout in LAYOUTS.values()}
    for name, marks in by_name.items():
        for counter in range(COUNTER_MODULO):
            word = protect(words(counter, 1)[0], counter, marks)
            passes = [other for other, theirs in by_name.items() if is_intact(word, theirs)]
            assert passes == [name]


def test_of_random_frames_one_in_256_passes():
    """20 000 draws at p = 1/256: mean 78, six standard deviations are 53."""
    chance = random.Random(5)
    marks = counter_marks(LAYOUTS[0x101].data_ids)
    passed = sum(is_intact(chance.getrandbits(BITS), marks) for _ in range(20_000))
    assert 25 < passed < 131


def test_crc_is_linear():
    for a, b in zip(words(3, 100), words(4, 100), strict=True):
        assert crc_of(a) ^ crc_of(b) == crc_of(a ^ b)
