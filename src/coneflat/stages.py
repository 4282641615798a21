"""What passes between the stages: a surface, its cones, a flat metric, a cut, a layout, and what is asked of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix

from .base.arrays import BoolArray, FloatArray, IntArray
from .base.threads import MEMORY_BOUND_TRIANGLES
from .geometry import angle_defect, corner_angles, cotangent_laplacian, cotangents, double_areas
from .geometry.delaunay import intrinsic_delaunay
from .geometry.intrinsic import IntrinsicTriangulation
from .geometry.operators import area_distortion, vertex_areas
from .geometry.straight import FlatTriangles
from .mesh.connectivity import TriangleMesh

# A mesh counts as stretched if its Delaunay triangulation takes more flips per edge: scans take less than 0.2, models
# stretched thirty to one 1.0 to 1.5, noise alone up to 0.85. Flips are tried only where this share of edges is not
# Delaunay.
STRETCHED_FLIPS, MIN_SHARE_TO_FLIP = 0.95, 0.15


@dataclass(frozen=True, eq=False)
class VertexCurvatures:
    """Vertices that the user names, each with a curvature or without.

    Attributes:
        vertices: (k,).
        curvatures: (k,) radians, NaN where it is to be computed.
    """

    vertices: IntArray
    curvatures: FloatArray

    def __len__(self) -> int:
        return len(self.vertices)

    def within(self, component: IntArray) -> VertexCurvatures:
        """Return those of a component, numbered there; `component` are its vertices."""
        if not len(self):
            return self
        inside = np.isin(self.vertices, component)
        order = np.argsort(component, kind="stable")
        places = order[np.searchsorted(component, self.vertices[inside], sorter=order)]
        return VertexCurvatures(places, self.curvatures[inside])


@dataclass(frozen=True, eq=False)
class ConeSpec:
    """What is asked of the cones of a connected mesh with n vertices.

    Attributes:
        strategy: "auto", "sparse", "greedy", "none", or "given" for `given`.
        needs_sparse_search: something is asked for that only the sparse search heeds.
        distortion: largest area distortion of the linear model.
        count: number of cones instead of a distortion, or None.
        max_count: largest number of cones, or None.
        min_angle, max_angle: bounds of cone angles, radians; None for no upper bound.
        positive_only: no cones of negative curvature.
        quantum: curvatures are multiples of it, radians; None for any.
        given: cones that are given, each with its curvature or NaN.
        required: vertices that are cones of any search.
        is_allowed: (n,) where a search may put a cone.
        weights: (n,) importance of each vertex, or None.
        absorbs_curvature: (n,) boundary vertices that take the curvature that the cones leave.
        prescribes_boundary: the boundary has a given shape.
        searches_corners: corners of a straight boundary are searched with the cones.
        scale_at_cones: phi = 0 is prescribed at the cones, not their curvature.
        names: (n,) the user's number of each vertex.
    """

    strategy: str
    needs_sparse_search: bool
    distortion: float
    count: int | None
    max_count: int | None
    min_angle: float
    max_angle: float | None
    positive_only: bool
    quantum: float | None
    given: VertexCurvatures
    required: IntArray
    is_allowed: BoolArray
    weights: FloatArray | None
    absorbs_curvature: BoolArray
    prescribes_boundary: bool
    searches_corners: bool
    scale_at_cones: bool
    names: IntArray

    def without(self, vertices: IntArray) -> ConeSpec:
        """Return the same, with no cones at some more vertices."""
        is_allowed = self.is_allowed.copy()
        is_allowed[vertices] = False
        return replace(self, is_allowed=is_allowed)


@dataclass(frozen=True, eq=False)
class MetricSpec:
    """What is asked of the metric of a connected mesh with n vertices.

    Attributes:
        method: "exact" or "linear".
        boundary: "free", "lengths", "disk", "straight" or "polygon".
        corners: corners of a polygon, each with its curvature or NaN.
        keeps_length: (n,) boundary vertices between which lengths are kept.
        keeps_area: the metric is scaled to the area of the input.
        scale_at_cones: phi = 0 is prescribed at the cones, not their curvature.
        quantum: rotations along handles and around holes are corrected to multiples of it, radians; None for not.
        accepts_failure: return a metric that did not converge.
        names: (n,) the user's number of each vertex.
    """

    method: str
    boundary: str
    corners: VertexCurvatures
    keeps_length: BoolArray
    keeps_area: bool
    scale_at_cones: bool
    quantum: float | None
    names: IntArray
    accepts_failure: bool = False

    def plain(self) -> MetricSpec:
        """Return the same without corrected rotations; what does not converge is accepted."""
        return replace(self, quantum=None, accepts_failure=True)


@dataclass(frozen=True, eq=False)
class SeamSpec:
    """What is asked of the seams of a connected mesh with n vertices and e edges.

    Attributes:
        follows_sharp: sharp edges are cheaper.
        hiding: how much hidden places are cheaper, from 0.
        visibility: (n,) share of directions from which each vertex is seen; None where it does not matter.
        weights: (n,) factors of the cost, or None.
        is_avoided: (e,) edges inside polygons of the input, cut only if nothing else serves.
        is_forbidden: (e,) edges that must not be cut.
    """

    follows_sharp: bool
    hiding: float
    visibility: FloatArray | None
    weights: FloatArray | None
    is_avoided: BoolArray
    is_forbidden: BoolArray


@dataclass(frozen=True)
class RelaxSpec:
    """What is asked of relaxing.

    Attributes:
        extent: "auto" for bent triangles, "whole" for all, "off" for none.
        stretch: from angles, 0, to areas, 1; above 0 all triangles are relaxed.
    """

    extent: str
    stretch: float

    @property
    def is_whole(self) -> bool:
        """Whether all triangles are relaxed."""
        return self.stretch > 0 or self.extent == "whole"

    @property
    def is_off(self) -> bool:
        """Whether none is."""
        return self.extent == "off" and not self.stretch


@dataclass(eq=False)
class Surface:
    """A connected mesh with n vertices and m faces, and the operators of its metric.

    Attributes:
        mesh: the mesh.
        lengths: (m, 3) side lengths, with which every triangle has area.
        laplacian: (n, n) cotangent Laplacian.
        curvature: (n,) angle defect, radians.
        areas: (n,) vertex areas.
        widest: (n,) the widest corner at each vertex as a share of all there.
        is_reused: other cones will be searched on it.
        memo: what stages store to use again; only who stored a value reads it.
        known_delaunay: the intrinsic Delaunay triangulation, once it is known.
    """

    mesh: TriangleMesh
    lengths: FloatArray
    laplacian: csc_matrix
    curvature: FloatArray
    areas: FloatArray
    widest: FloatArray
    is_reused: bool = False
    memo: dict[str, Any] = field(default_factory=dict)
    known_delaunay: tuple[IntrinsicTriangulation, IntArray] | None = None

    @classmethod
    def of(cls, mesh: TriangleMesh, lengths: FloatArray, flips: bool = True) -> Surface:
        """Return a mesh with the operators of its lengths.

        On stretched meshes many cotangents are negative. Laplacian and areas are then those of the intrinsic Delaunay
        triangulation, on which the exact metric is found.

        flips: the metric may flip edges; else Laplacian and areas are always the mesh's own.
        """
        n, cots = len(mesh.vertices), cotangents(lengths)
        faces, sides, delaunay = mesh.faces, lengths, None
        weights = np.bincount(mesh.halfedge_edges, cots.ravel(), len(mesh.edges))
        bad = np.count_nonzero(~mesh.is_boundary_edge & (weights < 0))
        if flips and bad > MIN_SHARE_TO_FLIP * len(mesh.edges):
            triangulation, done = delaunay = intrinsic_delaunay(mesh, lengths)
            if len(done) > STRETCHED_FLIPS * len(mesh.edges):
                faces, sides = triangulation.faces, triangulation.length.reshape(-1, 3)
                cots = cotangents(sides)
        angles = corner_angles(lengths)
        curvature = angle_defect(mesh.faces, angles, mesh.is_boundary_vertex)
        widest = np.zeros(n)
        np.maximum.at(widest, mesh.faces.ravel(), angles.ravel())
        widest /= np.where(mesh.is_boundary_vertex, np.pi, 2 * np.pi) - curvature
        laplacian, areas = cotangent_laplacian(faces, cots, n), vertex_areas(faces, sides, n)
        known = delaunay if len(faces) <= MEMORY_BOUND_TRIANGLES else None
        return cls(mesh, lengths, laplacian, curvature, areas, widest, known_delaunay=known)

    @property
    def delaunay(self) -> tuple[IntrinsicTriangulation, IntArray]:
        """The intrinsic Delaunay triangulation, and the half-edges flipped for it."""
        if self.known_delaunay is None:
            self.known_delaunay = intrinsic_delaunay(self.mesh, self.lengths)
        return self.known_delaunay

    def prepare(self, method: str) -> None:
        """Find what a metric by a method will need, but on huge surfaces, where memory is what matters."""
        if method == "exact" and len(self.mesh.faces) <= MEMORY_BOUND_TRIANGLES:
            _ = self.delaunay


@dataclass(frozen=True, eq=False)
class LaplacianInverse:
    """A factorized Laplacian, as a function of (n,) sources, up to a constant where nothing is held at zero.

    Attributes:
        solve: returns (n,) the solution for a source (n,).
        laplacian: (n, n), of all vertices.
        is_zero: (n,) the vertices where its solutions are zero.
        break_even: how many solutions take as long as another factorization.
    """

    solve: Callable[[FloatArray], FloatArray]
    laplacian: csc_matrix
    is_zero: BoolArray
    break_even: int


@dataclass(frozen=True, eq=False)
class ConeSolution:
    """Cones of a mesh with n vertices, their curvatures, and the log scale that produces them to first order.

    Attributes:
        cones: (s,) cone vertices, in the order in which they were chosen.
        target: (n,) target curvature, radians: 0 but at cones and on the boundary.
        log_scale: (n,) phi with L phi = target - curvature; constant on cones and boundary where their
            curvature was not prescribed.
        inverse: what solved for the log scale, if it is still there: zero on the boundary, mean-free without one.
        is_searched: the sparse search chose them, so that others may be tried.
        notes: unmet requests, one sentence each.
    """

    cones: IntArray
    target: FloatArray
    log_scale: FloatArray
    inverse: LaplacianInverse | None = None
    is_searched: bool = False
    notes: tuple[str, ...] = ()

    @property
    def curvatures(self) -> FloatArray:
        """(s,) target curvature of each cone, radians."""
        return self.target[self.cones]


@dataclass(frozen=True, eq=False)
class Cut:
    """A connected mesh cut open to a disk.

    Attributes:
        mesh: the cut mesh; its faces are those of the mesh, in the same order.
        seams: (k,) the edges that were cut.
    """

    mesh: TriangleMesh
    seams: IntArray


@dataclass(frozen=True)
class SolveStatistics:
    """How a metric and its layout were found.

    Attributes:
        newton_steps: steps of Newton's method.
        euclidean_flips: edges flipped to make the input Delaunay.
        ptolemy_flips: edges flipped during the solve.
        residual: largest curvature error of the metric where curvature was prescribed, radians.
        broken: triangles of the metric that break the triangle inequality.
        untangled_triangles: triangles that were inverted on their straight sides, and were flipped.
        untangled_vertices: vertices that were moved for this.
        untangled_move: how far one was moved at most, relative to the mean edge around them.
        relaxed_vertices: vertices that were free to move so that triangles are less distorted.
        qc_mean_unrelaxed, qc_max_unrelaxed: the mean and the largest quasi-conformal distortion before; NaN where
            nothing was to be relaxed, and of polygons in a file, which programs split into triangles of their own.
        area_distortion_linear: E of the linear model that the cones were chosen in: the standard deviation of
            the log scale, by area (and importance, where weights were given).
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
    def of_all(cls, parts: Sequence[SolveStatistics], areas: Sequence[float]) -> SolveStatistics:
        """Return the statistics of components together: counts add up, means and deviations combine by area."""
        values = {}
        for each in fields(cls):
            every = np.array([getattr(part, each.name) for part in parts])
            if each.name in ("newton_steps", "residual", "untangled_move", "qc_max_unrelaxed"):
                values[each.name] = every.max().item()
            elif each.name == "qc_mean_unrelaxed":
                values[each.name] = float(np.average(every, weights=areas))
            elif each.name.startswith("area_distortion"):
                values[each.name] = float(np.sqrt(np.average(every**2, weights=areas)))
            else:
                values[each.name] = every.sum().item()
        return cls(**values)


