"""Records of a live view as arrays: one pass over their heads, then a copy a topic."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.recorder.index import index_messages
from hil.log import topics
from hil.log.chunks import gather, index_entries
from hil.log.records import PAYLOAD_OFFSET

_DTYPES = {topic.name: np.dtype(topic.layout.numpy_spec) for topic in topics.ALL}


def rows_of(data: bytes, names: Mapping[int, str]) -> dict[str, NDArray[Any]]:
    """Return whole Message records by topic, as structured arrays of their fixed-size fields.

    Parameters: names : of the topics by channel number; one that is not ours is left out

    Raises: ValueError when the bytes are no such records
    """
    found = {}
    for number, channel in index_messages(data).channels.items():
        name = names.get(number, "")
        if name in _DTYPES:
            _, offsets = index_entries(channel.pairs)
            found[name] = gather(data, offsets, PAYLOAD_OFFSET, _DTYPES[name])
    return found
