"""Channels of a viewer, one a topic of a process, and the records on them, byte for byte."""

from __future__ import annotations

from typing import Any

from drivers.recorder.tap import Tap
from hil.log import topics
from hil.log.records import MESSAGE_HEAD

_ENCODING, _SCHEMA_ENCODING = "cdr", "ros2msg"


class Channels:
    """The records of both processes, for whoever subscribes: `/plant/truth`, `/controller/stroke`.

    Parameters: context : of the library, to which a server belongs

    t_ns: newest time of the run [ns]
    """

    def __init__(self, context: Any) -> None:  # noqa: ANN401
        self._context = context
        self._channels: dict[str, Any] = {}
        self.t_ns = 0

    def announce(self, side: str, tap: Tap) -> None:
        """Have the topics of a process offered."""
        import foxglove

        offered = (t.name for t in topics.EVERY if side in t.sides and t.name in tap.schemas)
        for topic in offered:
            key, (name, text) = f"/{side}{topic}", tap.schemas[topic]
            if key not in self._channels:
                schema = foxglove.Schema(name=name, encoding=_SCHEMA_ENCODING, data=text.encode())
                self._channels[key] = foxglove.Channel(
                    key, schema=schema, message_encoding=_ENCODING, context=self._context
                )

    def put(self, side: str, tap: Tap, data: bytes) -> None:
        """Hand on whole Message records, as far as somebody has subscribed to their topics."""
        wanted: dict[int, Any] = {}
        for number, topic in tap.topics.items():
            channel = self._channels.get(f"/{side}{topic}")
            if channel is not None and channel.has_sinks():
                wanted[number] = channel
        offset, t_ns = 0, self.t_ns
        while offset < len(data):
            _, length, number, _, t_ns, _ = MESSAGE_HEAD.unpack_from(data, offset)
            end = offset + 9 + length
            if number in wanted:
                payload = data[offset + MESSAGE_HEAD.size : end]
                wanted[number].log(payload, log_time=t_ns)
            offset = end
        self.t_ns = t_ns
