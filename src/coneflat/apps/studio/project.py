"""Projects: a small JSON file with the path and hash of a mesh and the choices for it."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
from dataclasses import dataclass, field, replace
from itertools import chain, count
from pathlib import Path
from typing import Any
from unicodedata import category

from ... import ConeflatError
from ...base import short_repr
from ...errors import MeshFileError, ProjectError, StudioError
from ...io import atomic_write, read_joined
from .carry import carried_over
from .choices import Choices
from .places import Places, shape_of

KIND, VERSION = "coneflat project", 1
ENDING = ".json"


@dataclass(frozen=True)
class Project:
    """A mesh file and the choices for it.

    Attributes:
        mesh: path of the mesh file.
        sha256: SHA-256 of its content, hexadecimal.
        choices: the choices of the user.
        places: where the vertices of the choices are on the mesh; None if that is not known.
        revision: SHA-256 of the content of the project's file; "" if there is none yet.
        notes: sentences on choices that were carried over from a mesh that has changed.
    """

    mesh: Path
    sha256: str
    choices: Choices
    places: Places | None = field(default=None, compare=False)
    revision: str = field(default="", compare=False)
    notes: tuple[str, ...] = field(default=(), compare=False)

    def save(self, path: Path) -> str:
        """Write the project, with the path of the mesh relative to it, and return the revision.

        No incomplete file is left.

        Raises:
            MeshFileError: the file cannot be written.
        """
        content = {
            "kind": KIND,
            "version": VERSION,
            "mesh": {"path": _relative(self.mesh, path.parent), "sha256": self.sha256},
            "choices": self.choices.as_plain(),
            **({} if self.places is None else {"places": self.places.as_plain()}),
        }
        text = f"{json.dumps(content, indent=1, allow_nan=False)}\n"
        with atomic_write(path, "w") as stream:
            stream.write(text)
        return _sha256(text.encode("utf-8"))

    def check_mesh(self) -> None:
        """Check that the mesh is the one for which the choices were made.

        Raises:
            ProjectError: the mesh has been changed since, or is missing.
        """
        try:
            sha256 = file_hash(self.mesh)
        except MeshFileError as error:
            raise ProjectError(f"the project's mesh is missing: {error}") from error
        if sha256 != self.sha256:
            raise ProjectError(
                f"{self.mesh} is not the mesh that the project was made with: its SHA-256 begins with {sha256[:12]}, "
                f"not {self.sha256[:12]}, so vertex numbers may have changed; coneflat studio opens the project and "
                "carries the choices over"
            )


def read_project(path: Path) -> Project:
    """Return the project in a file; its mesh is not read.

    Raises:
        ProjectError: the file cannot be read, or is not a project.
    """
    try:
        if path.stat().st_size > 64 * 1024 * 1024:  # A project with a million drawn edges is smaller.
            raise ProjectError(f"{path} is not a project: it has {path.stat().st_size:,} bytes")
        stored = path.read_bytes()
        content = json.loads(stored.decode("utf-8"))
    except OSError as error:
        raise ProjectError(f"cannot read {path}: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise ProjectError(f"{path} is not a project: it is not JSON") from error
    return replace(_project(path, content), revision=_sha256(stored))


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def is_changed(path: Path, revision: str) -> bool:
    """Return whether the file of a project is of another revision than the given one; a removed file is not."""
    try:
        return file_hash(path) != revision
    except MeshFileError:
        return False


def unused_name(path: Path) -> Path:
    """Return the path with the lowest number, from 2 on, added to the name that no file has."""
    names = (path.with_stem(f"{path.stem}-{number}") for number in count(2))
    return next(name for name in names if not name.exists())


def _project(path: Path, content: Any) -> Project:
    if not isinstance(content, dict) or content.get("kind") != KIND:
        raise ProjectError(f"{path} is not a project of coneflat")
    if content.get("version") != VERSION:
        raise ProjectError(
            f"{path} is a project of version {content.get('version')!r}; this coneflat reads version {VERSION}"
        )
    try:
        mesh = content["mesh"]
        file, sha256 = Path(str(mesh["path"])), str(mesh["sha256"])
        choices = Choices.from_plain(content["choices"])
        places = Places.from_plain(content.get("places"), len(choices.vertices()))
    except ConeflatError as error:
        raise ProjectError(f"{path} contains choices that are not valid: {error}") from error
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ProjectError(f"{path} is not a project: an entry is missing or not valid ({error})") from error
    return Project(Path(os.path.normpath(path.parent / file)), sha256, choices, places)


def file_hash(path: Path) -> str:
    """Return the SHA-256 of the content of a file, hexadecimal.

    Raises:
        MeshFileError: the file cannot be read.
    """
    try:
        with path.open("rb") as stream:
            digest = hashlib.sha256()
            while block := stream.read(1 << 20):
                digest.update(block)
    except (OSError, ValueError) as error:
        raise MeshFileError(f"cannot read {path}: {getattr(error, 'strerror', None) or error}") from error
    return digest.hexdigest()


def _relative(path: Path, folder: Path) -> str:
    """Return a path relative to a folder, with slashes; the full path if it is on another drive."""
    try:
        return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()
    except ValueError:  # Another drive.
        return str(path.resolve())


def project_path(path: Path, folder: Path) -> Path:
    """Return the path of the project file of a mesh, in a folder; or of a project, which is its own.

    Meshes of the same name, such as bunny.obj and bunny.ply, have a project each.

    Raises:
        MeshFileError: the mesh cannot be read.
        ProjectError: a project cannot be read.
    """
    if path.suffix.lower() == ENDING:
        return path
    first = folder / f"{path.stem}_studio{ENDING}"
    second = folder / f"{path.stem}_{path.suffix[1:].lower()}_studio{ENDING}"
    numbered = (second.with_stem(f"{second.stem}-{number}") for number in count(2))
    return next(file for file in chain((first, second), numbered) if _is_project_of(file, path))


def _is_project_of(file: Path, mesh: Path) -> bool:
    """Return whether a project file is that of a mesh, or does not exist; the mesh may have been changed or moved."""
    if not file.exists():
        return True
    project = read_project(file)
    is_moved = project.mesh.name == mesh.name and not project.mesh.exists()
    return project.mesh.resolve() == mesh.resolve() or is_moved or project.sha256 == file_hash(mesh)


def open_project(path: Path, file: Path, within: Path | None = None) -> Project:
    """Return the project of a mesh or of a project file; a mesh is opened with the choices in its project.

    Args:
        path: path of a mesh or a project.
        file: path of the project file, see `project_path`.
        within: folder in which the mesh of a project must be; None if it may be anywhere.

    Raises:
        MeshFileError: the mesh cannot be read.
        ProjectError: the project cannot be read, or its mesh is missing.
    """
    if not file.exists() and path != file:
        return Project(path, file_hash(path), Choices())
    project = read_project(file)
    mesh = project.mesh if path == file else path
    if within is not None and not mesh.resolve().is_relative_to(within):
        raise ProjectError(f"the mesh of {path.name} is outside the folder of the session")
    try:
        sha256 = file_hash(mesh)
    except MeshFileError as error:
        raise ProjectError(f"the project's mesh is missing: {error}") from error
    opened = replace(project, mesh=mesh, sha256=sha256)
    return opened if sha256 == project.sha256 else _with_changed_mesh(opened, file)


def _with_changed_mesh(project: Project, file: Path) -> Project:
    """Return a project whose mesh has changed, with the choices that can be carried over to it.

    They keep their vertices if the connectivity is the same. If choices have no place on the mesh, the project as it
    was is copied to another file.
    """
    if not len(project.choices.vertices()) and not project.choices.pins.pins:
        return project
    mesh = read_joined(project.mesh).mesh
    shape, places = shape_of(mesh), project.places
    if places is not None and places.connectivity == shape.connectivity:
        return replace(project, places=shape.places(project.choices.vertices()))
    carried = carried_over(project.choices, places, mesh)
    how = "keep the numbers of their vertices" if places is None else "are at the nearest vertices"
    note = f"{project.mesh.name} has changed since {file.name} was saved: the choices {how}."
    if carried.lost:
        note += f" Without a place on it: {', '.join(carried.lost)}."
        copy = unused_name(file)
        try:
            shutil.copyfile(file, copy)
            note += f" The project as it was is in {copy.name}."
        except OSError as error:
            note += f" The project as it was cannot be copied: {error.strerror or error}."
    return replace(
        project,
        choices=carried.choices,
        places=shape.places(carried.choices.vertices()),
        notes=(note,),
    )


def safe_name(name: str) -> str:
    """Return a file name that every system accepts, without invisible characters and those that reorder text."""
    printable = "".join(
        "_" if character in '<>:"|?*' else character for character in name if category(character)[0] != "C"
    )
    return (
        f"_{printable}"
        if re.match(r"(?i)(con|prn|aux|nul|(com|lpt)[0-9¹²³])\s*(\.|$)", printable)
        else printable
    )


def file_within(name: str, folder: Path) -> Path:
    """Return the path of a file in a folder; `folder` must be a resolved path.

    Raises:
        StudioError: the name is not valid, or the file is a link to another folder.
    """
    if not name:
        raise StudioError("no file is given: expected the name of a mesh or a project")
    if name != Path(name).name or name.startswith(".") or "\\" in name or "\0" in name:
        raise StudioError(f"{short_repr(name)} is not the name of a file in the folder of the session")
    path = folder / name
    if not path.resolve().is_relative_to(folder):
        raise StudioError(f"{short_repr(name)} is outside the folder of the session")
    return path
