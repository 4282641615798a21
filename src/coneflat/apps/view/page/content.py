"""What a page shows of a flattening, as arrays, with fewer triangles where there are too many."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from .... import TriangleMesh
from ....base import BoolArray, FloatArray, IntArray
from ....errors import ArrayShapeError, MeshError, OptionError
from ....geometry import signed_double_areas
from ....io import cell_side, split_at_seams
from ....mesh import end_corners, label_faces, point_seams
from ..quantity import ColorScale, Quantity, conformal_distortion, missing_angles, stretch

if TYPE_CHECKING:
    from .... import Flattening

CELLS = 4095
"""Cells along an axis at most, so that the five numbers of a cell fit into 60 bits."""


def thin(
    places: FloatArray, uv: FloatArray, faces: IntArray, kept: BoolArray, most: int
) -> tuple[IntArray, IntArray]:
    """Return at most so many triangles in place of all: the faces that stay, and their (k, 3) new corners.

    Points are merged that lie in one cell both in space and in the plane; each cell is represented by its point
    nearest to their mean. Points that are kept, those on outlines, stay themselves. Such a map of a chart's
    points, the identity on its outline, covers all of the chart, so no holes appear in the plane or in space.

    Args:
        places: (u, 3) points in space, of a size about 1.
        uv: (u, 2) the same points in the plane.
        faces: (m, 3) triangles.
        kept: (u,) which points must stay.
        most: triangles wanted at most.

    Raises:
        MeshError: the triangles along outlines alone are more than that.
    """
    areas = signed_double_areas(uv[faces])
    area = float(np.linalg.norm(np.cross(*sides(places[faces])), axis=1).sum())
    scale = np.sqrt(np.abs(areas).sum() / max(area, 1e-300))
    coordinates = np.column_stack([places, uv / max(scale, 1e-300)])
    coordinates -= coordinates.min(axis=0)
    extent = float(coordinates.max())
    # A cell holds about two triangles.
    size = float(np.sqrt(area / most))
    for _ in range(60):
        unmoved = kept
        while True:
            corners = _representatives(coordinates, unmoved, max(size, extent / CELLS))[faces]
            stay = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
            folded = np.flatnonzero(stay)
            folded = folded[signed_double_areas(uv[corners[folded]]) * areas[folded] <= 0]
            # Where merging folds the plane, what runs forward covers all that what runs backward does; but a fold
            # at an outline may reach over it, so the points there stay, too.
            crossing = folded[kept[faces[folded]].any(axis=1) & ~unmoved[faces[folded]].all(axis=1)]
            if not len(crossing):
                break
            unmoved = unmoved.copy()
            unmoved[faces[crossing]] = True
        stay[folded] = False
        count = int(stay.sum())
        if count <= most:
            chosen = np.flatnonzero(stay)
            return chosen, corners[chosen]
        if size > extent:
            break
        size *= float(np.clip(np.sqrt(count / most), 1.1, 2.0))
    raise MeshError(
        f"{len(faces):,} triangles are too many for a page of {most:,}: {count:,} of them lie along seams or "
        "boundaries, where none can be left out; allow more"
    )


def _representatives(coordinates: FloatArray, kept: BoolArray, size: float) -> IntArray:
    """Return (u,) the point that stands for each."""
    new = np.arange(len(coordinates))
    free = np.flatnonzero(~kept)
    if not len(free):
        return new
    cells = np.floor(coordinates[free] / size).astype(np.int64)
    key = np.zeros(len(free), dtype=np.int64)
    for column in cells.T:
        key = key * (CELLS + 1) + column
    _, cell = np.unique(key, return_inverse=True)
    cell = cell.reshape(-1)
    members = np.bincount(cell)
    off = np.zeros(len(free))
    for column in coordinates[free].T:
        off += (column - (np.bincount(cell, weights=column) / members)[cell]) ** 2
    order = np.lexsort([off, cell])
    first = np.concatenate([[0], np.cumsum(members)[:-1]])
    new[free] = free[order[first]][cell]
    return new


def sides(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the two sides (m, d) of triangles (m, 3, d) from their first corner."""
    return corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]


