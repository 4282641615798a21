"""Cuts of charts that are larger than a texture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..atlas import as_disk, square_angle
from ..base import ComplexArray, FloatArray, check_cancelled
from ..stages import Layout
from .chart_pieces import Cut, Piece
from .pack_cuts import with_pieces

#: Smallest areas of the pieces of a cut, relative to that of the chart, in the order in which they are tried.
PIECE_AREAS = (0.25, 0.1, 0.02)


def cut_to_fit(layouts: Sequence[Layout], costs: Callable[[int], FloatArray], side: float) -> list[Layout]:
    """Return layouts whose charts are cut until each fits in a square, as far as possible.

    The next cut of a chart is the shortest one relative to the root of the area that it separates, among those between
    pieces of similar areas.

    Args:
        layouts: layouts of one or several meshes.
        costs: returns for a layout, by its index, (e,) the costs of cutting its mesh's edges, infinite for those not to
            cut.
        side: the side of the square.
    """
    charts = [
        chart
        for i, layout in enumerate(layouts)
        for chart in _charts_of(i, layout, costs)
        if _side(chart) > side
    ]
    return with_pieces(layouts, charts, [piece for chart in charts for piece in _fitting_pieces(chart, side)])


def _charts_of(index: int, layout: Layout, costs: Callable[[int], FloatArray]) -> list[Piece]:
    """Return the charts of a layout."""
    side_costs = costs(index)[layout.mesh.halfedge_edges].reshape(-1, 3)
    order = np.argsort(layout.chart, kind="stable")
    starts = np.searchsorted(layout.chart[order], np.arange(1, layout.chart.max() + 1))
    return [
        Piece.of(index, faces, as_disk(layout.points, layout.corners[faces]), side_costs[faces].ravel(), 0.0)
        for faces in np.split(order, starts)
    ]


def square_side(points: FloatArray) -> float:
    """Return the side of the smallest square around points (n, 2)."""
    return _side_around(points[:, 0] + 1j * points[:, 1])


def _side_around(places: ComplexArray) -> float:
    turned = places * np.exp(1j * square_angle(places, np.empty(0)))
    return float(max(np.ptp(turned.real), np.ptp(turned.imag)))


def _side(piece: Piece) -> float:
    """Return the side of the smallest square around a piece."""
    return _side_around(piece.outline.sides.ravel())


def _fitting_pieces(chart: Piece, side: float) -> list[Piece]:
    """Return the pieces of a chart that fit in a square, or that cannot be cut."""
    pieces, fitting = [chart], list[Piece]()
    while pieces:
        check_cancelled()
        piece = pieces.pop()
        cut = _even_cut(piece) if _side(piece) > side else None
        if cut is None:
            fitting.append(piece)
        else:
            pieces += cut.pieces
    return fitting


def _even_cut(piece: Piece) -> Cut | None:
    """Return the cut with the lowest score into pieces of similar areas; None if there is none."""
    for share in PIECE_AREAS:
        cuts = [cut for cut in replace(piece, min_area=share * piece.area).cuts if np.isfinite(cut.cost)]
        if cuts:
            return min(cuts, key=lambda cut: cut.score)
    return None
