"""Measures of the existing UVs of a mesh, made by any program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from .. import Distortion, TriangleMesh, check_mesh
from ..base import FloatArray, IntArray, Unmet, mask_of, plural, unit_exponent, warns
from ..errors import MissingUVError
from ..geometry import MAX_CELLS, approximate_overlap_areas, find_overlaps, signed_double_areas
from ..io import UVMesh, as_uv_mesh
from ..measures import MAP_MEASURES, measure_map, path_text, sum_angles, undefined_measures
from ..mesh import CheckedMesh, corner_fans, end_corners, joined_edges, label_faces, left_out
from ..source import at_unit_size, rounding_notes

Values = TypeVar("Values", FloatArray, IntArray)

#: Limit of overlapping pairs, per triangle and at least. With more pairs, areas are counted in pixels, because the
#: number of pairs can be quadratic.
MAX_PAIRS_EACH, MIN_PAIRS = 8, 10_000

#: Limit of the number of unit squares: integers up to it are exact in JSON.
MAX_TILES = 2**53

#: Measures in addition to those of a map.
COUNTS = (
    "vertices",
    "polygons",
    "triangles",
    "triangles_without_uv",
    "corners_without_uv",
    "corners_not_finite",
    "outside",
    "textures",
    "tiles",
    "packing_efficiency",
    "box_efficiency",
    "angle_sum_error",
)
#: Names of all measures, as in the report.
MEASURED = COUNTS + MAP_MEASURES


@dataclass(frozen=True, eq=False)
class UVMeasures:
    """Measures of the UVs of a mesh.

    Attributes:
        mesh: the measured mesh: the m triangles that have UVs, as a manifold.
        corner_uv: (m, 3, 2) their UVs.
        distortion: as for a flattening, without curvature errors.
        counts: the other measures by name; see `report`.
        notes: what the measures leave out, and repairs of the mesh, one sentence each.
        path: path of the file, if there is one.
        face_corners: (m, 3) the polygon corner of the file at each triangle corner, if there is one.

    Examples:
        >>> vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
        >>> faces = np.array([[0, 1, 2], [0, 2, 3]])
        >>> measures = coneflat.measure_uv(vertices, faces, vertices[faces][:, :, :2])
        >>> measures.counts["triangles"], measures.report()["flipped"], measures.notes
        (2, 0, ())
    """

    mesh: TriangleMesh
    corner_uv: FloatArray
    distortion: Distortion
    counts: Mapping[str, float]
    notes: tuple[str, ...]
    path: Path | None = None
    face_corners: IntArray | None = None

    def report(self) -> dict[str, Any]:
        """Return all measures as plain Python values, ready for JSON; unknown values are None.

        In addition to the measures of the map in `Flattening.report`, these are: `triangles_without_uv`;
        `corners_without_uv` and `corners_not_finite`, numbers of polygon corners; `outside`, the number of triangles
        that are not inside the unit square; `textures`, the number of images that materials have; `tiles`, the number
        of unit squares that contain charts, of all textures, and at least the covered area;
        `packing_efficiency`, the covered fraction of these;
        `box_efficiency`, the area of all triangles over the area of the smallest axis-aligned square around them, or
        around those of each texture; `angle_sum_error`, the largest difference between the angle
        sum at a point inside a chart and a full turn, radians.
        """
        return {
            "input": None if self.path is None else path_text(self.path),
            **{name: value if np.isfinite(value) else None for name, value in self.values().items()},
            "notes": list(self.notes),
        }

    def values(self) -> dict[str, float]:
        """Return the measures by name; unknown values are NaN."""
        return {**self.counts, **{name: getattr(self.distortion, name) for name in MAP_MEASURES}}

    def __repr__(self) -> str:
        d = self.distortion
        overlap = f"{d.overlap:.3g}" if d.overlapping_pairs else "none"
        return (
            f"<UVMeasures: {plural(len(self.mesh.faces), 'triangle')}, {plural(d.charts, 'chart')}, "
            f"QC {d.qc_mean:.4f}, {d.flipped:,} flipped, overlap {overlap}>"
        )


@warns("measures.notes")
def measure_uv(
    mesh: Any,
    faces: ArrayLike | None = None,
    corner_uv: ArrayLike | None = None,
    *,
    weld: bool | None = None,
    strict: bool = False,
    uv_set: int = 0,
) -> UVMeasures:
    """Measure the existing UVs of a mesh, made by any program.

    Polygons are measured as fans of triangles, as most programs split them. A mesh that is not manifold is repaired as
    in `flatten` before it is measured, but overlaps are those of all triangles. Corners without UVs are counted.

    Args:
        mesh: a path of a mesh with UVs, or of a result (.npz); a `MeshFile`, a `Flattening`; or vertices
            (n, 3) with
        faces: (m, 3) vertex indices, and
        corner_uv: (m, 3, 2) the UV of every triangle corner, v upwards; NaN where there is none.
        weld: of a path: True merges all vertices at the same position, False none; None merges them in formats that
            cannot share vertices, and joins coinciding borders in the others.
        strict: raise an error for a mesh that is not manifold.
        uv_set: of a path of a glTF: 0 for TEXCOORD_0, 1 for TEXCOORD_1, as of lightmaps, and so on. The charts of a set
            other than the first are in one texture, whatever the images of the materials are.

    Returns:
        The measures.

    Raises:
        MissingUVError: there are no UVs, or no finite ones.
        OptionError: `uv_set` is not an integer from 0 on, or is given without a path.
        MeshError: the input is not a mesh.
        MeshFileError: the file cannot be read.

    Examples:
        >>> vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
        >>> faces = np.array([[0, 1, 2], [0, 2, 3]])
        >>> coneflat.measure_uv(vertices, faces, vertices[faces][:, :, :2])
        <UVMeasures: 2 triangles, 1 chart, QC 1.0000, 0 flipped, overlap none>
    """
    return measure_mapped(as_uv_mesh(mesh, faces, corner_uv, weld, uv_set), strict=strict)


def measure_mapped(mapped: UVMesh, *, strict: bool = False) -> UVMeasures:
    """Return the measures of triangles with UVs.

    Raises:
        MissingUVError: no triangle has finite UVs at all corners.
        MeshError: there is no mesh to measure, or, if strict, it is not manifold.
    """
    has_uv = mapped.has_uv
    checked, corner_uv = surface_of(mapped, strict=strict)
    exponent = unit_exponent(corner_uv)
    unit = np.ldexp(corner_uv, -exponent)
    scaled = at_unit_size(checked)
    texture = np.zeros(len(has_uv), np.int64) if mapped.texture is None else mapped.texture
    textures = np.unique(texture[has_uv])
    owner = texture[has_uv][checked.face_origin]
    log_scale = (scaled.exponent + exponent) * np.log(2)
    distortion = measure_map(scaled.mesh, unit, texture=owner).rescaled(log_scale)
    all_uv = mapped.corner_uv[has_uv]
    cover = _cover_of_textures(np.ldexp(all_uv, -exponent), texture[has_uv])
    with np.errstate(over="ignore"):  # A value that is not finite is reported as unknown.
        covered = float(np.ldexp(cover.area, 2 * exponent))
    # A chart may extend over several squares.
    tiles = max(_count_tiles(checked.mesh, unit, exponent, owner), round(min(covered, MAX_TILES)))
    counts = {
        "vertices": len(np.unique(mapped.faces)),
        "polygons": mapped.polygons,
        "triangles": len(mapped.faces),
        "triangles_without_uv": int(np.count_nonzero(~has_uv)),
        "corners_without_uv": mapped.without,
        "corners_not_finite": mapped.not_finite,
        "outside": int(((all_uv < 0) | (all_uv > 1)).any(axis=(1, 2)).sum()),
        "textures": len(textures),
        "tiles": tiles,
        "packing_efficiency": covered / tiles,
        "box_efficiency": cover.box_efficiency,
        "angle_sum_error": angle_sum_error(checked.mesh, unit),
    }
    measures = UVMeasures(
        mesh=checked.mesh,
        corner_uv=corner_uv,
        distortion=replace(distortion, overlap=cover.overlap, overlapping_pairs=cover.pairs),
        counts=counts,
        notes=(*mapped.notes, *_notes(mapped, checked), *mapped.texture_notes, *cover.notes),
        path=None if mapped.source is None else mapped.source.path,
        face_corners=None
        if mapped.face_corners is None
        else _reordered(mapped.face_corners[has_uv], checked),
    )
    notes = [*measures.notes, *undefined_measures(measures.values(), distortion.qc)]
    if distortion.degenerate_input or len(checked.mesh.faces) < len(all_uv):
        notes += rounding_notes(mapped.vertices, mapped.faces[has_uv])
    return replace(measures, notes=tuple(notes))


def _count_tiles(mesh: TriangleMesh, unit_uv: FloatArray, exponent: int, texture: IntArray) -> int:
    """Return the number of unit squares of all textures that contain charts.

    Args:
        mesh: m triangles.
        unit_uv: (m, 3, 2) their UVs times 2^-exponent.
        exponent: as above.
        texture: (m,) number of the texture of each.
    """
    points, corners = uv_points(mesh, unit_uv)
    return sum(
        len(chart_tiles(points, corners[texture == number], exponent)) for number in np.unique(texture)
    )


def surface_of(mapped: UVMesh, *, strict: bool = False) -> tuple[CheckedMesh, FloatArray]:
    """Return the triangles with UVs as a manifold mesh, repaired unless strict, and their (m, 3, 2) UVs.

    Raises:
        MissingUVError: no triangle has UVs.
        MeshError: the triangles are not a mesh.
    """
    mapped_faces = np.flatnonzero(mapped.has_uv)
    if not len(mapped_faces):
        raise MissingUVError(
            f"none of {plural(len(mapped.faces), 'triangle')} has finite UVs at all its corners"
        )
    checked = check_mesh(mapped.vertices, mapped.faces[mapped_faces], repair=not strict)
    return checked, _reordered(mapped.corner_uv[mapped_faces], checked)


def _reordered(per_corner: Values, checked: CheckedMesh) -> Values:
    """Return values (m, 3, ...) at triangle corners of the input, rearranged for the faces of the checked mesh."""
    values = per_corner[checked.face_origin]
    values[checked.is_flipped] = values[checked.is_flipped][:, [0, 2, 1]]
    return values


def uv_points(mesh: TriangleMesh, corner_uv: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return (u, 2) the points of the layout and (m, 3) the point of each corner; joined triangles share points."""
    count, fan = corner_fans(mesh.faces, *mesh.edge_halfedges[joined_edges(mesh, corner_uv)].T)
    points = np.empty((count, 2))
    points[fan] = corner_uv
    return points, fan


