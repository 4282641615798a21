"""What goes into the stages: a surface with its operators, and the specification of each stage."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from scipy.sparse import csc_matrix

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.sets import largest_at
from ..base.threads import MEMORY_BOUND_TRIANGLES
from ..geometry import angle_defect, corner_angles, cotangent_laplacian, cotangents
from ..geometry.delaunay import intrinsic_delaunay
from ..geometry.intrinsic import IntrinsicTriangulation
from ..geometry.operators import vertex_areas
from ..mesh.connectivity import TriangleMesh
from .outputs import ConeSolution

# A mesh counts as stretched if its Delaunay triangulation needs more than STRETCHED_FLIPS flips per edge: scans need
# less than 0.2, models stretched thirty to one 1.0 to 1.5, noise alone up to 0.85. Flips are tried only if more than
# MIN_SHARE_TO_FLIP of the edges are not Delaunay.
STRETCHED_FLIPS, MIN_SHARE_TO_FLIP = 0.95, 0.15

SurfaceT = TypeVar("SurfaceT", bound="Surface")


@dataclass(frozen=True, eq=False)
class VertexCurvatures:
    """Vertices chosen by the user, each with or without a prescribed curvature.

    Attributes:
        vertices: (k,).
        curvatures: (k,) radians, NaN where the curvature must be computed.
    """

    vertices: IntArray
    curvatures: FloatArray

    def __len__(self) -> int:
        return len(self.vertices)

    def within(self, component: IntArray) -> VertexCurvatures:
        """Return the vertices inside a component, in its numbering; `component` has its vertices in ascending order."""
        if not len(self):
            return self
        inside = np.isin(self.vertices, component)
        return VertexCurvatures(np.searchsorted(component, self.vertices[inside]), self.curvatures[inside])


@dataclass(frozen=True, eq=False)
class ConeSpec:
    """Specification of the cones of a connected mesh with n vertices.

    Attributes:
        strategy: "auto", "sparse", "greedy", "none", or "prescribed" for `prescribed`.
        needs_sparse_search: an option is set that only the sparse search supports.
        distortion: largest area distortion of the linear model.
        count: number of cones instead of a distortion, or None.
        max_count: largest number of cones, or None.
        min_angle, max_angle: bounds of cone angles, radians; None for no upper bound.
        positive_only: no cones of negative curvature.
        quantum: curvatures are multiples of it, radians; None for any.
        prescribed: cones chosen by the user, each with its curvature or NaN.
        required: vertices that every search must use as cones.
        is_allowed: (n,) vertices where a search may put a cone.
        weights: (n,) importance of each vertex, or None.
        absorbs_curvature: (n,) boundary vertices that take the curvature that the cones leave.
        prescribes_boundary: the boundary has a given shape.
        searches_corners: corners of a straight boundary are searched with the cones.
        scale_at_cones: phi = 0 is prescribed at the cones instead of their curvature.
        names: (n,) the index of each vertex in the user's input.
        rotations: returns (2 genus,) the rotations of loops along the handles in the metric of a solution, radians;
            quantised cones are moved to align them. None: they are not moved.
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
    prescribed: VertexCurvatures
    required: IntArray
    is_allowed: BoolArray
    weights: FloatArray | None
    absorbs_curvature: BoolArray
    prescribes_boundary: bool
    searches_corners: bool
    scale_at_cones: bool
    names: IntArray
    rotations: Callable[[ConeSolution], FloatArray] | None = None

    def without(self, vertices: IntArray) -> ConeSpec:
        """Return a specification that forbids cones at further vertices."""
        is_allowed = self.is_allowed.copy()
        is_allowed[vertices] = False
        return replace(self, is_allowed=is_allowed)


