"""Meshes and projects, opened: what a session begins with, and what it may open for the page."""

from __future__ import annotations

from pathlib import Path

from ...base import shown
from ...errors import ProjectError, StudioError
from .choices import Choices
from .project import ENDING, Project, hash_of, read_project


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


def opened_within(name: str, folder: Path) -> tuple[Project, Path]:
    """Return a mesh or a project of a folder, as `opened` does; the mesh of a project lies there, too.

    Raises:
        StudioError: it is no file of the folder.
        MeshFileError, ProjectError: as of `opened`.
    """
    return opened(file_within(name, folder), folder, only_within=True)


def file_within(name: str, folder: Path) -> Path:
    """Return the file of a folder, without links in its own path, that has a name.

    Raises:
        StudioError: it lies elsewhere, or has no proper name.
    """
    if not name or name != Path(name).name or name.startswith(".") or "\\" in name or "\0" in name:
        raise StudioError(f"{shown(name)} is no name of a file in the session's folder")
    path = folder / name
    if not path.resolve().is_relative_to(folder):
        raise StudioError(f"{shown(name)} leads out of the session's folder")
    return path
