"""Jobs of a batch: a mesh file, the file of its result, and a checksum that shows whether it is up to date."""

from __future__ import annotations

import hashlib
import json
import os
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ...errors import OptionError
from ...io import find_meshes


@dataclass(frozen=True)
class Job:
    """A mesh to flatten.

    Attributes:
        mesh, output: absolute paths.
        options: keyword arguments of `coneflat.flatten`, or of `unwrap` with `max_energy`, as JSON values.
        weld: merge vertices at the same position; None for the default, see `coneflat.io.read.read_joined`.
        mark: checksum of the size and time of the mesh file, the options and the version; "" if the file is missing.
        required: conditions on measures, such as "flipped=0"; a mesh that does not meet them has failed.
        uv_set: the UV set that is written, see `coneflat.Flattening.save`.
    """

    mesh: str
    output: str
    options: Mapping[str, Any]
    weld: bool | None
    mark: str
    required: tuple[str, ...] = ()
    uv_set: int | None = None

    def as_json(self) -> str:
        """Return the job as one line."""
        return json.dumps(asdict(self))


def find_jobs(
    patterns: Iterable[str],
    folder: Path,
    ending: str,
    options: Mapping[str, Any],
    weld: bool | None,
    required: tuple[str, ...] = (),
    uv_set: int | None = None,
) -> list[Job]:
    """Return a job for each mesh that matches the patterns, sorted by path.

    Args:
        patterns: files, folders (every mesh in them), or patterns with *, ? and ** for any depth.
        folder: folder of the results, which are named like the meshes.
        ending: extension of the results, such as ".obj".
        options, weld, required, uv_set: see `Job`.

    Raises:
        OptionError: a pattern matches nothing, or a result would overwrite a mesh.
        MeshFileError: a folder cannot be read.
    """
    # A file counts once. If it is given by links only, the name of the first link is used, because content-addressed
    # stores name their files by checksums.
    names: dict[str, str] = {}
    for pattern in patterns:
        for path in find_meshes(pattern):
            real, name = os.path.realpath(path), os.path.abspath(path)
            if real == name or real not in names:
                names[real] = name
    meshes = sorted(names.values())
    conditions = [dict(options), weld, required, uv_set]
    jobs = [
        Job(mesh, str(folder / name), options, weld, _mark(mesh, conditions), required, uv_set)
        for mesh, name in zip(meshes, _names(meshes, ending), strict=True)
    ]
    for job in jobs:
        if os.path.realpath(job.output) in names:
            raise OptionError(f"the result of {job.mesh} would overwrite {job.output}: choose another folder")
    return jobs


def _names(meshes: list[str], ending: str) -> list[str]:
    """Return a unique name for each result: the name of the mesh, with as much of its path as needed."""
    paths = [Path(mesh) for mesh in meshes]
    names = [path.stem for path in paths]
    for depth in range(max((len(path.parts) for path in paths), default=0)):
        repeated = {name for name, count in Counter(name.lower() for name in names).items() if count > 1}
        if not repeated:
            break
        # The file extension is added first, then folders.
        names = [
            _extended_name(path, depth) if name.lower() in repeated else name
            for path, name in zip(paths, names, strict=True)
        ]
    # Names that are still equal, or differ in upper and lower case only, are numbered.
    taken: set[str] = set()
    for i, name in enumerate(names):
        count = 1
        while names[i].lower() in taken:
            count += 1
            names[i] = f"{name}_{count}"
        taken.add(names[i].lower())
    return [name + ending for name in names]


def _extended_name(path: Path, depth: int) -> str:
    kind = f"{path.stem}_{path.suffix[1:].lower()}"
    folders = path.parent.relative_to(path.anchor).parts
    return "_".join([*folders[max(len(folders) - depth, 0) :], kind])


def _mark(mesh: str, conditions: list[Any]) -> str:
    """Return the checksum of a mesh file, of what else its result depends on, and of the version."""
    from ... import __version__

    try:
        about = os.stat(mesh)
    except (OSError, ValueError):  # A broken link: reading it reports the error.
        return ""
    text = json.dumps([about.st_size, about.st_mtime_ns, *conditions, __version__], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
