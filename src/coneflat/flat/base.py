"""What every method gives to the pipeline."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray, rows_of
from ..compiled import compiled
from ..cones import ConeSolution
from ..errors import ConvergenceError, MetricError
from ..geometry import double_areas, edge_lengths
from ..geometry.operators import area_distortion
from ..geometry.planar import signed_double_areas
from ..input.symmetry import SymmetryUse
from ..mesh import TriangleMesh
from ..quality.statistics import SolveStatistics
from ..text import plural

# Height over longest side below which a triangle counts as flat, neither upright nor upside down: coordinates are
# good to about 1e-12 of an edge.
FLAT = 1e-10


@dataclass(frozen=True, eq=False)
class Cuts:
    """Where edges of a mesh were cut.

    Attributes:
        ends: (x, 2) the vertices of the mesh between which each new one lies.
        weights: (x, 2) its barycentric coordinates there.
        edge_origin: (e,) the edge of the mesh that each edge of the result lies on, -1 for those inside of faces.
    """

    ends: IntArray
    weights: FloatArray
    edge_origin: IntArray


@dataclass(frozen=True, eq=False)
class LaidOut:
    """A connected mesh with its layout.

    Attributes:
        mesh: the mesh that was laid out: the one that was given, or its refinement, whose vertices are those of
            the given one followed by new ones.
        face_origin: (m,) the given face of each of its faces.
        points: (c, 2) points of the plane, model units.
        corners: (m, 3) index into `points` of every triangle corner.
        chart: (m,) the chart of each triangle, from 0; charts have no points in common and may lie over each other.
            None for one chart.
        cuts: where edges were cut, if the mesh is a refinement.
        cones: (s,) vertices.
        seams: (k, 2) vertex pairs.
        log_scale: (n,) phi; flat lengths are about l * exp(phi).
        target, curvature: (n,) curvature wanted and reached, radians.
        statistics: how it was found.
        notes: what falls short, one sentence each.
        symmetry: the symmetry that was found, and what it was used for; None if there is none.
        lies_on: (c,) the point that each is to lie on, itself for most: both sides of a model in one place; or None.
        disk: the mesh cut open, whose faces are the corners, with a vertex for each point; None if there is none.
    """

    mesh: TriangleMesh
    face_origin: IntArray
    points: FloatArray
    corners: IntArray
    cones: IntArray
    seams: IntArray
    log_scale: FloatArray
    target: FloatArray
    curvature: FloatArray
    statistics: SolveStatistics
    chart: IntArray | None = None
    cuts: Cuts | None = None
    notes: tuple[str, ...] = ()
    symmetry: SymmetryUse | None = None
    lies_on: IntArray | None = None
    disk: TriangleMesh | None = None

    @property
    def area(self) -> float:
        """The area of the mesh in space."""
        return float(double_areas(edge_lengths(self.mesh.vertices, self.mesh.faces)).sum() / 2)

    def with_area_distortion(self, linear: FloatArray, areas: FloatArray) -> LaidOut:
        """Return it with the area distortion of its metric, and of the linear model that its cones were chosen in.

        Args:
            linear: (n,) log scale of that model at the vertices of the mesh that was given.
            areas: (n,) what each of these counts.
        """
        linear_distortion, reached = (
            area_distortion(phi, areas) for phi in (linear, self.log_scale[: len(linear)])
        )
        statistics = replace(
            self.statistics, area_distortion_linear=linear_distortion, area_distortion=reached
        )
        return replace(self, statistics=statistics)


class FlatMetric(Protocol):
    """A flat metric on a connected mesh."""

    def lay_out(self, disk: TriangleMesh, seams: IntArray) -> LaidOut:
        """Lay the mesh out.

        Args:
            disk: the mesh, cut open.
            seams: (k,) the edges along which it was cut.
        """
        ...


def laid_out_curvature(mesh: TriangleMesh, corners: FloatArray, at: BoolArray | None = None) -> FloatArray:
    """Return (n,) the curvature of triangles with given corners (m, 3, 2): a full or half turn less their angles.

    Those of triangles that are upside down count as negative. Where triangles wind around a vertex twice, the
    curvature is a full turn less than it seems.

    at: (n,) the vertices of interest, as it takes less time at few; None for all.
    """
    sums = np.zeros(len(mesh.vertices))
    at = np.ones(len(sums), dtype=bool) if at is None else at
    sum_signed_angles(mesh.faces, np.ascontiguousarray(corners), at, FLAT, sums)
    curvature: FloatArray = np.where(mesh.is_boundary_vertex, np.pi, 2 * np.pi) - sums
    return curvature


@compiled
def sum_signed_angles(
    faces: IntArray, corners: FloatArray, at: BoolArray, flat: float, sums: FloatArray
) -> None:
    """Add the angles of triangles to the sums at their vertices, where these are of interest.

    Args:
        faces, corners: (m, 3) vertices and (m, 3, 2) places.
        at: (n,) vertices of interest.
        flat: height over longest side below which a triangle is neither upright nor upside down: its angles count.
        sums: (n,) added to; angles of triangles upside down are negative.
    """
    sides = np.empty((3, 2))
    for f in range(len(faces)):
        if not (at[faces[f, 0]] or at[faces[f, 1]] or at[faces[f, 2]]):
            continue
        longest = 0.0
        for i in range(3):
            for x in range(2):
                sides[i, x] = corners[f, (i + 2) % 3, x] - corners[f, (i + 1) % 3, x]
            longest = max(longest, sides[i, 0] ** 2 + sides[i, 1] ** 2)
        doubled = sides[0, 0] * sides[1, 1] - sides[0, 1] * sides[1, 0]
        is_flat = abs(doubled) < flat * longest or longest == 0.0
        for i in range(3):
            if at[faces[f, i]]:
                one, two = sides[(i + 1) % 3], sides[(i + 2) % 3]
                angle = math.atan2(one[0] * two[1] - one[1] * two[0], -(one[0] * two[0] + one[1] * two[1]))
                sums[faces[f, i]] += abs(angle) if is_flat else angle


def all_faces(mesh: TriangleMesh) -> IntArray:
    """Return (m,) the numbers of a mesh's faces, which are their own origin."""
    return np.arange(len(mesh.faces))


