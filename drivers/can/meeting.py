"""The handshake on a bus: what the nodes tell of themselves beside the frames of their ticks.

The plant tells its terms with each question after the controller; a controller answers with its
own. Frames that only this side sends, coming from somebody else, are a second one of its kind.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Protocol

from drivers.can.assembly import HEADS
from drivers.can.frames import Notice, Received
from drivers.zenoh.config import Role
from drivers.zenoh.node import PEER, misfit
from hil.errors import ConfigError, RefusedError
from hil.wire import terms as wire
from hil.wire.fields import layout_of
from hil.wire.terms import CAN_IDS, Gathered, Terms

PATIENCE_NS: Final = 500_000_000
"""How long the terms of a node that is heard are waited for; a foreign one has none."""


class Presence(Protocol):
    """Who this process is, and who else of the bench is there."""

    role: Role
    lockstep: bool

    def alive(self) -> set[str]:
        """Return the roles of the processes that take part by now."""

    def is_met(self) -> bool:
        """Whether the peer takes part, fits, and has no other partner."""

    def ready(self) -> None:
        """Tell the plant that its controller waits for the first sample."""

    def note(self, code: str, text: str) -> None:
        """Let the log of this process have an event."""

    def notices(self) -> list[Notice]:
        """Return (code, text) of what happened around the session since the last time."""


class Meeting:
    """What is known of the other nodes.

    Parameters: terms : what this side holds to; without them it agrees to anything
    """

    def __init__(self, side: Role, bus: str, terms: Terms | None) -> None:
        self._side = side
        self._bus = bus
        self._terms = terms
        self._peer = Gathered(PEER[side])
        self._peer_terms, self._own_terms = CAN_IDS[PEER[side]], CAN_IDS[side]
        self._own_head = layout_of(HEADS[side]).can_id
        self._ids = frozenset({self._peer_terms, self._own_terms, self._own_head})
        self.is_asked = False
        self.has_second = False

    @property
    def own(self) -> bytes:
        """The frames in which this side tells its terms; none without terms."""
        return b"" if self._terms is None else wire.encode(self._side, self._terms)

    def sifted(self, frames: list[Received]) -> list[Received]:
        """Keep what belongs to the handshake; returns the rest."""
        ids = self._ids
        for can_id, _, _ in frames:
            if can_id in ids:
                break
        else:
            return frames
        self._take([frame for frame in frames if frame[0] in ids])
        return [frame for frame in frames if frame[0] not in ids]

    def _take(self, frames: Sequence[Received]) -> None:
        for can_id, word, _ in frames:
            if can_id == self._peer_terms:
                self._peer.take(can_id, word)
                self.is_asked = self._side == "controller"
            else:
                self.has_second = True

    def refuse_second(self) -> None:
        """See that nobody else is what this side is.

        Raises: RefusedError
        """
        if self.has_second:
            raise RefusedError(
                f"a {self._side} is there already on {self._bus}: its frames were heard"
            )

    def fits(self) -> bool:
        """Whether the peer's terms are there, and are ours.

        Raises: ConfigError naming what differs
        """
        if self._terms is None:
            return True
        values = self._peer.values
        if values is None:
            return False
        line = misfit(self._side, self._terms, values)
        if line:
            raise ConfigError(line)
        return True
