"""The studio at work: a session, its server, and the browser."""

from __future__ import annotations

import secrets
import socket
from collections.abc import Callable
from pathlib import Path

from ...errors import OptionError, StudioError
from ...view.page.webpage import open_address

HOST = "127.0.0.1"


def run_studio(file: Path | None, port: int, opens: bool, say: Callable[[str], None]) -> None:
    """Serve a session until it is interrupted.

    Args:
        file: a mesh or a project to begin with.
        port: of this machine; 0 for a free one.
        opens: show the page in the browser.
        say: is told the page's address first.

    Raises:
        OptionError: the extra `studio` is not installed.
        StudioError: the port cannot be had.
        MeshFileError, ProjectError: the file cannot be read.
    """
    try:
        from .server import StudioServer
    except ImportError as error:
        raise OptionError(
            f'the studio needs {error.name or "a server"}: pip install "coneflat[studio]"'
        ) from error
    from .session import Session

    is_project = file is not None and file.suffix.lower() == ".json"
    session = Session(file.parent if file is not None and is_project else Path())
    with listening(port) as listener:
        port = listener.getsockname()[1]
        token = secrets.token_urlsafe(24)
        address = f"http://{HOST}:{port}/?token={token}"
        try:
            if file is not None:
                session.open(file)
            say(address)
            if opens:
                open_address(address)
            StudioServer(session, token, port).run(sockets=[listener])
        finally:
            session.close()


def listening(port: int) -> socket.socket:
    """Return a socket of this machine alone."""
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((HOST, port))
        listener.listen(64)
    except OSError as error:
        listener.close()
        raise StudioError(f"port {port} cannot be had: {error.strerror or error}") from error
    return listener
