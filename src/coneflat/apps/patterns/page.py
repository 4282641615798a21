"""The interactive page of a pattern: pieces with their numbers, seams with their names, darts, and the strain."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ... import Flattening, measure
from ...base import FloatArray, IntArray, plural
from ...measures import angle_sum_errors
from ...stages import SolveStatistics
from ..view import PageParts, PageText, check_page, open_page, page_html, write_page
from .drawing.allowances import polygon_of, shapely
from .drawing.shapes import tails
from .pages.strain_map import percentage, side_strains
from .pieces.borders import Seam
from .report import rows_of
from .result import Pattern

# Strain up to which a pattern is as exact as numbers are.
EXACT = 1e-6


def page_of_pattern(pattern: Pattern, *, name: str = "Pattern", show: str = "charts", **look: Any) -> str:
    """Return the HTML page of a pattern; arguments and errors are those of `page_html`."""
    strain = float(np.abs(pattern.strains).max())
    cuts, noun = (pattern.darts, "dart") if pattern.is_sewn else (pattern.corner_cuts, "corner cut")
    parts = [
        plural(pattern.piece_count, "piece"),
        plural(len(pattern.seams) - len(cuts), "seam"),
        plural(len(cuts), noun),
    ]
    if strain > EXACT:
        parts.append(f"strain {percentage(strain)}")
    text = PageText(title="  ·  ".join(parts), rows=rows_of(pattern))
    return page_html(as_flattening(pattern), name=name, show=show, text=text, parts=parts_of(pattern), **look)


def show_pattern(pattern: Pattern, path: str | PathLike[str] | None) -> Path:
    """Write the page of a pattern, and open it in the browser if no path is given; see `Pattern.view`."""
    if path is not None:
        check_page(path)
    page = write_page(page_of_pattern(pattern), path)
    if path is None:
        open_page(page)
    return page


def as_flattening(pattern: Pattern) -> Flattening:
    """Return the triangles of a pattern with UVs in the unit square; the tips of darts are its cones."""
    surface = pattern.surface
    mesh, points = surface.mesh, surface.points
    extent = float(np.ptp(points, axis=0).max())
    uv = (points - points.min(axis=0)) / extent
    corner_uv = uv[surface.corners]
    unknown, errors = (
        np.full(len(mesh.vertices), np.nan),
        angle_sum_errors(mesh, corner_uv, np.zeros(len(mesh.vertices)))[0],
    )
    tips = _tips(pattern)
    curvatures = -errors[tips]
    errors[tips] = 0.0
    return Flattening(
        vertices=mesh.vertices,
        faces=mesh.faces,
        uv=uv,
        uv_faces=surface.corners,
        uv_scale=1 / extent,
        packing_efficiency=float("nan"),
        cones=tips,
        curvatures=curvatures,
        log_scale=unknown,
        prescribed=unknown,
        curvature_residual=errors,
        seams=mesh.edges[surface.seams],
        distortion=measure(mesh, corner_uv),
        seconds={},
        notes=pattern.notes,
        settings=pattern.settings,
        solve=SolveStatistics(),
    )


def parts_of(pattern: Pattern) -> PageParts:
    """Return what a page shows of the pieces and the seams of a pattern."""
    surface = pattern.surface
    seam_of_edge = np.empty(len(surface.mesh.edges), dtype=np.int64)
    for number, seam in enumerate(pattern.seams):
        seam_of_edge[surface.mesh.halfedge_edges[seam.sides[0].halfedges]] = number
    return PageParts(
        pieces=surface.pieces,
        anchors=_anchors(pattern),
        seams=seam_of_edge[surface.seams],
        seam_names=[seam.name for seam in pattern.seams],
        seam_texts=[_seam_text(seam, pattern.is_sewn) for seam in pattern.seams],
        strain=side_strains(pattern.surface),
        strain_title="Strain: largest change of a side, at true scale",
    )


def _seam_text(seam: Seam, is_sewn: bool) -> str:
    length, shorter = max(seam.lengths), min(seam.lengths)
    eased = f" eased to {shorter:.1f} mm" if seam.is_eased else ""
    noun = "Seam" if not seam.is_dart else "Dart" if is_sewn else "Corner cut"
    return f"{noun} {seam.name}, {length:.1f} mm{eased}"


def _tips(pattern: Pattern) -> IntArray:
    """Return the vertices at the tips of darts."""
    surface = pattern.surface
    vertex = np.empty(len(surface.points), dtype=np.int64)
    vertex[surface.corners] = surface.mesh.faces
    return np.unique(vertex[[dart.tip for dart in pattern.darts if dart.tip is not None]])


def _anchors(pattern: Pattern) -> IntArray:
    """Return the triangle in the middle of each piece: at the centre of the largest circle in it."""
    surface = pattern.surface
    anchors = []
    for piece, loops in enumerate(pattern.borders.loops):
        polygon = polygon_of([surface.points[tails(surface, loop)] for loop in loops])
        centre = np.asarray(shapely().maximum_inscribed_circle(polygon).coords[0])
        triangles = np.flatnonzero(surface.pieces == piece)
        anchors.append(int(triangles[_depths(surface.places[triangles], centre).argmax()]))
    return np.array(anchors)


def _depths(places: FloatArray, point: FloatArray) -> FloatArray:
    """Return (m,) the distance of a point from the nearest side of each triangle (m, 3, 2), negative outside."""
    sides, to_point = np.roll(places, -1, axis=1) - places, point - places
    across = sides[..., 0] * to_point[..., 1] - sides[..., 1] * to_point[..., 0]
    return np.asarray((across / np.linalg.norm(sides, axis=2)).min(axis=1))
