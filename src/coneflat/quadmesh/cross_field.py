"""Directions that grid lines should have on a surface, and the smoothest cross field that follows them.

A cross, four directions at right angles, is represented by the fourth power z of a unit complex number. It is given in
the frame of a triangle, whose x-axis is its first side, that from corner 1 to corner 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix, diags

from ..base import ComplexArray, FloatArray, IntArray
from ..geometry import (
    angle_defect,
    complex_sums,
    corner_angles,
    cotangent_laplacian,
    cotangents,
    dihedral_angles,
    double_areas,
    edge_lengths,
    face_normals,
    mollify,
)
from ..linalg import HermitianFactor, factorize
from ..mesh import label_components
from ..mesh.connectivity import TriangleMesh
from .features import edge_indices, lengths_along, sharp_edges

# Edges are sharp if their dihedral angle is larger, radians, and if the connected ones are together longer than this
# fraction of the square root of the area. Shorter ones are noise.
SHARP_ANGLE, SHARP_LENGTH = np.deg2rad(35.0), 0.1
# Curvature is averaged over this fraction of the square root of the area.
CURVATURE_SCALE = 0.02
# Curvatures count up to this multiple of the inverse square root of the area: larger ones belong to sharp edges.
MAX_CURVATURE = 16.0
# How much more than its neighbours a sharp edge determines the cross of a triangle.
SHARP_WEIGHT = 100.0
# Total weight of preferred directions along sharp edges and the boundary, relative to that of curvature, if their
# length is at least half the square root of the area.
SHARP_SHARE = 3.0
# Surfaces are mechanical if their sharp edges are long, relative to the square root of the area, and the mean of their
# squared dihedral angles, at most right angles, is large, relative to that of right angles. These are 3 to 15 and 0.8
# to 1 on parts of machines, at most 1.2 and 0.95 on animals, hands and heads, 5 and 0.4 on a dressed person, and 13
# and 0.54 on an aeroplane.
MECHANICAL_LENGTH, MECHANICAL_SHARPNESS = 2.0, 0.65


@dataclass(frozen=True, eq=False)
class Directions:
    """Preferred crosses of the triangles of a mesh, with weights as absolute values.

    Attributes:
        sharp: (m,) along sharp edges and the boundary, weighted by length over the square root of the area.
        curved: (m,) along principal curvatures, weighted by the area times the squared difference of the curvatures.
    """

    sharp: ComplexArray
    curved: ComplexArray

    @property
    def combined(self) -> ComplexArray:
        """(m,) the sum of both, in which sharp edges have a share that does not depend on the curvature."""
        sharp, curved = (float(np.abs(crosses).sum()) for crosses in (self.sharp, self.curved))
        return self.curved + SHARP_SHARE * max(curved, 1.0) / max(sharp, 1.0) * self.sharp


def halfedge_angles(angles: FloatArray) -> FloatArray:
    """Return (3m,) the direction of each half-edge in the frame of its triangle, for corner angles (m, 3)."""
    zero = np.zeros(len(angles))
    return np.stack([zero, np.pi - angles[:, 2], np.pi + angles[:, 1]], axis=1).ravel()


def preferred_directions(mesh: TriangleMesh, angle: float = SHARP_ANGLE) -> Directions:
    """Return the preferred crosses of a mesh, at edges sharper than an angle and along curvature."""
    lengths, _ = mollify(edge_lengths(mesh.vertices, mesh.faces), mesh)
    areas = double_areas(lengths) / 2
    areas = np.maximum(areas, 1e-12 * areas.sum())  # Weights of edges are inverse to areas.
    scale = float(np.sqrt(areas.sum()))
    sides = mesh.edge_halfedges[sharp_or_boundary(mesh, SHARP_LENGTH * scale, angle)].ravel()
    sides = sides[sides >= 0]
    crosses = lengths.ravel()[sides] * np.exp(4j * halfedge_angles(corner_angles(lengths))[sides])
    sharp = complex_sums(sides // 3, crosses / scale, len(mesh.faces))
    tensors = curvature_tensors(mesh, areas, CURVATURE_SCALE * scale)
    # The direction of a tensor is that of an angle up to half turns.
    double = (tensors[:, 0, 0] - tensors[:, 1, 1]) + 2j * tensors[:, 0, 1]
    trace, size = tensors[:, 0, 0] + tensors[:, 1, 1], np.abs(double)
    # The curvatures are (trace +- size) / 2; those of a saddle of equal absolute values determine no direction of
    # least bending.
    difference = np.minimum(np.abs(np.abs(trace + size) - np.abs(trace - size)) / 2, MAX_CURVATURE / scale)
    curved = areas * difference**2 * (double / np.maximum(size, np.finfo(float).tiny)) ** 2
    return Directions(sharp, np.asarray(curved, dtype=np.complex128))


def sharp_or_boundary(mesh: TriangleMesh, shortest: float, angle: float = SHARP_ANGLE) -> IntArray:
    """Return the edges that are on the boundary or sharp and not noise.

    Connected sharp edges are noise if they are together shorter than `shortest`, or if they change between convex and
    concave at more than an eighth of the vertices with two of them: at most 2% on mechanical shapes, and 15% to 50%
    where noise of 0.15 to 0.3 edges makes edges sharp.
    """
    sharp, count = sharp_edges(mesh, angle), len(mesh.vertices)
    ends, is_convex = mesh.edges[sharp], dihedral_angles(mesh)[sharp] > 0
    _, label = label_components(count, ends[:, 0], ends[:, 1])
    length = np.bincount(label[ends[:, 0]], lengths_along(mesh, sharp), count)
    convex, concave = (np.bincount(ends[which].ravel(), minlength=count) for which in (is_convex, ~is_convex))
    inner = np.flatnonzero(convex + concave == 2)
    changes, every = (np.bincount(label[at], minlength=count) for at in (inner[convex[inner] == 1], inner))
    is_noise = (length <= shortest) | (8 * changes > every)
    return np.union1d(sharp[~is_noise[label[ends[:, 0]]]], np.flatnonzero(mesh.is_boundary_edge))


def sharp_ends(mesh: TriangleMesh, angle: float = SHARP_ANGLE) -> IntArray:
    """Return (k, 2) the vertices of the edges of a mesh sharper than an angle, without the boundary."""
    scale = float(np.sqrt(double_areas(edge_lengths(mesh.vertices, mesh.faces)).sum() / 2))
    edges = sharp_or_boundary(mesh, SHARP_LENGTH * scale, angle)
    return mesh.edges[edges[~mesh.is_boundary_edge[edges]]]


def is_mechanical(mesh: TriangleMesh, angle: float = SHARP_ANGLE) -> bool:
    """Return whether a connected surface has so many sharp edges that quads should follow them above all."""
    scale = float(np.sqrt(double_areas(edge_lengths(mesh.vertices, mesh.faces)).sum() / 2))
    edges = edge_indices(mesh, sharp_ends(mesh, angle))
    lengths = lengths_along(mesh, edges)
    total = float(lengths.sum())
    sharpness = np.minimum(np.abs(dihedral_angles(mesh)[edges]) / (np.pi / 2), 1.0) ** 2
    return total > MECHANICAL_LENGTH * scale and float(sharpness @ lengths) > MECHANICAL_SHARPNESS * total


def curvature_tensors(mesh: TriangleMesh, areas: FloatArray, radius: float) -> FloatArray:
    """Return (m, 2, 2) the curvature tensors of triangles in their frames, averaged over a radius.

    References:
        D. Cohen-Steiner, J.-M. Morvan, "Restricted Delaunay triangulations and normal cycle", 2003.
    """
    along = np.diff(mesh.vertices[mesh.edges], axis=1)[:, 0]
    lengths = np.linalg.norm(along, axis=1)
    weights = dihedral_angles(mesh) / np.maximum(lengths, np.finfo(float).tiny) / 2
    products = (weights[:, None, None] * along[:, :, None] * along[:, None, :]).reshape(-1, 9)
    first, second = mesh.edge_faces[~mesh.is_boundary_edge].T
    inner = products[~mesh.is_boundary_edge]
    faces_of_edges = np.concatenate([first, second])
    sums = [np.bincount(faces_of_edges, np.tile(column, 2), len(mesh.faces)) for column in inner.T]
    stiffness = _dual_laplacian(mesh, areas, np.zeros(len(first)))
    system = csc_matrix(diags(areas) + radius**2 * stiffness.real)
    right = np.ascontiguousarray(np.stack(sums, axis=1), dtype=np.float64)
    mean = factorize(system.sorted_indices()).solve(right).reshape(-1, 3, 3)
    x = mesh.vertices[mesh.faces[:, 2]] - mesh.vertices[mesh.faces[:, 1]]
    normal = face_normals(mesh.vertices, mesh.faces)
    axes = np.stack([x, np.cross(normal, x)], axis=1)
    axes /= np.maximum(np.linalg.norm(axes, axis=2, keepdims=True), np.finfo(float).tiny)
    return np.asarray(np.einsum("fai,fij,fbj->fab", axes, mean, axes))


def _dual_laplacian(mesh: TriangleMesh, areas: FloatArray, rotations: FloatArray) -> csr_matrix:
    """Return (m, m) the matrix of the energy sum w |z_g - e^(4 i r) z_f|^2 over the inner edges between f and g."""
    first, second = mesh.edge_faces[~mesh.is_boundary_edge].T
    weights = (
        3 * lengths_along(mesh, np.flatnonzero(~mesh.is_boundary_edge)) ** 2 / (areas[first] + areas[second])
    )
    across = -weights * np.exp(4j * rotations)
    rows, columns = (
        np.concatenate([first, second, first, second]),
        np.concatenate([first, second, second, first]),
    )
    values = np.concatenate([weights, weights, across.conj(), across])
    return coo_matrix((values, (rows, columns)), shape=(len(areas), len(areas))).tocsr()


def smoothest_cross_field(mesh: TriangleMesh, directions: Directions) -> ComplexArray:
    """Return (m,) the crosses of the smoothest field that follows preferred directions.

    References:
        F. Knoeppel, K. Crane, U. Pinkall, P. Schroeder, "Globally optimal direction fields", 2013.
    """
    lengths, _ = mollify(edge_lengths(mesh.vertices, mesh.faces), mesh)
    areas = double_areas(lengths) / 2
    energy = _dual_laplacian(mesh, areas, edge_rotations(mesh, halfedge_angles(corner_angles(lengths))))
    sharp = SHARP_WEIGHT * directions.sharp * np.sqrt(areas.sum() / areas)
    preferred = sharp + directions.curved
    weights = np.abs(sharp) + np.abs(directions.curved) + 1e-6 * areas / areas.sum()
    field = HermitianFactor(csr_matrix(energy + diags(weights))).solve(preferred)
    return field / np.maximum(np.abs(field), np.finfo(float).tiny)


def edge_rotations(mesh: TriangleMesh, angles: FloatArray) -> FloatArray:
    """Return the angle by which a direction in the frame of the first face of each inner edge differs in the second.

    Angles are modulo half turns; `angles` (3m,) are the directions of half-edges.
    """
    first, second = mesh.edge_halfedges[~mesh.is_boundary_edge].T
    return angles[second] - angles[first]


def field_indices(mesh: TriangleMesh, field: ComplexArray) -> IntArray:
    """Return (n,) the curvature of the cone that a cross field (m,) has at each vertex, in quarter turns.

    At boundary vertices these are corners of a boundary that follows the field.
    """
    angles = corner_angles(edge_lengths(mesh.vertices, mesh.faces))
    sides = halfedge_angles(angles)
    defect = angle_defect(mesh.faces, angles, mesh.is_boundary_vertex)
    inner = ~mesh.is_boundary_edge
    first, second = mesh.edge_faces[inner].T
    rotation = np.angle(field[second] * np.exp(-4j * edge_rotations(mesh, sides)) * field[first].conj()) / 4
    halfedge = mesh.edge_halfedges[inner, 0]
    border = mesh.edge_halfedges[~inner, 0]
    # From the direction of a boundary edge to the nearest of the cross.
    off = np.angle(field[border // 3] * np.exp(-4j * sides[border])) / 4
    count = len(mesh.vertices)
    turn = np.bincount(mesh.heads[halfedge], rotation, count) - np.bincount(
        mesh.tails[halfedge], rotation, count
    )
    turn += np.bincount(mesh.tails[border], off, count) - np.bincount(mesh.heads[border], off, count)
    return np.rint((defect + turn) / (np.pi / 2)).astype(np.int64)


def directions_and_indices(mesh: TriangleMesh, angle: float) -> tuple[Directions, IntArray]:
    """Return preferred directions, and (n,) the curvatures of the cones of the smoothest field along them.

    Sharp edges are those of the mesh; curvatures and the field are those of a smoothed mesh: on a noisy surface, there
    are thousands of cones otherwise. See `preferred_directions` and `field_indices`.
    """
    smooth = _smoothed(mesh)
    before, after = (
        halfedge_angles(
            corner_angles(mollify(edge_lengths(surface.vertices, surface.faces), surface)[0])
        ).reshape(-1, 3)
        for surface in (smooth, mesh)
    )
    # From the frame of a smoothed triangle to that of the triangle, so that sides agree in the mean.
    turn = np.exp(4j * (after - before).mean(axis=1))
    sharp, curved = preferred_directions(mesh, angle).sharp, preferred_directions(smooth, angle).curved
    field = smoothest_cross_field(smooth, Directions(sharp / turn, curved))
    return Directions(sharp, curved * turn), field_indices(smooth, field)


def _smoothed(mesh: TriangleMesh) -> TriangleMesh:
    """Return a mesh with its vertices averaged over half the radius of curvatures."""
    averaged = diffused(mesh, mesh.vertices, CURVATURE_SCALE / 2)
    # Digits that depend on the numbering are left out.
    digits = 30 - int(np.frexp(np.abs(averaged).max())[1])
    return mesh.moved_to(np.ldexp(np.rint(np.ldexp(averaged, digits)), -digits))


def diffused(mesh: TriangleMesh, values: FloatArray, radius: float) -> FloatArray:
    """Return values (n, k) at vertices after an implicit step of diffusion; the radius is relative to the root area."""
    lengths, _ = mollify(edge_lengths(mesh.vertices, mesh.faces), mesh)
    areas, count = double_areas(lengths) / 2, len(mesh.vertices)
    share = np.asarray(np.bincount(mesh.faces.ravel(), areas.repeat(3) / 3, count))
    stiffness = cotangent_laplacian(mesh.faces, cotangents(lengths), count)
    system = csc_matrix(diags(share) + radius**2 * areas.sum() * stiffness)
    return factorize(system.sorted_indices()).solve(share[:, None] * values)
