"""What a tick's stimuli leave in the log."""

from __future__ import annotations

from collections.abc import Mapping

from hil.log import topics
from hil.stimuli.player import CODE, Taken

MOST_PARAMETERS = 8
"""Of one side, that stimuli may change: so many have room in a record."""


def packed(taken: Taken, values: Mapping[str, float], tick: int, t_ns: int) -> bytes:
    """Pack beginnings and ends, and the values of a tick in which one is new."""
    data = b"".join(topics.EVENT.pack(tick, t_ns, topics.INFO, CODE, text) for text in taken.told)
    if taken.changes:
        room = [*values.values(), *(0.0,) * (MOST_PARAMETERS - len(values))]
        data += topics.STIMULUS.pack(tick, t_ns, len(values), tuple(room))
    return data
