"""Recorded runs for the tests: made once for each process, small, in memory and lockstep."""

from __future__ import annotations

import hil.log
from bench.dev import golden
from bench.run import scenarios
from bench.run.resolve import resolve
from drivers.recorder.index import index_messages
from drivers.recorder.mcap_file import McapFile
from hil.log import topics

LOCKSTEP = [("link.kind", "memory"), ("loop.clock", "lockstep")]
CHANGES = [("events.load.at_s", 0.2), ("run.duration_s", 0.7), *LOCKSTEP]


def make_run(directory, *changes, scenario="load-decrease"):
    """Record a run and return its directory."""
    directory.mkdir(parents=True, exist_ok=True)
    golden.record(resolve(scenarios.read(scenario, [*CHANGES, *changes])), directory)
    return directory


def records_of(path):
    """All Message records of a log, as they were put."""
    with hil.log.open(path) as log:
        return b"".join(log.raw())


def rewrite(path, out, data, *, metadata=None, drop_attachments=False, only=None):
    """Write a log with the head of another one and these records."""
    from mcap.records import Channel, Schema

    wanted = [t for t in topics.ALL if only is None or t.name in only]
    with hil.log.open(path) as log, out.open("w+b") as file:
        schemas = [Schema(t.channel_id, t.definition.encode(), "ros2msg", t.schema_name)
                   for t in wanted]  # fmt: skip
        channels = [Channel(t.channel_id, t.name, "cdr", {}, t.channel_id) for t in wanted]
        new = McapFile(file.fileno(), schemas, channels)
        for name, values in (log.metadata if metadata is None else metadata).items():
            new.add_metadata(name, values)
        if not drop_attachments:
            for attachment in log.attachments.values():
                new.add_attachment(*attachment)
        step = 60_000
        while data:
            index = index_messages(data[:step])
            new.add_chunk(data[: index.size], index)
            data = data[index.size :]
        new.finish()
    return out


def each_record(data):
    """Yield (channel, record) of packed records."""
    offset = 0
    while offset < len(data):
        end = offset + 9 + int.from_bytes(data[offset + 1 : offset + 9], "little")
        yield int.from_bytes(data[offset + 9 : offset + 11], "little"), data[offset:end]
        offset = end