def angle_sum_error(mesh: TriangleMesh, corner_uv: FloatArray) -> float:
    """Return the largest difference between 2 pi and the angle sum at a point inside a chart, radians; 0 if none.

    It is large at flipped triangles, and where triangles wind around a point twice.
    """
    points, fan = uv_points(mesh, corner_uv)
    joined = mask_of(mesh.faces.size, mesh.edge_halfedges[joined_edges(mesh, corner_uv)])
    inside = np.ones(len(points), dtype=bool)
    for end in end_corners(np.flatnonzero(~joined)):
        inside[fan.reshape(-1)[end]] = False
    sums, change = sum_angles(fan, np.ascontiguousarray(corner_uv), len(points))
    # The angles at a side of zero length are undefined.
    inside &= np.isfinite(change)
    return float(np.abs(sums[inside] - 2 * np.pi).max(initial=0.0))


def chart_tiles(points: FloatArray, faces: IntArray, exponent: int = 0) -> FloatArray:
    """Return (k, 2) the lower left corners of the unit squares (UDIM tiles) that contain the centroids of charts.

    Args:
        points: (u, 2) points of a layout, divided by 2**exponent.
        faces: (m, 3) the points of triangles.
        exponent: a power of two.
    """
    _, chart = np.unique(label_faces(faces, len(points))[1], return_inverse=True)
    corners = points[faces]
    weights = np.abs(signed_double_areas(corners)) + np.finfo(np.float64).tiny
    sums = [np.bincount(chart, weights * corners[..., k].mean(axis=1)) for k in (0, 1)]
    middles = np.stack(sums, axis=1) / np.bincount(chart, weights)[:, None]
    return np.unique(np.floor(np.ldexp(middles, exponent)), axis=0)


