"""Seam allowances: pieces widened by a distance for each part of their border."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ....base import FloatArray
from ....io import imported

if TYPE_CHECKING:
    from shapely import Polygon

# Distance of the tip of a mitred corner from the seam, relative to the allowance, beyond which it is trimmed: corners
# below 60 degrees.
MITRE_LIMIT = 2.0
# Angle between the points of a round corner, radians: they are within 0.1 mm of the circle up to a radius of 26 mm.
ARC_STEP = np.radians(10)
# Grid of unions of polygons, mm, far below what can be cut; without it, rounding leaves slits.
GRID = 1e-5


def shapely() -> Any:
    """Return the package shapely.

    Raises:
        OptionError: it is not installed.
    """
    return imported("shapely", "patterns need shapely", '"coneflat[patterns]"')


def polygon_of(rings: Sequence[FloatArray]) -> Polygon:
    """Return a polygon with holes from rings of points (k, 2), the outer one first."""
    polygon = shapely().Polygon(rings[0], rings[1:])
    return polygon if polygon.is_valid else united([shapely().make_valid(polygon)])


def united(shapes: Sequence[Any]) -> Polygon:
    """Return the union of shapes that are connected."""
    union = shapely().union_all(shapes, grid_size=GRID)
    parts = [part for part in shapely().get_parts(union) if part.geom_type == "Polygon"]
    if not parts:  # A collection, such as of a polygon and a line.
        parts = [part for nested in shapely().get_parts(union) for part in shapely().get_parts(nested)]
        parts = [part for part in parts if part.geom_type == "Polygon"]
    return max(parts, key=lambda part: part.area)


def widened(rings: Sequence[FloatArray], widths: Sequence[FloatArray], is_round: bool = False) -> Polygon:
    """Return a piece with seam allowances.

    Args:
        rings: the outer border and the holes, points (k, 2) with the piece on the left.
        widths: of each ring, (k,) the width along the edge from each point to the next, 0 or more.
        is_round: round corners instead of mitred ones.

    Notes:
        The union of the piece, of a strip along each edge, and of a corner between two strips that turn apart. Pockets
        that are enclosed by allowances which meet are filled.
    """
    parts = [polygon_of(rings)]
    for ring, width in zip(rings, widths, strict=True):
        parts += shapely().polygons([*_strips(ring, width)]).tolist() if width.any() else []
        parts += [shapely().Polygon(corner) for corner in _corners(ring, width, is_round)]
    union = united(parts)
    is_hole = shapely().intersects(
        shapely().MultiPolygon([[ring, []] for ring in rings[1:]]), _filled(union.interiors)
    )
    return shapely().Polygon(union.exterior, np.array(union.interiors, dtype=object)[is_hole].tolist())


def _filled(rings: Sequence[Any]) -> Any:
    return np.array([shapely().Polygon(ring) for ring in rings], dtype=object)


def _outward(ring: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (k, 2) the unit vectors along the edges of a ring and those that point out of the piece."""
    along = np.roll(ring, -1, axis=0) - ring
    along = along / np.maximum(np.linalg.norm(along, axis=1), np.finfo(float).tiny)[:, None]
    return along, np.stack([along[:, 1], -along[:, 0]], axis=1)


def _strips(ring: FloatArray, width: FloatArray) -> Iterator[FloatArray]:
    shift = width[:, None] * _outward(ring)[1]
    heads = np.roll(ring, -1, axis=0)
    return (corners for corners in np.stack([ring, ring + shift, heads + shift, heads], axis=1)[width > 0])


def _corners(ring: FloatArray, width: FloatArray, is_round: bool) -> Iterator[FloatArray]:
    """Yield the polygons between the strips along two edges, where the border is convex."""
    along, outward = _outward(ring)
    before, widths_before = np.roll(along, 1, axis=0), np.roll(width, 1)
    turns = before[:, 0] * along[:, 1] - before[:, 1] * along[:, 0]
    ahead = (before * along).sum(axis=1)
    # Where an edge goes back along the one before, as at the end of a spike, the border turns by half a turn.
    is_convex = (turns > 0) | ((turns == 0) & (ahead < 0))
    for i in np.flatnonzero(is_convex & (np.maximum(width, widths_before) > 0)).tolist():
        first, second = widths_before[i] * np.roll(outward, 1, axis=0)[i], width[i] * outward[i]
        if is_round:
            middle = _arc(first, second, float(np.arctan2(turns[i], ahead[i])))
        else:
            middle = _mitre(first, second, before[i], along[i])
        yield ring[i] + np.vstack([np.zeros(2), first, *middle, second])


def _arc(first: FloatArray, second: FloatArray, turn: float) -> list[FloatArray]:
    """Return the points between the ends of two allowances around their corner."""
    start, end = float(np.linalg.norm(first)), float(np.linalg.norm(second))
    angle = np.arctan2(first[1], first[0]) if start else np.arctan2(second[1], second[0]) - turn
    steps = int(np.ceil(turn / ARC_STEP))
    shares = np.arange(1, steps) / max(steps, 1)
    # Chords cut off the arc, which the radius makes up for in the mean.
    radii = (start + (end - start) * shares) * (1 + (turn / max(steps, 1)) ** 2 / 12)
    return [
        radius * np.array([np.cos(angle + turn * share), np.sin(angle + turn * share)])
        for share, radius in zip(shares, radii, strict=True)
    ]


def _mitre(first: FloatArray, second: FloatArray, before: FloatArray, after: FloatArray) -> list[FloatArray]:
    """Return the points between the ends of two allowances: where the offset edges meet, or a trimmed corner."""
    limit = MITRE_LIMIT * max(float(np.linalg.norm(first)), float(np.linalg.norm(second)))
    turn = before[0] * after[1] - before[1] * after[0]
    bisector = before - after
    bisector = bisector / np.linalg.norm(bisector)
    if turn > 0:
        # first + s before = second - t after
        gap = second - first
        s = (gap[0] * after[1] - gap[1] * after[0]) / turn
        t = (before[0] * gap[1] - before[1] * gap[0]) / -turn
        tip = first + s * before
        if s <= 0 or t >= 0:
            return []  # The wider allowance ends beyond the narrower one.
        if np.linalg.norm(tip) <= limit:
            return [tip]
    rise, fall = before @ bisector, -after @ bisector
    return [
        first + max((limit - first @ bisector) / rise, 0.0) * before,
        second - max((limit - second @ bisector) / fall, 0.0) * after,
    ]
