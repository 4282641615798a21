"""The specification that each stage gets for a component, from the options and the values of the whole mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..mesh.connectivity import TriangleMesh
from ..options import Options
from ..stages import ConeSpec, MetricSpec, SeamSpec
from .components import Component
from .constraints import Constraints
from .fill import Fill
from .marked_edges import unreachable


class Submesh(NamedTuple):
    """A connected mesh of n vertices and m faces that is part of another one.

    Attributes:
        mesh: the mesh.
        vertices, faces: (n,), (m,) indices in the whole mesh.
        lengths: (m, 3) side lengths.
        fill: the mesh with filled holes; None if there are none, or if they must be opened.
    """

    mesh: TriangleMesh
    vertices: IntArray
    faces: IntArray
    lengths: FloatArray
    fill: Fill | None


@dataclass(frozen=True, eq=False)
class MeshValues:
    """Values of the vertices and triangles of the whole mesh.

    Attributes:
        constraints: the user's constraints.
        is_diagonal: (m, 3) sides inside polygons of the input.
        is_forbidden: (m, 3) sides that must not be cut.
        visibility: (n,) fraction of directions from which each vertex is visible, or None.
        double_areas: (m,) twice the areas of the triangles before any were opened.
    """

    constraints: Constraints
    is_diagonal: BoolArray
    is_forbidden: BoolArray
    visibility: FloatArray | None
    double_areas: FloatArray


def specified_component(submesh: Submesh, values: MeshValues, options: Options) -> Component:
    """Return a component with its specifications."""
    mesh, vertices, faces, lengths, fill = submesh
    constraints, is_forbidden = values.constraints.within(vertices), values.is_forbidden[faces]
    boundary = _boundary_kind(mesh, constraints, options)
    on_marks = mesh.is_boundary_vertex & (False if constraints.on_marks is None else constraints.on_marks)
    cones = _cone_spec(mesh, constraints, boundary, on_marks, options)
    if is_forbidden.any():  # no cones where no seam can reach them
        cones = cones.without(unreachable(mesh, is_forbidden))
    sides = mesh.edge_halfedges[:, 0]
    seams = SeamSpec(
        creases=float(options.sharp_angle is not None),
        hiding=options.hide_seams,
        visibility=None if values.visibility is None else values.visibility[vertices],
        weights=constraints.seam_weights,
        is_avoided=values.is_diagonal[faces].ravel()[sides],
        is_forbidden=is_forbidden.ravel()[sides],
    )
    metric = _metric_spec(mesh, constraints, boundary, on_marks, options)
    # A prescribed boundary is that of the holes, too.
    fill = fill if boundary == "free" else None
    return Component(mesh, vertices, faces, lengths, values.double_areas[faces], cones, metric, seams, fill)


def _boundary_kind(mesh: TriangleMesh, constraints: Constraints, options: Options) -> str:
    """Return the kind of boundary of a component; it is free without a boundary, or without corners of a polygon."""
    is_free = options.boundary_kind == "polygon" and not len(constraints.corners)
    return "free" if is_free or not mesh.is_boundary_vertex.any() else options.boundary_kind


def _cone_spec(
    mesh: TriangleMesh, constraints: Constraints, boundary: str, on_marks: BoolArray, options: Options
) -> ConeSpec:
    """Return the specification of the cones; on_marks: (n,) boundary vertices on marked seams."""
    return ConeSpec(
        strategy=options.cone_choice,
        needs_sparse_search=options.asks_for_search,
        distortion=options.distortion,
        count=options.cone_count,
        max_count=options.max_cones,
        min_angle=options.min_cone_angle,
        max_angle=options.max_cone_angle,
        positive_only=options.positive_only,
        quantum=options.quantise,
        prescribed=constraints.cones,
        required=constraints.required.vertices,
        is_allowed=constraints.is_allowed,
        weights=constraints.weights,
        # Corners of a straightened boundary are searched like inner cones, but not on marked seams.
        absorbs_curvature=on_marks if boundary == "straight" else mesh.is_boundary_vertex,
        prescribes_boundary=boundary in ("disk", "polygon"),
        searches_corners=boundary == "straight",
        scale_at_cones=options.scale_at_cones and options.method == "exact",
        names=constraints.names,
    )


def _metric_spec(
    mesh: TriangleMesh, constraints: Constraints, boundary: str, on_marks: BoolArray, options: Options
) -> MetricSpec:
    """Return the specification of the metric; on_marks: (n,) boundary vertices on marked seams."""
    return MetricSpec(
        method=options.method,
        boundary=boundary,
        corners=constraints.corners,
        # Lengths are preserved on marked seams, so that both sides are equal.
        keeps_length=mesh.is_boundary_vertex if boundary == "lengths" else on_marks,
        keeps_area=boundary != "lengths" and not options.marks_seams,
        scale_at_cones=options.scale_at_cones,
        quantum=options.quantise if options.correct_handles else None,
        names=constraints.names,
    )