class _Cover(NamedTuple):
    """How triangles cover the plane.

    Attributes:
        pairs: number of overlapping pairs.
        overlap: fraction of the covered area that is covered more than once.
        area: covered area.
        total: sum of the areas of the triangles.
        square: area of the smallest axis-aligned square around them.
        notes: one sentence each.
    """

    pairs: int
    overlap: float
    area: float
    total: float
    square: float
    notes: tuple[str, ...] = ()

    @property
    def box_efficiency(self) -> float:
        """Return the area of the triangles over that of the square around them; NaN without area."""
        return self.total / self.square if self.square > 0 else float("nan")


def _cover_of_textures(corner_uv: FloatArray, texture: IntArray) -> _Cover:
    """Return how triangles (m, 3, 2) cover several textures; texture: (m,) that of each triangle."""
    covers = [_cover(corner_uv[texture == number]) for number in np.unique(texture)]
    if len(covers) == 1:
        return covers[0]
    area = sum(cover.area for cover in covers)
    twice = sum(cover.overlap * cover.area for cover in covers)
    note = f"Charts of {len(covers):,} textures: overlaps and packing are those within each texture."
    return _Cover(
        sum(cover.pairs for cover in covers),
        twice / area if area > 0 else 0.0,
        area,
        sum(cover.total for cover in covers),
        sum(cover.square for cover in covers),
        (note, *dict.fromkeys(note for cover in covers for note in cover.notes)),
    )


