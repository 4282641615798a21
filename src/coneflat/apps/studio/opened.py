"""The project that is open in a session: its file, which is locked, its mesh, and the places of its choices on it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from .choices import Choices
from .lock import ProjectLock, lock_path
from .places import Places, Shape, shape_received
from .project import Project, is_changed, unused_name


class OpenProject:
    """A mesh and the file of its choices; nothing is open at first.

    Attributes:
        mesh: path of the mesh; None if nothing is open.
        sha256: SHA-256 of its content, hexadecimal.
        file: the project file, which is locked; None if nothing is open.
        notes: sentences on choices that were carried over, and on a project that another program has changed.
    """

    def __init__(self, address: str) -> None:
        """address: address of the page, which other studios are told that open the same project."""
        self.mesh: Path | None = None
        self.sha256 = ""
        self.file: Path | None = None
        self.notes: tuple[str, ...] = ()
        self._address = address
        self._lock: ProjectLock | None = None
        self._revision = ""  # Of the project file when it was read or written last.
        # Of the mesh, once the worker has read it; until then, places are those of the project that was opened.
        self._shape: Shape | None = None
        self._places: Places | None = None

    @property
    def name(self) -> str:
        """Return the name of the project file; "" if nothing is open."""
        return "" if self.file is None else self.file.name

    @contextmanager
    def locked(self, file: Path) -> Iterator[Path]:
        """Yield a project file, which is locked; it replaces the one that was open unless the block fails.

        Raises:
            ProjectError: another studio has the project open.
        """
        lock, before = self._lock, self._lock
        if before is None or lock_path(before.project) != lock_path(file):
            lock = ProjectLock(file, self._address)
        try:
            yield file
        except BaseException:
            if lock is not None and lock is not before:
                lock.release()
            raise
        self._lock = lock
        if before is not None and before is not lock:
            before.release()

    def release(self) -> None:
        """Unlock the project file."""
        if self._lock is not None:
            self._lock.release()

    def begin(self, project: Project, file: Path) -> None:
        """Replace the project by another one, whose file is locked."""
        self.mesh, self.sha256, self.file = project.mesh.resolve(), project.sha256, file
        self._revision, self.notes = project.revision, project.notes
        self._shape, self._places = None, project.places

    def save(self, choices: Choices) -> None:
        """Write the project file.

        Raises:
            MeshFileError: it cannot be written.
            ProjectError: another program has changed it, and another studio has taken the next name.
        """
        assert self.mesh is not None
        assert self.file is not None
        if is_changed(self.file, self._revision):
            self._leave(self.file)
        if self._shape is not None:
            self._places = self._shape.places(choices.vertices())
        project = Project(self.mesh, self.sha256, choices, self._places)
        self._revision = project.save(self.file)

    def _leave(self, file: Path) -> None:
        """Continue in a new file: another program has written the project since this session read or wrote it."""
        with self.locked(unused_name(file)) as renamed:
            self.file, self._revision = renamed, ""
        self.notes = (
            *self.notes,
            f"Another program has changed {file.name}, which is left as it is; choices are saved in {renamed.name}.",
        )

    def forget_places(self) -> None:
        """Forget where the choices are, after a change of the choices before the worker has read the mesh."""
        if self._shape is None:
            self._places = None

    def take_shape(self, head: Mapping[str, str], body: bytes) -> bool:
        """Store the shape of the mesh, and return whether it is that of this mesh."""
        is_current = head["sha256"] == self.sha256
        if is_current:
            self._shape = shape_received(head, body)
        return is_current
