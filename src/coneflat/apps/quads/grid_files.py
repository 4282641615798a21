"""Writing and reading integer grids: OBJ whose UVs are the grid, and NPZ."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import fields
from os import PathLike
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from ...base import FloatArray, IntArray
from ...errors import MeshError, MeshFileError
from ...io import (
    CheckedArrays,
    as_path,
    atomic_write,
    checked_target,
    known_ending,
    lines_of,
    number,
    parse_obj,
    read_archive,
    read_bytes,
)

if TYPE_CHECKING:
    from .integer_map import IntegerGrid

#: Endings of the files that `write_grid` writes and `read_grid` reads.
GRID_FORMATS = (".obj", ".npz")
_ARRAYS = (
    "vertices",
    "faces",
    "corner_grid",
    "turns",
    "shifts",
    "cones",
    "quarters",
    "corners",
    "corner_quarters",
    "features",
)
_NUMBERS = (
    "size", "move_rms", "move_max", "energy_before", "energy", "qc_before", "qc_mean", "least_area",
)  # fmt: skip
_REPORT = re.compile(rb"(?m)^# grid (\{.*\})[ \t]*\r?$")
_LINE = re.compile(rb"(?m)^l +(\d+) +(\d+)[ \t]*\r?$")
_HEAD = (
    "# An integer grid by coneflat: texture coordinates are in squares of the grid, which goes on across seams.",
    "# seam V W TURNS X Y: across the edge from V to W, p of the triangle on its right is R p + (X, Y) in that on its",
    "# left, R being so many quarter turns to the left. Other edges are no seams.",
    "# Lines (l) are sharp edges on grid lines.",
)


def check_grid_output(path: str | PathLike[str]) -> Path:
    """Return the path if `write_grid` can be expected to succeed with it.

    Raises:
        UnknownFormatError: the ending is not one of `GRID_FORMATS`.
        MeshFileError: the folder is missing, the path is a folder, or writing is not permitted.
    """
    return checked_target(path, GRID_FORMATS, "integer grids are written as")


def write_grid(path: str | PathLike[str], grid: IntegerGrid) -> Path:
    """Write an integer grid, in full or not at all, and return the path.

    An .obj has the place of every triangle corner as texture coordinates in units of the grid, with all their
    digits: the form in which programs that extract quads take it, libQEx among them. The quarter turns and
    translations of seam edges, and the measures of the grid, stand in comments. An .npz has all arrays of the
    `IntegerGrid`, and `seams` (k, 2), pairs of vertices with their `seam_turns` (k,) and `seam_shifts` (k, 2), as the
    comments have them.

    Args:
        path: the file.
        grid: what to write.

    Raises:
        UnknownFormatError: the ending is not one of `GRID_FORMATS`.
        MeshFileError: the file cannot be written.
    """
    path = check_grid_output(path)
    with atomic_write(path) as stream:
        (_write_obj if path.suffix.lower() == ".obj" else _write_npz)(grid, stream)
    return path


def _write_obj(grid: IntegerGrid, stream: IO[bytes]) -> None:
    # A corner of the same vertex at the same place is the same point.
    keys = np.concatenate([grid.faces.reshape(-1, 1), grid.corner_grid.reshape(-1, 2)], axis=1)
    points, number_of = np.unique(keys, axis=0, return_inverse=True)
    told = {**grid.report(), "notes": list(grid.notes)}
    stream.write(("\n".join([*_HEAD, f"# grid {json.dumps(told)}"]) + "\n").encode("ascii"))
    edges, turns, shifts = _seams(grid)
    rows = np.concatenate([edges + 1, turns[:, None], shifts], axis=1)
    stream.writelines(lines_of("# seam", rows, b"\n"))
    stream.writelines(lines_of("v", grid.vertices, b"\n"))
    stream.writelines(lines_of("vt", points[:, 1:], b"\n"))
    stream.writelines(_face_lines(grid.faces + 1, number_of.reshape(-1, 3) + 1))
    stream.writelines(lines_of("l", grid.features + 1, b"\n"))


def _face_lines(vertices: IntArray, points: IntArray) -> Iterator[bytes]:
    """Yield the lines of triangles by their vertices and points, numbered from 1."""
    rows = np.stack([vertices, points], axis=2).reshape(-1, 6)
    for begin in range(0, len(rows), 1 << 15):
        block = rows[begin : begin + (1 << 15)]
        yield ("f %d/%d %d/%d %d/%d\n" * len(block) % tuple(block.ravel().tolist())).encode()


def _seams(grid: IntegerGrid) -> tuple[IntArray, IntArray, IntArray]:
    """Return (k, 2) seam edges, (k,) turns and (k, 2) shifts; the triangle on the left of an edge is moved to.

    An edge is a seam where the motion across it is not none.
    """
    from ... import TriangleMesh

    mesh = TriangleMesh(grid.vertices, grid.faces)
    here = mesh.edge_halfedges[~mesh.is_boundary_edge, 0]
    here = here[(grid.turns[here] != 0) | grid.shifts[here].any(axis=1)]
    edges = np.stack([mesh.tails[here], mesh.heads[here]], axis=1)
    return edges, grid.turns[here], grid.shifts[here]


def _write_npz(grid: IntegerGrid, stream: IO[bytes]) -> None:
    edges, turns, shifts = _seams(grid)
    values = {field.name: getattr(grid, field.name) for field in fields(grid)}
    arrays: dict[str, Any] = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
    arrays |= {"seams": edges, "seam_turns": turns, "seam_shifts": shifts}
    told = {**grid.report(), "notes": list(grid.notes)}
    np.savez(stream, **arrays, report=np.array(json.dumps(told)))


def read_grid(path: str | PathLike[str]) -> IntegerGrid:
    """Return an integer grid from an .npz or .obj file.

    Of an .obj nothing is needed but triangles and their texture coordinates, in units of the grid: quarter turns,
    translations and cones follow from these. Measures are those in the comments of `write_grid`, else not numbers.

    Raises:
        UnknownFormatError: the ending is another.
        MeshFileError: the file is not there, may not be read, or holds no manifold of triangles with UVs.
        MeshError: it has no vertices or faces, or some that do not exist.
        GridError: the UVs are no integer-grid map: triangles are turned over, or sides of seams do not fit.
    """
    path = as_path(path)
    if known_ending(path, GRID_FORMATS, "integer grids are read from") == ".npz":
        return read_archive(path, (*_ARRAYS, "report"), _grid_of_archive)
    return _grid_of_obj(path, read_bytes(path))


def _grid_of_obj(path: Path, content: bytes) -> IntegerGrid:
    from .integer_map import grid_of_corners

    mesh = parse_obj(path, content)
    if (np.diff(mesh.offsets) != 3).any():
        raise MeshFileError(f"{path} holds no integer grid: it has polygons that are no triangles")
    if (
        mesh.uv is None
        or mesh.texture is None
        or mesh.texture.min() < 0
        or mesh.texture.max() >= len(mesh.uv)
    ):
        raise MeshFileError(f"{path} holds no integer grid: there are triangle corners without UVs")
    faces, places = mesh.corners.reshape(-1, 3), mesh.uv[mesh.texture].reshape(-1, 3, 2)
    _require_mesh(path, mesh.vertices, faces)
    match = _REPORT.search(content)
    known = {} if match is None else _known(path, match[1])
    features = np.array(_LINE.findall(content), dtype=np.int64).reshape(-1, 2) - 1
    if len(features) and not (features.min() >= 0 and features.max() < len(mesh.vertices)):
        raise MeshFileError(f"{path} has lines between vertices that it does not have")
    return grid_of_corners(mesh.vertices, faces, places, **known, features=features)


def _require_mesh(path: Path, vertices: FloatArray, faces: IntArray) -> None:
    """Raise MeshFileError unless triangles are a manifold, and all run the same way round."""
    from ... import check_mesh

    used, numbers = np.unique(faces, return_inverse=True)
    again = numbers.reshape(-1, 3)
    try:
        checked = check_mesh(vertices[used], again)
    except MeshError as error:
        # What follows is how to repair it, which a map does not survive.
        raise MeshFileError(f"{path} holds no integer grid: {str(error).split(';')[0]}") from error
    if (checked.mesh.faces != again).any():
        raise MeshFileError(
            f"{path} holds no integer grid: neighbouring triangles run in opposite directions"
        )


def _known(path: Path, text: bytes) -> dict[str, Any]:
    """Return the measures and notes that a comment has."""
    try:
        report = json.loads(text)
        known: dict[str, Any] = {name: float(number(report[name])) for name in _NUMBERS if name in report}
        known["notes"] = tuple(str(note) for note in report.get("notes", ()))
    except (ValueError, TypeError, AttributeError) as error:
        raise MeshFileError(f"{path} has a comment on its grid that cannot be read: {error}") from error
    return known


def _grid_of_archive(reading: CheckedArrays) -> IntegerGrid:
    from ... import TriangleMesh
    from .integer_map import IntegerGrid, find_motions

    reading.need((*_ARRAYS, "report"), "integer grid")
    report = reading.report()
    vertices = reading.finite("vertices", (None, 3))
    n = len(vertices)
    faces = reading.indices("faces", (None, 3), n)
    m = len(faces)
    numbers: dict[str, Any] = {name: float(number(report[name])) for name in _NUMBERS}
    cones, corners = (reading.indices(name, (None,), n) for name in ("cones", "corners"))
    grid = IntegerGrid(
        vertices=vertices,
        faces=faces,
        corner_grid=reading.finite("corner_grid", (m, 3, 2)),
        turns=reading.indices("turns", (3 * m,), 4, least=-1),
        shifts=reading.indices("shifts", (3 * m, 2), None, least=-(2**53)),
        cones=cones,
        quarters=reading.indices("quarters", (len(cones),), None),
        corners=corners,
        corner_quarters=reading.indices("corner_quarters", (len(corners),), None),
        features=reading.indices("features", (None, 2), n),
        **numbers,
        notes=reading.notes(report),
    )
    _require_mesh(reading.path, vertices, faces)
    turns, shifts, _ = find_motions(TriangleMesh(vertices, faces), grid.corner_grid)
    if (turns != grid.turns).any() or (shifts != grid.shifts).any():
        raise MeshFileError(
            f"{reading.path} holds no integer grid: its turns and shifts are not those of its corners"
        )
    return grid
