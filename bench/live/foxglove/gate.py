"""The door before the library's server, which itself lets in whoever comes.

A page of any origin in this user's own browser reaches 127.0.0.1, and could read and steer. So a
connection with an Origin, which a browser never leaves out, is let through with the token of the
address alone. The server behind stands at an address of this machine that is as hard to guess.
"""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import socket
from collections.abc import AsyncIterator, Mapping
from typing import Final
from urllib.parse import parse_qs, urlsplit

_END: Final = b"\r\n\r\n"
_MOST_HEAD: Final = 16 << 10
_PATIENCE_S: Final = 5.0
_AT_ONCE: Final = 64 << 10
_PROTOCOL: Final = b"foxglove.sdk.v1"
_ELDER: Final = b"foxglove.websocket.v1"
"""The name that the same protocol had before; older viewers ask for it alone."""

_REFUSED: Final = (
    b"HTTP/1.1 403 Forbidden\r\ncontent-length: 27\r\ncontent-type: text/plain\r\n"
    b"connection: close\r\n\r\nnot from here, or no token\n"
)


def unguessable_host() -> str:
    """Return one of the sixteen million addresses of this machine."""
    return "127." + ".".join(str(1 + secrets.randbelow(253)) for _ in range(3))


class Gate:
    """Lets connections through to the server behind, or refuses them with 403."""

    def __init__(self, token: str, behind: tuple[str, int]) -> None:
        self._token = token
        self._behind = behind

    @contextlib.asynccontextmanager
    async def opened(self, listener: socket.socket) -> AsyncIterator[None]:
        """Be open while the body runs."""
        async with await asyncio.start_server(self._admit, sock=listener, limit=_MOST_HEAD):
            yield

    async def _admit(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError, EOFError, TimeoutError, asyncio.LimitOverrunError):
            head = await asyncio.wait_for(reader.readuntil(_END), _PATIENCE_S)
            if self.admits(head):
                await self._join(head, reader, writer)
            else:
                writer.write(_REFUSED)
                await writer.drain()
        writer.close()

    def admits(self, head: bytes) -> bool:
        """Whether a request comes from no page, or has the token."""
        line, _, rest = head.decode("latin-1").partition("\r\n")
        names = {each.partition(":")[0].strip().lower() for each in rest.split("\r\n")}
        target = line.split(" ")[1] if line.count(" ") == 2 else ""
        given = parse_qs(urlsplit(target).query).get("token", [""])[0]
        return "origin" not in names or secrets.compare_digest(given.encode(), self._token.encode())

    async def _join(
        self, head: bytes, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        """Carry both ways until one of the two ends."""
        inner_reader, inner_writer = await asyncio.open_connection(*self._behind, limit=_MOST_HEAD)
        elder = _ELDER in head and _PROTOCOL not in head
        names = {_ELDER: _PROTOCOL} if elder else {}
        inner_writer.write(_renamed(head, names))
        answer = await inner_reader.readuntil(_END)
        writer.write(_renamed(answer, {new: old for old, new in names.items()}))
        ways = [
            asyncio.create_task(_carry(reader, inner_writer)),
            asyncio.create_task(_carry(inner_reader, writer)),
        ]
        try:
            await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
        finally:
            inner_writer.close()
            for way in ways:
                way.cancel()
            await asyncio.gather(*ways, return_exceptions=True)


def _renamed(head: bytes, names: Mapping[bytes, bytes]) -> bytes:
    for old, new in names.items():
        head = head.replace(old, new)
    return head


async def _carry(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Hand on what comes; no more is taken than the other side takes."""
    while data := await reader.read(_AT_ONCE):
        writer.write(data)
        await writer.drain()
