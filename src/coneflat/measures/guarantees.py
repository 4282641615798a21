"""Checks of the guarantees of a flattening; a note reports each unmet guarantee."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray, mask_of, unit_exponent
from ..base.notes import Unmet
from ..base.text import list_some, plural
from ..geometry.overlap import Overlaps
from ..geometry.planar import sides_between, signed_double_areas
from ..mesh.connectivity import TriangleMesh, are_among, label_faces
from ..mesh.polygons import polygon_of
from .distortion import angle_sum_errors, measure, measure_map
from .report import MAP_MEASURES
from .seam_data import Rotations, seam_rotations

if TYPE_CHECKING:
    from ..result import Flattening

# Relative rounding of a double, and of the 32-bit numbers of GLB files.
DOUBLE, SINGLE = (float(np.finfo(kind).epsneg) for kind in (np.float64, np.float32))
# Error of points, in roundings, up to which no note is given: of the coordinates, and of what rotates and moves them.
MAX_ROUNDINGS = 4
# Tolerance of a layout in addition to rounding: radians, or relative to a length. Metrics are solved to about 1e-11.
EXACT_TOLERANCE = 1e-8
# Radians, for methods without exact angles: a vertex around which triangles wind twice has an error of 2 pi.
WINDING_TOLERANCE = 1.0
# Mean QC, and QC exceeded on 5% of the area, above which a layout is unsuitable for most uses even though all triangles
# are positively oriented. Single triangles are worse on many models.
EXTREME_QC, EXTREME_TAIL = 1.25, 2.0
# QC distortion of a triangle that is named, whatever the others have.
NEEDLE_QC = 1e3
# Tolerance of the turning angle of a round boundary at a vertex: radians, as it is solved iteratively, plus a fraction
# of the turning angle of a circle, which is not visible.
NOT_ROUND, NOT_ROUND_SHARE = 1e-6, 0.02
# Relative difference of the areas of the front and the back of a chart.
SAME_AREA = 1e-6
# Tolerated relative difference of the sides of marked seams for methods without a flat metric.
ROUGH_TOLERANCE = 0.01


def unmet_guarantees(
    result: Flattening, unit: float = DOUBLE, mesh: TriangleMesh | None = None
) -> tuple[Unmet, ...]:
    """Return a note, one sentence, for each guarantee of the options that a result does not meet.

    Args:
        result: the result with its measures.
        unit: relative rounding of the coordinates.
        mesh: a mesh with the result's faces, whose connectivity is reused, if there is one.
    """
    mesh = TriangleMesh(result.vertices, result.faces) if mesh is None else mesh.moved_to(result.vertices)
    notes = (
        *_undefined(result),
        *_orientation(result),
        *_overlaps(result),
        *_angle_sums(result, unit, mesh),
        *_equal_sides(result, unit, mesh),
        *_boundary_lengths(result, unit, mesh),
        *_round_boundary(result, unit, mesh),
        *_seam_rotations(result, unit, mesh),
        *_distortion(result),
    )
    return tuple(map(Unmet, notes))


def remeasured(
    result: Flattening,
    changed: Flattening,
    unit: float,
    notes: tuple[str, ...] = (),
    overlaps: Overlaps | None = None,
) -> Flattening:
    """Return a changed result, measured again, with updated notes.

    Args:
        result: the result before the change.
        changed: the changed result, with the measures and notes of the original.
        unit: relative rounding of its coordinates.
        notes: further notes to add.
        overlaps: the overlaps of its triangles; None to compute them.
    """
    old_notes = unmet_guarantees(result)
    old = result.distortion
    # Scaling by a power of two avoids underflow and overflow of squared lengths.
    exponent = -unit_exponent(changed.vertices[changed.faces])
    is_measured = first_faces(changed)
    is_stacked = not is_measured.all()
    points = np.ldexp(changed.vertices, exponent)
    distortion = measure(
        TriangleMesh(points, changed.faces[is_measured]),
        changed.corner_uv[is_measured],
        (old.curvature_error, old.curvature_error_max),
        changed.cones,
        changed.prescribed,
        None if is_stacked else overlaps,
        None if changed.lengths is None else np.ldexp(changed.lengths, exponent),
    )
    if is_stacked:
        local = measure_map(TriangleMesh(points, changed.faces), changed.corner_uv)
        distortion = replace(distortion, qc=local.qc, log_area_scale=local.log_area_scale)
    distortion = distortion.rescaled(exponent * float(np.log(2)))
    changed = replace(changed, distortion=distortion, rotations=_rotations(result, changed))
    lasting = tuple(note for note in result.notes if note not in old_notes)
    return replace(changed, notes=(*lasting, *unmet_guarantees(changed, unit), *notes))


def first_faces(result: Flattening) -> BoolArray:
    """Return (m,) True for the faces that are measured: of several polygons that share their texels, the first.

    Halves and copies of a model that share texels by choice do not overlap each other.
    """
    plane, is_first = result.settings.get("mirror_plane"), np.ones(len(result.faces), dtype=bool)
    if plane is not None:
        is_first = result.vertices[result.faces].mean(axis=1) @ plane[:3] > plane[3]
    elif result.settings.get("stack") == "copies":
        polygons = _polygons_of(result)
        fronts = np.flatnonzero(~_is_back(result))
        first = _first_polygons(polygons[fronts], result.uv_faces[fronts])
        is_first = mask_of(len(is_first), fronts[np.isin(polygons[fronts], first)])
    return np.asarray(is_first)


def _polygons_of(result: Flattening) -> IntArray:
    """Return (m,) the polygon of the file that each triangle belongs to; without a file, each is a polygon."""
    if result.source is None or result.face_corners is None:
        return np.arange(len(result.faces))
    return polygon_of(result.face_corners, result.source.offsets)


def _first_polygons(polygons: IntArray, uv_faces: IntArray) -> IntArray:
    """Return the polygons at points of the plane that no polygon before has, in whichever triangles they are split.

    Args:
        polygons: (m,) the polygon of each triangle.
        uv_faces: (m, 3) the points of the triangles.
    """
    count = int(uv_faces.max(initial=-1)) + 1
    polygon, point = np.divmod(np.unique(np.repeat(polygons, 3) * count + uv_faces.ravel()), max(count, 1))
    names, starts, sizes = np.unique(polygon, return_index=True, return_counts=True)
    first = list[IntArray]()
    for size in np.unique(sizes):
        of_size = np.flatnonzero(sizes == size)
        points = point[starts[of_size, None] + np.arange(size)]
        first.append(names[of_size[np.unique(points, axis=0, return_index=True)[1]]])
    return np.concatenate(first) if first else np.empty(0, dtype=np.int64)


def _is_back(result: Flattening) -> BoolArray:
    """Return (m,) True for the faces that are the back of others, at the same points with the opposite orientation.

    Polygons of the back may be split along other diagonals, so whole components are compared: half of their area in a
    chart is flipped, or all of it while another component is not.
    """
    count, chart = label_faces(result.uv_faces, len(result.uv))
    component = label_faces(result.faces, len(result.vertices))[1]
    part = np.unique(component * count + chart, return_inverse=True)[1].ravel()
    areas = signed_double_areas(result.corner_uv)
    sizes, sums = (np.bincount(part, values) for values in (np.abs(areas), areas))
    is_doubled, is_mirrored = (np.abs(sums) <= SAME_AREA * sizes)[part], (sums < -SAME_AREA * sizes)[part]
    has_front = np.bincount(chart, ~is_mirrored, count) > 0
    return np.asarray((is_doubled & (areas < 0)) | (is_mirrored & has_front[chart]))


def _rotations(result: Flattening, changed: Flattening) -> Rotations | None:
    """Return the rotations of seams after small changes of the points, with the worst deviation measured again."""
    before = result.rotations
    if before is None:
        return None
    old_mesh, new_mesh = (TriangleMesh(layout.vertices, layout.faces) for layout in (result, changed))
    off, after = (
        seam_rotations(mesh, layout.corner_uv, before.quantum)
        for mesh, layout in ((old_mesh, result), (new_mesh, changed))
    )
    # Polygons may have other diagonals, so edges are identified by their ends.
    edges_before, edges = (mesh.edges[~mesh.is_boundary_edge] for mesh in (old_mesh, new_mesh))
    bound = ~are_among(edges, edges_before[~before.binds(off)])
    return replace(before, worst=float(after[bound].max(initial=0.0)))


def _is_exact(result: Flattening) -> bool:
    """Return whether the layout has the angles and seams of an exact flat metric, not a least squares fit."""
    return result.settings.get("method") == "exact"


def _undefined(result: Flattening) -> Iterator[str]:
    """Yield a note if measures of the map are not numbers."""
    values = {name: getattr(result.distortion, name) for name in MAP_MEASURES}
    yield from undefined_measures(values, result.distortion.qc)


def undefined_measures(values: Mapping[str, float], qc: FloatArray) -> tuple[Unmet, ...]:
    """Return a note on the measures that are not numbers, which is so if no triangle has area.

    Args:
        values: the measures by name.
        qc: (m,) the QC of each triangle, NaN for those without area.
    """
    names = [name for name, value in values.items() if not np.isfinite(value)]
    if not names:
        return ()
    count = int(np.count_nonzero(np.isfinite(qc)))
    return (
        Unmet(
            f"Measures that are not defined: {', '.join(names)}; {count:,} of {plural(len(qc), 'triangle')} have area "
            "on the model and in the plane."
        ),
    )


def _orientation(result: Flattening) -> Iterator[str]:
    measures = result.distortion
    kinds = ((measures.flipped, "flipped triangle"), (measures.degenerate, "degenerate triangle"))
    parts = [plural(count, noun) for count, noun in kinds if count]
    if parts:
        advice = "refine the mesh there" if _is_exact(result) else "method exact gives the fewest"
        verb, broken = "is" if parts[0].startswith("1 ") else "are", result.solve.broken
        reason = (
            f" ({plural(broken, 'triangle')} broke the triangle inequality in the metric)" if broken else ""
        )
        yield f"There {verb} {' and '.join(parts)} in the plane{reason}: {advice}."


def _overlaps(result: Flattening) -> Iterator[str]:
    count, share = result.distortion.overlapping_pairs, result.distortion.overlap
    if result.settings.get("charts") not in ("one", None) and count:
        verb = "overlaps" if count == 1 else "overlap"
        yield f"{plural(count, 'pair')} of triangles {verb} in the atlas, on {share:.2g} of the covered area."


def _angle_sums(result: Flattening, unit: float, mesh: TriangleMesh) -> Iterator[str]:
    largest = result.distortion.angle_sum_error
    tolerance = EXACT_TOLERANCE if _is_exact(result) else WINDING_TOLERANCE
    if not largest > tolerance:
        return
    errors, change = angle_sum_errors(mesh, result.corner_uv, result.prescribed)
    with np.errstate(invalid="ignore"):
        off = np.flatnonzero(np.abs(errors) > tolerance + MAX_ROUNDINGS * unit * change)
    if len(off):
        worst = off[np.argmax(np.abs(errors[off]))]
        yield (
            f"Around {plural(len(off), 'vertex', 'vertices')} the angle sum differs from its target: most at vertex "
            f"{worst}, by {errors[worst]:+.3g} rad."
        )


def _equal_sides(result: Flattening, unit: float, mesh: TriangleMesh) -> Iterator[str]:
    settings = result.settings
    is_marked = any(settings.get(name) is not None for name in ("seams", "sharp_angle"))
    is_tied = is_marked and settings.get("method") != "free seams"
    tolerance = EXACT_TOLERANCE if _is_exact(result) else ROUGH_TOLERANCE if is_tied else np.inf
    if not np.isfinite(tolerance):
        return
    # Also edges whose sides are so close that they are measured as no seam.
    first, second = (
        np.abs(sides_between(result.corner_uv)).ravel()[mesh.edge_halfedges[~mesh.is_boundary_edge]].T
    )
    off, mean = np.abs(first - second), (first + second) / 2
    beyond = off > tolerance * mean + MAX_ROUNDINGS * unit
    if beyond.any():
        worst = (off[beyond] / mean[beyond]).max()
        yield f"The two sides of seams differ in length: relative difference up to {worst:.2g}."


def _boundary_lengths(result: Flattening, unit: float, mesh: TriangleMesh) -> Iterator[str]:
    if result.settings.get("boundary") != "lengths":
        return
    sides = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
    # Scaling by a power of two avoids underflow of squares.
    exponent = unit_exponent(mesh.vertices)
    sides_in_space = np.ldexp(mesh.vertices[mesh.heads[sides]] - mesh.vertices[mesh.tails[sides]], -exponent)
    lengths = np.linalg.norm(sides_in_space, axis=1) * np.ldexp(result.uv_scale, exponent)
    if result.lengths is not None:
        lengths = result.lengths.ravel()[sides] * result.uv_scale
    off = np.abs(np.abs(sides_between(result.corner_uv).ravel()[sides]) - lengths)
    beyond = off > EXACT_TOLERANCE * lengths + MAX_ROUNDINGS * unit
    if beyond.any():
        worst = (off[beyond] / np.maximum(lengths[beyond], np.finfo(float).tiny)).max()
        yield f"Lengths along the boundary are not preserved: relative difference up to {worst:.2g}."


def _round_boundary(result: Flattening, unit: float, mesh: TriangleMesh) -> Iterator[str]:
    """Yield a note if the turning angle of a round boundary is not uniform along its length in the plane."""
    boundary = result.settings.get("boundary", "free")
    if boundary != "disk" and isinstance(boundary, str):
        return
    count, loop = mesh.boundary_loops
    if isinstance(boundary, Mapping):
        origin = np.arange(len(loop)) if result.vertex_origin is None else result.vertex_origin
        on_straight = loop[np.isin(origin, list(boundary)) & (loop >= 0)]
        loop = np.where(np.isin(loop, on_straight), -1, loop)
    on_round = np.flatnonzero((loop >= 0) & np.isfinite(result.prescribed))
    if not len(on_round):
        return
    missing, change = angle_sum_errors(mesh, result.corner_uv, np.where(loop >= 0, 0.0, np.nan))
    edges = mesh.is_boundary_edge
    sides = np.abs(sides_between(result.corner_uv)).ravel()[mesh.edge_halfedges[edges, 0]]
    share = np.bincount(mesh.edges[edges].ravel(), np.repeat(sides / 2, 2), len(loop))
    turns = np.bincount(loop[on_round], -missing[on_round], count)[loop[on_round]]
    around = np.bincount(loop[on_round], share[on_round], count)[loop[on_round]]
    even = turns * share[on_round] / np.maximum(around, np.finfo(float).tiny)
    off = (
        np.abs(-missing[on_round] - even)
        - MAX_ROUNDINGS * unit * change[on_round]
        - NOT_ROUND_SHARE * np.abs(even)
    )
    worst = int(np.argmax(off))
    if off[worst] > NOT_ROUND:
        yield (
            f"The boundary is not a circle: at vertex {on_round[worst]} it turns by "
            f"{-missing[on_round[worst]]:.3g} rad instead of {even[worst]:.3g} rad."
        )


def _seam_rotations(result: Flattening, unit: float, mesh: TriangleMesh) -> Iterator[str]:
    rotations = result.rotations
    if rotations is None or not rotations.worst > EXACT_TOLERANCE:
        return
    sides = np.abs(sides_between(result.corner_uv)).ravel()
    shorter = sides[mesh.edge_halfedges[~mesh.is_boundary_edge]].min(axis=1)
    off = seam_rotations(mesh, result.corner_uv, rotations.quantum)
    off = np.where(rotations.binds(off), off, 0.0)
    if (off * shorter > EXACT_TOLERANCE * shorter + MAX_ROUNDINGS * unit).any():
        along = np.abs(rotations.handles).max(initial=0.0) > EXACT_TOLERANCE
        advice = ", also along handles: use correct_handles=True" if along else ""
        yield f"Seam rotations are {rotations.worst:.2g} rad off multiples of {rotations.quantum:.4g} rad{advice}."


def _distortion(result: Flattening) -> Iterator[str]:
    measures = result.distortion
    if measures.qc_mean > EXTREME_QC or measures.qc_p95 > EXTREME_TAIL:
        cure = ["more cones", "smaller triangles"]
        if result.settings.get("boundary", "free") != "free":
            cure.insert(0, "a free boundary")
        yield (
            f"Angle distortion is high: the mean QC distortion is {measures.qc_mean:.3g}, and above "
            f"{measures.qc_p95:.3g} on 5% of the area; {', '.join(cure[:-1])} or {cure[-1]} would lower it."
        )
    needles = np.flatnonzero(measures.qc > NEEDLE_QC)
    if len(needles):
        yield (
            f"{plural(len(needles), 'triangle')} with a QC distortion above {NEEDLE_QC:g}: {list_some(needles)}; up to "
            f"{measures.qc_max:.2g}. Remesh there if this area is visible."
        )
