"""The studio from Python: its page in a frame, as notebooks show it, what is chosen there and what comes of it."""

from __future__ import annotations

import html
import secrets
import tempfile
import threading
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ...base import shown
from ...errors import ArrayShapeError, OptionError, StudioError
from ...io import as_input, atomic_write, lines_of
from .serve import address_of, listening, studio_server
from .session import PATIENCE, Session

if TYPE_CHECKING:
    from ... import Flattening


class Studio:
    """A studio that this process serves, until it is closed or the process ends.

    The last line of a notebook's cell shows its page in a frame, which the browser loads from this machine; or, where
    the kernel runs elsewhere, from the notebook's server by a proxy. A saved notebook holds no picture of it.

    Attributes:
        address: of the page, for any browser on this machine, or as the notebook has it through a proxy; who knows it
            may change what is chosen.
        project: the file in which everything that is chosen is kept.
        height: of the frame, pixels.
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
            folder: where the project is kept, and meshes that come as arrays; by default the current one, and for
                arrays a new one that goes with the studio.
            color: numbers that are shown as colours, see `coneflat view --color`.
            height: of the frame, pixels.
            through: where a proxy has a port of this machine, as the browser sees it: "/proxy/{port}/" with
                jupyter-server-proxy, "/user/NAME/proxy/{port}/" on a hub. Then the token alone keeps others out.

        Raises:
            ArrayShapeError: it is not a mesh.
            MeshFileError, ProjectError: the file cannot be read.
            OptionError: the extra `studio` is not installed, or `through` names no port.
        """
        server_class = studio_server()
        self.height = height
        self._own_folder: tempfile.TemporaryDirectory[str] | None = None
        file = self._file_of(mesh, faces, folder)
        is_project = file.suffix.lower() == ".json"
        home = Path() if folder is None else Path(folder)
        if is_project or self._own_folder is not None:
            home = file.parent
        self._session = Session(home, color)
        try:
            self._session.open(file)
            token, listener = secrets.token_urlsafe(24), listening(0)
            port = listener.getsockname()[1]
            self.address = address_of(port, token) if through is None else _proxied(through, port, token)
            self._server = server_class(self._session, token, port, framed=True, proxied=through is not None)
        except BaseException:
            self._session.close()
            raise
        self._thread = threading.Thread(target=self._server.run, args=([listener],), daemon=True)
        self._thread.start()

    def _file_of(self, mesh: Any, faces: ArrayLike | None, folder: str | PathLike[str] | None) -> Path:
        """Return the file of a mesh; arrays are written to one."""
        if faces is None and isinstance(mesh, (str, PathLike)):
            return Path(mesh)
        given = as_input(mesh, faces)
        if given.source is not None:
            return given.source.path
        vertices, triangles = np.asarray(given.vertices, dtype=np.float64), np.asarray(given.faces)
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            raise ArrayShapeError(f"vertices must have the shape (n, 3), not {vertices.shape}")
        if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype.kind not in "iu":
            raise ArrayShapeError(
                f"faces must be integers of the shape (m, 3), not of {triangles.shape} and type {triangles.dtype}"
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
        """The file in which everything that is chosen is kept."""
        assert self._session.project_file is not None
        return self._session.project_file.resolve()

    @property
    def choices(self) -> dict[str, Any]:
        """What is chosen, as the project's file has it; others may be set, which is a step that can be undone."""
        return dict(self._session.state()["choices"])

    @choices.setter
    def choices(self, choices: Mapping[str, Any]) -> None:
        """Choose something else.

        Raises:
            StudioError, OptionError: it makes no sense.
        """
        self._session.choose(choices)

    @property
    def result(self) -> Flattening:
        """What comes of the choices, waited for.

        Raises:
            StudioError: they cannot be, and why.
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
        """End the page and what works behind it; the project stays, but for one in a folder of the studio's own."""
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
        """Return the page in a frame, which notebooks show."""
        return (
            f'<iframe src="{html.escape(self.address)}" title="coneflat studio" allow="clipboard-write" '
            f'style="width: 100%; height: {int(self.height)}px; border: 1px solid #8886; border-radius: 6px"></iframe>'
        )

    def __repr__(self) -> str:
        return f"<Studio of {self.project.name} at {self.address.split('?')[0]}>"


def _proxied(through: str, port: int, token: str) -> str:
    """Return the address of the page as a proxy has it.

    Raises:
        OptionError: that has no place for the port.
    """
    if "{port}" not in through:
        raise OptionError(
            f"through is an address with the port in it, such as /proxy/{{port}}/, not {shown(through)}"
        )
    return f"{through.replace('{port}', str(port)).rstrip('/')}/?token={token}"


def studio(mesh: Any, faces: ArrayLike | None = None, **options: Any) -> Studio:
    """Return the studio on a mesh, as a page that notebooks show; see `Studio` for the arguments and what it has.

    Args:
        mesh, faces: a file or a project, or a mesh as `coneflat.flatten` takes it.
        options: the other arguments of `Studio`.

    Raises:
        ArrayShapeError: it is not a mesh.
        MeshFileError, ProjectError: the file cannot be read.
        OptionError: the extra `studio` is not installed, or `through` names no port.

    Examples:
        >>> page = coneflat.studio(coneflat.sample_path())  # doctest: +SKIP
        >>> page  # its page, in a cell of a notebook  # doctest: +SKIP
        >>> page.choices, page.result  # what was chosen there, and the flattening  # doctest: +SKIP
        >>> coneflat.studio([[0.0, 0.0]], [[0, 1, 2]])
        Traceback (most recent call last):
            ...
        coneflat.errors.ArrayShapeError: vertices must have the shape (n, 3), not (1, 2)
    """
    return Studio(mesh, faces, **options)
