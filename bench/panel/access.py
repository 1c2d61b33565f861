"""Who may enter: who has the token, on this machine, and not from another page.

Every user of the machine reaches 127.0.0.1, and so does a page of any origin in this user's own
browser. The token keeps out the first, Origin and Host the second: a browser tells truthfully from
which page a request comes, and under which name it was sent (DNS may name any address ours).
"""

from __future__ import annotations

import secrets
from typing import Any, Final
from urllib.parse import parse_qs

_HEADERS: Final = (
    (b"cache-control", b"no-store"),
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"content-security-policy",
     b"default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline';"
     b" connect-src 'self'; img-src data:; frame-ancestors 'none'"),
)  # fmt: skip


def new_token() -> str:
    """Return a secret for an address."""
    return secrets.token_urlsafe(24)


class Guard:
    """Lets a request through to the application, or refuses it with 403."""

    def __init__(self, app: Any, token: str, port: int) -> None:  # noqa: ANN401
        self._app = app
        self._token = token
        self._hosts = {f"{name}:{port}" for name in ("127.0.0.1", "localhost")}

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:  # noqa: ANN401
        """Judge one request or socket (ASGI)."""
        if scope["type"] == "lifespan" or self.admits(scope):
            await self._app(scope, receive, _with_headers(send))
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        else:
            head = [(b"content-type", b"text/plain"), *_HEADERS]
            await send({"type": "http.response.start", "status": 403, "headers": head})
            await send({"type": "http.response.body", "body": b"not from here, or no token\n"})

    def admits(self, scope: Any) -> bool:  # noqa: ANN401
        """Whether host, origin and token are right."""
        heads = {name: value.decode("latin-1") for name, value in scope["headers"]}
        host, origin = heads.get(b"host", ""), heads.get(b"origin")
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        return (
            host in self._hosts
            and origin in (None, f"http://{host}")
            and secrets.compare_digest(given.encode(), self._token.encode())
        )


def _with_headers(send: Any) -> Any:  # noqa: ANN401
    async def sent(message: Any) -> None:  # noqa: ANN401
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message["headers"], *_HEADERS]}
        await send(message)

    return sent
