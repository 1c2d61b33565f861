"""What the shells rely on, whatever carries the frames."""

import time

import pytest

from hil.errors import LinkError

PATIENCE_NS = 2_000_000_000


def take(link, count):
    taken = []
    while len(taken) < count and (batch := link.wait(PATIENCE_NS)) is not None:
        taken.append(batch)
    return taken


def test_what_is_sent_arrives_identical_one_for_one_and_in_order(pair):
    plant, controller = pair.plant.link, pair.controller.link
    for sender, receiver, side in ((plant, controller, "plant"), (controller, plant, "controller")):
        sent = pair.talk.various(side)
        for batch in sent:
            sender.send(batch)
        assert take(receiver, len(sent)) == sent
        assert receiver.receive() is None


def test_a_burst_is_neither_lost_nor_merged_nor_split(pair):
    sent = [pair.talk.batch("plant", i) for i in range(pair.burst)]
    for batch in sent:
        pair.plant.link.send(batch)
    assert take(pair.controller.link, len(sent)) == sent
    assert pair.controller.link.receive() is None


def test_a_thousand_turns_of_question_and_answer(pair):
    plant, controller, batch = pair.plant.link, pair.controller.link, pair.talk.batch
    for turn in range(pair.turns):
        plant.send(batch("plant", turn))
        assert controller.wait(PATIENCE_NS) == batch("plant", turn)
        controller.send(batch("controller", -turn - 1))
        assert plant.wait(PATIENCE_NS) == batch("controller", -turn - 1)


def test_the_directions_do_not_mix(pair):
    plant, controller, batch = pair.plant.link, pair.controller.link, pair.talk.batch
    for turn in range(8):
        plant.send(batch("plant", turn))
        controller.send(batch("controller", -turn - 1))
    assert take(plant, 8) == [batch("controller", -turn - 1) for turn in range(8)]
    assert take(controller, 8) == [batch("plant", turn) for turn in range(8)]
    assert plant.receive() is None
    assert controller.receive() is None


def test_an_empty_link_has_nothing_and_says_so_at_once(links):
    plant, _ = links
    begin = time.monotonic()
    assert [plant.receive() for _ in range(100)] == [None] * 100
    assert plant.wait(0) is None
    assert time.monotonic() - begin < 0.1


@pytest.mark.parametrize("timeout_ns", [1, 1_500_000, 60_000_000])
def test_waiting_in_vain_ends_in_time(links, timeout_ns):
    _, controller = links
    begin = time.monotonic()
    assert controller.wait(timeout_ns) is None
    assert time.monotonic() - begin < timeout_ns * 1e-9 + 0.1


def test_waiting_returns_what_is_there_already(pair):
    pair.plant.link.send(pair.talk.batch("plant", 1))
    assert pair.controller.link.wait(PATIENCE_NS) == pair.talk.batch("plant", 1)


def test_counters_count_both_directions(pair):
    plant, controller = pair.plant.link, pair.controller.link
    for number in range(7):
        plant.send(pair.talk.batch("plant", number))
    take(controller, 7)
    assert plant.counters()["sent"] == 7
    assert controller.counters()["received"] == 7
    assert plant.counters()["received"] == controller.counters()["sent"] == 0


def test_closing_twice_is_closing_once(links):
    plant, controller = links
    for link in (plant, plant, controller, controller):
        link.close()
    assert plant.receive() is None
    assert plant.wait(1_000_000) is None


def test_sending_on_a_closed_link_is_a_link_error(links):
    plant, _ = links
    plant.close()
    with pytest.raises(LinkError, match="send"):
        plant.send(b"x" * 10)


def test_sending_to_a_closed_peer_neither_hangs_nor_fails(pair):
    pair.controller.close()
    begin = time.monotonic()
    for _ in range(200):
        pair.plant.link.send(b"x" * 60)
    assert time.monotonic() - begin < 1.0


def test_the_peers_presence_is_known_and_its_end_noticed(pair):
    assert pair.plant.link.peer_alive()
    assert pair.controller.link.peer_alive()
    pair.controller.close()
    end = time.monotonic() + 2.0
    while pair.plant.link.peer_alive():
        assert time.monotonic() < end
    assert pair.plant.link.wait(1_000) is None


def test_waiting_for_a_peer_that_is_gone_names_it(pair):
    pair.controller.close()
    end = time.monotonic() + 2.0
    while pair.plant.link.peer_alive():
        assert time.monotonic() < end
    with pytest.raises(LinkError):
        pair.plant.link.wait_for_peer(0.05)
