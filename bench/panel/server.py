"""The panel's server: one page, one socket to each viewer; on 127.0.0.1 alone."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
from collections.abc import AsyncIterator, Mapping
from typing import Any, Final

from bench.live.ports import HOST
from bench.panel.access import Guard
from bench.panel.session import Session, Subject, opened
from bench.panel.steering import is_urgent
from bench.panel.viewers import Viewer
from bench.web.page import panel_page
from hil.errors import MissingExtraError

_MOST_ASKED: Final = 64 << 10
"""Bytes of a message from a page."""

_LIBRARIES: Final = ("starlette", "uvicorn", "websockets", "uplot")


def check_libraries() -> None:
    """See that all is there before anything begins.

    Raises: MissingExtraError
    """
    from importlib.util import find_spec

    for library in _LIBRARIES:
        if find_spec(library) is None:
            raise MissingExtraError(library, "panel", "the panel")


def address(listener: socket.socket, token: str) -> str:
    """Return what to open in a browser."""
    return f"http://{HOST}:{listener.getsockname()[1]}/?token={token}"


def serve(subject: Subject, listener: socket.socket, token: str) -> None:
    """Serve until interrupted.

    Raises: ConfigError, LinkError when the engine cannot be joined
    """
    run_until_interrupted(Guard(application(subject), token, listener.getsockname()[1]), listener)


def run_until_interrupted(guarded: Guard, listener: socket.socket) -> None:
    """Serve an application on a socket that is bound."""
    import uvicorn

    config = uvicorn.Config(
        guarded, log_level="error", access_log=False, loop="uvloop", ws="websockets-sansio",
        ws_max_size=_MOST_ASKED, ws_per_message_deflate=False, timeout_graceful_shutdown=1,
    )  # fmt: skip
    uvicorn.Server(config).run(sockets=[listener])


def application(subject: Subject) -> Any:  # noqa: ANN401
    """Return the application that follows one engine (ASGI)."""
    from starlette.applications import Starlette
    from starlette.responses import HTMLResponse, Response
    from starlette.routing import Route, WebSocketRoute

    @contextlib.asynccontextmanager
    async def lifespan(app: Any) -> AsyncIterator[None]:  # noqa: ANN401
        app.state.session = session = await asyncio.to_thread(opened, subject)
        session.begin()
        yield
        await session.end()

    async def page(_request: Any) -> Response:  # noqa: ANN401
        return HTMLResponse(panel_page(subject.scenario.name))

    async def viewer(connection: Any) -> None:  # noqa: ANN401
        await connection.accept()
        await attend(connection.app.state.session, connection)

    routes = [Route("/", page), WebSocketRoute("/socket", viewer)]
    return Starlette(routes=routes, lifespan=lifespan)


async def attend(session: Session, connection: Any) -> None:  # noqa: ANN401
    """Serve one viewer until it leaves, or is dropped because it takes nothing any more."""
    viewer = session.audience.admit(connection)
    session.greet(viewer)
    following = asyncio.create_task(viewer.follow(session.memory))
    hearing = asyncio.create_task(_hear(session, viewer, connection))
    try:
        await asyncio.wait({following, hearing}, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in (following, hearing):
            task.cancel()
        await asyncio.gather(following, hearing, return_exceptions=True)
        session.audience.dismiss(viewer)
        with contextlib.suppress(Exception):  # gone already, as a rule
            await connection.close()


async def _hear(session: Session, viewer: Viewer, connection: Any) -> None:  # noqa: ANN401
    """Do what a page asks, one thing after the other; what makes no sense is left out."""
    while True:
        told = await connection.receive()
        if told["type"] == "websocket.disconnect":
            return
        try:
            asked = json.loads(told.get("text") or "null")
        except ValueError:
            continue
        if isinstance(asked, dict):
            with contextlib.suppress(TypeError, ValueError):
                await _answer(session, viewer, asked)


async def _answer(session: Session, viewer: Viewer, asked: Mapping[str, Any]) -> None:
    do = asked.get("do")
    if do == "show":
        viewer.show(asked["signals"], session.memory)
    elif do == "window":
        await viewer.send_window(session.memory, asked)
    elif do == "wheel":
        wanted, by_force = bool(asked.get("wanted")), bool(asked.get("force"))
        session.audience.take_wheel(viewer, wanted=wanted, by_force=by_force)
    elif do in ("order", "set", "undo"):
        answer = await _steered(session, viewer, str(do), asked)
        told = {"k": "answer", "id": asked.get("id"), **answer}
        session.audience.tell(told | {"by": viewer.name, "asked": _shown(asked)})
        session.tell_values()


async def _steered(
    session: Session, viewer: Viewer, do: str, asked: Mapping[str, Any]
) -> dict[str, Any]:
    """Give a command for the one who steers; what ends the motion for anybody."""
    table = dict(asked.get("command") or {})
    if not session.audience.steers(viewer) and not (do == "order" and is_urgent(table)):
        return {"taken": False, "text": f"{viewer.name} does not steer", "tick": None}
    if do == "set":
        return await session.steering.change(dict(asked["values"]))
    return await (session.steering.undo() if do == "undo" else session.steering.order(table))


def _shown(asked: Mapping[str, Any]) -> str:
    """What was asked for, in words."""
    table = dict(asked.get("values") or asked.get("command") or {})
    kind = table.pop("kind", "set" if table else "undo")
    return " ".join([str(kind), *(f"{key}={value}" for key, value in table.items())])
