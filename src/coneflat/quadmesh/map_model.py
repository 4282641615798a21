"""The linear model of conformal maps: log conformal factor and rotation of triangles by the curvatures of cones."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix
from scipy.sparse.csgraph import dijkstra

from ..base import BoolArray, ComplexArray, FloatArray, IntArray
from ..cones import CONE_ANGLE_PER_TRIANGLE
from ..geometry import (
    angle_defect,
    complex_sums,
    corner_angles,
    cotangent_laplacian,
    cotangents,
    double_areas,
    edge_lengths,
    handle_loops,
    mollify,
)
from ..linalg import MultiGraph, factorize
from ..mesh import tie_key
from ..mesh.connectivity import TriangleMesh
from .cross_field import edge_rotations, halfedge_angles
from .features import vertex_graph

# Numbers of regions over which the log conformal factor and the directions are summed.
REGIONS, SAMPLES = 500, 250


class MapModel:
    """The linear model of a connected mesh.

    The last column of all matrices, of zeros, is for curvature without a place.
    Rotations are linearised at given cones. There, directions within a region agree best.

    Attributes:
        places: (p,) all vertices, in an order that does not depend on the numbering.
        key: (p,) numbers by which they are sorted.
        curvature: (p,) the angle defects of the surface there, in quarter turns.
        centres: indices of places that are the centres of regions; each is far from the previous ones.
        spacing: mean distance of the centres.
        scales: (r, p + 1) change of the mean log conformal factor of each region by a quarter turn, times the root of
            the region's share of the area.
        turns: (s, p + 1) four times the rotation of samples by a quarter turn.
        loops: (l, p + 1) the same for the rotations along handles.
        min_quarters, max_quarters: (p + 1,) bounds of the curvatures.
        weight: the total weight of preferred directions.
    """

    def __init__(
        self,
        mesh: TriangleMesh,
        preferred: ComplexArray,
        min_quarters: int,
        max_quarters: int,
        triangles: IntArray,
        log_scale: FloatArray | None = None,
        is_seam: BoolArray | None = None,
        is_seam_end: BoolArray | None = None,
    ) -> None:
        """Set up the model.

        Args:
            mesh: connected mesh.
            preferred: (m,) preferred crosses of triangles, weighted.
            min_quarters, max_quarters: bounds of the curvature of cones, in quarter turns.
            triangles: (n,) the number of triangles at each vertex in the mesh that gets the cones.
            log_scale: (n,) the target log conformal factor, up to a constant; None for 0.
            is_seam: (n,) boundary vertices at which the mesh continues as its mirror image, with twice their curvature;
                None for none.
            is_seam_end: (n,) boundary vertices at which the mesh and its image have a common boundary; None for none.
        """
        lengths, _ = mollify(edge_lengths(mesh.vertices, mesh.faces), mesh)
        angles, count = corner_angles(lengths), len(mesh.vertices)
        areas, key = double_areas(lengths), tie_key(mesh.vertices)
        share = np.bincount(mesh.faces.ravel(), areas.repeat(3), count) / (3 * areas.sum())
        centres, region, larger = _regions(mesh, key)
        self._preferred, self.weight = preferred, max(float(np.abs(preferred).sum()), np.finfo(float).tiny)
        self._defect = angle_defect(mesh.faces, angles, mesh.is_boundary_vertex)
        self._poisson = _Poisson(cotangent_laplacian(mesh.faces, cotangents(lengths), count), share)
        self._target_scale = 0.0 if log_scale is None else log_scale - share @ log_scale
        self._rotations = _Rotations(mesh, angles)
        self._means = _region_means(region, share)
        # A triangle belongs to the first region of its corners. The sample is its triangle of largest weight.
        of_face = larger[mesh.faces].min(axis=1)
        rank = -np.round(np.abs(preferred) / self.weight, 9)
        order = np.lexsort((key[mesh.faces].sum(axis=1), rank, of_face))
        samples = order[np.concatenate([[True], np.diff(of_face[order]) > 0])]
        self._number = np.searchsorted(of_face[samples], of_face)
        self.places = np.argsort(key, kind="stable")
        self.key, self.curvature = key[self.places], self._defect[self.places] / (np.pi / 2)
        self.centres = np.argsort(self.places)[centres]
        self.spacing = float(np.sqrt(areas.sum() / 2 / len(centres)))
        to_samples = self._rotations.to_frames(samples) + self._rotations.mean_change[samples]
        self.scales = self._functional(self._means)
        self.turns = 4 * self._functional(to_samples)
        self.loops = 4 * self._functional(self._rotations.loops)
        triangles = triangles[self.places]
        border = mesh.is_boundary_vertex[self.places]
        straight = np.where(border, 2, 4)
        widest = np.floor(CONE_ANGLE_PER_TRIANGLE * triangles / (np.pi / 2)).astype(np.int64)
        low = np.minimum(np.maximum(np.where(border, -1, min_quarters), straight - widest), 0)
        high = np.where(border, 1, np.where(triangles > 2, max_quarters, 0))
        if is_seam is not None:
            # Where a corner of one quad meets its image, a vertex would have two.
            low = np.where(is_seam[self.places], np.maximum(low, -(-min_quarters // 2)), low)
            high = np.where(is_seam[self.places], 0, high)
        if is_seam_end is not None:
            # Corners of one quad and its image form a straight boundary. With two, the boundary would fold back.
            low, high = (np.where(is_seam_end[self.places], 1, bounds) for bounds in (low, high))
        self.min_quarters, self.max_quarters = np.append(low, -(10**9)), np.append(high, 10**9)

    def _functional(self, rows: csr_matrix) -> FloatArray:
        return np.pad(self._poisson.functional(rows, self.places), ((0, 0), (0, 1)))

    def linearise(self, indices: IntArray) -> None:
        """Linearise the rotations at the cones with given curvatures (p + 1,), in quarter turns."""
        curvature = -self._defect
        curvature[self.places] += np.pi / 2 * indices[:-1]
        self._log_scale = self._poisson.solve(curvature[:, None])[:, 0]
        turned = self._rotations.of_frames(self._log_scale) + self._rotations.mean_change @ self._log_scale
        crosses = self._preferred * np.exp(4j * turned)
        self._at, self._base = indices.copy(), complex_sums(self._number, crosses, len(self.turns))
        self._excess = self._log_scale - self._target_scale
        self._base_scale = self._means @ self._excess
        self._base_loops = np.exp(4j * self._rotations.around_loops(self._log_scale))

    @property
    def spread(self) -> float:
        """The log of the ratio of the 95% and 5% quantiles of the areas of quads, for the cones of `linearise`.

        Areas are relative to the target ones.
        """
        order = np.argsort(self._excess)
        scale = self._log_scale[order] - self._log_scale.max()
        number = np.cumsum(self._poisson.share[order] * np.exp(2 * scale))
        low, high = np.interp([0.05, 0.95], number / number[-1], self._excess[order])
        return float(2 * (high - low))

    def state(self, indices: IntArray) -> tuple[FloatArray, ComplexArray, ComplexArray]:
        """Return the errors of log conformal factors of regions (r,), of crosses of samples (s,), of loops (l,)."""
        step = indices - self._at
        changed = np.flatnonzero(step)
        turned, looped = (matrix[:, changed] @ step[changed] for matrix in (self.turns, self.loops))
        scale = self._base_scale + self.scales[:, changed] @ step[changed]
        return scale, self._base * np.exp(1j * turned), self._base_loops * np.exp(1j * looped)


def _regions(mesh: TriangleMesh, key: FloatArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return the centres of regions, each as far as possible from the previous ones, and regions of the vertices.

    The regions (n,) are those of all centres, and those of the first SAMPLES centres alone.
    """
    graph, count = vertex_graph(mesh), min(REGIONS, len(key))
    scale = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    distance, region, centres = np.full(len(key), np.inf), np.zeros(len(key), dtype=np.int64), list[int]()
    larger = region
    for number in range(count):
        # The choice among vertices at equal distances does not depend on the numbering.
        farthest = np.flatnonzero(distance >= distance.max() - 1e-9 * scale)
        centre = int(farthest[np.argmax(key[farthest])])
        limit = np.inf if number == 0 else float(distance[centre])
        distance_from_centre = dijkstra(graph, indices=centre, limit=limit)
        is_nearer = distance_from_centre < distance - 1e-9 * scale
        distance[is_nearer], region[is_nearer] = distance_from_centre[is_nearer], number
        centres.append(centre)
        larger = region.copy() if number < SAMPLES else larger
    return np.array(centres), region, larger


