"""The studio's server: a session, for the page that has the token."""

from __future__ import annotations

import asyncio
import json
import mimetypes
import secrets
import socket
import struct
from collections.abc import AsyncIterator
from contextlib import suppress
from pathlib import Path

import uvicorn
from anyio.to_thread import run_sync
from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp

from ... import ConeflatError
from ...errors import StudioError
from ...io import INPUT_FORMATS
from .guard import MOST_ASKED, Guard
from .messages import in_page
from .page import studio_page
from .project import file_within
from .session import Session

MOST_UPLOADED = 512 * 1024 * 1024  # bytes of a mesh


class StudioServer(uvicorn.Server):
    """Serves a session until it is interrupted; then nobody waits for news any more."""

    def __init__(
        self, session: Session, token: str, port: int, framed: bool = False, proxied: bool = False
    ) -> None:
        super().__init__(
            uvicorn.Config(
                studio_app(session, token, port, framed=framed, proxied=proxied),
                log_level="error",
                access_log=False,  # It would hold the token.
                server_header=False,
                ws="none",
                timeout_graceful_shutdown=1,
            )
        )
        self._session = session

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """End."""
        self._session.close()
        await super().shutdown(sockets)


class TooLarge(Exception):
    """More was sent than is taken."""


class Bell:
    """Wakes coroutines when something has happened in a session, whose threads ring it."""

    def __init__(self) -> None:
        self._waiting: dict[asyncio.Event, asyncio.AbstractEventLoop] = {}

    def ring(self) -> None:
        """Wake all."""
        for event, loop in list(self._waiting.items()):
            with suppress(RuntimeError):  # The server has just ended.
                loop.call_soon_threadsafe(event.set)

    async def wait_beyond(self, session: Session, version: int, seconds: float) -> None:
        """Wait until a session has come further than a version, or for some time."""
        event = asyncio.Event()
        self._waiting[event] = asyncio.get_running_loop()
        try:
            if session.version <= version:
                with suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(event.wait(), seconds)
        finally:
            del self._waiting[event]


def studio_app(
    session: Session, token: str, port: int, framed: bool = False, proxied: bool = False
) -> ASGIApp:
    """Return the server's application.

    Args:
        session: what it shows and changes.
        token: that every request must have.
        port: at which it is served: the only one that requests may name.
        framed: notebooks of this machine may show the page in a frame.
        proxied: requests come through a proxy.
    """
    bell = Bell()
    session.listen(bell.ring)

    async def page(request: Request) -> Response:
        return HTMLResponse(studio_page(INPUT_FORMATS))

    async def state(request: Request) -> Response:
        after = _number(request, "after")
        if isinstance(after, int):
            await bell.wait_beyond(session, after, 20.0)  # seconds
        known = _number(request, "chosen")
        return JSONResponse(await run_sync(session.state, known if isinstance(known, int) else 0))

    async def layout(request: Request) -> Response:
        known = _number(request, "known")
        shown = await run_sync(session.picture, known if isinstance(known, int) else 0)
        if shown is None:
            raise StudioError("there is no layout yet")
        head = json.dumps(shown[0]).encode("ascii")
        head += b" " * (-len(head) % 4)
        content = struct.pack("<I", len(head)) + head + shown[1]
        return Response(content, media_type="application/octet-stream")

    async def act(request: Request) -> Response:
        action = json.loads(b"".join([part async for part in _parts(request, MOST_ASKED)]))
        if not isinstance(action, dict):
            raise StudioError("an action has names and values")
        await run_sync(session.act, action)
        return JSONResponse({"version": session.version})

    async def export(request: Request) -> Response:
        ending = f".{request.path_params['ending']}"
        content = await run_sync(session.export, ending)
        return Response(content, media_type=_media_type(ending))

    async def quads(request: Request) -> Response:
        ending = f".{request.path_params['ending']}"
        content = await run_sync(session.quads, ending, _number(request, "count"))
        return Response(content, media_type=_media_type(ending))

    async def curve(request: Request) -> Response:
        return JSONResponse(await run_sync(session.curve))

    async def upload(request: Request) -> Response:
        path = file_within(request.query_params.get("name", ""), session.folder)
        if path.suffix.lower() not in (*INPUT_FORMATS, ".json"):
            raise StudioError(f"{path.name} is not a mesh that can be read: {', '.join(INPUT_FORMATS)}")
        stored = await _store(request, path)
        await run_sync(session.open_named, stored.name)
        return JSONResponse({"version": session.version})

    app = Starlette(
        routes=[
            Route("/", page),
            Route("/state", state),
            Route("/layout", layout),
            Route("/act", act, methods=["POST"]),
            Route("/export/{ending}", export, methods=["POST"]),
            Route("/quads/{ending}", quads, methods=["POST"]),
            Route("/curve", curve, methods=["POST"]),
            Route("/mesh", upload, methods=["POST"]),
        ],
        exception_handlers=dict.fromkeys((ConeflatError, ValueError, TooLarge, ClientDisconnect), _refused),
    )
    return Guard(app, token, port, framed, proxied)


def _media_type(ending: str) -> str:
    return mimetypes.MimeTypes(()).guess_type(f"it{ending}")[0] or "application/octet-stream"


def _number(request: Request, name: str) -> int | str:
    """Return the number that a request gives by a name, or the text that is none."""
    text = request.query_params.get(name, "")
    return int(text) if text.isdecimal() and text.isascii() and len(text) < 16 else text


async def _refused(request: Request, error: Exception) -> Response:
    if isinstance(error, TooLarge):
        return PlainTextResponse(str(error), 413)
    said = in_page(str(error)) if isinstance(error, ConeflatError) else "this cannot be read"
    return PlainTextResponse(said, 400)


async def _parts(request: Request, most: int) -> AsyncIterator[bytes]:
    """Yield what is sent, up to so many bytes.

    Raises:
        TooLarge: it is more.
    """
    size = 0
    async for part in request.stream():
        size += len(part)
        if size > most:
            raise TooLarge(f"more than {most:,} bytes are not taken")
        yield part


async def _store(request: Request, path: Path) -> Path:
    """Return the file that what is sent is kept in: of this name, or, where another file has it, of one like it."""
    temporary = path.with_name(f".{secrets.token_hex(8)}.upload")
    try:
        with temporary.open("xb") as stream:
            async for part in _parts(request, MOST_UPLOADED):
                stream.write(part)
        return await run_sync(_settle, temporary, path)
    except OSError as error:
        raise StudioError(f"{path.name} cannot be kept: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def _settle(temporary: Path, path: Path) -> Path:
    """Give a file a name; that of a file with the same content, or a new one."""
    content, count, target = temporary.read_bytes(), 1, path
    while target.exists() and not (target.is_file() and target.read_bytes() == content):
        count += 1
        target = path.with_name(f"{path.stem}-{count}{path.suffix}")
    if not target.exists():
        temporary.rename(target)
    return target
