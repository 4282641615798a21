"""Access control of the server: only the page with the token on this machine, and no other page of the browser."""

from __future__ import annotations

import hmac
from typing import TYPE_CHECKING
from urllib.parse import parse_qs

from starlette.responses import PlainTextResponse

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

TOKEN_HEADER = "x-coneflat-token"
#: Accepted names of this machine; others are rejected, because they may be due to DNS rebinding.
HOSTS = ("127.0.0.1", "localhost")
#: Largest size of a request in bytes, except for meshes.
MAX_REQUEST_BYTES = 4 * 1024 * 1024
_HEADERS = (
    (b"cache-control", b"no-store"),
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cross-origin-opener-policy", b"same-origin"),
)
#: Headers that forbid frames, and headers that allow frames of notebooks (Jupyter, VS Code) and of a proxy.
_UNFRAMED = ((b"x-frame-options", b"DENY"), (b"content-security-policy", b"frame-ancestors 'none'"))
_ANCESTORS = b"frame-ancestors http://localhost:* http://127.0.0.1:* 'self' vscode-webview: vscode-file:"
_FRAMED = ((b"content-security-policy", _ANCESTORS),)


class Guard:
    """Rejects requests without access before the application processes them."""

    def __init__(
        self, app: ASGIApp, token: str, port: int, framed: bool = False, proxied: bool = False
    ) -> None:
        """Args:
        app: the application.
        token: the token that every request must have.
        port: port of the server; requests with another one are rejected.
        framed: whether notebooks of this machine may show the page in a frame.
        proxied: whether requests come through a proxy, which is then the host; only the token is checked.
        """
        self._proxied = proxied
        self._headers = (*_HEADERS, *(_FRAMED if framed else _UNFRAMED))
        self._app, self._token = app, token
        self._hosts = {f"{host}:{port}" for host in HOSTS} | (set(HOSTS) if port == 80 else set())

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request to the application, or reject it."""
        if scope["type"] == "websocket":  # They are not supported.
            return
        reason = "" if scope["type"] == "lifespan" else self.refusal(scope)
        answer = PlainTextResponse(reason, 403) if reason else self._app

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", ()), *self._headers]
            await send(message)

        await answer(scope, receive, send_guarded)

    def refusal(self, scope: Scope) -> str:
        """Return the reason for rejecting a request; "" if it is accepted."""
        headers: dict[str, list[str]] = {}
        for name, value in scope["headers"]:
            headers.setdefault(name.decode("latin-1").lower(), []).append(value.decode("latin-1"))
        host, origin = headers.get("host", []), headers.get("origin", [])
        if not self._proxied and (len(host) != 1 or host[0].lower() not in self._hosts):
            return "the host is not this machine"
        if not self._proxied and any(
            address.lower() not in {f"http://{name}" for name in self._hosts} for address in origin
        ):
            return "the request comes from another page"
        tokens = headers.get(TOKEN_HEADER, [])
        if scope["path"] == "/" and not tokens:
            # The token of the page itself is in its address.
            tokens = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
        if len(tokens) != 1 or not hmac.compare_digest(tokens[0].encode(), self._token.encode()):
            return "the token is missing or wrong: open the address that the studio has printed"
        return ""
