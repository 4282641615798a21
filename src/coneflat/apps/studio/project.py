"""Projects: a small JSON file with the path and hash of a mesh and the choices for it."""

from __future__ import annotations

import hashlib
import json
import os
import re
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path
from typing import Any
from unicodedata import category

from ... import ConeflatError
from ...base import short_repr
from ...errors import MeshFileError, ProjectError, StudioError
from ...io import atomic_write
from .choices import Choices

KIND, VERSION = "coneflat project", 1
ENDING = ".json"


@dataclass(frozen=True)
class Project:
    """A mesh file and the choices for it.

    Attributes:
        mesh: path of the mesh file.
        sha256: SHA-256 of its content, hexadecimal.
        choices: the choices of the user.
        revision: SHA-256 of the content of the project's file; "" if there is none yet.
    """

    mesh: Path
    sha256: str
    choices: Choices
    revision: str = field(default="", compare=False)

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
                f"not {self.sha256[:12]}, so vertex numbers may have changed"
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
    except ConeflatError as error:
        raise ProjectError(f"{path} contains choices that are not valid: {error}") from error
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ProjectError(f"{path} is not a project: an entry is missing or not valid ({error})") from error
    return Project(Path(os.path.normpath(path.parent / file)), sha256, choices)


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
    """Return the path of the project file of a mesh, in a folder; or of a project, which is its own."""
    return path if path.suffix.lower() == ENDING else folder / f"{path.stem}_studio{ENDING}"


def open_project(path: Path, file: Path, within: Path | None = None) -> Project:
    """Return the project of a mesh or of a project file; a mesh is opened with the choices in its project.

    Args:
        path: path of a mesh or a project.
        file: path of the project file, see `project_path`.
        within: folder in which the mesh of a project must be; None if it may be anywhere.

    Raises:
        MeshFileError: the mesh cannot be read.
        ProjectError: the project cannot be read, or belongs to another mesh.
    """
    if path == file:
        project = read_project(path)
        if within is not None and not project.mesh.resolve().is_relative_to(within):
            raise ProjectError(f"the mesh of {path.name} is outside the folder of the session")
        project.check_mesh()
        return project
    sha256 = file_hash(path)
    if not file.exists():
        return Project(path, sha256, Choices())
    before = read_project(file)
    if before.sha256 != sha256:
        raise ProjectError(
            f"{file} is a project of another mesh: its SHA-256 begins with {before.sha256[:12]}, that of "
            f"{path} with {sha256[:12]}; move it away, or work in another folder"
        )
    return replace(before, mesh=path)


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