@dataclass(frozen=True, eq=False)
class Content:
    """A flattening as a page shows it: v vertices, u points of the layout, m triangles, c cones.

    Attributes:
        model: the surface that these are of.
        places: (v, 3) vertices, moved and scaled into the unit ball.
        point_vertex: (u,) the vertex of each point of the layout.
        uv: (u, 2) the points.
        uv_side: the root of the area of all triangles in the plane.
        faces: (m, 3) triangles of points.
        outline: half-edges 3 f + i on the outlines of charts, each opposite corner i of face f: the two sides of
            each seam edge, one after the other, then those of the boundary.
        seams: how many seam edges there are.
        chart: (m,) the chart of each triangle, the largest first.
        qc, area: (m,) QC distortion, and scale relative to its mean; NaN where undefined.
        curvature, flat: (v,) of the model and of the flat metric, in units of pi; NaN on the boundary.
        cones: (c,) vertices.
        cone_curvatures: (c,) radians.
        vertex_numbers: (v,) each vertex's number in the input, or -1.
        face_numbers: (m,) each triangle's number in the result.
        left_out: how many triangles are not shown.
        scales: the scale of each colour map.
        own: numbers of the user's own, at the vertices or the triangles that are shown.
    """

    model: Model
    places: FloatArray
    point_vertex: IntArray
    uv: FloatArray
    uv_side: float
    faces: IntArray
    outline: IntArray
    seams: int
    chart: IntArray
    qc: FloatArray
    area: FloatArray
    curvature: FloatArray
    flat: FloatArray
    cones: IntArray
    cone_curvatures: FloatArray
    vertex_numbers: IntArray
    face_numbers: IntArray
    left_out: int
    scales: dict[str, ColorScale]
    own: Quantity | None


@dataclass(frozen=True, eq=False)
class Model:
    """The surface of a result, whatever its layout: n vertices, v of which have triangles.

    Attributes:
        mesh: the mesh.
        used: (v,) the vertices that have triangles.
        places: (v, 3) these, moved and scaled into the unit ball.
        centre, radius: where the ball lies in the model's units.
        curvature: (v,) in units of pi; NaN on the boundary.
        outward: 1 if triangles run anticlockwise seen from outside, else -1.
    """

    mesh: TriangleMesh
    used: IntArray
    places: FloatArray
    centre: FloatArray
    radius: float
    curvature: FloatArray
    outward: int

    @classmethod
    def of(cls, result: Flattening) -> Model:
        """Return the surface of a result."""
        mesh = TriangleMesh(result.vertices, result.faces)
        is_used = np.zeros(len(mesh.vertices), dtype=bool)
        is_used[mesh.faces] = True
        used = np.flatnonzero(is_used)
        places, centre, radius = _into_unit_ball(result.vertices[used])
        curvature = missing_angles(result, False, mesh)[used] / np.pi
        number = np.cumsum(is_used) - 1
        corners = places[number[mesh.faces]]
        centroids = corners.mean(axis=1)
        # Normals point away from the middle, by and large.
        away = (centroids - centroids.mean(axis=0)) * np.cross(*sides(corners))
        outward = -1 if float(away.sum()) < 0 else 1
        return cls(mesh, used, places, centre, radius, curvature, outward)

    def is_of(self, result: Flattening) -> bool:
        """Return whether it is the surface of a result."""
        mesh = self.mesh
        return np.array_equal(mesh.faces, result.faces) and np.array_equal(mesh.vertices, result.vertices)


