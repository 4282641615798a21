"""Packing of charts into a texture."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.defaults import PADDING, RESOLUTION
from ..base.text import short_repr
from ..errors import OptionError
from .charts import Charts, Outlines, read_charts
from .grid import Packing
from .orient import along_axes, border_directions, mean_rise, straight_angles
from .rectangles import HALF_PI, RELATIVE_TOLERANCE, square_angle
from .tight_packing import pack_outlines

ROTATIONS = ("any", "quarter", "none")
# MAX_PLACEMENTS limits the number of charts times the number of angles tried for each; for many charts quarter turns
# are enough. MAX_TURNS is the largest number of equal parts into which a full turn is divided.
MAX_PLACEMENTS, QUARTER_TURNS, MAX_TURNS = 480, 4, 16
TILES_IN_A_ROW = 10


@dataclass(frozen=True, eq=False)
class Packed:
    """The k charts in a texture.

    Attributes:
        corner_uv: (m, 3, 2) position of every triangle corner, in [0, 1]^2; tile i of several is
            [i % 10, i % 10 + 1] x [i // 10, i // 10 + 1], which is UDIM 1001 + i.
        scale: UV units per unit of length of the input charts, the same for all charts.
        efficiency: area of the charts divided by the area of the tiles. Area that a chart covers twice counts twice.
        tile_of_chart: (k,) tile index of each chart, from 0.
        angle_of_chart: (k,) angle by which each chart was rotated, radians.
    """

    corner_uv: FloatArray
    scale: float
    efficiency: float
    tile_of_chart: IntArray
    angle_of_chart: FloatArray


def pack_charts(
    corner_uv: ArrayLike,
    chart_of_triangle: ArrayLike | None = None,
    *,
    resolution: int = RESOLUTION,
    padding: float = PADDING,
    rotate: str | int = "any",
    tiles: int = 1,
    block_size: int = 1,
) -> Packed:
    """Pack charts into a square texture at the largest possible scale, or into several at a common scale (UDIM tiles).

    Every chart is only rotated, translated and scaled. Charts keep their order; charts of several meshes may be
    packed together.

    Args:
        corner_uv: (m, 3, 2) positions of the triangle corners, each chart anywhere in the plane.
        chart_of_triangle: (m,) chart index of each triangle, from 0; None for one chart.
        resolution: texels along a side of the texture.
        padding: minimum number of texels between charts, and between charts and the border of the texture.
        rotate: "any" rotates charts to fill the texture best; charts with a straight border are aligned with the axes.
            "quarter" aligns each chart, its long side along u or v. "none" does not rotate charts. An integer rotates
            each chart by a multiple of that fraction of a full turn, for example 4 by quarter turns; charts with a
            straight border only so that the border is as parallel to the axes as possible. A single chart is rotated
            by "any" by at most an eighth of a turn, and by an integer not at all.
        tiles: number of textures to distribute charts over. Charts are not cut, so the largest chart limits the scale.
        block_size: texels along a side of a block; the box of each chart begins at the corner of a block, on the left
            and below. With 4, a padding of 6 texels or more keeps the charts out of each other's blocks of a
            compressed texture. 1 for any places.

    Returns:
        The packed charts.

    Raises:
        ArrayShapeError, NonFiniteError: the shape of an array is wrong, or its values are not finite.
        OptionError: charts are not numbered from 0 without gaps, a chart is mirrored, an option is invalid, or the
            padding leaves no space for charts.

    Notes:
        The shapes of charts, not their bounding boxes, are rasterized on a grid and placed one after the other, each
        where its top is lowest. Orders and angles are changed at random, with a fixed seed, and improvements are kept.
    """
    charts = read_charts(corner_uv, chart_of_triangle)
    _check(resolution, padding, rotate, tiles, block_size)
    return pack_known(charts, Frame.of(resolution, padding, block_size), rotate, tiles)


@dataclass(frozen=True)
class Frame:
    """The square of a texture in which charts are placed.

    Attributes:
        low: margin on the left and below, relative to the side of the texture.
        side: side of the square, relative to that of the texture.
        gap: minimum distance between charts, relative to the side of the texture.
        block_count: number of blocks along the side; None if charts may begin anywhere.
    """

    low: float
    side: float
    gap: float
    block_count: int | None

    @classmethod
    def of(cls, resolution: int, padding: float, block_size: int) -> Frame:
        """Return the square for a padding; arguments as of `pack_charts`.

        Raises:
            OptionError: the padding leaves no space.
        """
        gap = padding / resolution
        if block_size == 1:
            low, count, side = gap, None, 1.0 - 2.0 * padding / resolution
        else:
            margin = block_size * math.ceil(padding / block_size)
            low, count = margin / resolution, math.floor((resolution - margin - padding) / block_size)
            side = count * block_size / resolution
        if side <= 0:
            is_padding = block_size == 1 or 2 * padding >= resolution
            blocks = "" if is_padding else f" and blocks of {block_size} texels"
            advice = "" if is_padding else ": use a smaller block_size, or a higher resolution"
            raise OptionError(
                f"{padding:g} texels of padding{blocks} leave no space in a texture of {resolution} texels{advice}"
            )
        return cls(low, side, gap, count)

    def snapped(self, packing: Packing, low: complex) -> Packing:
        """Return the packing of a single chart, moved to the corner of a block; low: that of its box, rotated."""
        if self.block_count is None:
            return packing
        block = (packing.side or 1.0) / self.block_count
        corner = (packing.shift[0] + low) / block
        column, row = (max(math.floor(place + RELATIVE_TOLERANCE), 0) for place in (corner.real, corner.imag))
        shift = (column + 1j * row) * block - low
        return replace(packing, shift=np.array([shift]))


def pack_known(charts: Charts, frame: Frame, rotate: str | int, tiles: int) -> Packed:
    """Pack validated charts; see `pack_charts`."""
    outlines = charts.outlines()
    is_single = charts.count == 1
    as_given = rotate == "none" or isinstance(rotate, int) or (is_single and rotate == "any")
    directions = [np.empty(0)] * charts.count if rotate == "none" else border_directions(outlines)
    straight = np.zeros(charts.count) if as_given else straight_angles(charts, outlines, directions)
    rotations = np.exp(1j * straight)
    outlines = outlines.times(rotations)
    if is_single:
        packing = _pack_single(outlines, directions[0], rotate, frame)
    else:
        area = float(np.abs(charts.sums(charts.areas)).sum())
        finest = QUARTER_TURNS * min(max(MAX_PLACEMENTS // (QUARTER_TURNS * charts.count), 1), 6)
        choices = {"any": finest, "quarter": QUARTER_TURNS, "none": 1}
        turns = rotate if isinstance(rotate, int) else choices[rotate]
        angles = np.tile(np.arange(turns) * (2 * np.pi / turns), (charts.count, 1))
        allowed = along_axes(directions, straight, angles)
        packing = pack_outlines(
            outlines,
            area,
            angles,
            allowed,
            frame.gap / frame.side,
            min(tiles, charts.count),
            block_count=frame.block_count,
        )

    scale = frame.side / (packing.side or 1.0)
    factors = scale * rotations * np.exp(1j * packing.angle)
    uv = charts.moved(factors, packing.shift * scale + (1 + 1j) * frame.low)
    np.clip(uv, 0.0, 1.0, out=uv)
    corner = np.stack([packing.tile % TILES_IN_A_ROW, packing.tile // TILES_IN_A_ROW], axis=1)
    uv += corner[charts.chart][:, None] if packing.tile.any() else 0.0  # no -0.0
    return Packed(
        corner_uv=uv,
        scale=scale,
        efficiency=float(np.abs(charts.areas * np.abs(factors)[charts.chart] ** 2).sum()) / tiles,
        tile_of_chart=packing.tile,
        angle_of_chart=np.angle(factors),
    )


def _pack_single(outlines: Outlines, directions: FloatArray, rotate: str | int, frame: Frame) -> Packing:
    """Return the packing of a single chart, centred in its smallest enclosing square, with the least rotation.

    With blocks, its box is at the nearest corner of a block on the left and below.
    """
    angle = square_angle(outlines.points(0), directions) if rotate == "any" else 0.0
    angle -= HALF_PI * round(angle / HALF_PI)
    points = outlines.points(0) * np.exp(1j * angle)
    low, high = (complex(pick(points.real), pick(points.imag)) for pick in (np.min, np.max))
    side = max((high - low).real, (high - low).imag)
    shift = (side * (1 + 1j) - low - high) / 2
    packing = Packing(side, np.array([angle]), np.array([shift]), np.zeros(1, dtype=np.int64))
    return frame.snapped(packing, low)


def _check(resolution: int, padding: float, rotate: str | int, tiles: int, block_size: int) -> None:
    for name, count in (("resolution", resolution), ("tiles", tiles), ("block_size", block_size)):
        if not isinstance(count, (int, np.integer)) or isinstance(count, bool) or count < 1:
            raise OptionError(f"{name} must be a positive integer, got {short_repr(count)}")
    is_number = isinstance(padding, (int, float, np.number)) and not isinstance(padding, bool)
    if not is_number or not 0 <= padding < np.inf:
        raise OptionError(f"padding must be a number of texels, 0 or more, got {short_repr(padding)}")
    if isinstance(rotate, int) and not isinstance(rotate, bool):
        if not 1 <= rotate <= MAX_TURNS:
            raise OptionError(f"rotate must be from 1 to {MAX_TURNS} turns, got {rotate}")
    elif not isinstance(rotate, str) or rotate not in ROTATIONS:
        raise OptionError(
            f"unknown rotate {short_repr(rotate)}: choose from {', '.join(ROTATIONS)}, or a number of turns"
        )


def arrange_charts(
    corner_uv: FloatArray,
    chart: IntArray,
    component: IntArray,
    heights: FloatArray | None,
    *,
    resolution: int,
    padding: float,
    tiles: int,
    block_size: int = 1,
    quantum: float | None = None,
    edge_halfedges: IntArray,
) -> Packed:
    """Return the charts of a flattening packed into a texture.

    Args:
        corner_uv: (m, 3, 2) positions of the triangle corners; those of a component are in one frame.
        chart: (m,) the chart of each triangle, from 0.
        component: (k,) the connected component of each chart.
        heights: (m, 3) coordinates of the triangles' corners on the model along the direction that should map to v;
            None to fill the texture best.
        resolution, padding, tiles, block_size: see `pack_charts`.
        quantum: angle in radians; charts of a component are rotated relative to each other only by its multiples, so
            that the rotations between the sides of seams stay such multiples. None for any angle.
        edge_halfedges: (e, 2) the half-edges of each edge of the triangles' mesh, see `TriangleMesh`.
    """
    corners = np.ascontiguousarray(corner_uv).view(np.complex128)[..., 0]
    charts = _unmirrored(Charts(corners, chart, len(component), edge_halfedges))
    rotate: str | int = "any"
    if quantum is not None and charts.count > 1:
        rotate = turns_of_quantum(quantum)
        charts = _rotated_together(charts, component, rotate, heights)
    elif heights is not None:
        charts = _rotated_together(charts, np.arange(charts.count), QUARTER_TURNS, heights)
    frame = Frame.of(resolution, padding, block_size)
    return pack_known(charts, frame, rotate if heights is None else "none", tiles)


def turns_of_quantum(quantum: float) -> int:
    """Return the largest number of equal turns, up to MAX_TURNS, whose angle is a multiple of the quantum (radians)."""
    parts = 2 * np.pi / quantum
    if abs(parts - round(parts)) > RELATIVE_TOLERANCE * parts:
        return 1
    return max(turns for turns in range(1, MAX_TURNS + 1) if round(parts) % turns == 0)


def _rotated_together(charts: Charts, component: IntArray, turns: int, heights: FloatArray | None) -> Charts:
    """Return the charts with one of each component axis-aligned and the others rotated by the same angle.

    The aligned chart is the largest of those with a straight border, or of all. With heights each chart is then rotated
    by the number of equal turns that brings its up direction closest to v; charts with a straight border stay aligned
    with the axes.
    """
    outlines = charts.outlines()
    directions = border_directions(outlines)
    angles, areas = straight_angles(charts, outlines, directions), np.abs(charts.sums(charts.areas))
    is_free = np.array([not len(of_border) for of_border in directions])
    order = np.lexsort((-areas, is_free, component))
    _, first = np.unique(component[order], return_index=True)
    largest = order[first][np.unique(component, return_inverse=True)[1]]
    if heights is None:
        return charts.rotated(angles[largest])
    rise = mean_rise(charts, heights)
    angles += _best_turn(rise * np.exp(1j * angles), np.ones((charts.count, QUARTER_TURNS), dtype=bool))
    angles = angles[largest]
    choices = np.tile(2 * np.pi / turns * np.arange(turns), (charts.count, 1))
    angles = angles + _best_turn(rise * np.exp(1j * angles), along_axes(directions, angles, choices))
    return charts.rotated(angles)


def _best_turn(rise: NDArray[np.complex128], allowed: BoolArray) -> FloatArray:
    """Return (k,) the allowed multiple of a t-th of a turn that rotates each direction closest to v, in radians."""
    turns = 2 * np.pi / allowed.shape[1] * np.arange(allowed.shape[1])
    height = np.where(allowed, (rise[:, None] * np.exp(1j * turns)).imag, -np.inf)
    return turns[height.argmax(axis=1)]


def _unmirrored(charts: Charts) -> Charts:
    """Return the charts; those with negative total area are mirrored."""
    is_mirrored = charts.sums(charts.areas) < 0
    if not is_mirrored.any():
        return charts
    corners = np.where(is_mirrored[charts.chart][:, None], charts.corners.conj(), charts.corners)
    return replace(charts, corners=corners)
