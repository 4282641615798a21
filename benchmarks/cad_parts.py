"""Mechanical parts triangulated as CAD programs export them: only the corners of outlines, in long thin triangles."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import mechanical
import numpy as np

Mesh = tuple[np.ndarray, np.ndarray]
Loop = np.ndarray

#: Angle between neighbouring points of an arc, radians.
ARC_STEP = 2 * np.pi / 32
TEETH = 12


def shapes() -> dict[str, Mesh]:
    """Return the parts by name, of 100 to 1,000 triangles."""
    return {name: make() for name, make in SHAPES.items()}


def round_hole() -> Mesh:
    """Return a box with a round hole of 32 corners, in 144 triangles."""
    return prism([BLOCK, arc((0.7, 0.2), 0.6)], 1.0)


def gear() -> Mesh:
    """Return a gear with a bore."""
    angles = (2 * np.pi / TEETH * (np.arange(TEETH)[:, None] + [0, 0.2, 0.45, 0.65])).ravel()
    radii = np.tile([0.8, 1.05, 1.05, 0.8], TEETH)
    return prism([radii[:, None] * circle(angles), arc((0, 0), 0.3)], 0.5)


def nut() -> Mesh:
    """Return a hexagonal nut with a bore."""
    return prism([circle(np.pi / 3 * np.arange(6)), arc((0, 0), 0.55)], 0.7)


def bracket() -> Mesh:
    """Return an L-shaped bracket with a fillet in its corner and three holes."""
    fillet = arc((1.0, 1.0), 0.4, 1.5 * np.pi, np.pi)
    outline = np.array([(0, 0), (3, 0), (3, 0.6), *fillet, (0.6, 2.5), (0, 2.5)])
    return prism([outline, arc((2.5, 0.3), 0.15), arc((1.6, 0.3), 0.15), arc((0.3, 2.1), 0.17)], 0.8)


def plate() -> Mesh:
    """Return a rounded plate with a slot and four holes."""
    slot = [arc((0.4, 0), 0.2, -np.pi / 2, np.pi / 2), arc((-0.4, 0), 0.2, np.pi / 2, 1.5 * np.pi)]
    holes = [arc(corner * (1.15, 0.65), 0.12) for corner in mechanical.CORNERS]
    return prism([rounded_rectangle(), np.concatenate(slot), *holes], 0.35)


def pocket() -> Mesh:
    """Return a block with a rounded pocket in its top."""
    outline, wall = BLOCK, rounded_rectangle()
    return joined(
        [
            *cap([outline], 0.0, is_top=False),
            *walls(outline, 0.0, 1.2),
            *cap([outline, wall], 1.2, is_top=True),
            *walls(wall[::-1], 0.5, 1.2),
            *cap([wall], 0.5, is_top=True),
        ]
    )


def shaft(around: int = 48) -> Mesh:
    """Return a stepped shaft with a fillet, turned about the z axis."""
    fillet = arc((0.65, 1.35), 0.15, np.pi, 1.5 * np.pi)
    profile = [(0.3, 0), (0.3, 0.5), (0.5, 0.5), *fillet, (0.9, 1.2), (0.9, 1.6)]
    ring = circle(2 * np.pi * np.arange(around) / around)
    rings = [at_height(radius * ring, z) for radius, z in profile]
    sides = [face for low, high in pairwise(rings) for face in strip(low, high)]
    (first, bottom), (last, top) = profile[0], profile[-1]
    return joined([*cap([first * ring], bottom, is_top=False), *sides, *cap([last * ring], top, is_top=True)])


def tee(radius: float = 0.5, branch: float = 0.35, length: float = 1.5, height: float = 1.3) -> Mesh:
    """Return a cylinder along x with a thinner one along z joined to its side, closed by disks."""
    turns = np.linspace(-np.pi / 2, np.pi / 2, 17)
    up = np.arcsin(branch / radius * np.sin(turns))
    angles = np.concatenate([up, np.linspace(up[-1], 2 * np.pi + up[0], 26)[1:-1]])
    around = radius * circle(np.pi / 2 - angles)
    low, high = (np.column_stack([np.full(len(around), x), around]) for x in (-length, length))
    half = branch * np.cos(turns)
    half[[0, -1]] = 0.0
    left, right = (np.column_stack([side * half, around[: len(up)]]) for side in (-1, 1))
    last, count = len(up) - 1, len(around)
    beyond = np.arange(last + 1, count)
    sides = [
        *strip(left, low[: last + 1], is_closed=False),
        *strip(high[: last + 1], right, is_closed=False),
        *strip(high[beyond], low[beyond], is_closed=False),
        # The strips beside the branch have its outermost points on their sides.
        np.array([high[last], high[last + 1], low[last + 1], low[last], left[last]]),
        np.array([low[0], low[count - 1], high[count - 1], high[0], left[0]]),
    ]
    rim = np.concatenate([right, left[-2:0:-1]])
    top = rim * (1, 1, 0) + (0, 0, height)
    disk = around[::-1]
    disks = [*cap([disk], length, is_top=True), *cap([disk], -length, is_top=False)]
    lids = [face[:, [2, 0, 1]] for face in disks]
    return joined([*sides, *strip(rim, top), *cap([top[:, :2]], height, is_top=True), *lids])


SHAPES: dict[str, Callable[[], Mesh]] = {
    maker.__name__: maker for maker in (round_hole, gear, nut, bracket, plate, pocket, shaft, tee)
}
BLOCK = np.array([(-2, -1.5), (2, -1.5), (2, 1.5), (-2, 1.5)])


# -- outlines


def circle(angles: np.ndarray) -> Loop:
    """Return points (k, 2) of the unit circle."""
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def arc(
    centre: tuple[float, float] | np.ndarray, radius: float, start: float = 0.0, end: float = 2 * np.pi
) -> Loop:
    """Return points (k, 2) of an arc; a full circle has no point twice."""
    is_circle = abs(end - start) > 6.28
    count = round(abs(end - start) / ARC_STEP) + (not is_circle)
    return np.asarray(centre) + radius * circle(np.linspace(start, end, count, endpoint=not is_circle))


def rounded_rectangle() -> Loop:
    """Return the outline of a rectangle with rounded corners."""
    quarters = np.pi / 2 * np.arange(5)
    corners = zip(mechanical.CORNERS, pairwise(quarters), strict=True)
    return np.concatenate([arc(corner * (1.2, 0.7), 0.3, *ends) for corner, ends in corners])


def at_height(loop: Loop, height: float) -> np.ndarray:
    """Return points (k, 3) above those of a loop."""
    return np.column_stack([loop, np.full(len(loop), height)])


# -- solids


def prism(loops: list[Loop], height: float) -> Mesh:
    """Return the prism over the region inside the first loop and outside the others; all run counterclockwise."""
    outer, *holes = loops
    sides = [*walls(outer, 0.0, height), *(face for hole in holes for face in walls(hole[::-1], 0.0, height))]
    return joined([*cap(loops, 0.0, is_top=False), *sides, *cap(loops, height, is_top=True)])


def walls(loop: Loop, low: float, high: float) -> list[np.ndarray]:
    """Return the sides of a prism, which are seen from the right of the loop."""
    return strip(at_height(loop, low), at_height(loop, high))


def strip(low: np.ndarray, high: np.ndarray, is_closed: bool = True) -> list[np.ndarray]:
    """Return the quadrangles between two rows of points (k, 3)."""
    count = len(low)
    pairs = [(k, (k + 1) % count) for k in range(count if is_closed else count - 1)]
    return [np.array([low[a], low[b], high[b], high[a]]) for a, b in pairs]


def cap(loops: list[Loop], height: float, is_top: bool) -> list[np.ndarray]:
    """Return the triangles of a plane region, see `prism`, that face up or down."""
    points = at_height(np.concatenate(loops), height)
    triangles = points[region_triangles(loops)]
    return list(triangles if is_top else triangles[:, ::-1])


def joined(polygons: list[np.ndarray]) -> Mesh:
    """Return the mesh of convex polygons, each a fan of triangles at its last corner, with common points joined."""
    fans = [np.stack([polygon[[-1, k, k + 1]] for k in range(len(polygon) - 2)]) for polygon in polygons]
    corners = np.concatenate(fans).reshape(-1, 3)
    _, first, number = np.unique(np.round(corners, 9), axis=0, return_index=True, return_inverse=True)
    return corners[first], number.reshape(-1, 3)


# -- triangles of plane regions


def region_triangles(loops: list[Loop]) -> np.ndarray:
    """Return triangles (m, 3) of the points of loops, that cover the first without the others, by cutting off ears."""
    points = np.concatenate(loops)
    starts = np.cumsum([0, *map(len, loops)])
    outline = list(range(len(loops[0])))
    holes = [list(range(a, b))[::-1] for a, b in pairwise(starts[1:])]
    # The hole farthest to the right sees the outline.
    for hole in sorted(holes, key=lambda hole: -points[hole, 0].max()):
        outline = _bridged(points, outline, hole)
    triangles = []
    while len(outline) > 3:
        k = next(k for k in range(len(outline)) if _is_ear(points, outline, k))
        triangles.append([outline[k - 1], outline[k], outline[(k + 1) % len(outline)]])
        del outline[k]
    return np.array([*triangles, outline])


def _bridged(points: np.ndarray, outline: list[int], hole: list[int]) -> list[int]:
    """Return an outline that runs to a hole, around it, and back, along the shortest way that crosses nothing."""
    turn = int(np.argmax(points[hole, 0]))
    hole = hole[turn:] + hole[:turn]
    start = points[hole[0]]
    for k in np.argsort(np.linalg.norm(points[outline] - start, axis=1), kind="stable").tolist():
        end = points[outline[k]]
        if not any(_crosses(start, end, points[loop]) for loop in (outline, hole)):
            return [*outline[: k + 1], *hole, hole[0], *outline[k:]]
    raise ValueError("the loops cross")


def _crosses(start: np.ndarray, end: np.ndarray, loop: Loop) -> bool:
    """Return whether a segment crosses an edge of a loop in the inner of both."""
    heads = np.roll(loop, -1, axis=0)
    sides = _turn(start, end, loop) * _turn(start, end, heads)
    ends = _turn(loop, heads, start) * _turn(loop, heads, end)
    return bool(((sides < -1e-12) & (ends < -1e-12)).any())


def _is_ear(points: np.ndarray, outline: list[int], k: int) -> bool:
    """Return whether the corner k is convex and no other one is in its triangle."""
    a, b, c = (points[outline[i % len(outline)]] for i in (k - 1, k, k + 1))
    corners = points[outline]
    is_tip = [(corners == tip).all(axis=1) for tip in (a, b, c)]
    corners = corners[~np.any(is_tip, axis=0)]
    inside = [_turn(p, q, corners) >= -1e-12 for p, q in ((a, b), (b, c), (c, a))]
    return bool(_turn(a, b, c) > 1e-12) and not np.all(inside, axis=0).any()


def _turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Return twice the area of triangles, positive if they turn to the left."""
    first, second = b - a, c - a
    return first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
