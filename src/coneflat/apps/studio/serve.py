"""The studio at work: a session, its server, and the browser."""

from __future__ import annotations

import secrets
import socket
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from ...errors import OptionError, StudioError
from ..view import open_address

if TYPE_CHECKING:
    from .server import StudioServer
    from .session import Session

HOST = "127.0.0.1"


def run_studio(
    file: Path | None,
    port: int,
    opens: bool,
    say: Callable[[str], None],
    tell: Callable[[str], None] | None,
    color: str | None,
    most_triangles: int,
) -> None:
    """Serve a session until it is interrupted.

    Args:
        file: a mesh or a project to begin with.
        port: of this machine; 0 for a free one.
        opens: show the page in the browser.
        say: is told the page's address first.
        tell: is told of every layout and every failure, if anybody wants to know.
        color: what numbers of the user's own are shown as colours.
        most_triangles: of larger meshes fewer are shown.

    Raises:
        OptionError: the extra `studio` is not installed.
        StudioError: the port cannot be had.
        MeshFileError, ProjectError: the file cannot be read.
    """
    server_class = studio_server()
    from .session import Session

    folder = Path() if file is None or file.suffix.lower() != ".json" else file.parent
    session = Session(folder, color, most_triangles)
    with listening(port) as listener:
        port = listener.getsockname()[1]
        token = secrets.token_urlsafe(24)
        address = address_of(port, token)
        try:
            if file is not None:
                session.open(file)
            say(address)
            if tell is not None:
                session.listen(Teller(session, tell))
            if opens:
                open_address(address)
            server_class(session, token, port).run(sockets=[listener])
        finally:
            session.close()


def studio_server() -> type[StudioServer]:
    """Return the class of servers.

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


def address_of(port: int, token: str) -> str:
    """Return the address of the page."""
    return f"http://{HOST}:{port}/?token={token}"


class Teller:
    """Hears of what happens in a session, and tells a line of each layout and each failure."""

    def __init__(self, session: Session, tell: Callable[[str], None]) -> None:
        self._session, self._tell = session, tell
        self._told: tuple[int, str] = (0, "")

    def __call__(self) -> None:
        """Tell what is new."""
        state, shown = self._session.state(), self._session.picture()
        trouble = "" if state["trouble"] is None else str(state["trouble"]["text"])
        layout, before = self._told
        self._told = (state["layout"], trouble)
        if state["layout"] != layout and shown is not None and not state["early"]:
            self._tell(f"layout {state['layout']} in {state['seconds']:.2f} s: {shown[0]['title']}")
        if trouble and trouble != before:
            self._tell(trouble)


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