def _region_means(region: IntArray, share: FloatArray) -> csr_matrix:
    """Return (r, n) the matrix to the mean of each region, times the root of its share of the area."""
    count, total = int(region.max()) + 1, np.bincount(region, share)
    root = np.sqrt(np.maximum(total, np.finfo(float).tiny))
    return csr_matrix((share / root[region], (region, np.arange(len(region)))), shape=(count, len(region)))


class _Poisson:
    """Solves L x = y on a connected mesh for y without its mean; x has mean 0 by area."""

    def __init__(self, laplacian: csc_matrix, share: FloatArray) -> None:
        self.share, self.factor = share, factorize(csc_matrix(laplacian[1:, 1:]).sorted_indices())

    def solve(self, right: FloatArray) -> FloatArray:
        """Return (n, k) the solutions for right-hand sides (n, k)."""
        right = right - self.share[:, None] * right.sum(axis=0)
        solution = np.zeros_like(right)
        solution[1:] = self.factor.solve(np.ascontiguousarray(right[1:]))
        return solution - self.share @ solution

    def functional(self, rows: csr_matrix, places: IntArray) -> FloatArray:
        """Return (k, p) linear functionals (k, n) of the log conformal factor for a quarter turn at each place."""
        values = np.empty((rows.shape[0], len(places)))
        for start in range(0, rows.shape[0], 64):  # not all at once, which would take much memory
            block = slice(start, start + 64)
            values[block] = np.pi / 2 * self.solve(rows[block].toarray().T)[places].T
        return values


