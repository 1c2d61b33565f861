"""What the recorders of a running pair are given, as it comes: rows, words, frames counted."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.panel.memory import Rows
from drivers.recorder.index import index_messages
from hil.log import topics
from hil.log.chunks import gather, index_entries
from hil.log.records import MESSAGE_HEAD, PAYLOAD_OFFSET, Topic

_TOPICS: Final = {topic.name: topic for topic in topics.EVERY}
_ROWS: Final = {
    topic.name: np.dtype(topic.layout.numpy_spec)
    for topic in topics.EVERY
    if not topic.layout.variable
}
_LENGTH: Final = np.dtype("<u4")
_FRAME_BYTES: Final = 10
_MOST_WORDS: Final = 200


class Word(NamedTuple):
    """An event of a log, or an operator's command as it was taken."""

    t_s: float
    source: str
    severity: str
    code: str
    text: str


class Batch(NamedTuple):
    """What came from one process since the last look.

    rows: of each topic of fixed size, by its key (`plant.truth`)
    """

    rows: dict[str, Rows]
    words: list[Word]
    frames: int


def taken(data: bytes, side: str, names: dict[int, str]) -> Batch:
    """Sort whole Message records of a process.

    Parameters: names : of the topics, by channel number
    """
    rows: dict[str, Rows] = {}
    words: list[Word] = []
    frames = 0
    for number, channel in index_messages(data).channels.items():
        topic = _TOPICS.get(names.get(number, ""))
        if topic is None:
            continue
        _, offsets = index_entries(channel.pairs)
        if topic.name in _ROWS:
            found = gather(data, offsets, PAYLOAD_OFFSET, _ROWS[topic.name])
            rows[f"{side}{topic.name.replace('/', '.')}"] = found
        elif topic.name.startswith("/frames/"):
            skip = PAYLOAD_OFFSET + topic.layout.size
            frames += int(gather(data, offsets, skip, _LENGTH).sum()) // _FRAME_BYTES
        elif topic is not topics.SNAPSHOT:
            words += _words(data, offsets[-_MOST_WORDS:], topic, side)
    words.sort(key=lambda word: word.t_s)  # gathered by channel; a page reads them as they happened
    return Batch(rows, words, frames if side == "plant" else 0)


def _words(data: bytes, offsets: NDArray[np.int64], topic: Topic, side: str) -> Iterator[Word]:
    for offset in offsets.tolist():
        length = MESSAGE_HEAD.unpack_from(data, offset)[1]
        payload = data[offset + PAYLOAD_OFFSET : offset + 9 + length]
        _, t_ns, *rest = topic.layout.unpack(payload)
        if topic is topics.EVENT:
            severity, code, text = rest
            yield Word(t_ns * 1e-9, side, topics.SEVERITIES.get(severity, "info"), code, text)
        elif topic is topics.COMMAND:
            origin, raw = rest
            told = _shown(raw)
            if not told.startswith("get "):  # asked often, and changes nothing
                yield Word(t_ns * 1e-9, side, "info", "order", f"{told} from {origin}")


def _shown(data: bytes) -> str:
    """A command in words."""
    try:
        table = dict(json.loads(data))
    except (ValueError, TypeError):
        return repr(data[:60])
    words = (f"{key}={value}" for key, value in table.items() if key != "kind")
    return " ".join([str(table.get("kind")), *words])