@dataclass(frozen=True, eq=False)
class Embedding:
    """A cut mesh in the plane, by a method that maps it without a metric.

    Attributes:
        points: (c, 2) of the vertices of the cut mesh, at any scale, positively oriented.
        statistics: how it was found.
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
        target: (n,) curvature that was prescribed, or came out where the scale was.
        log_scale: (n,) phi; flat lengths are about l * exp(phi).
        is_open: (n,) vertices whose curvature is not prescribed.
        is_held: (n,) boundary vertices that a layout must leave where the metric has them.
        statistics: how it was found.
        notes: unmet requests, one sentence each.
        scale: factor of the triangles' size, contained in phi.
        triangles: straight triangles that fit each other, which are unfolded; or None.
        flat_lengths: (m, 3) lengths that fit nearly, for a least squares layout; or None.
        embed: maps the cut mesh itself; or None.
        holds_cones: the cones have the target; if not, the sides of seams are a free boundary.
    """

    mesh: TriangleMesh
    lengths: FloatArray
    cones: IntArray
    target: FloatArray
    log_scale: FloatArray
    is_open: BoolArray
    is_held: BoolArray
    statistics: SolveStatistics = field(default_factory=SolveStatistics)
    notes: tuple[str, ...] = ()
    scale: float = 1.0
    triangles: FlatTriangles | None = None
    flat_lengths: FloatArray | None = None
    embed: Callable[[Cut], Embedding] | None = None
    holds_cones: bool = True

    def scaled(self, factor: float) -> FlatMetric:
        """Return the metric at another size."""
        return replace(self, scale=factor * self.scale, log_scale=self.log_scale + np.log(factor))


