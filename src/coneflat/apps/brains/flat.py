"""Flattening of a cortex whose medial wall is cut off by label."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ... import Flattening, MeshFile, check_mesh, flatten
from ...base import BoolArray, FloatArray, IntArray, mask_of, plural, warns
from ...errors import OptionError
from ...geometry import rotated_up, signed_double_areas
from ...io import UVMesh, as_path, checked_target, read_label, read_mesh
from ...mesh import label_faces
from .files import FLAT_FORMATS, check_same_side, structure_of, write_gifti, write_patch

#: The upward direction of a surface in the coordinates of the field, right, anterior and superior.
SUPERIOR = (0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class FlatCortex:
    """A flat map in the numbering of the surface's vertices.

    A flat map of this field has one point for each vertex, so triangles on one side of a cut are left out: at a vertex
    on a cut, those that do not touch its first copy.

    Attributes:
        result: the flattening, in which no triangle is left out.
        surface: the file of the surface.
        points: (n, 2) the flat map in the unit of the surface, 0 for vertices that are left out.
        faces: (m, 3) its triangles.
        is_single: (n,) vertices that are not on a cut.
    """

    result: Flattening
    surface: MeshFile
    points: FloatArray
    faces: IntArray
    is_single: BoolArray

    def uv_mesh(self, path: Path) -> UVMesh:
        """Return the flat map as a file of the format of `path` has it."""
        faces = self.faces if path.suffix.lower() == ".gii" else self._patch_faces()
        stored = self.points.astype(np.float32).astype(np.float64)
        return UVMesh(self.surface.vertices, faces, stored[faces], len(faces), 0, 0, source=self.surface)

    def _patch_faces(self) -> IntArray:
        return self.faces[self.is_single[self.faces].all(axis=1)]

    def save(self, path: str | PathLike[str]) -> Path:
        """Write the flat map: a GIFTI surface (.gii), or a FreeSurfer patch (.3d) without the vertices on cuts.

        Raises:
            UnknownFormatError, MeshFileError: the file cannot be written.
        """
        path = checked_target(path, FLAT_FORMATS, "flat maps are written as")
        if path.suffix.lower() == ".gii":
            write_gifti(path, self.points, self.faces, structure_of(self.surface.path))
            return path
        faces = self._patch_faces()
        ends = np.sort(faces[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2), axis=1)
        edges, count = np.unique(ends, axis=0, return_counts=True)
        vertices = np.unique(faces)
        write_patch(path, self.points, vertices, np.isin(vertices, edges[count == 1]))
        return path


@warns("flat.result.notes", lambda flat, *_: flat.result.notes)
def flatten_cortex(
    surface: str | PathLike[str],
    *,
    remove: Sequence[str] = (),
    keep: Sequence[str] = (),
    up: Sequence[float] | None = None,
    **options: Any,
) -> FlatCortex:
    """Return the flat map of a cortex; relief cuts are found by the search of cones.

    Args:
        surface: a GIFTI or FreeSurfer surface of one hemisphere.
        remove: labels to cut off, such as the medial wall; see `coneflat.io.read_label`.
        keep: labels that no cut may cross.
        up: the direction of the surface that points up in the flat map; None for superior.
        options: as of `coneflat.flatten`; stretch is 1 by default.

    Raises:
        MeshFileError, OptionError: a file cannot be read, a label does not exist or is of another surface.
    """
    path, upward = as_path(surface), SUPERIOR if up is None else up
    mesh = read_mesh(path, weld=False)
    wall, uncut = (_vertices(mesh, labels) for labels in (remove, keep))
    cut_off = mask_of(len(mesh.vertices), wall)
    faces = mesh.triangles[~cut_off[mesh.triangles].any(axis=1)]
    if not len(faces):
        raise OptionError(f"the labels to remove must leave triangles of {path}, got all of them")
    checked = check_mesh(mesh.vertices, faces, repair=True)  # separates what touches in a point
    count, part = label_faces(checked.mesh.faces, len(checked.mesh.vertices))
    largest = faces[checked.face_origin[part == np.bincount(part, minlength=count).argmax()]]
    offsets = np.arange(0, largest.size + 1, 3)
    source = MeshFile(path, mesh.vertices, largest.reshape(-1), offsets, attributes=mesh.attributes)
    if len(uncut):
        options["no_seams"] = uncut[~cut_off[uncut]]
    result = flatten(source, **{"stretch": 1.0, "repair": True, "up": tuple(upward), **options})
    if len(largest) < len(faces):
        left_out = plural(len(faces) - len(largest), "triangle")
        note = f"{left_out} in separate pieces were left out."
        result = replace(result, notes=(*result.notes, note))
    return _as_flat(result, mesh, np.array(upward, dtype=np.float64))


def _vertices(mesh: MeshFile, labels: Sequence[str]) -> IntArray:
    """Return the vertices of labels, which must be of the mesh."""
    parts = [np.empty(0, np.int64)]
    for label in labels:
        check_same_side(mesh.path, {"the label": Path(label.rpartition(":")[0] or label)})
        vertices = read_label(label, len(mesh.vertices))
        if not len(vertices):
            raise OptionError(f"{label} must have vertices, got none: choose another label")
        parts.append(vertices)
    return np.unique(np.concatenate(parts))


def _as_flat(result: Flattening, surface: MeshFile, up: FloatArray) -> FlatCortex:
    """Return a result, rotated by `up`, with one point for each vertex: that of the copy with the largest area."""
    origin = np.arange(len(result.vertices)) if result.vertex_origin is None else result.vertex_origin
    count, vertex = len(surface.vertices), np.empty(len(result.uv), np.int64)
    vertex[result.uv_faces] = origin[result.faces]
    areas = np.repeat(np.abs(signed_double_areas(result.corner_uv)), 3)
    area = np.bincount(result.uv_faces.reshape(-1), areas, len(result.uv))
    chosen = np.full(count, -1)
    order = np.argsort(area, kind="stable")
    chosen[vertex[order]] = order  # the last one, the largest, remains
    points = np.where(chosen[:, None] < 0, 0.0, (result.uv / result.uv_scale)[chosen])
    is_whole = (chosen[vertex[result.uv_faces]] == result.uv_faces).all(axis=1)
    faces = origin[result.faces[is_whole]]
    is_laid_out = chosen >= 0
    points[is_laid_out] = rotated_up(
        points[is_laid_out], surface.vertices[is_laid_out], up, area[chosen[is_laid_out]]
    )
    return FlatCortex(result, surface, points, faces, np.bincount(vertex, minlength=count) == 1)
