"""Splitting of vertices along UV seams and creases, and normals from the file or its smoothing groups.

This is needed for formats with one UV point and one normal per vertex.
"""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..geometry.triangles import face_normals, sums_at, unit_vectors, vertex_normals
from ..mesh.check import weld
from ..mesh.polygons import polygon_of
from ..result import Flattening
from .mesh_file import MeshFile

_SMOOTHING = re.compile(rb"(?m)^[ \t]*s[ \t]+(\S+)")


class CornerValues(NamedTuple):
    """Values at the triangle corners of a surface, such as normals, which differ along creases, or UVs.

    Attributes:
        values: (k, d) distinct values: unit vectors, or UV points.
        corners: (m, 3) index into `values` of every triangle corner.
        is_missing: (m, 3) True for corners without a value in the file, which have another one; None if all have one.
    """

    values: FloatArray
    corners: IntArray
    is_missing: BoolArray | None = None


class SplitMesh(NamedTuple):
    """A mesh with one vertex for each combination of vertex, UV point, normal and earlier UV at a triangle corner.

    Attributes:
        vertices: (k, 3) positions.
        uv: (k, 2) UV points.
        faces: (m, 3) triangles.
        vertex: (k,) the vertex of the result for each vertex.
        origin: (k,) the vertex of the input for each vertex.
        normals: (k, 3) normals, if they were given.
        texture_uv: (k, 2) UV points of the textures of the input, if they were given.
    """

    vertices: FloatArray
    uv: FloatArray
    faces: IntArray
    vertex: IntArray
    origin: IntArray
    normals: FloatArray | None = None
    texture_uv: FloatArray | None = None


def split_at_seams(
    result: Flattening, normals: CornerValues | None = None, texture_uv: CornerValues | None = None
) -> SplitMesh:
    """Return the mesh of a result split at its UV seams, in the order of its vertices, without unused vertices.

    Args:
        result: the flattening.
        normals, texture_uv: further values at the triangle corners; vertices are also split where these differ.
    """
    layers = (CornerValues(result.uv, result.uv_faces), normals, texture_uv)
    vertex, faces = np.arange(len(result.vertices)), result.faces.reshape(-1)
    split_values: list[FloatArray | None] = []
    for layer in layers:
        if layer is None:
            split_values.append(None)
            continue
        pair, index, faces = distinct_pairs(faces, layer.corners.reshape(-1), len(layer.values))
        vertex = vertex[pair]
        split_values = [None if values is None else values[pair] for values in split_values]
        split_values.append(layer.values[index])
    uv, shading, uv_of_textures = split_values
    assert uv is not None
    origin = input_vertices(result)[vertex]
    return SplitMesh(
        result.vertices[vertex], uv, faces.reshape(-1, 3), vertex, origin, shading, uv_of_textures
    )


def input_vertices(result: Flattening) -> IntArray:
    """Return (n,) the vertex of the input that each vertex of a result came from."""
    return np.arange(len(result.vertices)) if result.vertex_origin is None else result.vertex_origin


def distinct_pairs(
    vertices: IntArray, points: IntArray, point_count: int
) -> tuple[IntArray, IntArray, IntArray]:
    """Return the vertices and the points of all distinct pairs, in order, and the index of every given pair."""
    pairs, number = np.unique(vertices * point_count + points, return_inverse=True)
    return *np.divmod(pairs, point_count), number.reshape(-1)


def usable_normals(normals: FloatArray, corners: IntArray) -> IntArray | None:
    """Return (c,) the index of each corner into (k, 3) normals, -1 for unusable normals; None if all are unusable."""
    is_usable = np.append(np.isfinite(normals).all(axis=1) & normals.any(axis=1), False)
    usable = np.where((corners >= 0) & (corners < len(normals)), corners, -1)
    usable = np.where(is_usable[usable], usable, -1)
    return usable if np.any(usable >= 0) else None


def source_normals(result: Flattening) -> CornerValues | None:
    """Return the corner normals of the file that a result was read from; None if it has neither normals nor groups.

    These are the file's normals, or those computed from its smoothing groups; corners without either get the mean
    normal of their vertex.
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
    used_normals, numbers = np.unique(corners, return_inverse=True)
    # Many files have a normal for every corner, most of them equal.
    shown = shading_normals(normals[used_normals])
    distinct, merged = weld(shown)
    return CornerValues(shown[distinct], merged[numbers.reshape(corners.shape)])


def source_uv(result: Flattening) -> CornerValues | None:
    """Return the UVs of the file that a result was read from, (0, 0) at corners without; None if it has none."""
    source = result.source
    if source is None or result.face_corners is None or source.uv is None or source.texture is None:
        return None
    corners = source.texture[result.face_corners]
    count = len(source.uv)
    is_usable = np.append(np.isfinite(source.uv).all(axis=1), False)
    usable = np.where((corners >= 0) & (corners < count), corners, count)
    usable = np.where(is_usable[usable], usable, count)
    if np.all(usable == count):
        return None
    points, numbers = np.unique(usable, return_inverse=True)
    values = np.concatenate([source.uv, [[0.0, 0.0]]])[points]
    missing = usable == count
    return CornerValues(values, numbers.reshape(corners.shape), missing if missing.any() else None)


def _smoothing_groups(source: MeshFile) -> IntArray | None:
    """Return (p,) the smoothing group of each polygon of an OBJ file, 0 for none; None if groups have no effect."""
    if source.obj is None:
        return None
    numbers: dict[bytes, int] = {}
    starts, groups = [0], [0]
    for polygon in sorted(source.obj.gaps):
        names = _SMOOTHING.findall(source.obj.gaps[polygon])
        if names:
            name = names[-1].lower()
            starts.append(polygon)
            groups.append(0 if name in (b"off", b"0") else numbers.setdefault(name, len(numbers) + 1))
    of_polygon = np.repeat(groups, np.diff([*starts, len(source.offsets) - 1]))
    if len(starts) == 1 or (of_polygon[0] > 0 and np.all(of_polygon == of_polygon[0])):
        return None
    return of_polygon


def _smoothed(result: Flattening, source: MeshFile, groups: IntArray) -> tuple[FloatArray, IntArray]:
    """Return normals, and (m, 3) their index at each corner: means over a vertex's group, or the polygon's normal."""
    assert result.face_corners is not None
    polygon = polygon_of(result.face_corners, source.offsets)
    group = groups[polygon][:, None]
    count = len(result.vertices)
    keys = np.where(group > 0, group * count + result.faces, -1 - polygon[:, None])
    _, corners = np.unique(keys, return_inverse=True)
    corners = corners.reshape(keys.shape)
    areas = face_normals(result.vertices, result.faces)[:, None]
    return sums_at(corners, areas, int(corners.max()) + 1), corners


def shading_normals(vectors: FloatArray) -> FloatArray:
    """Return (k, 3) unit vectors; zero vectors become (0, 0, 1), as files need a direction."""
    units = unit_vectors(vectors)
    return np.where(units.any(axis=1, keepdims=True), units, [0.0, 0.0, 1.0])
