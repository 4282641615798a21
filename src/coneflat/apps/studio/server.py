"""The server of the studio, which gives the page with the token access to a session."""

from __future__ import annotations

import asyncio
import json
import mimetypes
import secrets
import socket
import struct
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from pathlib import Path
from types import FrameType

import uvicorn
from anyio.to_thread import run_sync
from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp

from ... import ConeflatError, sample_path
from ...errors import StudioError
from ...io import INPUT_FORMATS, export_advice
from .guard import MAX_REQUEST_BYTES, Guard
from .messages import page_message
from .page import studio_page
from .project import file_within, safe_name
from .requests import Cancelled
from .session import Session

MAX_UPLOAD_BYTES = 512 * 1024 * 1024  # Bytes of an uploaded mesh.
BYTES = "application/octet-stream"
#: Errors of requests that are answered with their message, not with a traceback.
REFUSED = (ConeflatError, ValueError, RecursionError, ClientDisconnect)


class StudioServer(uvicorn.Server):
    """Serves a session until it is interrupted, and then closes the session.

    Attributes:
        signal: number of the signal that has ended it; 0 before.
    """

    def __init__(self, session: Session, token: str, port: int, **access: bool) -> None:
        super().__init__(
            uvicorn.Config(
                studio_app(session, token, port, **access),
                log_level="error",
                access_log=False,  # The log would contain the token.
                server_header=False,
                ws="none",
                timeout_graceful_shutdown=1,
            )
        )
        self.signal = 0
        self._session = session

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Note a signal, and end."""
        self.signal = sig
        super().handle_exit(sig, frame)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Close the session, and shut down."""
        self._session.close()
        await super().shutdown(sockets)


class TooLarge(ValueError):
    """A request is larger than the limit."""


class Notifier:
    """Wakes coroutines after events of a session, from any thread."""

    def __init__(self) -> None:
        self._waiting: dict[asyncio.Event, asyncio.AbstractEventLoop] = {}

    def notify(self) -> None:
        """Wake all waiting coroutines."""
        for event, loop in list(self._waiting.items()):
            with suppress(RuntimeError):  # The server has just ended.
                loop.call_soon_threadsafe(event.set)

    async def wait_for_change(self, session: Session, version: int, seconds: float) -> None:
        """Wait until the version of a session is above the given one, or until the time is over."""
        event = asyncio.Event()
        self._waiting[event] = asyncio.get_running_loop()
        try:
            if session.version <= version:
                with suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(event.wait(), seconds)
        finally:
            del self._waiting[event]


def studio_app(session: Session, token: str, port: int, **access: bool) -> ASGIApp:
    """Return the application of the server.

    Args:
        session: the session.
        token: the token that every request must have.
        port: port of the server; requests with another one are rejected.
        access: `framed` and `proxied`, as in `Guard`.
    """
    routes = Routes(session)
    app = Starlette(
        routes=[
            Route("/", routes.page),
            Route("/state", routes.state),
            Route("/layout", routes.layout),
            Route("/act", routes.act, methods=["POST"]),
            Route("/export/{ending}", routes.export, methods=["POST"]),
            Route("/quads", routes.quads, methods=["POST"]),
            Route("/quads", routes.quads_page),
            Route("/quads/{ending}", routes.save_quads, methods=["POST"]),
            Route("/cancel", routes.cancel, methods=["POST"]),
            Route("/curve", routes.curve, methods=["POST"]),
            Route("/mesh", routes.upload, methods=["POST"]),
            Route("/sample", routes.sample, methods=["POST"]),
        ],
        exception_handlers=dict.fromkeys(REFUSED, _refused),
    )
    return Guard(app, token, port, **access)


