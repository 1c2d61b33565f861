"""The server's process: records of both processes to viewers, parameters to and from them.

It takes no part in a loop. A viewer that is too slow loses its oldest records, nobody else does.
"""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import socket
from pathlib import Path
from typing import Any, Final

from bench.live.engines import Engine, engine_of
from bench.live.foxglove.channels import Channels
from bench.live.foxglove.gate import Gate, unguessable_host
from bench.live.foxglove.tuning import Tuning, shown
from bench.live.ports import HOST, bound
from bench.live.taps import Taps
from drivers.zenoh.channels import ZenohOperator
from hil.errors import MissingExtraError

_LOOK_S: Final = 0.02
_JOIN_S: Final = 0.5
_BACKLOG: Final = 1 << 15
"""Messages kept for a viewer that does not keep up: a second or two of everything."""


def check_library() -> None:
    """See that all is there before anything begins.

    Raises: MissingExtraError
    """
    from importlib.util import find_spec

    if find_spec("foxglove") is None:
        raise MissingExtraError("foxglove-sdk", "foxglove", "Foxglove")


class Session:
    """One engine, and the viewers of it.

    Parameters: operator : None of a run in memory, which has no keys to ask it over
    """

    def __init__(self, engine: Engine, operator: ZenohOperator | None) -> None:
        import foxglove
        from foxglove.websocket import Capability

        context = foxglove.Context()
        self._taps = Taps(engine.records_of)
        self._channels = Channels(context)
        self._operator = operator
        self._tuning = None if operator is None else Tuning(operator, self._complain)
        self.host = unguessable_host()
        listener: Any = self._tuning
        self._server = foxglove.start_server(
            name=f"hil {engine.where}", host=self.host, port=0, context=context,
            capabilities=[Capability.Time, *([Capability.Parameters] if operator else [])],
            server_listener=listener, session_id=secrets.token_hex(8),
            message_backlog_size=_BACKLOG,
        )  # fmt: skip
        self.port: int = self._server.port

    def _complain(self, text: str) -> None:
        from foxglove.websocket import StatusLevel

        self._server.publish_status(text, StatusLevel.Error)

    async def follow(self) -> None:
        """Hand on what the processes record and what their parameters become, until cancelled."""
        await asyncio.gather(self._follow_records(), self._follow_presence())

    async def _follow_records(self) -> None:
        while True:
            for side, tap, data in self._taps.take():
                before_ns = self._channels.t_ns
                self._channels.put(side, tap, data)
                if self._channels.t_ns < before_ns - 1_000_000_000:  # another run
                    self._server.clear_session()
            self._server.broadcast_time(self._channels.t_ns)
            await asyncio.sleep(_LOOK_S)

    async def _follow_presence(self) -> None:
        """Join recorders that appear; hear the parameters when they have changed."""
        changes: dict[str, Any] = {}
        while True:
            heard = dict(changes)
            while self._operator is not None and (told := self._operator.poll_status()) is not None:
                changes[told[0]] = told[1].get("changes")
            new = self._taps.join()
            for side, tap in new.items():
                self._channels.announce(side, tap)
            if self._tuning is not None and (new or changes != heard):
                news = await asyncio.to_thread(self._tuning.look)
                self._server.publish_parameter_values(shown(news))
            await asyncio.sleep(_JOIN_S)

    async def close(self) -> None:
        """Leave."""
        await asyncio.to_thread(self._server.stop)
        self._taps.close()
        if self._operator is not None:
            await asyncio.to_thread(self._operator.close)


def run(port: int, directory: Path | None) -> int:
    """Serve a running engine to viewers until interrupted; prints the address.

    Raises: ConfigError, LinkError when no engine is there
    """
    import uvloop

    check_library()
    engine = engine_of(directory)
    listener = bound(port)
    with contextlib.closing(listener):
        uvloop.run(_serve(engine, listener))
    return 0


async def _serve(engine: Engine, listener: socket.socket) -> None:
    operator = None if engine.link == "memory" else engine.operator("hil foxglove")
    session, token = Session(engine, operator), secrets.token_urlsafe(24)
    try:
        async with Gate(token, (session.host, session.port)).opened(listener):
            print(f"ws://{HOST}:{listener.getsockname()[1]}/?token={token}", flush=True)
            await session.follow()
    finally:
        await session.close()