def content_of(
    result: Flattening, most: int, model: Model | None = None, own: Quantity | None = None
) -> Content:
    """Return what a page shows, with at most so many triangles.

    Args:
        result: what is shown.
        most: triangles.
        model: its surface, if something knows it already.
        own: numbers of the user's own.

    Raises:
        ArrayShapeError: the result has no UVs, or no triangles.
        MeshError: it cannot be thinned to so few triangles.
        OptionError: `most` is not positive.
    """
    if most < 1:
        raise OptionError(f"a page shows at least one triangle, not {most}")
    if not len(result.faces) or not len(result.uv) or np.shape(result.uv_faces) != np.shape(result.faces):
        raise ArrayShapeError(
            f"there is nothing to show: {len(result.faces):,} triangles, {len(result.uv):,} UV points and "
            f"{len(result.uv_faces):,} triangles of them"
        )
    split, model = split_at_seams(result), Model.of(result) if model is None else model
    used, places = model.used, model.places
    vertex = np.searchsorted(used, split.own)
    outline, seams = outline_halfedges(model.mesh, split.faces)
    chart = _charts(split.faces, split.uv)
    qc, scale = conformal_distortion(result), stretch(result)
    flat_curvature = missing_angles(result, True, model.mesh)[used] / np.pi
    cone = np.searchsorted(used, result.cones)

    # Of all there is, every point is of a triangle, and every vertex has one.
    shown, faces = np.arange(len(split.faces)), split.faces
    points, vertices, point_vertex = np.arange(len(split.uv)), np.arange(len(used)), vertex
    if len(shown) > most:
        kept = np.zeros(len(split.uv), dtype=bool)
        for end in end_corners(outline):
            kept[split.faces.reshape(-1)[end]] = True
        kept |= np.isin(vertex, cone)
        shown, corners = thin(places[vertex], split.uv, split.faces, kept, most)
        # Those at outlines all stay: their third corner is merged with none of the other two.
        outline = 3 * np.searchsorted(shown, outline // 3) + outline % 3
        points, faces = np.unique(corners, return_inverse=True)
        vertices, point_vertex = np.unique(vertex[points], return_inverse=True)
    numbers = np.arange(len(result.vertices)) if result.vertex_origin is None else result.vertex_origin
    scales = _scales(qc, scale, model.curvature)
    if own is not None:
        colors = "diverging" if own.scale.low < 0 < own.scale.high else "sequential"
        scales = {"own": replace(own.scale, colors=colors), **scales}
        own = replace(own, values=own.values[shown if own.corners is None else used[vertices]])
    return Content(
        model=model,
        places=places[vertices],
        point_vertex=point_vertex.reshape(-1),
        uv=split.uv[points],
        uv_side=cell_side(split.uv, split.faces, 1.0),
        faces=faces.reshape(-1, 3),
        outline=outline,
        seams=seams,
        chart=chart[shown],
        qc=qc.values[shown],
        area=scale.values[shown],
        curvature=model.curvature[vertices],
        flat=flat_curvature[vertices],
        cones=np.searchsorted(vertices, cone),
        cone_curvatures=result.curvatures,
        vertex_numbers=numbers[used[vertices]],
        face_numbers=shown,
        left_out=len(split.faces) - len(shown),
        scales=scales,
        own=own,
    )


def _scales(qc: Quantity, area: Quantity, curvature: FloatArray) -> dict[str, ColorScale]:
    """Return the scale of each colour map of a page; both curvatures have that of the model.

    That scale has four decades to either side of zero; almost all curvatures lie within its ends.

    Args:
        qc, area: distortion.
        curvature: of the model, in units of pi.
    """
    amounts = np.abs(curvature[np.isfinite(curvature) & (curvature != 0)])
    largest = float(np.percentile(amounts, 99.9)) if len(amounts) else 1.0
    top = int(np.clip(np.ceil(np.log10(largest)), -12, 1))
    superscripts = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
    powers = (top, top - 2)
    ticks = [(10.0**power, f"10{str(power).translate(superscripts)}" if power else "1") for power in powers]
    both = [*((-value, f"−{label}") for value, label in ticks), (0.0, "0"), *reversed(ticks)]
    bent = ColorScale(10.0 ** (top - 4), 10.0**top, "diverging", "signed log", tuple(both))
    return {
        "qc": replace(qc.scale, colors="sequential"),
        "area": replace(area.scale, colors="diverging"),
        "curvature": bent,
        "flat": bent,
    }


def outline_halfedges(mesh: TriangleMesh, uv_faces: IntArray) -> tuple[IntArray, int]:
    """Return the half-edges on the outlines of charts, and how many seams are among them.

    Seams come first, the two half-edges of each together, then the half-edges of the boundary.
    """
    seams = mesh.edge_halfedges[point_seams(mesh, uv_faces)]
    boundary = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
    return np.concatenate([seams.reshape(-1), boundary]), len(seams)


def _into_unit_ball(vertices: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    centre = low + (high - low) / 2
    centred = vertices - centre
    # The largest coordinate first, or squares could overflow.
    size = float(np.abs(centred).max()) or 1.0
    radius = size * float(np.sqrt(((centred / size) ** 2).sum(axis=1).max())) or 1.0
    return centred / radius, centre, radius


def _charts(faces: IntArray, uv: FloatArray) -> IntArray:
    """Return (m,) the chart of each triangle, numbered from the one with the largest area."""
    count, chart = label_faces(faces, len(uv))
    areas = np.abs(signed_double_areas(uv[faces]))
    rank = np.full(count, -1, dtype=np.int64)
    rank[np.argsort(-np.bincount(chart, weights=areas, minlength=count), kind="stable")] = np.arange(count)
    return rank[chart]
