"""Integer-grid maps with known quad meshes."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from scipy.spatial import Delaunay
from shapes import torus

from coneflat import TriangleMesh, check_mesh
from coneflat.mesh import label_components

QUARTER = np.array([[0, -1], [1, 0]])


def with_motions(vertices, faces, corner_grid, cones=None):
    """Return the map with the motions across its edges, and its cones by the angles that it has."""
    faces, corner_grid = np.asarray(faces), np.asarray(corner_grid, dtype=float)
    mesh = TriangleMesh(np.asarray(vertices, dtype=float), faces)
    turns, shifts = np.full(faces.size, -1), np.zeros((faces.size, 2), dtype=int)
    z = corner_grid @ [1, 1j]
    for one, two in mesh.edge_halfedges[~mesh.is_boundary_edge]:
        for h, t in ((one, two), (two, one)):
            a, b = (z[h // 3, (h % 3 + k) % 3] for k in (1, 2))
            c, d = (z[t // 3, (t % 3 + k) % 3] for k in (2, 1))
            turns[h] = round(np.angle((b - a) / (d - c)) / (np.pi / 2)) % 4
            shift = a - 1j ** int(turns[h]) * c
            shifts[h] = round(shift.real), round(shift.imag)
    sides = np.roll(z, -1, axis=1) - z
    angle = np.angle(-np.roll(sides, 1, axis=1) / sides)
    total = np.bincount(faces.ravel(), angle.ravel(), len(mesh.vertices))
    quarters = np.round(total / (np.pi / 2)).astype(int)
    cones = np.flatnonzero((quarters != 4) & ~mesh.is_boundary_vertex)
    return SimpleNamespace(
        vertices=mesh.vertices,
        faces=faces,
        corner_grid=corner_grid,
        turns=turns,
        shifts=shifts,
        cones=cones,
        quarters=quarters[cones],
    )


def on_squares(points, squares, cells=5, inside=6, along=2, seed=0):
    """Return a map of a surface of squares, each so many cells wide, triangulated at random in a chart of its own.

    points: (n, 3) corners; squares: (s, 4) counterclockwise. Every square's coordinates are turned and moved at random.
    inside, along: points inside each square and within each edge.
    """
    rng = np.random.default_rng(seed)
    number, at = {}, [*np.asarray(points, dtype=float)]
    steps = {}
    faces, grid = [], []
    for square in np.asarray(squares).tolist():
        local, index = [], []
        unit = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
        for i in range(4):
            a, b = square[i], square[(i + 1) % 4]
            key = (min(a, b), max(a, b))
            t = steps.setdefault(key, np.sort(rng.uniform(0.1, 0.9, along)))
            for k in range(along):
                share = t[k] if a < b else 1 - t[k]
                if (key, k) not in number:
                    number[key, k] = len(at)
                    at.append(at[key[0]] + t[k] * (at[key[1]] - at[key[0]]))
                local.append(unit[i] + share * (unit[(i + 1) % 4] - unit[i]))
                index.append(number[key, k])
        local += [*unit]
        index += square
        p, q, r, s = (at[k] for k in square)
        for u, v in rng.uniform(0.05, 0.95, (inside, 2)):
            local.append(np.array([u, v]))
            index.append(len(at))
            at.append((1 - u) * (1 - v) * p + u * (1 - v) * q + u * v * r + (1 - u) * v * s)
        local, index = np.array(local), np.array(index)
        triangles = Delaunay(local).simplices
        x, y = np.moveaxis(local[triangles], -1, 0)
        area = (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0])
        triangles = np.where((area < 0)[:, None], triangles[:, ::-1], triangles)[np.abs(area) > 1e-9]
        turned = np.linalg.matrix_power(QUARTER, int(rng.integers(4)))
        moved = local * cells @ turned.T + rng.integers(-50, 50, 2)
        faces.append(index[triangles])
        grid.append(moved[triangles])
    return with_motions(np.array(at), np.concatenate(faces), np.concatenate(grid))


def polycube(cells):
    """Return the corners and squares of the surface of unit cubes at whole places (k, 3)."""
    cells = {tuple(cell) for cell in np.asarray(cells).tolist()}
    squares = []
    for cell in sorted(cells):
        for axis in range(3):
            for step in (1, -1):
                beside = list(cell)
                beside[axis] += step
                if tuple(beside) in cells:
                    continue
                base = np.array(cell)
                base[axis] += step > 0
                p, q = np.eye(3, dtype=int)[[(axis + 1) % 3, (axis + 2) % 3]]
                ring = [base, base + p, base + p + q, base + q]
                squares.append(ring if step > 0 else ring[::-1])
    points, index = np.unique(np.array(squares).reshape(-1, 3), axis=0, return_inverse=True)
    return points.astype(float), index.reshape(-1, 4)


CUBE = [(0, 0, 0)]
L_SHAPE = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
TRIPOD = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
RING = [(i, j, 0) for i in range(3) for j in range(3) if (i, j) != (1, 1)]
TWO_RINGS = [(i, j, 0) for i in range(5) for j in range(3) if (i, j) not in ((1, 1), (3, 1))]


def flat(corner_grid, faces):
    """Return a map of a plane mesh with vertices (n, 2) in grid units in one chart; the surface lies at z = 0."""
    points = np.asarray(corner_grid, dtype=float)
    return with_motions(np.column_stack([points, np.zeros(len(points))]), faces, points[faces])


def torus_map(along, across, shear, seed=0):
    """Return a map of a torus: a parallelogram of so many units, the other way around shifted by a shear, in one chart.

    Its triangles are not on grid lines, and every vertex's coordinates are moved by whole periods at random.
    """
    rng = np.random.default_rng(seed)
    around, wide = 17, 11
    vertices, faces = torus(around, wide)
    index = np.arange(len(vertices))
    u, v = index // wide / around, index % wide / wide
    u, v = (z + 0.02 * rng.uniform(-1, 1, len(z)) for z in (u, v))
    parameters = np.stack([u, v], axis=1)[faces]
    # Corners of a triangle are near each other.
    parameters -= np.round(parameters - parameters[:, :1])
    parameters += rng.integers(-3, 3, (len(faces), 1, 2))
    corner_grid = parameters @ np.array([[along, 0], [shear, across]], dtype=float)
    return with_motions(vertices, faces, corner_grid + 0.37)


def random_sheet(seed):
    """Return a map of a random polygon with a hole, with the squares that lie on it whole, and its area."""
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, 14))
    radius = rng.uniform(4, 9, 14)
    outline = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    hole = 1.6 * np.array([[1, 0.1], [0, 1], [-1, -0.2], [0.1, -1]]) + rng.uniform(-0.5, 0.5, 2)
    points = rng.uniform(-9, 9, (700, 2))
    triangles = Delaunay(points).simplices
    middle = points[triangles].mean(axis=1)
    kept = triangles[_within(outline, middle) & ~_within(hole, middle)]
    kept = _largest_manifold(kept, len(points))
    used, index = np.unique(kept, return_inverse=True)
    points, kept = points[used], index.reshape(-1, 3)
    x, y = np.moveaxis(points[kept], -1, 0)
    area = (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0])
    kept = np.where((area < 0)[:, None], kept[:, ::-1], kept)
    sheet = flat(points, kept)
    sheet.area = float(np.abs(area).sum() / 2)
    sheet.whole_squares = {
        (i, j) for i in range(-10, 10) for j in range(-10, 10) if _covers(points[kept], i, j)
    }
    return sheet


def _within(outline, points):
    """Return which points lie in a polygon, by the number of sides to the right of them."""
    inside = np.zeros(len(points), dtype=bool)
    for (ax, ay), (bx, by) in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        crosses = (ay > points[:, 1]) != (by > points[:, 1])
        at = ax + (points[:, 1] - ay) / (by - ay) * (bx - ax)
        inside ^= crosses & (points[:, 0] < at)
    return inside


def _largest_manifold(faces, count):
    """Return the largest part of triangles that hang together by edges, with a fan at each vertex."""
    points = np.random.default_rng(0).normal(size=(count, 3))
    while True:
        mesh = TriangleMesh(points, faces)
        pairs = mesh.edge_faces[~mesh.is_boundary_edge]
        _, part = label_components(len(faces), pairs[:, 0], pairs[:, 1])
        faces = faces[part == np.argmax(np.bincount(part))]
        mesh = TriangleMesh(points, faces)
        ends = mesh.edges[mesh.is_boundary_edge].ravel()
        pinched = np.flatnonzero(np.bincount(ends, minlength=count) > 2)
        if not len(pinched):
            check_mesh(points, faces, repair=False)
            return faces
        faces = faces[~np.isin(faces, pinched).any(axis=1)]


def _covers(triangles, i, j):
    """Return whether triangles cover the unit square with the least corner (i, j)."""
    total = 0.0
    for triangle in triangles:
        polygon = triangle
        for axis, bound, sign in ((0, i, 1), (0, i + 1, -1), (1, j, 1), (1, j + 1, -1)):
            polygon = _clipped(polygon, sign * (polygon[:, axis] - bound))
            if len(polygon) == 0:
                break
        if len(polygon) > 2:
            x, y = polygon.T
            total += (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    return total > 1 - 1e-9


def _clipped(polygon, height):
    """Return the part of a convex polygon where the height, given at its corners, is not negative."""
    kept = []
    for k in range(len(polygon)):
        following = (k + 1) % len(polygon)
        if height[k] >= 0:
            kept.append(polygon[k])
        if (height[k] < 0) != (height[following] < 0):
            share = height[k] / (height[k] - height[following])
            kept.append(polygon[k] + share * (polygon[following] - polygon[k]))
    return np.array(kept)


def broken(grid, **changes):
    return SimpleNamespace(**{**vars(grid), **changes})


def bumpy(seed=0, cells=5):
    grid = on_squares(*polycube(TWO_RINGS), cells, inside=12, seed=seed)
    p = grid.vertices
    return broken(grid, vertices=p + 0.06 * np.sin(3 * p[:, [1, 2, 0]]) + 0.03 * np.sin(9 * p[:, [2, 0, 1]]))


def quad_areas(mesh):
    corners = mesh.vertices[mesh.quads]
    cross = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    return np.linalg.norm(cross, axis=1) / 2
