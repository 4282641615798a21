"""A project: one small JSON file with a mesh, by path and hash, and what was chosen for it; and how both are opened."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ... import ConeflatError
from ...base import shown
from ...errors import MeshFileError, ProjectError, StudioError
from ...io import atomic_write
from .choices import Choices

KIND, VERSION = "coneflat project", 1
ENDING = ".json"


@dataclass(frozen=True)
class Project:
    """A mesh file and what was chosen for it.

    Attributes:
        mesh: the file.
        sha256: of its content, hexadecimal.
        choices: what was chosen.
    """

    mesh: Path
    sha256: str
    choices: Choices

    def save(self, path: Path) -> None:
        """Write it, in full or not at all; the mesh is named as it lies beside the project.

        Raises:
            MeshFileError: the file cannot be written.
        """
        content = {
            "kind": KIND,
            "version": VERSION,
            "mesh": {"path": _relative(self.mesh, path.parent), "sha256": self.sha256},
            "choices": self.choices.as_plain(),
        }
        with atomic_write(path, "w") as stream:
            json.dump(content, stream, indent=1, allow_nan=False)
            stream.write("\n")

    def check_mesh(self) -> None:
        """Make sure that the mesh is the one that the choices were made for.

        Raises:
            ProjectError: it has been changed since, or is not there.
        """
        try:
            found = hash_of(self.mesh)
        except MeshFileError as error:
            raise ProjectError(f"the project's mesh is missing: {error}") from error
        if found != self.sha256:
            raise ProjectError(
                f"{self.mesh} is not the mesh that the project was made with: its SHA-256 begins with {found[:12]}, "
                f"not {self.sha256[:12]}, so numbers of vertices may mean others"
            )


def read_project(path: Path) -> Project:
    """Return the project that a file holds; its mesh is not looked at.

    Raises:
        ProjectError: it cannot be read, or is none.
    """
    try:
        if path.stat().st_size > 64 * 1024 * 1024:  # a project of a million drawn edges is smaller
            raise ProjectError(f"{path} is not a project: it has {path.stat().st_size:,} bytes")
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ProjectError(f"cannot read {path}: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise ProjectError(f"{path} is not a project: it is not JSON") from error
    return _project(path, content)


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
        raise ProjectError(f"{path} holds choices that make no sense: {error}") from error
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ProjectError(
            f"{path} is not a project: something in it is missing or broken ({error})"
        ) from error
    return Project(Path(os.path.normpath(path.parent / file)), sha256, choices)


def hash_of(path: Path) -> str:
    """Return the SHA-256 of a file's content.

    Raises:
        MeshFileError: it cannot be read.
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
    """Return a path as seen from a folder, with slashes; the full path where there is no way."""
    try:
        return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()
    except ValueError:  # Another drive.
        return str(path.resolve())


def opened(path: Path, folder: Path, only_within: bool = False) -> tuple[Project, Path]:
    """Return a mesh with what was chosen for it before, and the file that it is kept in; or a project and its file.

    Args:
        path: a mesh or a project.
        folder: of the projects of meshes.
        only_within: the mesh of a project must lie in the folder, too.

    Raises:
        MeshFileError: the mesh cannot be read.
        ProjectError: the project cannot, or its mesh is another.
    """
    if path.suffix.lower() == ENDING:
        project = read_project(path)
        if only_within and not project.mesh.resolve().is_relative_to(folder):
            raise ProjectError(f"the mesh of {path.name} lies outside the session's folder")
        project.check_mesh()
        return project, path
    sha256, file = hash_of(path), folder / f"{path.stem}_studio{ENDING}"
    if not file.exists():
        return Project(path, sha256, Choices()), file
    before = read_project(file)
    if before.sha256 != sha256:
        raise ProjectError(
            f"{file} is a project of another mesh: its SHA-256 begins with {before.sha256[:12]}, that of "
            f"{path} with {sha256[:12]}; move it away, or work in another folder"
        )
    return Project(path, sha256, before.choices), file


def file_within(name: str, folder: Path) -> Path:
    """Return the file of a folder, without links in its own path, that has a name.

    Raises:
        StudioError: it lies elsewhere, or has no proper name.
    """
    if not name:
        raise StudioError("no file is named: give the name of a mesh or a project in the session's folder")
    if name != Path(name).name or name.startswith(".") or "\\" in name or "\0" in name:
        raise StudioError(f"{shown(name)} is not a name of a file in the session's folder")
    path = folder / name
    if not path.resolve().is_relative_to(folder):
        raise StudioError(f"{shown(name)} leads out of the session's folder")
    return path
