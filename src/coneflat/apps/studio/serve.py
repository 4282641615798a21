"""Start of the studio: a session, its server, and the browser."""

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
    log: Callable[[str], None] | None,
    color: str | None,
    most_triangles: int,
) -> None:
    """Serve a session until it is interrupted.

    Args:
        file: path of a mesh or a project to open.
        port: port of this machine; 0 for a free one.
        opens: whether to open the page in the browser.
        say: called with the address of the page.
        log: called with a line on every layout and every error; None for none.
        color: name of values that are shown as colours.
        most_triangles: largest number of triangles shown.

    Raises:
        OptionError: the extra `studio` is not installed.
        StudioError: the port is not available.
        MeshFileError, ProjectError: the file cannot be read.
    """
    server_class = studio_server()
    from .session import Session

    folder = Path() if file is None or file.suffix.lower() != ".json" else file.parent
    session = Session(folder, color, most_triangles)
    with open_listener(port) as listener:
        port = listener.getsockname()[1]
        token = secrets.token_urlsafe(24)
        address = page_address(port, token)
        try:
            if file is not None:
                session.open(file)
            say(address)
            if log is not None:
                session.listen(ChangePrinter(session, log))
            if opens:
                open_address(address)
            server_class(session, token, port).run(sockets=[listener])
        finally:
            session.close()


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


class ChangePrinter:
    """Listener of a session that reports a line on each layout and each error."""

    def __init__(self, session: Session, log: Callable[[str], None]) -> None:
        self._session, self._log = session, log
        self._printed: tuple[int, str] = (0, "")

    def __call__(self) -> None:
        """Report what has changed."""
        state, shown = self._session.state(), self._session.picture()
        trouble = "" if state["trouble"] is None else str(state["trouble"]["text"])
        layout, before = self._printed
        self._printed = (state["layout"], trouble)
        if state["layout"] != layout and shown is not None and not (state["early"] or state["bare"]):
            self._log(f"layout {state['layout']} in {state['seconds']:.2f} s: {shown[0]['title']}")
        if trouble and trouble != before:
            self._log(trouble)


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
