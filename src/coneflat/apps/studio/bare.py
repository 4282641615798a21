"""Meshes that cannot be flattened, or only after a repair: what is wrong with them, and what is drawn."""

from __future__ import annotations

from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import numpy as np

from ... import Flattening, check_mesh
from ...errors import MeshError
from ...io import Joined, as_input
from ...mesh import REPAIR_ADVICE, CheckedMesh


@lru_cache(maxsize=1)
def repaired(source: Joined) -> tuple[CheckedMesh, str]:
    """Return the repaired mesh of a source, and what was wrong with it, or "".

    Triangles with coordinates that are not finite are left out.

    Raises:
        MeshError: no triangle is left, or the arrays are not a mesh.
    """
    given = as_input(source.mesh)
    vertices, faces = np.asarray(given.vertices), np.asarray(given.faces)
    try:
        return check_mesh(vertices, faces), ""
    except MeshError as error:
        wrong = str(error).partition(f"; {REPAIR_ADVICE}")[0]
    is_finite = np.isfinite(vertices).all(axis=1)
    vertices, faces = np.where(is_finite[:, None], vertices, 0.0), faces[is_finite[faces].all(axis=1)]
    return check_mesh(vertices, faces, repair=True), wrong


def bad_places(checked: CheckedMesh) -> list[list[int]]:
    """Return where a repair has separated a mesh: edges as pairs of input vertices, and further vertices alone."""
    mesh, origin = checked.mesh, checked.vertex_origin
    pairs, counts = np.unique(np.sort(origin[mesh.edges], axis=1), axis=0, return_counts=True)
    edges = pairs[counts > 1]
    split = np.setdiff1d(np.flatnonzero(np.bincount(origin) > 1), edges)
    # The page stays fast if only some of very many places are marked.
    return [*edges.tolist(), *split[:, None].tolist()][:2000]


def without_layout(checked: CheckedMesh) -> Flattening:
    """Return a mesh in the form of a flattening without cones; its UVs are a projection, which must not be shown."""
    mesh, zeros, none = checked.mesh, np.zeros(len(checked.mesh.vertices)), np.empty(0, dtype=np.int64)
    # In a skew projection the triangles of boxes have areas, too, which a simplification for display needs.
    uv = mesh.vertices @ np.array([[0.92, 0.13], [0.31, 0.84], [0.23, 0.51]])
    each = np.ones(len(mesh.faces))
    unknown: Any = SimpleNamespace(qc=each, log_area_scale=0 * each)
    return Flattening(
        mesh.vertices, mesh.faces, uv, mesh.faces, 1.0, none, zeros[:0], zeros, zeros, zeros, mesh.edges[:0], 0.0,
        unknown, {}, vertex_origin=checked.vertex_origin,
    )  # fmt: skip