@dataclass(frozen=True, eq=False)
class Layout:
    """A connected mesh with n vertices and m faces, laid out in the plane.

    Attributes:
        mesh: the mesh.
        lengths: (m, 3) its side lengths before scaling.
        points: (c, 2) points of the plane, model units.
        corners: (m, 3) index into `points` of every triangle corner.
        chart: (m,) the chart of each triangle, from 0; charts have no points in common and may lie over each other.
        cones: (s,) vertices.
        seams: (k, 2) vertex pairs.
        log_scale: (n,) phi; flat lengths are about l * exp(phi).
        target, curvature: (n,) curvature wanted and reached, radians.
        is_open: (n,) vertices whose curvature is not prescribed.
        is_held: (n,) boundary vertices that must stay.
        statistics: how it was found.
        notes: unmet requests, one sentence each.
        disk: the mesh cut open, whose faces are the corners, with a vertex for each point; None if there is none.
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
    is_held: BoolArray
    statistics: SolveStatistics
    notes: tuple[str, ...] = ()
    disk: TriangleMesh | None = None

    @property
    def area(self) -> float:
        """The area of the mesh before scaling."""
        return float(double_areas(self.lengths).sum() / 2)

    @property
    def prescribed(self) -> FloatArray:
        """(n,) the curvature that vertices are to have in the plane, radians; NaN where none is prescribed."""
        return np.where(self.is_open, np.nan, self.target)

    def with_notes(self, *notes: str) -> Layout:
        """Return the same layout with more notes."""
        return replace(self, notes=(*self.notes, *notes))

    def with_area_distortion(self, linear: FloatArray, areas: FloatArray) -> Layout:
        """Return the layout with the area distortion of its metric, and of the linear model of its cones.

        Args:
            linear: (n,) log scale of that model.
            areas: (n,) weight of each vertex.
        """
        of_linear, reached = (area_distortion(phi, areas) for phi in (linear, self.log_scale))
        statistics = replace(self.statistics, area_distortion_linear=of_linear, area_distortion=reached)
        return replace(self, statistics=statistics)
