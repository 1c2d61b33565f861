"""Waiting for a batch that must come."""

from hil.exchange import await_batch
from hil.ports import Link

SECOND_NS = 1_000_000_000


class Peer(Link):
    """A link whose batch comes after so many waits, if at all; dies after so many."""

    def __init__(self, comes_after=None, dies_after=None, last_words=None):
        self.comes_after, self.dies_after = comes_after, dies_after
        self.last_words = last_words
        self.waits = []

    def wait(self, timeout_ns):
        self.waits.append(timeout_ns)
        return b"batch" if self.comes_after == len(self.waits) else None

    def peer_alive(self):
        return self.dies_after is None or len(self.waits) < self.dies_after

    def receive(self):
        return self.last_words


def test_batch_is_returned_as_soon_as_it_is_there():
    peer = Peer(comes_after=3)
    assert await_batch(peer, SECOND_NS) == b"batch"
    assert len(peer.waits) == 3


def test_waiting_ends_with_the_patience():
    peer = Peer()
    assert await_batch(peer, SECOND_NS) is None
    assert sum(peer.waits) == SECOND_NS


def test_patience_is_kept_to_the_nanosecond():
    peer = Peer()
    assert await_batch(peer, 120_000_001) is None
    assert sum(peer.waits) == 120_000_001


def test_waiting_ends_at_once_when_the_peer_is_gone():
    peer = Peer(dies_after=2)
    assert await_batch(peer, SECOND_NS) is None
    assert len(peer.waits) == 2


def test_what_the_peer_sent_before_it_went_is_still_taken():
    assert await_batch(Peer(dies_after=1, last_words=b"last"), SECOND_NS) == b"last"
