"""Integer-grid maps with known quad meshes."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from scipy.spatial import Delaunay
from shapes import torus

from coneflat import TriangleMesh

QUARTER = np.array([[0, -1], [1, 0]])


def with_motions(vertices, faces, corner_grid, cones=None):
    """Return the map with the motions across its edges, and its cones by the angles that it has."""
    faces, corner_grid = np.asarray(faces), np.asarray(corner_grid, dtype=float)
    mesh = TriangleMesh(np.asarray(vertices, dtype=float), faces)
    turns, shifts = np.full(faces.size, -1), np.zeros((faces.size, 2), dtype=int)
    z = corner_grid @ [1, 1j]
    for first, second in mesh.edge_halfedges[~mesh.is_boundary_edge]:
        for h, t in ((first, second), (second, first)):
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
