"""The thickness of solids that are sheets with two sides."""

from __future__ import annotations

import numpy as np

from .... import TriangleMesh
from ....base import FloatArray, IntArray, compiled
from ....geometry import face_normals, unit_vectors
from ....mesh import tie_key

# Rays through the solid, one for each equal share of the area, and the step of a sequence that fills an interval.
RAYS, GOLDEN_RATIO = 400, 0.6180339887498949
# Largest thickness of a sheet, relative to the root of the area of one side.
MAX_THICKNESS = 0.15
# Relative deviation from the median up to which distances count as equal, and the fraction of rays that must agree.
# The edges of a sheet, holes and bends account for the others.
TOLERANCE, MIN_SHARE = 0.1, 0.7
# Largest cosine of the angle between the normals at both ends of a ray through a sheet.
MAX_COSINE = -0.95


def thickness_of(mesh: TriangleMesh) -> float | None:
    """Return the thickness of a closed surface whose opposite sides have a nearly constant small distance, or None.

    Args:
        mesh: a connected mesh.

    Notes:
        Rays start at points that are distributed over the surface, against its normals. A sheet is a solid in which
        most of them meet a parallel side at the same distance, which is small against the root of the area of one side.
    """
    if mesh.is_boundary_edge.any():
        return None
    normals = face_normals(mesh.vertices, mesh.faces)
    areas = np.linalg.norm(normals, axis=1) / 2
    directions = unit_vectors(normals)
    starts, origins = _spread(mesh, areas)
    distances, hits = first_hits(mesh.vertices[mesh.faces], starts, origins, -directions[starts])
    is_parallel = (hits >= 0) & ((directions[starts] * directions[hits]).sum(axis=1) < MAX_COSINE)
    if is_parallel.mean() < MIN_SHARE:
        return None
    thickness = float(np.median(distances[is_parallel]))
    agrees = is_parallel & (np.abs(distances - thickness) <= TOLERANCE * thickness)
    is_sheet = agrees.mean() >= MIN_SHARE and thickness <= MAX_THICKNESS * np.sqrt(areas.sum() / 2)
    return float(np.median(distances[agrees])) if is_sheet else None


def _spread(mesh: TriangleMesh, areas: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the triangles (k,) and places (k, 3) of points that are evenly distributed over a mesh."""
    key = np.round(tie_key(mesh.vertices), 9)
    first = key[mesh.faces].argmax(axis=1)
    order = np.argsort(key[mesh.faces].sum(axis=1), kind="stable")
    sums = np.cumsum(areas[order])
    shares = (np.arange(RAYS) + 0.5) / RAYS * sums[-1]
    place = np.minimum(np.searchsorted(sums, shares), len(order) - 1)
    starts = order[place]
    # The part of the triangle's area before the point, and the golden ratio, are two coordinates inside the square.
    part = np.clip((sums[place] - shares) / areas[starts], 0, 1)
    turn = (np.arange(RAYS) * GOLDEN_RATIO) % 1
    weights = np.stack([1 - np.sqrt(part), np.sqrt(part) * (1 - turn), np.sqrt(part) * turn], axis=1)
    corners = mesh.faces[starts[:, None], (first[starts, None] + np.arange(3)) % 3]
    return starts, (weights[:, :, None] * mesh.vertices[corners]).sum(axis=1)


@compiled
def first_hits(
    corners: FloatArray, starts: IntArray, origins: FloatArray, directions: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Return how far rays from a surface go to the next triangle, and this triangle; inf and -1 if there is none.

    Args:
        corners: (m, 3, 3) corners of all triangles.
        starts: (k,) the triangle in which each ray starts.
        origins: (k, 3) where it starts.
        directions: (k, 3) unit vectors.

    References:
        T. Moeller, B. Trumbore, "Fast, minimum storage ray-triangle intersection", 1997.
    """
    distances, hits = np.full(len(starts), np.inf), np.full(len(starts), -1)
    for k in range(len(starts)):
        ray = directions[k]
        ox, oy, oz = origins[k, 0], origins[k, 1], origins[k, 2]
        for t in range(len(corners)):
            a = corners[t, 0]
            ux, uy, uz = corners[t, 1, 0] - a[0], corners[t, 1, 1] - a[1], corners[t, 1, 2] - a[2]
            vx, vy, vz = corners[t, 2, 0] - a[0], corners[t, 2, 1] - a[1], corners[t, 2, 2] - a[2]
            px, py, pz = ray[1] * vz - ray[2] * vy, ray[2] * vx - ray[0] * vz, ray[0] * vy - ray[1] * vx
            determinant = ux * px + uy * py + uz * pz
            if determinant == 0 or t == starts[k]:
                continue
            sx, sy, sz = ox - a[0], oy - a[1], oz - a[2]
            first = (sx * px + sy * py + sz * pz) / determinant
            qx, qy, qz = sy * uz - sz * uy, sz * ux - sx * uz, sx * uy - sy * ux
            second = (ray[0] * qx + ray[1] * qy + ray[2] * qz) / determinant
            distance = (vx * qx + vy * qy + vz * qz) / determinant
            if first >= 0 and second >= 0 and first + second <= 1 and 0 < distance < distances[k]:
                distances[k], hits[k] = distance, t
    return distances, hits
