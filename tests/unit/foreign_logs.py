"""Logs of other programs, each odd in one way that the format allows."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import NamedTuple

from mcap.writer import CompressionType, IndexType, Writer

LE = b"\x00\x01\x00\x00"
PLAIN = b"int64 t_ns\nfloat64 x_m\n"
NESTED = b"""geometry_msgs/Pose pose
string<=8 name
float64[<=3] samples
geometry_msgs/Point[] path
================================================================================
MSG: geometry_msgs/Pose
Point position
uint8[4] flags
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
"""
CALENDAR_NS = 1_700_000_000_000_000_000


class Topic(NamedTuple):
    """A channel and its messages: (log time, payload)."""

    name: str
    definition: bytes
    messages: list[tuple[int, bytes]]
    encoding: str = "cdr"
    schema: str = "ros2msg"


def plain(count: int = 10, start: int = 0) -> list[tuple[int, bytes]]:
    return [(start + k, LE + struct.pack("<qd", k, 0.5 * k)) for k in range(count)]


def nested() -> bytes:
    """Pose (x, y, flags), name, samples, path, aligned as CDR asks."""
    body = struct.pack("<dd4B", 1.0, 2.0, 1, 2, 3, 4)
    body += struct.pack("<I", 3) + b"ab\0"
    body += bytes(-len(body) % 4) + struct.pack("<I", 2)
    body += bytes(-len(body) % 8) + struct.pack("<dd", 7.0, 8.0)
    body += struct.pack("<I", 1)
    body += bytes(-len(body) % 8) + struct.pack("<dd", 3.0, 4.0)
    return LE + body


def write(path: Path, topics: list[Topic], **options: object) -> Path:
    """Write a log through the public writer; messages in the order of their topics' rows."""
    settings = {"compression": CompressionType.NONE, **options}
    with path.open("wb") as file:
        writer = Writer(file, **settings)
        writer.start("ros2", "another program")
        schemas: dict[bytes, int] = {}
        channels = []
        for topic in topics:
            number = 0
            if topic.schema:
                number = schemas.get(topic.definition) or writer.register_schema(
                    "a/msg/B", topic.schema, topic.definition
                )
                schemas[topic.definition] = number
            channels.append(writer.register_channel(topic.name, topic.encoding, number))
        for channel, topic in zip(channels, topics, strict=True):
            for sequence, (t_ns, data) in enumerate(topic.messages):
                writer.add_message(channel, t_ns, data, t_ns, sequence)
        writer.add_metadata("rig", {"name": "other"})
        writer.add_attachment(0, 0, "notes.txt", "text/plain", b"quiet")
        writer.finish()
    return path


NO_INDEX = {"index_types": IndexType.NONE}
LAYOUTS: dict[str, dict[str, object]] = {
    "indexed": {},
    "many-chunks": {"chunk_size": 100},
    "zstd": {"compression": CompressionType.ZSTD},
    "lz4": {"compression": CompressionType.LZ4},
    "no-index": NO_INDEX,
    "no-chunk-index": {"index_types": IndexType.MESSAGE},
    "no-message-index": {"index_types": IndexType.CHUNK},
    "unchunked": {"use_chunking": False},
    "no-statistics": {"use_statistics": False},
    "no-summary": {
        **NO_INDEX, "use_statistics": False, "use_summary_offsets": False,
        "repeat_channels": False, "repeat_schemas": False,
    },
    "no-checksum": {"enable_crcs": False},
    "data-checksum": {"enable_data_crcs": True},
}  # fmt: skip
"""Options of the public writer: everything but the first ones leaves something out."""

TOPICS: dict[str, list[Topic]] = {
    "calendar": [Topic("/a", PLAIN, plain(start=CALENDAR_NS))],
    "beyond-2-63": [Topic("/a", PLAIN, plain(start=(1 << 63) + 5))],
    "two-channels": [Topic("/a", PLAIN, plain(4)), Topic("/a", PLAIN, plain(3, start=50))],
    "one-file-name": [Topic("/a/b", PLAIN, plain(4)), Topic("/a_b", PLAIN, plain(3))],
    "constants": [Topic("/a", b"byte DEBUG=10\nint32 K = -1\n" + PLAIN, plain())],
    "defaults": [Topic("/a", b"int64 t_ns 5\nfloat64 x_m 0.5 # [m] place\n", plain())],
    "marked": [Topic("/a", b"\xef\xbb\xbf" + PLAIN, plain())],
    "no-time": [Topic("/a", b"float64 x\n", [(k, LE + bytes(8)) for k in range(3)])],
    "empty-message": [Topic("/a", b"", [(k, LE + b"\0") for k in range(3)])],
    "keyword": [Topic("/a", b"int64 t_ns\nuint8 class\n", [(1, LE + bytes(9))])],
    "field-twice": [Topic("/a", b"int64 t_ns\nuint8 x\nuint8 x\n", [(1, LE + bytes(10))])],
    "nested": [Topic("/a", NESTED, [(5, nested()), (6, nested())])],
    "odd-names": [Topic("/\x1b[31m\0\N{SNOWMAN}/..", PLAIN, plain(2)), Topic("/", PLAIN, plain(2))],
    "no-text": [Topic("/a", b"int64 t_ns\nstring s\n", [(1, LE + bytes(8) + b"\2\0\0\0\xff\0")])],
}

UNDECODED: dict[str, list[Topic]] = {
    "json": [Topic("/j", b"{}", [(1, b"{}")], "json", "jsonschema")],
    "protobuf": [Topic("/p", b"\1\2", [(1, b"\1")], "protobuf", "protobuf")],
    "no-schema": [Topic("/n", b"", [(1, b"{}")], "json", "")],
    "huge-array": [Topic("/h", b"int64 t_ns\nfloat64[1000000000] x\n", [(1, LE + bytes(16))])],
    "negative-array": [Topic("/m", b"float64[-1] x\n", [(1, LE + bytes(8))])],
    "short-message": [Topic("/s", PLAIN, [(1, b"")])],
    "big-endian": [Topic("/b", PLAIN, [(1, b"\0\0\0\0" + bytes(16))])],
    "own-type": [Topic("/t", b"a/B x\n===\nMSG: a/B\na/B x\n", [(1, LE + bytes(8))])],
    "no-type": [Topic("/u", b"a/Missing x\n", [(1, LE + bytes(8))])],
}
"""Topics that no decoder of ours reads."""