def _cover(corner_uv: FloatArray) -> _Cover:
    """Return how triangles (m, 3, 2) cover the plane: exactly, or counted in pixels if there are too many pairs."""
    total = float(np.abs(signed_double_areas(corner_uv)).sum()) / 2
    square = float(np.ptp(corner_uv, axis=(0, 1)).max()) ** 2
    limit = max(MIN_PAIRS, MAX_PAIRS_EACH * len(corner_uv))
    overlaps = find_overlaps(corner_uv, limit=limit)
    if np.isfinite(overlaps.fraction):
        area = overlaps.area / overlaps.fraction if overlaps.fraction > 0 else total
        return _Cover(len(overlaps.pairs), overlaps.fraction, area, total, square)
    twice, area = approximate_overlap_areas(corner_uv)
    reason = (
        ""
        if overlaps.complete
        else f"More than {limit:,} pairs of triangles overlap; the rest was not counted. "
    )
    note = Unmet(f"{reason}The overlap was counted in {MAX_CELLS:,} x {MAX_CELLS:,} pixels.")
    return _Cover(len(overlaps.pairs), twice / area if area > 0 else 0.0, area, total, square, (note,))


def _notes(mapped: UVMesh, checked: CheckedMesh) -> tuple[str, ...]:
    """Return notes on what the measures leave out, and on repairs of the mesh."""
    corners = ((mapped.without, "no UV"), (mapped.not_finite, "a UV that is not finite"))
    missing = " and ".join(f"{plural(count, 'corner')} with {defect}" for count, defect in corners if count)
    triangles = plural(int(np.count_nonzero(~mapped.has_uv)), "triangle")
    notes = [f"{missing}: {triangles} left out of the measures."] if missing else []
    repairs = [note for note in checked.notes if note != left_out_of(mapped, checked)]
    if repairs:
        notes.append(f"The mesh was repaired before it was measured: {' '.join(repairs)}")
    return tuple(notes)


def left_out_of(mapped: UVMesh, checked: CheckedMesh) -> str:
    """Return the note on vertices without triangles, which does not concern the measures."""
    return left_out(len(mapped.vertices) - len(np.unique(checked.vertex_origin)))
