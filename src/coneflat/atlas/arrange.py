"""Charts of components brought into a texture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..geometry.planar import signed_double_areas
from .charts import Charts, read_charts
from .orient import border_directions, mean_rise, orient_charts, straight_angles
from .pack import MOST_TURNS, QUARTERS, Packed, pack_known
from .straight import SAME, along_axes


def arrange_charts(
    corner_uv: FloatArray,
    chart: IntArray,
    component: IntArray,
    space: FloatArray | None,
    *,
    resolution: int,
    padding: float,
    tiles: int,
    up: tuple[float, float, float] | None = None,
    quantum: float | None = None,
    edge_halfedges: IntArray,
) -> Packed:
    """Return charts packed into a texture.

    Args:
        corner_uv: (m, 3, 2) points of the triangle corners; those of a component are in one frame.
        chart: (m,) the chart of each triangle, from 0.
        component: (k,) the component of each chart.
        space: (m, 3, 3) the triangles' corners on the model; needed for an up direction only.
        resolution, padding, tiles: see `pack_charts`.
        up: direction in space that is to be v; None to fill the texture best.
        quantum: the charts of a component are turned against each other by multiples of this angle only, so that the
            rotations between the sides of seams stay such multiples; None for any angle.
        edge_halfedges: (e, 2) of the triangles' mesh, see `TriangleMesh`.
    """

    def read(corner_uv: FloatArray) -> Charts:
        return replace(read_charts(corner_uv, chart), edge_halfedges=edge_halfedges)

    flat = _upright(corner_uv, chart)
    rotate: str | int = "any" if up is None else "none"
    if quantum is not None and len(component) > 1:
        turns = whole_turns(quantum)
        flat = _turned_together(read(flat), component, turns, space, up)
        rotate = turns if up is None else "none"
    elif up is not None:
        flat = orient_charts(flat, chart, corners=space, up=up)
    return pack_known(read(flat), None, resolution, padding, padding, rotate, tiles)


def whole_turns(quantum: float) -> int:
    """Return into how many equal parts a full turn can be divided, few enough to be tried, by multiples of an angle."""
    parts = 2 * np.pi / quantum
    if abs(parts - round(parts)) > SAME * parts:
        return 1
    return max(turns for turns in range(1, MOST_TURNS + 1) if round(parts) % turns == 0)


def _turned_together(
    charts: Charts,
    component: IntArray,
    turns: int,
    space: FloatArray | None,
    up: tuple[float, float, float] | None,
) -> FloatArray:
    """Return (m, 3, 2) the charts, one of each component straight, and the others turned as far as it.

    It is the largest of those whose border is straight, or of all. With an up direction each chart is then turned by
    that number of equal turns which brings it up best; where its border is straight, along the axes.
    """
    outlines = charts.outlines()
    directions = border_directions(outlines)
    angles, areas = straight_angles(charts, outlines, directions), np.abs(charts.sums(charts.areas))
    is_free = np.array([not len(of_border) for of_border in directions])
    order = np.lexsort((-areas, is_free, component))
    _, first = np.unique(component[order], return_index=True)
    largest = order[first][np.unique(component, return_inverse=True)[1]]
    if up is not None:
        rise = mean_rise(charts, space, up)
        angles += _best_turn(rise * np.exp(1j * angles), np.ones((charts.count, QUARTERS), dtype=bool))
        angles = angles[largest]
        choices = np.tile(2 * np.pi / turns * np.arange(turns), (charts.count, 1))
        angles = angles + _best_turn(rise * np.exp(1j * angles), along_axes(directions, angles, choices))
        return charts.moved(np.exp(1j * angles))
    return charts.moved(np.exp(1j * angles[largest]))


def _best_turn(rise: NDArray[np.complex128], allowed: BoolArray) -> FloatArray:
    """Return (k,) which of t equal parts of a turn, of those allowed, brings each direction next to v, as an angle."""
    turns = 2 * np.pi / allowed.shape[1] * np.arange(allowed.shape[1])
    height = np.where(allowed, (rise[:, None] * np.exp(1j * turns)).imag, -np.inf)
    angles: FloatArray = turns[height.argmax(axis=1)]
    return angles


def _upright(flat: FloatArray, chart: IntArray) -> FloatArray:
    """Return (m, 3, 2) charts, those turned over of which more area is upside down than not."""
    is_mirrored = np.bincount(chart, weights=signed_double_areas(flat)) < 0
    if not is_mirrored.any():
        return flat
    return np.where(is_mirrored[chart][:, None, None], flat * [1.0, -1.0], flat)