@dataclass(frozen=True, eq=False)
class MetricSpec:
    """Specification of the metric of a connected mesh with n vertices.

    Attributes:
        method: "exact" or "linear".
        boundary: "free", "lengths", "disk", "straight" or "polygon".
        corners: corners of a polygon, each with its curvature or NaN.
        keeps_length: (n,) boundary vertices between which edge lengths are preserved.
        keeps_area: the metric is scaled to the area of the input.
        scale_at_cones: phi = 0 is prescribed at the cones instead of their curvature.
        quantum: holonomy along handles and around holes is corrected to multiples of it, radians; None: no correction.
        accepts_failure: return a metric even if it did not converge.
        names: (n,) the index of each vertex in the user's input.
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
        """Return a specification without corrected holonomy that accepts metrics that did not converge."""
        return replace(self, quantum=None, accepts_failure=True)


@dataclass(frozen=True, eq=False)
class SeamSpec:
    """Specification of the seams of a connected mesh with n vertices and e edges.

    Attributes:
        creases: strength of the preference for sharp edges, from 0 to 1.
        hiding: strength of the preference for hidden places, from 0.
        visibility: (n,) fraction of directions from which each vertex is visible; None if `hiding` is 0.
        weights: (n,) factors of the cost, or None.
        is_avoided: (e,) edges inside polygons of the input, cut only if necessary.
        is_forbidden: (e,) edges that must not be cut.
    """

    creases: float
    hiding: float
    visibility: FloatArray | None
    weights: FloatArray | None
    is_avoided: BoolArray
    is_forbidden: BoolArray


@dataclass(frozen=True)
class RelaxSpec:
    """Specification of relaxing.

    Attributes:
        extent: which triangles are relaxed: "auto" for the most distorted ones near cones, "whole" for all, "off" for
            none.
        stretch: from 0 (preserve angles) to 1 (preserve areas); above 0 all triangles are relaxed.
    """

    extent: str
    stretch: float

    @property
    def relaxes_all(self) -> bool:
        """Whether all triangles are relaxed."""
        return self.stretch > 0 or self.extent == "whole"

    @property
    def is_off(self) -> bool:
        """Whether no triangle is relaxed."""
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
        widest: (n,) largest corner angle at each vertex, divided by the angle sum there.
        is_reused: the surface is cached, and further searches for cones will follow.
        known_delaunay: the intrinsic Delaunay triangulation, or None before it is computed.
    """

    mesh: TriangleMesh
    lengths: FloatArray
    laplacian: csc_matrix
    curvature: FloatArray
    areas: FloatArray
    widest: FloatArray
    is_reused: bool = False
    known_delaunay: tuple[IntrinsicTriangulation, IntArray] | None = None

    @classmethod
    def of(cls: type[SurfaceT], mesh: TriangleMesh, lengths: FloatArray, flips: bool = True) -> SurfaceT:
        """Return a mesh with the operators of its lengths.

        On stretched meshes many cotangent weights are negative. Laplacian and areas are then those of the intrinsic
        Delaunay triangulation, on which the exact metric is computed.

        Args:
            mesh: a connected mesh with m faces.
            lengths: (m, 3) side lengths, with which every triangle has area.
            flips: the metric may flip edges; else Laplacian and areas are always those of the mesh itself.
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
        widest = largest_at(mesh.faces.ravel(), angles.ravel(), n)
        widest /= np.where(mesh.is_boundary_vertex, np.pi, 2 * np.pi) - curvature
        laplacian, areas = cotangent_laplacian(faces, cots, n), vertex_areas(faces, sides, n)
        cached_delaunay = delaunay if len(faces) <= MEMORY_BOUND_TRIANGLES else None
        return cls(mesh, lengths, laplacian, curvature, areas, widest, known_delaunay=cached_delaunay)

    @property
    def delaunay(self) -> tuple[IntrinsicTriangulation, IntArray]:
        """The intrinsic Delaunay triangulation, and the half-edges flipped for it."""
        if self.known_delaunay is None:
            self.known_delaunay = intrinsic_delaunay(self.mesh, self.lengths)
        return self.known_delaunay
