"""Start of the studio: a session, its server, and the browser."""

from __future__ import annotations

import secrets
import signal
import socket
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from ...errors import OptionError, StudioError
from .worker import start_process

if TYPE_CHECKING:
    from .server import StudioServer

HOST = "127.0.0.1"


def run_studio(
    file: Path | None,
    port: int,
    opens: bool,
    say: Callable[[str], None],
    color: str | None,
    most_triangles: int,
) -> Path | None:
    """Serve a session until it is interrupted, and return the path of the project with its choices, if there is one.

    Args:
        file: path of a mesh or a project to open.
        port: port of this machine; 0 for a free one.
        opens: whether to open the page in the browser.
        say: called with the address of the page.
        color: name of values that are shown as colours.
        most_triangles: largest number of triangles shown.

    Raises:
        OptionError: the extra `studio` is not installed.
        StudioError: the port is not available.
        MeshFileError, ProjectError: the file cannot be read.
    """
    process = start_process()
    with process, ExitStack() as ending, open_listener(port) as listener:
        ending.callback(process.kill)
        server_class = studio_server()
        from ..view import open_address
        from .session import Session

        folder = Path() if file is None or file.suffix.lower() != ".json" else file.parent
        token, port = secrets.token_urlsafe(24), listener.getsockname()[1]
        address = page_address(port, token)
        session = Session(folder, color, most_triangles, address, process)
        ending.callback(session.close)
        if file is not None:
            session.open(file)
        say(address)
        if opens:
            open_address(address)
        server = server_class(session, token, port)
        try:
            server.run(sockets=[listener])
        except KeyboardInterrupt:
            if server.signal != signal.SIGINT:  # Ctrl-C is the usual end.
                raise
        return session.project_file


def studio_server() -> type[StudioServer]:
    """Return the class of the server.

    Raises:
        OptionError: the extra `studio` is not installed.
    """
    try:
        from .server import StudioServer
    except ImportError as error:
        raise OptionError(
            f'the studio needs {error.name or "a server"}: pip install "coneflat[studio]"'
        ) from error
    return StudioServer


def page_address(port: int, token: str) -> str:
    """Return the address of the page."""
    return f"http://{HOST}:{port}/?token={token}"


def open_listener(port: int) -> socket.socket:
    """Return a listening socket that only this machine can reach.

    Raises:
        StudioError: the port is not available.
    """
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((HOST, port))
        listener.listen(64)
    except OSError as error:
        listener.close()
        raise StudioError(f"port {port} is not available: {error.strerror or error}") from error
    return listener