class _Rotations:
    """Rotations of the first half-edges of triangles in the plane, and along loops, by a tree in the dual graph."""

    def __init__(self, mesh: TriangleMesh, angles: FloatArray) -> None:
        self.inner = np.flatnonzero(~mesh.is_boundary_edge)
        first, second = mesh.edge_halfedges[self.inner].T
        self.by_edge = edge_rotations(mesh, halfedge_angles(angles))
        # The linear model of the angles: see `_angle_changes`.
        change = _angle_changes(mesh, angles)
        self.change = csr_matrix(change[first] - change[second])
        # A triangle rotates as its three half-edges do on average.
        self.mean_change = csr_matrix((change[0::3] + change[1::3] + change[2::3]) / 3)
        centres = mesh.vertices[mesh.faces].mean(axis=1)
        steps = np.linalg.norm(centres[first // 3] - centres[second // 3], axis=1)
        root = int(np.argmax(tie_key(centres)))
        dual = MultiGraph(
            len(mesh.faces), np.stack([first, second], axis=1) // 3, steps + 1e-9 * steps.max(initial=1.0)
        )
        paths = dual.shortest_paths(np.array([root]))
        self.root, self.before, self.edge = root, np.where(paths.before < 0, root, paths.before), paths.edge
        self.sign = np.where(self.edge < 0, 0.0, np.where(first[self.edge] // 3 == self.before, 1.0, -1.0))
        # Which inner edges each loop along a handle crosses, and in which direction.
        loops = [np.empty(0, np.int64), *handle_loops(mesh)]
        crossed, of_loop = np.concatenate(loops), np.arange(-1, len(loops) - 1).repeat([*map(len, loops)])
        edges = np.searchsorted(self.inner, mesh.halfedge_edges[crossed])
        signs = np.where(first[edges] == crossed, 1.0, -1.0)
        self._around = csr_matrix((signs, (of_loop, edges)), shape=(len(loops) - 1, len(first)))
        # The matrix (l, n) from the log conformal factor to the rotations of loops.
        self.loops = csr_matrix(self._around @ self.change)

    def of_frames(self, log_scale: FloatArray) -> FloatArray:
        """Return (m,) the rotations of first half-edges in the plane for a log conformal factor (n,)."""
        steps = np.pi - self.by_edge + self.change @ log_scale
        total, before = np.where(self.edge < 0, 0.0, self.sign * steps[self.edge]), self.before
        while (before != self.root).any():
            total = total + np.where(before == self.root, 0.0, total[before])
            before = before[before]
        return total

    def to_frames(self, faces: IntArray) -> csr_matrix:
        """Return (k, n) the matrix from the log conformal factor to rotations of the first half-edges of triangles."""
        row, face, path = np.arange(len(faces)), faces, list[tuple[IntArray, IntArray]]()
        while len(face):
            is_below_root = face != self.root
            row, face = row[is_below_root], face[is_below_root]
            path.append((row, face))
            face = self.before[face]
        rows, on = (np.concatenate(columns) for columns in zip(*path, strict=True))
        parts = self.sign[on], (rows, self.edge[on])
        return csr_matrix(csr_matrix(parts, shape=(len(faces), len(self.inner))) @ self.change)

    def around_loops(self, log_scale: FloatArray) -> FloatArray:
        """Return (l,) the rotations around loops for a log conformal factor (n,), up to half turns."""
        return np.asarray(self._around @ (np.pi - self.by_edge + self.change @ log_scale))


def _angle_changes(mesh: TriangleMesh, angles: FloatArray) -> csr_matrix:
    """Return (3m, n) the matrix from the log conformal factor to the directions of half-edges in their triangles.

    A corner i changes by (cot k (u_j - u_i) + cot j (u_k - u_i)) / 2.
    """
    half, faces, count = 0.5 / np.tan(angles), mesh.faces, len(mesh.faces)
    rows, columns, values = [], [], []
    # The second half-edge has the direction pi - corner 2, the third pi + corner 1.
    for halfedge, corner, sign in ((1, 2, -1.0), (2, 1, 1.0)):
        j, k = (corner + 1) % 3, (corner + 2) % 3
        row = 3 * np.arange(count) + halfedge
        rows += [row, row, row]
        columns += [faces[:, j], faces[:, k], faces[:, corner]]
        values += [sign * half[:, k], sign * half[:, j], -sign * (half[:, j] + half[:, k])]
    parts = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return csr_matrix(coo_matrix(parts, shape=(3 * count, len(mesh.vertices))))
