"""The content of a page: a flattening as arrays, simplified if it has too many triangles."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .... import TriangleMesh
from ....base import FloatArray, IntArray, mask_of
from ....errors import ArrayShapeError, OptionError
from ....geometry import signed_double_areas
from ....io import SplitMesh, cell_side, split_at_seams
from ....mesh import end_corners, label_faces, point_seams
from ..faults import fault_places, uv_faults
from ..quantity import (
    ColorScale,
    Quantity,
    Ranges,
    angle_defects,
    conformal_distortion,
    largest_strain,
    stretch,
)
from .parts import PageParts, seam_numbers
from .simplified import sides, simplify

if TYPE_CHECKING:
    from .... import Flattening

FITTING = Ranges()


@dataclass(frozen=True, eq=False)
class Content:
    """A flattening as a page shows it: v vertices, u points of the layout, m triangles, c cones.

    Attributes:
        model: the surface.
        places: (v, 3) vertices, moved and scaled into the unit ball.
        point_vertex: (u,) the vertex of each point of the layout.
        uv: (u, 2) points of the layout.
        uv_side: square root of the area of all triangles in the plane.
        faces: (m, 3) triangles of points.
        outline: half-edges 3 f + i on the outlines of charts, each opposite corner i of face f: the two half-edges of
            each seam, one after the other, then those of the boundary.
        seams: number of seam edges.
        seam_numbers: the seam of each seam edge, see `seam_numbers`.
        chart: (m,) the chart of each triangle, the largest first; or its piece.
        anchors: of each piece, a triangle on which its number is shown; empty without pieces.
        qc, area: (m,) QC distortion, and scale relative to its mean; NaN where undefined.
        strain: (m,) the largest relative change of the length of a side; NaN where undefined.
        curvature, flat: (v,) curvature of the model and of the flat metric, in units of pi; NaN on the boundary.
        cones: (c,) vertices of the cones.
        cone_curvatures: (c,) curvatures in radians.
        vertex_numbers: (v,) index of each vertex in the input, or -1.
        face_numbers: (m,) index of each triangle in the result.
        left_out: number of triangles that are not shown.
        scales: the colour scale of each quantity.
        quantity: quantity given by the user, at the vertices or triangles that are shown.
        faults: (m,) the faults of the UVs of each triangle, see `UVFaults.bits`.
        fault_places: (k, 2) a triangle and its fault at each place with one, see `fault_places`.
        fault_counts: number of all triangles with each fault.
    """

    model: Model
    places: FloatArray
    point_vertex: IntArray
    uv: FloatArray
    uv_side: float
    faces: IntArray
    outline: IntArray
    seams: int
    seam_numbers: IntArray
    chart: IntArray
    anchors: IntArray
    qc: FloatArray
    area: FloatArray
    strain: FloatArray
    curvature: FloatArray
    flat: FloatArray
    cones: IntArray
    cone_curvatures: FloatArray
    vertex_numbers: IntArray
    face_numbers: IntArray
    left_out: int
    scales: dict[str, ColorScale]
    quantity: Quantity | None
    faults: NDArray[np.uint8]
    fault_places: IntArray
    fault_counts: dict[str, int]


@dataclass(frozen=True, eq=False)
class Model:
    """The surface of a result, independent of its layout: n vertices, v of which have triangles.

    Attributes:
        mesh: the mesh.
        vertices: (v,) the vertices that have triangles.
        places: (v, 3) their positions, moved and scaled into the unit ball.
        centre, radius: centre and radius of this ball in model units.
        curvature: (v,) curvature in units of pi; NaN on the boundary.
        outward: 1 if triangles are counterclockwise seen from outside, else -1.
    """

    mesh: TriangleMesh
    vertices: IntArray
    places: FloatArray
    centre: FloatArray
    radius: float
    curvature: FloatArray
    outward: int

    @classmethod
    def of(cls, result: Flattening) -> Model:
        """Return the surface of a result."""
        mesh = TriangleMesh(result.vertices, result.faces)
        is_used = mask_of(len(mesh.vertices), mesh.faces)
        vertices = np.flatnonzero(is_used)
        places, centre, radius = _into_unit_ball(result.vertices[vertices])
        curvature = angle_defects(result, False, mesh)[vertices] / np.pi
        number = np.cumsum(is_used) - 1
        corners = places[number[mesh.faces]]
        centroids = corners.mean(axis=1)
        # Most normals of an outward orientation point away from the middle.
        away = (centroids - centroids.mean(axis=0)) * np.cross(*sides(corners))
        outward = -1 if float(away.sum()) < 0 else 1
        return cls(mesh, vertices, places, centre, radius, curvature, outward)

    def is_of(self, result: Flattening) -> bool:
        """Return whether this is the surface of a result."""
        mesh = self.mesh
        return np.array_equal(mesh.faces, result.faces) and np.array_equal(mesh.vertices, result.vertices)


def content_of(
    result: Flattening,
    max_triangles: int,
    model: Model | None = None,
    quantity: Quantity | None = None,
    ranges: Ranges = FITTING,
    parts: PageParts | None = None,
) -> Content:
    """Return the content of a page of a result.

    Args:
        result: the flattening.
        max_triangles: largest number of triangles.
        model: its surface, if it has been computed already.
        quantity: quantity given by the user.
        ranges: ends of the colour scales.
        parts: pieces that are shown instead of charts.

    Raises:
        ArrayShapeError: the result has no UVs, or no triangles.
        MeshError: it cannot be reduced to `max_triangles`.
        OptionError: `max_triangles` is not positive.
    """
    if max_triangles < 1:
        raise OptionError(f"most_triangles must be 1 or more, got {max_triangles}")
    if not len(result.faces) or not len(result.uv) or np.shape(result.uv_faces) != np.shape(result.faces):
        raise ArrayShapeError(
            f"the result cannot be shown: it has {len(result.faces):,} triangles, {len(result.uv):,} UV points and "
            f"{len(result.uv_faces):,} UV triangles"
        )
    split, model = split_at_seams(result), Model.of(result) if model is None else model
    vertex = np.searchsorted(model.vertices, split.vertex)
    cone = np.searchsorted(model.vertices, result.cones)
    outline, seams = outline_halfedges(model.mesh, split.faces)
    drawn = _drawn(split, model.places[vertex], vertex, cone, outline, max_triangles)
    chart = _charts(split.faces, split.uv) if parts is None else parts.pieces
    qc, scale = conformal_distortion(result, ranges.qc_max), stretch(result, ranges.scale_max)
    faults = uv_faults(result)
    faults_drawn, uv = faults.bits[drawn.triangles], split.uv[drawn.points]
    flat_curvature = angle_defects(result, True, model.mesh)[model.vertices] / np.pi
    numbers = np.arange(len(result.vertices)) if result.vertex_origin is None else result.vertex_origin
    strain = largest_strain(result, None if parts is None else parts.strain)
    scales = _scales(qc, scale, strain, model.curvature)
    if quantity is not None:
        colors = "diverging" if quantity.scale.low < 0 < quantity.scale.high else "sequential"
        scales = {"own": replace(quantity.scale, colors=colors), **scales}
        rows = drawn.triangles if quantity.corners is None else model.vertices[drawn.vertices]
        quantity = replace(quantity, values=quantity.values[rows])
    return Content(
        model=model,
        places=model.places[drawn.vertices],
        point_vertex=drawn.point_vertex,
        uv=uv,
        uv_side=cell_side(split.uv, split.faces, 1.0),
        faces=drawn.faces,
        outline=drawn.outline,
        seams=seams,
        seam_numbers=seam_numbers(outline, seams, split.faces) if parts is None else parts.seams,
        chart=chart[drawn.triangles],
        anchors=_nearest_drawn(parts, split, drawn.triangles),
        qc=qc.values[drawn.triangles],
        area=scale.values[drawn.triangles],
        strain=strain.values[drawn.triangles],
        curvature=model.curvature[drawn.vertices],
        flat=flat_curvature[drawn.vertices],
        cones=np.searchsorted(drawn.vertices, cone),
        cone_curvatures=result.curvatures,
        vertex_numbers=numbers[model.vertices[drawn.vertices]],
        face_numbers=drawn.triangles,
        left_out=len(split.faces) - len(drawn.triangles),
        scales=scales,
        quantity=quantity,
        faults=faults_drawn,
        fault_places=fault_places(faults_drawn, uv, drawn.faces),
        fault_counts=faults.counts(),
    )


def _nearest_drawn(parts: PageParts | None, split: SplitMesh, triangles: IntArray) -> IntArray:
    """Return for the anchor of each piece the nearest triangle of the piece that is drawn."""
    if parts is None:
        return np.empty(0, dtype=np.int64)
    middles = split.uv[split.faces].mean(axis=1)
    nearest = []
    for piece, anchor in enumerate(parts.anchors.tolist()):
        candidates = np.flatnonzero(parts.pieces[triangles] == piece)
        distances = np.linalg.norm(middles[triangles[candidates]] - middles[anchor], axis=1)
        nearest.append(candidates[distances.argmin()])
    return np.array(nearest)


@dataclass(frozen=True, eq=False)
class _Drawn:
    """What a page draws of a cut mesh: everything, or a simplified mesh.

    Attributes:
        triangles: (m,) the triangles of the mesh that remain.
        points, vertices: (u,), (v,) the points of the layout and the vertices of the model that remain.
        point_vertex: (u,) index into `vertices` of each point.
        faces: (m, 3) index into `points` of every corner.
        outline: half-edges on the outlines of charts, as in `Content`.
    """

    triangles: IntArray
    points: IntArray
    vertices: IntArray
    point_vertex: IntArray
    faces: IntArray
    outline: IntArray


def _drawn(
    split: SplitMesh,
    places: FloatArray,
    vertex: IntArray,
    cones: IntArray,
    outline: IntArray,
    max_triangles: int,
) -> _Drawn:
    """Return what a page draws of a cut mesh.

    Args:
        split: the mesh.
        places: (u, 3) positions of its vertices in the unit ball.
        vertex: (u,) the vertex of the model of each.
        cones: vertices of the model that must remain.
        outline: half-edges on the outlines of charts.
        max_triangles: largest number of triangles.

    Raises:
        MeshError: it cannot be reduced to `max_triangles`.
    """
    if len(split.faces) <= max_triangles:
        # Every point and every vertex of the model has a triangle.
        points, vertices = np.arange(len(split.uv)), np.arange(int(vertex.max()) + 1)
        return _Drawn(np.arange(len(split.faces)), points, vertices, vertex, split.faces, outline)
    fixed = np.zeros(len(split.uv), dtype=bool)
    for end in end_corners(outline):
        fixed[split.faces.reshape(-1)[end]] = True
    fixed |= np.isin(vertex, cones)
    triangles, corners = simplify(places, split.uv, split.faces, fixed, max_triangles)
    # All triangles at outlines remain, because their third corner is not merged with the other two.
    outline = 3 * np.searchsorted(triangles, outline // 3) + outline % 3
    points, faces = np.unique(corners, return_inverse=True)
    vertices, point_vertex = np.unique(vertex[points], return_inverse=True)
    return _Drawn(triangles, points, vertices, point_vertex.reshape(-1), faces.reshape(-1, 3), outline)


def _scales(qc: Quantity, area: Quantity, strain: Quantity, curvature: FloatArray) -> dict[str, ColorScale]:
    """Return the colour scale of each quantity of a page; both curvatures have that of the model.

    The scale of curvatures has four decades on each side of zero, and contains almost all curvatures.

    Args:
        qc, area, strain: QC distortion, scale and strain.
        curvature: (v,) curvature of the model in units of pi.
    """
    amounts = np.abs(curvature[np.isfinite(curvature) & (curvature != 0)])
    largest = float(np.percentile(amounts, 99.9)) if len(amounts) else 1.0
    top = int(np.clip(np.ceil(np.log10(largest)), -12, 1))
    superscripts = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
    powers = (top, top - 2)
    ticks = [(10.0**power, f"10{str(power).translate(superscripts)}" if power else "1") for power in powers]
    signed_ticks = [*((-value, f"−{label}") for value, label in ticks), (0.0, "0"), *reversed(ticks)]
    bent = ColorScale(10.0 ** (top - 4), 10.0**top, "diverging", "signed log", tuple(signed_ticks))
    return {
        "qc": replace(qc.scale, colors="sequential"),
        "area": replace(area.scale, colors="diverging"),
        "strain": strain.scale,
        "curvature": bent,
        "flat": bent,
    }


def outline_halfedges(mesh: TriangleMesh, uv_faces: IntArray) -> tuple[IntArray, int]:
    """Return the half-edges on the outlines of charts, and the number of seam edges.

    The two half-edges of each seam come first, one after the other, then the half-edges of the boundary.
    """
    seams = mesh.edge_halfedges[point_seams(mesh, uv_faces)]
    boundary = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
    return np.concatenate([seams.reshape(-1), boundary]), len(seams)


def _into_unit_ball(vertices: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    centre = low + (high - low) / 2
    centred = vertices - centre
    # Coordinates are divided by the largest one first, because squares could overflow.
    size = float(np.abs(centred).max()) or 1.0
    radius = size * float(np.sqrt(((centred / size) ** 2).sum(axis=1).max())) or 1.0
    return centred / radius, centre, radius


def _charts(faces: IntArray, uv: FloatArray) -> IntArray:
    """Return (m,) the chart of each triangle; charts are numbered by decreasing area."""
    count, chart = label_faces(faces, len(uv))
    areas = np.abs(signed_double_areas(uv[faces]))
    rank = np.full(count, -1, dtype=np.int64)
    rank[np.argsort(-np.bincount(chart, weights=areas, minlength=count), kind="stable")] = np.arange(count)
    return rank[chart]
