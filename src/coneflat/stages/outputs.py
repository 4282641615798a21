"""What comes out of the stages: cones, a flat metric, a cut and a layout."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csc_matrix

from ..base.arrays import BoolArray, FloatArray, IntArray, rows_of
from ..geometry import double_areas
from ..geometry.operators import area_distortion
from ..geometry.planar import qc_distortion, signed_double_areas
from ..geometry.straight import FlatTriangles
from ..mesh.connectivity import TriangleMesh

# A log conformal factor that varies by less is constant.
CONSTANT_SCALE = 1e-9


@dataclass(frozen=True, eq=False)
class LaplacianInverse:
    """The inverse of a Laplacian, or an approximation to it; unique up to a constant if no solution is fixed at zero.

    Attributes:
        solve: returns (n,) the solution for a source (n,).
        laplacian: (n, n), with sorted indices; its rows at fixed vertices are not used.
        is_zero: (n,) vertices where solutions are zero.
        break_even: number of solves that take as long as another factorization.
    """

    solve: Callable[[FloatArray], FloatArray]
    laplacian: csc_matrix
    is_zero: BoolArray
    break_even: int


@dataclass(frozen=True, eq=False)
class ConeSolution:
    """Cones of a mesh with n vertices, their curvatures, and the log conformal factor of the linear model.

    Attributes:
        cones: (s,) cone vertices, in the order in which they were chosen.
        target: (n,) target curvature, radians: 0 except at cones and on the boundary.
        log_scale: (n,) phi with L phi = target - curvature; constant on cones and boundary where their curvature was
            not prescribed.
        inverse: the factorized Laplacian that gave phi, if it still exists: solutions are zero on the boundary,
            or have zero mean without one.
        notes: unmet requests, one sentence each.
    """

    cones: IntArray
    target: FloatArray
    log_scale: FloatArray
    inverse: LaplacianInverse | None = None
    notes: tuple[str, ...] = ()

    @property
    def is_polyhedral(self) -> bool:
        """Whether lengths are not scaled: the surface is a polyhedron with the cones as corners."""
        return bool(np.ptp(self.log_scale) < CONSTANT_SCALE)

    @property
    def curvatures(self) -> FloatArray:
        """(s,) target curvature of each cone, radians."""
        return self.target[self.cones]


@dataclass(frozen=True, eq=False)
class Cut:
    """A connected mesh cut open to a disk, which may have holes.

    Attributes:
        mesh: the cut mesh; its faces are those of the original mesh, in the same order.
        seams: (k,) the edges of the original mesh that were cut.
    """

    mesh: TriangleMesh
    seams: IntArray


@dataclass(frozen=True)
class SolveStatistics:
    """Statistics of the solvers of a metric and its layout.

    Attributes:
        newton_steps: steps of Newton's method.
        euclidean_flips: edges flipped to make the input Delaunay.
        ptolemy_flips: edges flipped during the solve.
        residual: largest curvature error of the metric where curvature was prescribed, radians.
        broken: triangles of the metric that break the triangle inequality.
        untangled_triangles: flipped triangles that were untangled, i.e. became positively oriented.
        untangled_vertices: vertices that were moved for this.
        untangled_move: largest displacement of a vertex, relative to the mean length of the edges around it.
        relaxed_vertices: vertices that were free to move in relaxing.
        qc_mean_unrelaxed, qc_max_unrelaxed: mean and largest quasi-conformal distortion before relaxing; NaN if nothing
            was relaxed, and for files with polygons, which programs split into triangles differently.
        area_distortion_linear: E of the linear model in which the cones were chosen: standard deviation of the log
            scale, weighted by area (and by importance, if weights were given).
        area_distortion: E of the metric that was laid out.
    """

    newton_steps: int = 0
    euclidean_flips: int = 0
    ptolemy_flips: int = 0
    residual: float = 0.0
    broken: int = 0
    untangled_triangles: int = 0
    untangled_vertices: int = 0
    untangled_move: float = 0.0
    relaxed_vertices: int = 0
    qc_mean_unrelaxed: float = float("nan")
    qc_max_unrelaxed: float = float("nan")
    area_distortion_linear: float = 0.0
    area_distortion: float = 0.0

    @classmethod
    def of_all(cls, components: Sequence[SolveStatistics], areas: Sequence[float]) -> SolveStatistics:
        """Return the combined statistics of components: sums of counts, maxima, and means weighted by area."""
        values = {}
        for statistic in fields(cls):
            numbers = np.array([getattr(component, statistic.name) for component in components])
            if statistic.name in ("newton_steps", "residual", "untangled_move", "qc_max_unrelaxed"):
                values[statistic.name] = numbers.max().item()
            elif statistic.name == "qc_mean_unrelaxed":
                values[statistic.name] = float(np.average(numbers, weights=areas))
            elif statistic.name.startswith("area_distortion"):
                values[statistic.name] = float(np.sqrt(np.average(numbers**2, weights=areas)))
            else:
                values[statistic.name] = numbers.sum().item()
        return cls(**values)


@dataclass(frozen=True, eq=False)
class Embedding:
    """A cut mesh in the plane, from a method that computes no metric.

    Attributes:
        points: (c, 2) points of the vertices of the cut mesh, at any scale, positively oriented.
        statistics: statistics of the solvers.
        notes: unmet requests, one sentence each.
    """

    points: FloatArray
    statistics: SolveStatistics = field(default_factory=SolveStatistics)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class FlatMetric:
    """A flat metric of a connected mesh with n vertices and m faces, with one of three ways to lay it out.

    Attributes:
        mesh: the mesh.
        lengths: (m, 3) its side lengths before scaling.
        cones: (s,) vertices.
        target: (n,) prescribed curvature, or the resulting curvature where the scale was prescribed; radians.
        log_scale: (n,) phi; flat lengths are about l * exp(phi).
        is_open: (n,) vertices whose curvature is not prescribed.
        is_fixed: (n,) boundary vertices that a layout must not move from where the metric puts them.
        statistics: statistics of the solvers.
        notes: unmet requests, one sentence each.
        scale: factor of the triangles' size, contained in phi.
        triangles: flat triangles with matching edge lengths, to be unfolded; or None.
        flat_lengths: (m, 3) lengths that are nearly flat, for a least squares layout; or None.
        embed: maps the cut mesh to the plane; or None.
        has_target_cones: the cones have their target curvature; if not, the sides of seams are a free boundary.
    """

    mesh: TriangleMesh
    lengths: FloatArray
    cones: IntArray
    target: FloatArray
    log_scale: FloatArray
    is_open: BoolArray
    is_fixed: BoolArray
    statistics: SolveStatistics = field(default_factory=SolveStatistics)
    notes: tuple[str, ...] = ()
    scale: float = 1.0
    triangles: FlatTriangles | None = None
    flat_lengths: FloatArray | None = None
    embed: Callable[[Cut], Embedding] | None = None
    has_target_cones: bool = True

    def scaled(self, factor: float) -> FlatMetric:
        """Return the metric with all lengths multiplied by a factor."""
        return replace(self, scale=factor * self.scale, log_scale=self.log_scale + np.log(factor))


@dataclass(frozen=True, eq=False)
class Layout:
    """A connected mesh with n vertices and m faces, laid out in the plane.

    Attributes:
        mesh: the mesh.
        lengths: (m, 3) its side lengths before scaling.
        points: (c, 2) points of the plane, model units.
        corners: (m, 3) index into `points` of every triangle corner.
        chart: (m,) the chart of each triangle, from 0; charts share no points, but may overlap.
        cones: (s,) vertices.
        seams: (k, 2) vertex pairs.
        log_scale: (n,) phi; flat lengths are about l * exp(phi).
        target, curvature: (n,) target curvature and curvature of the metric, radians.
        is_open: (n,) vertices whose curvature is not prescribed.
        is_fixed: (n,) boundary vertices that must not move.
        statistics: statistics of the solvers.
        notes: unmet requests, one sentence each.
        disk: the mesh cut to a disk, which may have holes, with one vertex per point and `corners` as faces; or None.
    """

    mesh: TriangleMesh
    lengths: FloatArray
    points: FloatArray
    corners: IntArray
    chart: IntArray
    cones: IntArray
    seams: IntArray
    log_scale: FloatArray
    target: FloatArray
    curvature: FloatArray
    is_open: BoolArray
    is_fixed: BoolArray
    statistics: SolveStatistics
    notes: tuple[str, ...] = ()
    disk: TriangleMesh | None = None

    @property
    def area(self) -> float:
        """The area of the mesh before scaling."""
        return float(double_areas(self.lengths).sum() / 2)

    @cached_property
    def flat_double_areas(self) -> FloatArray:
        """(m,) twice the signed areas of the triangles in the plane."""
        return signed_double_areas(rows_of(self.points, self.corners))

    @cached_property
    def qc(self) -> FloatArray:
        """(m,) the quasi-conformal distortion of each triangle, infinite if it is flipped or has no area."""
        return qc_distortion(self.lengths, rows_of(self.points, self.corners))

    @property
    def prescribed(self) -> FloatArray:
        """(n,) the prescribed curvature in the plane, radians; NaN where none is prescribed."""
        return np.where(self.is_open, np.nan, self.target)

    def with_notes(self, *notes: str) -> Layout:
        """Return the same layout with further notes."""
        return replace(self, notes=(*self.notes, *notes))

    def with_area_distortion(self, linear: FloatArray, areas: FloatArray) -> Layout:
        """Return the layout with the area distortion of its metric, and of the linear model of its cones.

        Args:
            linear: (n,) log conformal factor of that model.
            areas: (n,) weight of each vertex.
        """
        of_linear, reached = (area_distortion(phi, areas) for phi in (linear, self.log_scale))
        statistics = replace(self.statistics, area_distortion_linear=of_linear, area_distortion=reached)
        return replace(self, statistics=statistics)