def off_by(residual: float, unit: str = " rad") -> str:
    """Return the part of a message that says by how much something is missed."""
    if not np.isfinite(residual):
        return "off by more than double precision can hold"
    return f"off by {residual:.2g}{unit}"


def failure_notes(
    failure: str | None, accepted: bool, instead: str = "--method exact is surer"
) -> tuple[str, ...]:
    """Return how a solve fell short as notes, if it is accepted all the same.

    Args:
        failure: a clause, or None if it did not fall short.
        accepted: the best effort will do.
        instead: what else to try.

    Raises:
        ConvergenceError: it will not.
    """
    if failure is None:
        return ()
    if not accepted:
        raise ConvergenceError(
            f"{failure}; --best-effort takes it as it is, {instead}, other cones, --repair or remeshing may help"
        )
    return (f"{failure[0].upper()}{failure[1:]}.",)


# Areas below so much of the mean are taken as so much, where a logarithm is wanted.
TINY = 1e-12


def laid_out_at(
    points: FloatArray,
    mesh: TriangleMesh,
    disk: TriangleMesh,
    seams: IntArray,
    lengths: FloatArray,
    solution: ConeSolution,
    statistics: SolveStatistics | None = None,
    notes: tuple[str, ...] = (),
) -> LaidOut:
    """Return a layout of a mesh's own triangles, at the mesh's area, with the scale and curvature that it has.

    Args:
        points: (c, 2) of the disk's vertices, at any scale, not upside down.
        mesh: connected.
        disk: the mesh cut open.
        seams: (k,) the edges along which it was cut.
        lengths: (m, 3) side lengths, with which every triangle has area.
        solution: the cones and what was asked of them.
        statistics, notes: how it was found, and what falls short.

    Raises:
        MetricError: the layout has no area.
    """
    corners = rows_of(points, disk.faces)
    doubles = np.abs(signed_double_areas(corners))
    if not doubles.sum() > 0:
        raise MetricError(
            f"all {plural(len(corners), 'triangle')} of the layout lie on a line: use method 'exact'"
        )
    before = double_areas(lengths)
    factor = float(np.sqrt(before.sum() / doubles.sum()))
    curvature = laid_out_curvature(mesh, corners)
    return LaidOut(
        mesh=mesh,
        face_origin=all_faces(mesh),
        points=points * factor,
        corners=disk.faces,
        cones=solution.cones,
        seams=mesh.edges[seams],
        log_scale=vertex_log_scale(mesh, before, doubles * factor**2),
        # The boundary is free: what comes out there is what was wanted.
        target=np.where(mesh.is_boundary_vertex, curvature, solution.target),
        curvature=curvature,
        statistics=SolveStatistics() if statistics is None else statistics,
        notes=notes,
    )


def vertex_log_scale(mesh: TriangleMesh, before: FloatArray, after: FloatArray) -> FloatArray:
    """Return (n,) half the log of the ratio of areas around each vertex, after to before, (m,) each."""
    ratio = []
    for areas in (before, after):
        around = np.bincount(mesh.faces.ravel(), np.repeat(areas, 3), minlength=len(mesh.vertices))
        ratio.append(np.maximum(around, TINY * around.mean()))
    log_scale: FloatArray = np.log(ratio[1] / ratio[0]) / 2
    return log_scale
