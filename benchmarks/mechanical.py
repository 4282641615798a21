"""Mechanical shapes with sharp edges, fillets, holes and ribs, as closed triangle meshes."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from common import shapes as common_shapes
from scipy.spatial import Delaunay

Mesh = tuple[np.ndarray, np.ndarray]


def shapes() -> dict[str, Mesh]:
    """Return the shapes by name, of 4,000 to 20,000 triangles."""
    return {name: make() for name, make in SHAPES.items()}


def bracket() -> Mesh:
    """Return an L-shaped bracket with a fillet in its corner and three holes."""
    fillet = arc((1.0, 1.0), 0.4, 1.5 * np.pi, np.pi)
    outer = polygon([(0, 0), (3, 0), (3, 0.6), *fillet, (0.6, 2.5), (0, 2.5)])
    holes = [arc((2.5, 0.3), 0.15), arc((1.6, 0.3), 0.15), arc((0.3, 2.1), 0.17)]
    return extruded([outer, *map(polygon, holes)], 0.8)


def ribs() -> Mesh:
    """Return a plate with four ribs."""
    corners: list[tuple[float, float]] = [(0, 0), (4, 0), (4, 0.3)]
    for left in (3.3, 2.3, 1.3, 0.3):
        corners += [(left + 0.4, 0.3), (left + 0.4, 1.1), (left, 1.1), (left, 0.3)]
    return extruded([polygon([*corners, (0, 0.3)])], 2.0)


def plate() -> Mesh:
    """Return a rounded plate with a slot and four holes."""
    outer = [
        point
        for k in range(4)
        for point in arc(CORNERS[k] * (1.2, 0.7), 0.3, k * np.pi / 2, (k + 1) * np.pi / 2)
    ]
    slot = [*arc((0.4, 0), 0.2, -np.pi / 2, np.pi / 2), *arc((-0.4, 0), 0.2, np.pi / 2, 1.5 * np.pi)]
    holes = [arc(corner * (1.15, 0.65), 0.12) for corner in CORNERS]
    return extruded([polygon(loop) for loop in (outer, slot, *holes)], 0.35)


def gear() -> Mesh:
    """Return a gear of twelve teeth with a bore."""
    angles = (2 * np.pi / 12 * (np.arange(12)[:, None] + [0, 0.2, 0.45, 0.65])).ravel()
    radii = np.tile([0.8, 1.05, 1.05, 0.8], 12)
    teeth = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    return extruded([polygon(teeth), polygon(arc((0, 0), 0.3))], 0.5)


def shaft() -> Mesh:
    """Return a stepped shaft with a fillet, turned about the z axis."""
    fillet = arc((0.65, 1.35), 0.15, np.pi, 1.5 * np.pi)
    return turned(
        [
            (0, 0),
            (0.3, 0),
            (0.3, 0.5),
            (0.5, 0.5),
            (0.5, 1.2),
            *fillet[::-1],
            (0.9, 1.2),
            (0.9, 1.6),
            (0, 1.6),
        ]
    )


def wedge() -> Mesh:
    """Return a block with two slanted sides."""
    return extruded([polygon([(0, 0), (2, 0), (2, 0.5), (1.2, 1.3), (0, 1.3)])], 1.0)


def maze(cells: int = 12, corridor: float = 0.3, wall: float = 0.04) -> Mesh:
    """Return the floor of a maze: a flat sheet with narrow gaps between its corridors, and one long boundary."""
    is_corridor = common_shapes.corridors(cells)
    places = np.concatenate([[0.0], np.cumsum(np.where(np.arange(len(is_corridor)) % 2, corridor, wall))])
    lines, marks = zip(*(_finer(places) for _ in range(2)), strict=True)
    i, j = np.nonzero(is_corridor[np.ix_(*marks)])
    count = len(lines[1])
    quads = np.stack([i * count + j, (i + 1) * count + j, (i + 1) * count + j + 1, i * count + j + 1], axis=1)
    corners, quads = np.unique(quads, return_inverse=True)
    quads = quads.reshape(-1, 4)
    flat = [lines[0][corners // count], lines[1][corners % count], np.zeros(len(corners))]
    vertices = np.stack(flat, axis=1)
    return vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def cut_maze(cells: int = 10, corridor: float = 0.3, wall: float = 0.04, depth: float = 0.5) -> Mesh:
    """Return a plate into which the corridors of a maze are cut, with thin walls between them."""
    is_corridor = common_shapes.corridors(cells)
    places = np.concatenate([[0.0], np.cumsum(np.where(np.arange(len(is_corridor)) % 2, corridor, wall))])
    is_solid = np.stack([np.ones_like(is_corridor), ~is_corridor], axis=2)
    return blocks(is_solid, (places, places, np.array([0.0, 0.1, 0.1 + depth])))


def thin_box(thickness: float = 0.02) -> Mesh:
    """Return a box of unit size with a closed hollow, which thin walls surround."""
    places = np.array([0.0, thickness, 1.0 - thickness, 1.0])
    is_solid = np.ones((3, 3, 3), dtype=bool)
    is_solid[1, 1, 1] = False
    return blocks(is_solid, (places, places, places))


def open_box(thickness: float = 0.02) -> Mesh:
    """Return a box of unit size with thin walls, which is open at the top."""
    places = np.array([0.0, thickness, 1.0 - thickness, 1.0])
    is_solid = np.ones((3, 3, 2), dtype=bool)
    is_solid[1, 1, 1] = False
    return blocks(is_solid, (places, places, places[:3]))


def pierced_shell(thickness: float = 0.04) -> Mesh:
    """Return a hollow box with thirteen windows in its walls, a surface with a dozen handles."""
    middles = np.linspace(thickness, 1.0 - thickness, 8)
    places = np.concatenate([[0.0], middles, [1.0]])
    is_solid = np.ones((9, 9, 9), dtype=bool)
    is_solid[1:-1, 1:-1, 1:-1] = False
    for i, j in [(2, 2), (2, 5), (5, 2), (5, 5)]:
        is_solid[i, j, 0] = is_solid[i, 0, j] = is_solid[0, i, j] = False
    is_solid[4, 4, -1] = False
    return blocks(is_solid, (places, places, places))


def boot(thickness: float = 0.03, around: int = 120) -> Mesh:
    """Return a boot with an inside and twelve eyelets, a curved surface with a dozen handles."""
    along = np.linspace(0, 1, around)[:-1]
    # The middle line bends from the leg to the toes.
    bend = np.pi / 2 / (1 + np.exp(-14 * (along - 0.5)))
    middle = 2.5 / around * np.cumsum(np.stack([np.sin(bend), -np.cos(bend)], axis=1), axis=0)
    radius = (0.4 + 0.06 * np.cos(7 * along)) * np.sqrt(1 - along**8)
    angle = 2 * np.pi * np.arange(around) / around
    front, side = radius[:, None] * np.cos(angle), radius[:, None] * np.sin(angle)
    x = middle[:, :1] + np.cos(bend)[:, None] * front
    z = middle[:, 1:] + np.sin(bend)[:, None] * front
    sheet = np.stack([x, side, z], axis=2).reshape(-1, 3)
    tip = np.array([[middle[-1, 0] + 0.02, 0.0, middle[-1, 1]]])
    row, column = (index.ravel() for index in np.indices((len(along) - 1, around)))
    turned = np.minimum(column, around - column) / around
    rows, places = 0.1 + 0.06 * np.arange(6), 0.06
    is_eyelet = (np.abs(row[:, None] / around - rows).min(axis=1) < 0.015) & (np.abs(turned - places) < 0.015)
    row, column = row[~is_eyelet], column[~is_eyelet]
    after = (column + 1) % around
    first = np.stack([row * around + column, (row + 1) * around + column, (row + 1) * around + after], axis=1)
    second = np.stack([row * around + column, (row + 1) * around + after, row * around + after], axis=1)
    last = (len(along) - 1) * around + np.arange(around)
    fan = np.stack([last, np.full(around, len(sheet)), np.roll(last, -1)], axis=1)
    return thickened(np.concatenate([sheet, tip]), np.concatenate([first, second, fan]), thickness)


def thickened(vertices: np.ndarray, faces: np.ndarray, thickness: float) -> Mesh:
    """Return the closed surface of a sheet with a thickness; each boundary after the first makes a handle."""
    at, corners = np.unique(faces, return_inverse=True)
    points, faces = vertices[at], corners.reshape(-1, 3)
    normals = np.zeros_like(points)
    steps = points[faces[:, 1:]] - points[faces[:, :1]]
    np.add.at(normals, faces.ravel(), np.cross(steps[:, 0], steps[:, 1]).repeat(3, axis=0))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    keys, back = sides @ (len(points), 1), sides[:, ::-1] @ (len(points), 1)
    a, b = sides[~np.isin(keys, back)].T
    inner = len(points)
    rims = np.concatenate([np.stack([b, a, a + inner], axis=1), np.stack([b, a + inner, b + inner], axis=1)])
    return np.concatenate([points, points - thickness * normals]), np.concatenate(
        [faces, faces[:, ::-1] + inner, rims]
    )


def small_blocks(count: int = 60) -> Mesh:
    """Return separate blocks of different sizes."""
    rng, parts = np.random.default_rng(1), []
    for k in range(count):
        sides = rng.uniform(0.1, 0.5, 3)
        corner = np.array([k % 8, k // 8 % 8, 0.0])
        places = [corner[x] + np.array([0.0, sides[x]]) for x in range(3)]
        parts.append(blocks(np.ones((1, 1, 1), dtype=bool), (places[0], places[1], places[2])))
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    faces = [first + faces for first, (_, faces) in zip(starts, parts, strict=False)]
    return np.concatenate([vertices for vertices, _ in parts]), np.concatenate(faces)


SHAPES: dict[str, Callable[[], Mesh]] = {
    maker.__name__: maker for maker in (bracket, gear, plate, ribs, shaft, wedge)
}
#: Shapes that need many quads: thin walls, narrow corridors, handles, components.
NARROW_SHAPES: dict[str, Callable[[], Mesh]] = {
    maker.__name__: maker for maker in (boot, cut_maze, maze, open_box, pierced_shell, small_blocks, thin_box)
}
CORNERS = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
#: Edge length of the meshes.
SPACING = 0.05
#: Edge length of the meshes of blocks.
BLOCK_SPACING = 0.1


def arc(
    centre: tuple[float, float] | np.ndarray, radius: float, start: float = 0.0, end: float = 2 * np.pi
) -> list:
    """Return points on an arc; a full circle has no point twice."""
    is_circle = abs(end - start) > 6.2
    count = max(5, int(np.ceil(abs(end - start) * radius / SPACING)))
    angle = np.linspace(start, end, count, endpoint=not is_circle)
    return (np.asarray(centre) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)).tolist()


def polygon(corners: list | np.ndarray) -> np.ndarray:
    """Return points along a closed polygon at most SPACING apart."""
    points = np.asarray(corners, dtype=np.float64)
    parts = []
    for start, end in zip(points, np.roll(points, -1, axis=0), strict=True):
        count = max(1, int(np.ceil(np.linalg.norm(end - start) / SPACING - 1e-9)))
        parts.append(start + (end - start) * (np.arange(count) / count)[:, None])
    return np.concatenate(parts)


def extruded(loops: list[np.ndarray], height: float) -> Mesh:
    """Return the prism over the region inside the first loop and outside the others."""
    border = np.concatenate(loops)
    flat = np.concatenate([border, _inner_points(loops)])
    faces = Delaunay(flat).simplices
    first_corner, second_corner, third_corner = (flat[faces[:, i]] for i in range(3))
    turn = _cross(second_corner - first_corner, third_corner - first_corner)
    # Three points on a line make triangles without area.
    is_inside = _is_inside(flat[faces].mean(axis=1), loops) & (np.abs(turn) > 1e-9)
    faces = np.where((turn > 0)[:, None], faces, faces[:, ::-1])[is_inside]
    layers, count = int(np.ceil(height / SPACING)), len(flat)
    vertices = [np.column_stack([flat, np.full(count, z)]) for z in (0.0, height)]
    levels = height * np.arange(1, layers) / layers
    vertices += [np.column_stack([border, np.full(len(border), z)]) for z in levels]
    starts = np.concatenate([[0], 2 * count + len(border) * np.arange(layers - 1), [count]])
    sides = []
    for low, high in pairwise(starts):
        first = 0
        for loop in loops:
            ring = first + np.arange(len(loop))
            after = np.roll(ring, -1)
            first += len(loop)
            area = _cross(loop, np.roll(loop, -1, axis=0)).sum()
            outer = area > 0 if loop is loops[0] else area < 0
            a, b = (ring, after) if outer else (after, ring)
            sides += [np.stack([low + a, low + b, high + b], 1), np.stack([low + a, high + b, high + a], 1)]
    return np.concatenate(vertices), np.concatenate([faces[:, ::-1], faces + count, *sides])


def _inner_points(loops: list[np.ndarray]) -> np.ndarray:
    low, high = loops[0].min(axis=0), loops[0].max(axis=0)
    rows = np.arange(low[1], high[1], SPACING * np.sqrt(0.75))
    columns = np.arange(low[0], high[0], SPACING)
    flat = np.concatenate(
        [
            np.column_stack([columns + SPACING / 2 * (k % 2), np.full(len(columns), y)])
            for k, y in enumerate(rows)
        ]
    )
    flat = flat[_is_inside(flat, loops)]
    gaps = np.linalg.norm(flat[:, None] - np.concatenate(loops), axis=2).min(axis=1)
    return flat[gaps > 0.6 * SPACING]


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _is_inside(points: np.ndarray, loops: list[np.ndarray]) -> np.ndarray:
    """Return whether each point is inside an odd number of loops."""
    inside = np.zeros(len(points), dtype=bool)
    for loop in loops:
        for start, end in zip(loop, np.roll(loop, -1, axis=0), strict=True):
            crosses = (start[1] > points[:, 1]) != (end[1] > points[:, 1])
            with np.errstate(divide="ignore", invalid="ignore"):
                x = start[0] + (points[:, 1] - start[1]) / (end[1] - start[1]) * (end[0] - start[0])
            inside ^= crosses & (points[:, 0] < x)
    return inside


def turned(profile: list, around: int = 96) -> Mesh:
    """Return the solid of revolution of a profile (radius, z) that starts and ends on the axis."""
    points = np.asarray(profile, dtype=np.float64)
    inner = [
        start + (end - start) * t
        for start, end in pairwise(points)
        for count in [max(1, int(np.ceil(np.linalg.norm(end - start) / SPACING - 1e-9)))]
        for t in np.arange(count) / count
    ][1:]
    rings = np.array(inner)
    angle = 2 * np.pi * np.arange(around) / around
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    vertices = [np.column_stack([radius * circle, np.full(around, z)]) for radius, z in rings]
    poles = np.array([[0, 0, points[0, 1]], [0, 0, points[-1, 1]]])
    at, after = np.arange(around), np.roll(np.arange(around), -1)
    faces = []
    for k in range(len(rings) - 1):
        low, high = around * k, around * (k + 1)
        faces += [
            np.stack([low + at, low + after, high + after], 1),
            np.stack([low + at, high + after, high + at], 1),
        ]
    count, last = around * len(rings), around * (len(rings) - 1)
    faces += [
        np.stack([np.full(around, count), after, at], 1),
        np.stack([np.full(around, count + 1), last + at, last + after], 1),
    ]
    return np.concatenate([*vertices, poles]), np.concatenate(faces)


def blocks(is_solid: np.ndarray, places: tuple[np.ndarray, np.ndarray, np.ndarray]) -> Mesh:
    """Return the surface of the solid cells of a grid of blocks, in triangles with sides of about `BLOCK_SPACING`.

    Args:
        is_solid: (a, b, c) whether each cell is solid.
        places: coordinates of the a + 1, b + 1 and c + 1 planes between the cells.
    """
    lines, cells = zip(*(_finer(line) for line in places), strict=True)
    padded = np.pad(is_solid[np.ix_(*cells)], 1)
    shape = np.array(padded.shape) - 1
    sides = []
    for axis in range(3):
        ahead = np.moveaxis(padded, axis, 0)
        for is_out, turns in ((ahead[:-1] & ~ahead[1:], 1), (ahead[1:] & ~ahead[:-1], -1)):
            place, *across = np.nonzero(is_out)
            square = np.empty((len(place), 4, 3), dtype=np.int64)
            first, second = (axis + 1) % 3, (axis + 2) % 3
            of_axis = dict(zip([k for k in range(3) if k != axis], across, strict=True))
            for corner, (a, b) in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))[::turns]):
                square[:, corner, axis] = place
                square[:, corner, first] = of_axis[first] - 1 + a
                square[:, corner, second] = of_axis[second] - 1 + b
            sides.append(square)
    corners = np.concatenate(sides)
    numbers = np.ravel_multi_index(tuple(np.moveaxis(corners, 2, 0)), tuple(shape))
    corners_of_grid, numbers = np.unique(numbers, return_inverse=True)
    quads = numbers.reshape(-1, 4)
    grid = np.unravel_index(corners_of_grid, tuple(shape))
    vertices = np.stack([line[at] for line, at in zip(lines, grid, strict=True)], axis=1)
    return vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _finer(line: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return coordinates at most `BLOCK_SPACING` apart, and the cell of the given ones that each gap is in."""
    counts = np.maximum(np.ceil(np.diff(line) / BLOCK_SPACING - 1e-9), 1).astype(np.int64)
    parts = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(line, line[1:], counts, strict=False)]
    return np.concatenate([*parts, line[-1:]]), np.repeat(np.arange(len(counts)), counts)
