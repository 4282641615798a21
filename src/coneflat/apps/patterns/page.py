"""The interactive page of a pattern: pieces with their numbers, seams with their names, darts, and the strain."""

from __future__ import annotations

from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ... import Flattening, measure
from ...base import FloatArray, IntArray, plural
from ...measures import angle_sum_errors
from ...stages import SolveStatistics
from ..view import FoldLines, PageParts, PageText, check_page, open_page, page_html, write_page
from .drawing.allowances import polygon_of, shapely
from .drawing.seam_names import straight_parts
from .drawing.shapes import tails
from .pages.strain_map import side_strains
from .pieces.borders import Seam
from .pieces.cut_surface import CutSurface
from .report import rows_of
from .result import Pattern
from .units import EXACT_STRAIN, percentage


def page_of_pattern(pattern: Pattern, *, name: str = "Pattern", show: str = "charts", **look: Any) -> str:
    """Return the HTML page of a pattern; arguments and errors are those of `page_html`."""
    strain = float(np.abs(pattern.strains).max())
    cuts, noun = (pattern.darts, "dart") if pattern.is_sewn else (pattern.corner_cuts, "corner cut")
    counts = {"piece": pattern.piece_count, "seam": len(pattern.seams) - len(cuts), noun: len(cuts)}
    parts = [plural(count, counted) for counted, count in counts.items() if count]
    if strain > EXACT_STRAIN:
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
    uv = _as_uv(surface, points)
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


def _as_uv(surface: CutSurface, points: FloatArray) -> FloatArray:
    """Return points (..., 2) of the plane of the pieces in the unit square."""
    return np.asarray((points - surface.points.min(axis=0)) / float(np.ptp(surface.points, axis=0).max()))


def parts_of(pattern: Pattern) -> PageParts:
    """Return what a page shows of the pieces and the seams of a pattern."""
    surface = pattern.surface
    seam_of_edge, name_of_edge = np.empty((2, len(surface.mesh.edges)), dtype=np.int64)
    names: list[str] = []
    for number, seam in enumerate(pattern.seams):
        edges = surface.mesh.halfedge_edges[seam.sides[0].halfedges]
        seam_of_edge[edges] = number
        for name, begin, end in _named_parts(pattern, seam):
            name_of_edge[edges[begin:end]] = len(names)
            names.append(name)
    return PageParts(
        pieces=surface.pieces,
        anchors=_anchors(pattern),
        seams=seam_of_edge[surface.seams],
        seam_texts=[_seam_text(seam, pattern.is_sewn) for seam in pattern.seams],
        names=names,
        edge_names=name_of_edge[surface.seams],
        strain=side_strains(pattern.surface),
        strain_title="Strain: largest change of a side, at true scale",
        folds=_folds(pattern),
    )


def _named_parts(pattern: Pattern, seam: Seam) -> Iterator[tuple[str, int, int]]:
    """Yield the names of a seam as they are drawn, and the edges of its first side from and to which they are."""
    if pattern.is_sewn:
        yield seam.name, 0, len(seam.sides[0].halfedges)
    else:
        yield from straight_parts(seam, pattern.surface.points)


def _folds(pattern: Pattern) -> FoldLines:
    """Return the folds of a net, and the centre lines of the bends of a sheet."""
    surface, bends = pattern.surface, pattern.bends
    lines = np.array([bend.line for bend in bends]).reshape(-1, 2, 2)
    ends = np.concatenate([surface.points[pattern.folds], lines])
    angles = np.concatenate([pattern.fold_angles, [bend.angle for bend in bends]])
    bent = [[_place_on_model(surface, bend.piece, point) for point in bend.line] for bend in bends]
    folded = surface.mesh.vertices[surface.vertex_of_point[pattern.folds]]
    places = np.concatenate([folded, np.array(bent).reshape(-1, 2, 3)])
    return FoldLines(places, _as_uv(surface, ends), angles > 0)


def _place_on_model(surface: CutSurface, piece: int, point: FloatArray) -> FloatArray:
    """Return (3,) the place on the model of a point of a piece; beside the piece, in the plane of its next triangle."""
    triangles = surface.triangles_of_pieces[piece]
    triangle = triangles[_depths(surface.places[triangles], point).argmax()]
    origin, *corners = surface.places[triangle]
    weights = np.linalg.solve((np.array(corners) - origin).T, point - origin)
    origin, *corners = surface.mesh.vertices[surface.mesh.faces[triangle]]
    return np.asarray(origin + weights @ (np.array(corners) - origin))


def _seam_text(seam: Seam, is_sewn: bool) -> str:
    length, shorter = max(seam.lengths), min(seam.lengths)
    eased = f" eased to {shorter:.1f} mm" if seam.is_eased else ""
    noun = "Seam" if not seam.is_dart else "Dart" if is_sewn else "Corner cut"
    return f"{noun} {seam.name}, {length:.1f} mm{eased}"


def _tips(pattern: Pattern) -> IntArray:
    """Return the vertices at the tips of darts."""
    vertex = pattern.surface.vertex_of_point
    return np.unique(vertex[[dart.tip for dart in pattern.darts if dart.tip is not None]])


def _anchors(pattern: Pattern) -> IntArray:
    """Return the triangle in the middle of each piece: at the centre of the largest circle in it."""
    surface = pattern.surface
    anchors = []
    for piece, loops in enumerate(pattern.borders.loops):
        polygon = polygon_of([surface.points[tails(surface, loop)] for loop in loops])
        centre = np.asarray(shapely().maximum_inscribed_circle(polygon).coords[0])
        triangles = surface.triangles_of_pieces[piece]
        anchors.append(int(triangles[_depths(surface.places[triangles], centre).argmax()]))
    return np.array(anchors)


def _depths(places: FloatArray, point: FloatArray) -> FloatArray:
    """Return (m,) the distance of a point from the nearest side of each triangle (m, 3, 2), negative outside."""
    sides, to_point = np.roll(places, -1, axis=1) - places, point - places
    across = sides[..., 0] * to_point[..., 1] - sides[..., 1] * to_point[..., 0]
    return np.asarray((across / np.linalg.norm(sides, axis=2)).min(axis=1))
