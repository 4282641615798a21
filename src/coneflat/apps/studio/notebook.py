"""The studio in Python: its page in the frame of a notebook, its choices and its result."""

from __future__ import annotations

import html
import secrets
import tempfile
import threading
from collections.abc import Mapping
from contextlib import ExitStack
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ...base import short_repr
from ...errors import ArrayShapeError, OptionError, StudioError
from ...io import as_input, atomic_write, lines_of
from .editing import PATIENCE
from .serve import open_listener, page_address, studio_server
from .session import Session

if TYPE_CHECKING:
    from ... import Flattening


class Studio:
    """A studio that is served by this process until it is closed or the process ends.

    As the last line of a notebook cell, it is shown as a frame. The browser loads the page from this machine or, if the
    kernel runs on another one, through a proxy of the notebook server. A saved notebook does not contain the page.

    Attributes:
        address: address of the page for browsers on this machine, or through the proxy. Everyone who knows it can
            change the choices.
        project: path of the project file, which contains all choices.
        height: height of the frame in pixels.
    """

    def __init__(
        self,
        mesh: Any,
        faces: ArrayLike | None = None,
        *,
        folder: str | PathLike[str] | None = None,
        color: str | None = None,
        height: int = 720,
        through: str | None = None,
    ) -> None:
        """Args:
            mesh: a file or a project; or vertices (n, 3) if `faces` is given, a pair (vertices, faces), or a mesh of
                trimesh, meshio or pyvista.
            faces: (m, 3) vertex indices.
            folder: folder of the project, and of meshes given as arrays; by default the current one, and for arrays
                a temporary one that is removed by `close`.
            color: name of values that are shown as colours, see `coneflat view --color`.
            height: height of the frame in pixels.
            through: address of ports of this machine through a proxy, as the browser uses it: "/proxy/{port}/" with
                jupyter-server-proxy, "/user/NAME/proxy/{port}/" on a hub. Access is then protected by the token only.

        Raises:
            ArrayShapeError: the arrays are not a mesh.
            MeshFileError, ProjectError: the file cannot be read.
            OptionError: the extra `studio` is not installed, or `through` does not contain "{port}".
        """
        server_class = studio_server()
        self.height = height
        self._own_folder: tempfile.TemporaryDirectory[str] | None = None
        file = self._file_of(mesh, faces, folder)
        is_project = file.suffix.lower() == ".json"
        home = Path() if folder is None else Path(folder)
        if is_project or self._own_folder is not None:
            home = file.parent
        with ExitStack() as failing:
            token, listener = secrets.token_urlsafe(24), failing.enter_context(open_listener(0))
            port = listener.getsockname()[1]
            self.address = page_address(port, token) if through is None else _proxied(through, port, token)
            self._session = Session(home, color, address=self.address)
            failing.callback(self._session.close)
            self._session.open(file)
            self._server = server_class(self._session, token, port, framed=True, proxied=through is not None)
            failing.pop_all()
        self._thread = threading.Thread(target=self._server.run, args=([listener],), daemon=True)
        self._thread.start()

    def _file_of(self, mesh: Any, faces: ArrayLike | None, folder: str | PathLike[str] | None) -> Path:
        """Return the path of a mesh file; arrays are written to a new file."""
        if faces is None and isinstance(mesh, (str, PathLike)):
            return Path(mesh)
        source = as_input(mesh, faces)
        if source.source is not None:
            return source.source.path
        vertices, triangles = np.asarray(source.vertices, dtype=np.float64), np.asarray(source.faces)
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            raise ArrayShapeError(f"vertices must have the shape (n, 3), got {vertices.shape}")
        if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype.kind not in "iu":
            raise ArrayShapeError(
                f"faces must be (m, 3) integers, got {triangles.dtype} of shape {triangles.shape}"
            )
        if folder is None:
            self._own_folder = tempfile.TemporaryDirectory(prefix="coneflat-")
            folder = self._own_folder.name
        path = Path(folder) / "mesh.obj"
        with atomic_write(path) as stream:
            stream.writelines(lines_of("v", vertices, b"\n"))
            stream.writelines(lines_of("f", triangles.astype(np.int64) + 1, b"\n"))
        return path

    @property
    def project(self) -> Path:
        """Return the path of the project file, which contains all choices."""
        assert self._session.project_file is not None
        return self._session.project_file.resolve()

    @property
    def choices(self) -> dict[str, Any]:
        """Return the choices as in the project file; they can be set, which is a step that can be undone."""
        return dict(self._session.state()["choices"])

    @choices.setter
    def choices(self, choices: Mapping[str, Any]) -> None:
        """Set the choices.

        Raises:
            StudioError, OptionError: a choice is not valid.
        """
        self._session.choose(choices)

    @property
    def result(self) -> Flattening:
        """Return the flattening for the choices, after waiting for it.

        Raises:
            StudioError: the flattening has failed, or takes too long.
        """
        from ... import read_flattening

        if not self._session.wait_until_idle():
            raise StudioError(f"there is no layout after {PATIENCE:g} seconds")
        try:
            content = self._session.export(".npz")
        except StudioError as error:
            trouble = self._session.state()["trouble"]
            raise StudioError(str(error) if trouble is None else trouble["text"]) from error
        with tempfile.TemporaryDirectory(prefix="coneflat-") as folder:
            path = Path(folder) / "result.npz"
            path.write_bytes(content)
            return read_flattening(path)

    def close(self) -> None:
        """End the server and the worker process; the project remains, except in a temporary folder."""
        self._server.should_exit = True
        self._thread.join(10)
        self._session.close()
        if self._own_folder is not None:
            self._own_folder.cleanup()

    def __enter__(self) -> Studio:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _repr_html_(self) -> str:
        """Return the page in a frame, for notebooks."""
        return (
            f'<iframe src="{html.escape(self.address)}" title="coneflat studio" allow="clipboard-write" '
            f'style="width: 100%; height: {int(self.height)}px; border: 1px solid #8886; border-radius: 6px"></iframe>'
        )

    def __repr__(self) -> str:
        return f"<Studio of {self.project.name} at {self.address.split('?')[0]}>"


def _proxied(through: str, port: int, token: str) -> str:
    """Return the address of the page through a proxy.

    Raises:
        OptionError: the address does not contain "{port}".
    """
    if "{port}" not in through:
        raise OptionError(f"through must be an address that contains {{port}}, got {short_repr(through)}")
    return f"{through.replace('{port}', str(port)).rstrip('/')}/?token={token}"


def studio(mesh: Any, faces: ArrayLike | None = None, **options: Any) -> Studio:
    """Return a studio for a mesh, whose page is shown in notebooks; see `Studio` for its arguments and attributes.

    Args:
        mesh, faces: a file or a project, or a mesh as in `coneflat.flatten`.
        options: further arguments of `Studio`.

    Raises:
        ArrayShapeError: the arrays are not a mesh.
        MeshFileError, ProjectError: the file cannot be read.
        OptionError: the extra `studio` is not installed, or `through` does not contain "{port}".

    Examples:
        >>> page = coneflat.studio(coneflat.sample_path())  # doctest: +SKIP
        >>> page  # its page, in a cell of a notebook  # doctest: +SKIP
        >>> page.choices, page.result  # what was chosen there, and the flattening  # doctest: +SKIP
        >>> coneflat.studio([[0.0, 0.0]], [[0, 1, 2]])
        Traceback (most recent call last):
            ...
        coneflat.errors.ArrayShapeError: vertices must have the shape (n, 3), got (1, 2)
    """
    return Studio(mesh, faces, **options)
