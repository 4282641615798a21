"""What a flattening promises, held against what it is: a note on everything that is not kept."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from .distortion import angle_sum_errors, seam_sides, seams_of
from .mesh import TriangleMesh
from .options import UNFOLDED
from .rotations import seam_rotations
from .text import plural

if TYPE_CHECKING:
    from .result import Flattening

# Of a double, and of the 32-bit numbers of GLB files, relative to 1.
DOUBLE, SINGLE = 2.0**-53, 2.0**-24
# Points are off by so many roundings: of the coordinates, and of what turned, moved and scaled them.
ROUNDINGS = 8
# Radians, or parts of a length, that a layout may be off by beside rounding. Metrics are solved to about 1e-11.
EXACT = 1e-6
# Radians for methods that have no exact angles: a vertex that triangles go around twice is off by 2 pi.
WINDING = 1.0
# Mean of QC, and what a twentieth of the area is above, from which on a layout is unfit for most uses, though every
# triangle is upright. Single triangles are worse on many models.
EXTREME_QC, EXTREME_TAIL = 1.25, 2.0
# Lengths that are not told from 0.
TINY = float(np.finfo(np.float64).tiny)
# Relative difference of the sides of marked seams that methods without a flat metric are let go.
ROUGH = 0.01


def broken_promises(result: Flattening, unit: float = DOUBLE) -> tuple[str, ...]:
    """Return what a result does not keep of what its options promise, one sentence each.

    Args:
        result: with its measures.
        unit: rounding of the coordinates, relative to 1.
    """
    return (
        *_upright(result),
        *_apart(result),
        *_angle_sums(result, unit),
        *_equal_sides(result, unit),
        *_boundary_lengths(result, unit),
        *_whole_turns(result, unit),
        *_distortion(result),
    )


def _is_exact(result: Flattening) -> bool:
    """Whether angles and seams are those of a flat metric, for which no least squares stand in."""
    return result.settings.get("method") in UNFOLDED


def _upright(result: Flattening) -> Iterator[str]:
    measures = result.distortion
    parts = [
        plural(count, f"triangle {what}", f"triangles {what}")
        for count, what in (
            (measures.flipped, "upside down in the plane"),
            (measures.degenerate, "without area there"),
        )
        if count
    ]
    if parts:
        advice = (
            "refine (--refine), which cannot invert any" if _is_exact(result) else "--method exact has fewest"
        )
        verb, broken = "is" if parts[0].startswith("1 ") else "are", result.solve.broken
        why = f" ({plural(broken, 'triangle')} broke the triangle inequality in the metric)" if broken else ""
        yield f"There {verb} {' and '.join(parts)}{why}: {advice}."


def _apart(result: Flattening) -> Iterator[str]:
    measures = result.distortion
    if result.settings.get("charts") == "atlas" and measures.overlapping_pairs:
        pairs = plural(measures.overlapping_pairs, "pair")
        yield f"{pairs} of triangles overlap in the atlas, {measures.overlap:.2g} of the area that it covers."


def _angle_sums(result: Flattening, unit: float) -> Iterator[str]:
    largest = result.distortion.angle_sum_error
    most = EXACT if _is_exact(result) else WINDING
    if not largest > most:
        return
    mesh = TriangleMesh(result.vertices, result.faces)
    errors, change = angle_sum_errors(mesh, result.corner_uv, result.prescribed)
    with np.errstate(invalid="ignore"):
        off = np.flatnonzero(np.abs(errors) > most + ROUNDINGS * unit * change)
    if len(off):
        worst = off[np.argmax(np.abs(errors[off]))]
        yield (
            f"Around {plural(len(off), 'vertex', 'vertices')} the angles do not sum to what they are to be: vertex "
            f"{worst} is the worst, {errors[worst]:+.3g} rad off."
        )


def _equal_sides(result: Flattening, unit: float) -> Iterator[str]:
    settings = result.settings
    marked = settings.get("seams") is not None or settings.get("sharp_angle") is not None
    most = EXACT if _is_exact(result) else ROUGH if marked else np.inf
    if not result.distortion.seam_mismatch_max > most:
        return
    mesh = TriangleMesh(result.vertices, result.faces)
    here, there = seam_sides(mesh, result.corner_uv, seams_of(mesh, result.corner_uv))
    mean = np.maximum((here + there) / 2, TINY)
    off = np.abs(here - there) / mean
    off = off[off > most + ROUNDINGS * unit / mean]
    if len(off):
        yield f"The two sides of seams differ in length, by up to {off.max():.2g} of it."


def _boundary_lengths(result: Flattening, unit: float) -> Iterator[str]:
    if result.settings.get("boundary") != "lengths":
        return
    mesh = TriangleMesh(result.vertices, result.faces)
    sides = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
    tails, heads = mesh.tails[sides], mesh.heads[sides]
    flat = (
        result.uv[result.uv_faces[sides // 3, (sides + 2) % 3]]
        - result.uv[result.uv_faces[sides // 3, (sides + 1) % 3]]
    )
    # By a power of two, lest squares underflow.
    exponent = int(np.frexp(np.abs(mesh.vertices).max())[1])
    ways = np.ldexp(mesh.vertices[heads] - mesh.vertices[tails], -exponent)
    lengths = np.maximum(np.linalg.norm(ways, axis=1) * np.ldexp(result.uv_scale, exponent), TINY)
    off = np.abs(np.linalg.norm(flat, axis=1) - lengths) / lengths
    off = off[off > EXACT + ROUNDINGS * unit / lengths]
    if len(off):
        yield f"Lengths along the boundary are not kept: they differ by up to {off.max():.2g} of them."


def _whole_turns(result: Flattening, unit: float) -> Iterator[str]:
    rotations = result.rotations
    if rotations is None or not rotations.worst > EXACT:
        return
    mesh = TriangleMesh(result.vertices, result.faces)
    seams = seam_rotations(mesh, result.corner_uv, rotations.quantum)
    off = seams.off[rotations.binds(seams.off) & (seams.off > EXACT + ROUNDINGS * unit * seams.change)]
    if not len(off):
        return
    along = np.abs(rotations.handles).max(initial=0.0) > EXACT
    advice = ", as loops along handles do: correct them (--correct-handles)" if along else ""
    yield f"Seams turn by up to {off.max():.2g} rad beside multiples of the quantum{advice}."


def _distortion(result: Flattening) -> Iterator[str]:
    measures = result.distortion
    if measures.qc_mean > EXTREME_QC or measures.qc_p95 > EXTREME_TAIL:
        cure = ["more cones", "smaller triangles"]
        if result.settings.get("boundary", "free") != "free":
            cure.insert(0, "a free boundary")
        if result.solve.euclidean_flips + result.solve.ptolemy_flips and not result.solve.refined_triangles:
            cure.append("--refine")
        yield (
            f"Angles are far from kept: the mean QC distortion is {measures.qc_mean:.3g}, a twentieth of the area is "
            f"above {measures.qc_p95:.3g}; {', '.join(cure[:-1])} or {cure[-1]} would lower it."
        )
