"""Who may talk to the server: the page that has the token, on this machine, and no other page of the browser."""

from __future__ import annotations

import hmac
from typing import TYPE_CHECKING
from urllib.parse import parse_qs

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

TOKEN_HEADER = "x-coneflat-token"
#: Names of this machine; another that leads here (DNS rebinding) is none.
HOSTS = ("127.0.0.1", "localhost")
#: Bytes of what is asked for, but for meshes.
MOST_ASKED = 4 * 1024 * 1024
_HEADERS = (
    (b"cache-control", b"no-store"),
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cross-origin-opener-policy", b"same-origin"),
)
#: In no frame; or in those of notebooks on this machine, Jupyter's and VS Code's, and of where a proxy has it.
_ALONE = ((b"x-frame-options", b"DENY"), (b"content-security-policy", b"frame-ancestors 'none'"))
_FRAMED = (
    (
        b"content-security-policy",
        b"frame-ancestors http://localhost:* http://127.0.0.1:* 'self' vscode-webview: vscode-file:",
    ),
)


class Guard:
    """Refuses requests by others, before anything looks at them."""

    def __init__(
        self, app: ASGIApp, token: str, port: int, framed: bool = False, proxied: bool = False
    ) -> None:
        """Args:
        app: what answers.
        token: that every request must have.
        port: the only one that requests may name.
        framed: notebooks of this machine may show the page in a frame.
        proxied: requests come through a proxy, which names itself as the host: the token alone tells who asks.
        """
        self._proxied = proxied
        self._headers = (*_HEADERS, *(_FRAMED if framed else _ALONE))
        self._app, self._token = app, token
        self._hosts = {f"{host}:{port}" for host in HOSTS} | (set(HOSTS) if port == 80 else set())

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        reason = "websockets are not served here" if scope["type"] != "http" else self.refusal(scope)
        if reason:
            if scope["type"] == "http":
                await _refuse(send, reason)
            return

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", ()), *self._headers]
            await send(message)

        await self._app(scope, receive, send_guarded)

    def refusal(self, scope: Scope) -> str:
        """Return why a request is refused; "" if it is not."""
        headers: dict[str, list[str]] = {}
        for name, value in scope["headers"]:
            headers.setdefault(name.decode("latin-1").lower(), []).append(value.decode("latin-1"))
        host, origin = headers.get("host", []), headers.get("origin", [])
        if not self._proxied and (len(host) != 1 or host[0].lower() not in self._hosts):
            return "this is another host"
        if not self._proxied and any(
            each.lower() not in {f"http://{name}" for name in self._hosts} for each in origin
        ):
            return "this comes from another page"
        given = headers.get(TOKEN_HEADER, [])
        if scope["path"] == "/" and not given:
            # The page itself is opened by its address.
            given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
        if len(given) != 1 or not hmac.compare_digest(given[0].encode(), self._token.encode()):
            return "the token is missing or wrong: open the address that the studio has printed"
        return ""


async def _refuse(send: Send, reason: str) -> None:
    text = reason.encode()
    headers = [
        (b"content-type", b"text/plain"),
        (b"content-length", str(len(text)).encode()),
        *_HEADERS,
        *_ALONE,
    ]
    await send({"type": "http.response.start", "status": 403, "headers": headers})
    await send({"type": "http.response.body", "body": text})