class Routes:
    """The answers to the requests of a page, from a session; what takes long runs in a thread."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._notifier = Notifier()
        session.listen(self._notifier.notify)

    async def page(self, request: Request) -> Response:
        """Answer with the page."""
        return HTMLResponse(studio_page(INPUT_FORMATS))

    async def state(self, request: Request) -> Response:
        """Answer with the state of the session, as soon as it is newer than that of the page."""
        after = _number(request, "after")
        if isinstance(after, int):
            await self._notifier.wait_for_change(self._session, after, 20.0)  # Seconds.
        received = _number(request, "chosen")
        return JSONResponse(await run_sync(self._session.state, received if isinstance(received, int) else 0))

    async def layout(self, request: Request) -> Response:
        """Answer with the page data of the layout: the length of the head, the head as JSON, and arrays."""
        received = _number(request, "known")
        shown = await run_sync(self._session.picture, received if isinstance(received, int) else 0)
        if shown is None:
            raise StudioError("there is no layout yet")
        head = json.dumps(shown[0]).encode("ascii")
        head += b" " * (-len(head) % 4)
        content = struct.pack("<I", len(head)) + head + shown[1]
        return Response(content, media_type=BYTES)

    async def act(self, request: Request) -> Response:
        """Perform an action of the user."""
        action = json.loads(b"".join([part async for part in _parts(request, MAX_REQUEST_BYTES)]))
        if not isinstance(action, dict):
            raise StudioError("an action must be a JSON object")
        return await self._changed(self._session.act, action)

    async def export(self, request: Request) -> Response:
        """Answer with a file of the result."""
        ending = _ending(request)
        return _file(await run_sync(self._session.export, ending), ending)

    async def quads(self, request: Request) -> Response:
        """Compute quads, and answer when they are computed."""
        return await self._changed(self._session.make_quads, _number(request, "count"))

    async def quads_page(self, request: Request) -> Response:
        """Answer with the page of the quads."""
        return HTMLResponse(await run_sync(self._session.quads_page))

    async def save_quads(self, request: Request) -> Response:
        """Answer with a file of the quads."""
        ending = _ending(request)
        return _file(await run_sync(self._session.save_quads, ending), ending)

    async def cancel(self, request: Request) -> Response:
        """Cancel what is being computed."""
        await run_sync(self._session.cancel)
        return JSONResponse({})

    async def curve(self, request: Request) -> Response:
        """Answer with the distortion for each number of cones."""
        return JSONResponse(await run_sync(self._session.curve))

    async def upload(self, request: Request) -> Response:
        """Store the mesh or the project of a request, and open it."""
        folder = self._session.folder
        requested = file_within(request.query_params.get("name", ""), folder)
        path = file_within(safe_name(requested.name), folder)
        if path.suffix.lower() not in (*INPUT_FORMATS, ".json"):
            advice = export_advice(path.suffix)
            raise StudioError(
                f"{path.name} is not in a format that can be read{advice}: {', '.join(INPUT_FORMATS)}"
            )
        before = set(folder.glob("*"))  # none if the folder is gone
        stored = await _store(request, path)
        try:
            return await self._changed(self._session.open_named, stored.name)
        except ConeflatError:
            for uploaded in {stored} - before:
                uploaded.unlink(missing_ok=True)
            raise

    async def sample(self, request: Request) -> Response:
        """Open the sample mesh."""
        return await self._changed(self._session.open, sample_path())

    async def _changed(self, change: Callable[..., None], argument: object) -> Response:
        """Change the session, and answer with its version."""
        await run_sync(change, argument)
        return JSONResponse({"version": self._session.version})


def _ending(request: Request) -> str:
    return f".{request.path_params['ending']}"


def _file(content: bytes, ending: str) -> Response:
    return Response(content, media_type=mimetypes.MimeTypes(()).guess_type(f"it{ending}")[0] or BYTES)


def _number(request: Request, name: str) -> int | str:
    """Return a query parameter of a request as a number, or as text if it is not one."""
    text = request.query_params.get(name, "")
    return int(text) if text.isdecimal() and text.isascii() and len(text) < 16 else text


async def _refused(request: Request, error: Exception) -> Response:
    if isinstance(error, TooLarge):
        return PlainTextResponse(str(error), 413)
    if isinstance(error, Cancelled):
        return Response(status_code=204)  # Not an error for browsers.
    message = page_message(str(error)) if isinstance(error, ConeflatError) else "the request cannot be read"
    return PlainTextResponse(message, 400)


async def _parts(request: Request, limit: int) -> AsyncIterator[bytes]:
    """Yield the content of a request, at most `most` bytes.

    Raises:
        TooLarge: the content is larger.
    """
    size = 0
    async for part in request.stream():
        size += len(part)
        if size > limit:
            raise TooLarge(f"the request is larger than the limit of {limit:,} bytes")
        yield part


async def _store(request: Request, path: Path) -> Path:
    """Store the content of a request in a file, with a number added to the name if needed, and return its path."""
    temporary = path.with_name(f".{secrets.token_hex(8)}.upload")
    try:
        with temporary.open("xb") as stream:
            async for part in _parts(request, MAX_UPLOAD_BYTES):
                stream.write(part)
        return await run_sync(_settle, temporary, path)
    except OSError as error:
        raise StudioError(f"{path.name} cannot be stored: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def _settle(temporary: Path, path: Path) -> Path:
    """Rename a temporary file to an unused name, or find a file with the same content; return the path."""
    content, count, target = temporary.read_bytes(), 1, path
    while target.exists() and not (target.is_file() and target.read_bytes() == content):
        count += 1
        target = path.with_name(f"{path.stem}-{count}{path.suffix}")
    if not target.exists():
        temporary.rename(target)
    return target
