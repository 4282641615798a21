"""The normals that a mesh's file gives, or its smoothing groups, at the corners of a result's triangles."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .._arrays import FloatArray, IntArray
from ..input.mesh_file import MeshFile
from ..input.polygons import polygon_of
from ..input.weld import weld

if TYPE_CHECKING:
    from ..result.flattening import Flattening

_SMOOTHING = re.compile(rb"(?m)^[ \t]*s[ \t]+(\S+)")
_FLAT = (b"off", b"0")


class CornerNormals(NamedTuple):
    """Normals of a surface that need not be smooth everywhere.

    Attributes:
        normals: (k, 3) unit vectors, all different.
        corners: (m, 3) index into them of every triangle corner.
    """

    normals: FloatArray
    corners: IntArray


def usable_normals(normals: FloatArray, corners: IntArray) -> IntArray | None:
    """Return (c,) index of each corner into (k, 3) normals, -1 for those that are none; None if no corner has any."""
    is_usable = np.append(np.isfinite(normals).all(axis=1) & normals.any(axis=1), False)
    known = np.where((corners >= 0) & (corners < len(normals)), corners, -1)
    known = np.where(is_usable[known], known, -1)
    return known if np.any(known >= 0) else None


def vertex_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return (n, 3) unit normals, each the mean of its triangles' by area; (0, 0, 1) where there is none."""
    return _unit(
        _sums(np.repeat(_area_vectors(vertices, faces), 3, axis=0), faces.reshape(-1), len(vertices))
    )


def corner_normals(result: Flattening) -> CornerNormals | None:
    """Return the shading of the file that a result was read from; None where it says nothing of it.

    That is the file's normals, or what its smoothing groups make; corners without either have the mean normal of
    their vertex.
    """
    source = result.source
    if source is None or result.face_corners is None:
        return None
    if source.normals is not None and source.normal is not None:
        normals, corners = source.normals, source.normal[result.face_corners]
    else:
        groups = _smoothing_groups(source)
        if groups is None:
            return None
        normals, corners = _smoothed(result, source, groups)
    missing = corners < 0
    if missing.any():
        corners = np.where(missing, len(normals) + result.faces, corners)
        normals = np.concatenate([normals, vertex_normals(result.vertices, result.faces)])
    used, numbers = np.unique(corners, return_inverse=True)
    # Many files have a normal for every corner, most of them the same.
    kept, merged = weld(_unit(normals[used]))
    return CornerNormals(_unit(normals[used][kept]), merged[numbers.reshape(corners.shape)])


def _smoothing_groups(source: MeshFile) -> IntArray | None:
    """Return (p,) the smoothing group of each polygon of an OBJ file, 0 for none; None if they make no difference."""
    if source.obj is None:
        return None
    known: dict[bytes, int] = {}
    starts, groups = [0], [0]
    for polygon in sorted(source.obj.gaps):
        names = _SMOOTHING.findall(source.obj.gaps[polygon])
        if names:
            name = names[-1].lower()
            starts.append(polygon)
            groups.append(0 if name in _FLAT else known.setdefault(name, len(known) + 1))
    of_polygon = np.repeat(groups, np.diff([*starts, len(source.offsets) - 1]))
    if len(starts) == 1 or (of_polygon[0] > 0 and np.all(of_polygon == of_polygon[0])):
        return None
    return of_polygon


def _smoothed(result: Flattening, source: MeshFile, groups: IntArray) -> tuple[FloatArray, IntArray]:
    """Return normals, and the (m, 3) of each corner: the mean over the group at the vertex, or the polygon's own."""
    assert result.face_corners is not None
    polygon = polygon_of(result.face_corners, source.offsets)
    group = groups[polygon][:, None]
    count = len(result.vertices)
    keys = np.where(group > 0, group * count + result.faces, -1 - polygon[:, None])
    _, corners = np.unique(keys, return_inverse=True)
    corners = corners.reshape(keys.shape)
    areas = _area_vectors(result.vertices, result.faces)
    return _sums(np.repeat(areas, 3, axis=0), corners.reshape(-1), int(corners.max()) + 1), corners


def _area_vectors(vertices: FloatArray, faces: IntArray) -> FloatArray:
    a, b, c = (np.take(vertices, faces[:, k], axis=0) for k in range(3))
    return np.asarray(np.cross(b - a, c - a))


def _sums(values: FloatArray, places: IntArray, count: int) -> FloatArray:
    """Return (count, 3) the sums of the values of each place."""
    return np.stack([np.bincount(places, values[:, k], count) for k in range(3)], axis=1)


def _unit(vectors: FloatArray) -> FloatArray:
    """Return vectors of length one; (0, 0, 1) for those without a direction."""
    with np.errstate(over="ignore", invalid="ignore"):
        # Squares of the largest component's parts neither overflow nor vanish.
        scaled = vectors / np.maximum(np.abs(vectors).max(axis=1, keepdims=True), np.finfo(float).tiny)
        lengths = np.linalg.norm(scaled, axis=1, keepdims=True)
    is_vector = np.isfinite(lengths) & (lengths > 0)
    return np.where(is_vector, scaled / np.where(is_vector, lengths, 1), [0.0, 0.0, 1.0])
