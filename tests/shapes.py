"""Meshes with known answers."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from types import SimpleNamespace

import numpy as np

from coneflat import check_mesh
from coneflat.geometry import edge_lengths
from coneflat.layout import lay_out
from coneflat.mesh import cut_open
from coneflat.seams import find_seams
from coneflat.stages import Cut


def tetrahedron():
    vertices = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=float)
    return vertices, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])


def grid(columns: int = 8, rows: int = 6, height: Callable | None = None, wrap=(False, False)):
    """A grid of 2 * columns * rows triangles; `wrap` glues its left to its right, its bottom to its top."""
    u, v = np.meshgrid(np.arange(columns + (not wrap[0])), np.arange(rows + (not wrap[1])), indexing="ij")
    width, depth = u.shape
    index = np.arange(width * depth).reshape(width, depth)

    def corner(du, dv):
        i = (np.arange(columns) + du) % width
        j = (np.arange(rows) + dv) % depth
        return index[np.ix_(i, j)].ravel()

    a, b, c, d = corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    x, y = u.ravel() / columns, v.ravel() / rows
    z = np.zeros_like(x) if height is None else height(x, y)
    return np.stack([x, y, z], axis=1).astype(float), faces


def hill(columns: int = 24, rows: int = 20):
    """A curved disk."""
    return grid(columns, rows, lambda x, y: 0.6 * np.exp(-12 * ((x - 0.45) ** 2 + (y - 0.55) ** 2)))


def torus(around: int = 40, across: int = 20, radius: float = 0.4):
    """A torus of revolution, outward orientation, with a bulge so that it has no symmetry."""
    points, faces = grid(around, across, wrap=(True, True))
    s, t = 2 * np.pi * points[:, 0], 2 * np.pi * points[:, 1]
    r = radius * (1 + 0.3 * np.cos(s + 0.3) + 0.1 * np.sin(2 * t + s))
    ring = 1 + r * np.cos(t)
    return np.stack([ring * np.cos(s), ring * np.sin(s), r * np.sin(t)], axis=1), faces


def sphere(rounds: int = 3, bumps: float = 0.3, seed: int = 0):
    """An icosphere of 20 * 4**rounds triangles with smooth bumps."""
    g = (1 + 5**0.5) / 2
    vertices = np.array(
        [
            [-1, g, 0], [1, g, 0], [-1, -g, 0], [1, -g, 0], [0, -1, g], [0, 1, g],
            [0, -1, -g], [0, 1, -g], [g, 0, -1], [g, 0, 1], [-g, 0, -1], [-g, 0, 1],
        ]
    )  # fmt: skip
    faces = np.array(
        [
            [0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4],
            [11, 10, 2], [10, 7, 6], [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8],
            [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1],
        ]
    )  # fmt: skip
    for _ in range(rounds):
        vertices, faces = subdivide(vertices, faces)
    vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    directions = np.random.default_rng(seed).normal(size=(5, 3))
    return vertices * (1 + bumps * np.sin(2 * vertices @ directions.T).mean(axis=1))[:, None], faces


def subdivide(vertices, faces):
    """Split every triangle in four at the midpoints of its sides."""
    sides = np.sort(np.concatenate([faces[:, [1, 2]], faces[:, [2, 0]], faces[:, [0, 1]]]), axis=1)
    edges, which = np.unique(sides, axis=0, return_inverse=True)
    a, b, c = (which.ravel() + len(vertices)).reshape(3, -1)
    i, j, k = faces.T
    parts = [(i, c, b), (c, j, a), (b, a, k), (a, b, c)]
    middle = vertices[edges].mean(axis=1)
    return np.concatenate([vertices, middle]), np.concatenate([np.stack(part, 1) for part in parts])


def annulus(around: int = 40, rings: int = 8):
    """A bent ring: two boundary loops."""
    points, faces = grid(around, rings, wrap=(True, False))
    s, r = 2 * np.pi * points[:, 0], 0.4 + points[:, 1]
    return np.stack([r * np.cos(s), r * np.sin(s), 0.9 * np.sin(2 * s) * r**2], axis=1), faces


def blocks(pattern: list[str], size: int = 3):
    """The surface of unit cubes laid out on a plane as in a drawing, each face split finely.

    Genus is the number of holes in the drawing: blocks(["###", "#.#", "###"]) has genus 1.
    """
    solid = np.zeros((len(pattern) * size + 2, max(map(len, pattern)) * size + 2, size + 2), dtype=bool)
    for i, row in enumerate(pattern):
        for j, sign in enumerate(row):
            if sign == "#":
                solid[1 + i * size : 1 + (i + 1) * size, 1 + j * size : 1 + (j + 1) * size, 1:-1] = True
    quads = []
    for axis in range(3):
        for step in (1, -1):
            exposed = np.argwhere(solid & ~np.roll(solid, -step, axis=axis))
            base = exposed.copy()
            base[:, axis] += step > 0
            p, q = np.eye(3, dtype=int)[[(axis + 1) % 3, (axis + 2) % 3]]
            ring = [base, base + p, base + p + q, base + q]
            quads.append(np.stack(ring if step > 0 else ring[::-1], axis=1))
    vertices, index = np.unique(np.concatenate(quads).reshape(-1, 3), axis=0, return_inverse=True)
    a, b, c, d = index.ravel().reshape(-1, 4).T
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    # Rounded a little, so that the curvature is not all in the corners.
    points = vertices.astype(float) / size
    return points + 0.05 * np.sin(3 * points[:, [1, 2, 0]]), faces


def corridors(cells: int, seed: int = 1) -> np.ndarray:
    """Which of (2 cells + 1) x (2 cells + 1) blocks are the corridors of a maze without closed ways."""
    size, rng = 2 * cells + 1, np.random.default_rng(seed)
    is_corridor, way = np.zeros((size, size), dtype=bool), [(1, 1)]
    is_corridor[1, 1] = True
    while way:
        i, j = way[-1]
        steps = [(i + a, j + b) for a, b in ((2, 0), (-2, 0), (0, 2), (0, -2))]
        steps = [(a, b) for a, b in steps if 0 < a < size and 0 < b < size and not is_corridor[a, b]]
        if not steps:
            way.pop()
            continue
        a, b = steps[rng.integers(len(steps))]
        is_corridor[a, b] = is_corridor[(a + i) // 2, (b + j) // 2] = True
        way.append((a, b))
    return is_corridor


def without(vertices: np.ndarray, faces: np.ndarray, is_dropped: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The mesh without flagged triangles, and without vertices that none uses."""
    indices, corners = np.unique(faces[~is_dropped], return_inverse=True)
    return vertices[indices], corners.reshape(-1, 3)


def genus(handles: int):
    """A closed surface with so many handles."""
    return blocks(["#" * (2 * handles + 1), "#" + ".#" * handles, "#" * (2 * handles + 1)])


def moebius(around: int = 30, across: int = 3):
    """A strip with one side."""
    s = 2 * np.pi * np.arange(around) / around
    t = np.linspace(-0.3, 0.3, across + 1)
    s, t = (x.ravel() for x in np.meshgrid(s, t, indexing="ij"))
    r = 1 + t * np.cos(s / 2)
    vertices = np.stack([r * np.cos(s), r * np.sin(s), t * np.sin(s / 2)], axis=1)
    faces = []
    for i in range(around):
        for j in range(across):
            a, d = i * (across + 1) + j, i * (across + 1) + j + 1
            b, c = a + across + 1, d + across + 1
            if i == around - 1:
                b, c = across - j, across - j - 1
            faces += [[a, b, c], [a, c, d]]
    return vertices, np.array(faces)


def join(*parts):
    """Several meshes as one."""
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in parts])
    return (
        np.concatenate([vertices for vertices, _ in parts]),
        np.concatenate([faces + start for (_, faces), start in zip(parts, starts[:-1], strict=True)]),
    )


def renumber(vertices, faces, seed: int = 1):
    """The same mesh with vertices, faces and corners in another order, and the new number of each vertex."""
    rng = np.random.default_rng(seed)
    numbers = rng.permutation(len(vertices))
    shuffled = np.empty_like(vertices)
    shuffled[numbers] = vertices
    turned = np.stack(
        [
            np.roll(face, shift)
            for face, shift in zip(numbers[faces], rng.integers(0, 3, len(faces)), strict=True)
        ]
    )
    return shuffled, turned[rng.permutation(len(faces))], numbers


def rotation(seed: int = 2):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def box(cells: int = 4, sides=(1.0, 2.0, 3.0)):
    """A box with square-cut faces."""
    steps = np.linspace(0, 1, cells + 1)
    points, faces, count = [], [], (cells + 1) ** 2
    for axis in range(3):
        for end in (0, 1):
            sheet = np.zeros((cells + 1, cells + 1, 3))
            sheet[..., axis] = end
            sheet[..., (axis + 1) % 3], sheet[..., (axis + 2) % 3] = np.meshgrid(steps, steps, indexing="ij")
            i, j = np.meshgrid(np.arange(cells), np.arange(cells), indexing="ij")
            q = (len(points) * count + i * (cells + 1) + j).ravel()
            side = np.concatenate(
                [np.stack([q, q + cells + 1, q + cells + 2], 1), np.stack([q, q + cells + 2, q + 1], 1)]
            )
            points.append(sheet.reshape(-1, 3))
            faces.append(side if end else side[:, ::-1])
    vertices, number = np.unique(np.round(np.concatenate(points), 9), axis=0, return_inverse=True)
    return vertices * np.array(sides), number.ravel()[np.concatenate(faces)]


def cylinder(around: int = 24, along: int = 8, height: float = 3.0, caps: bool = False):
    """A cylinder of radius 1, open or with flat caps of one triangle per side."""
    points, faces = grid(around, along, wrap=(True, False))
    angle = 2 * np.pi * points[:, 0]
    vertices = np.stack([np.cos(angle), np.sin(angle), height * points[:, 1]], axis=1)
    if not caps:
        return vertices, faces
    lids = []
    for index, level in enumerate((0, 1)):
        rim = np.flatnonzero(points[:, 1] == level)
        lids.append(np.stack([rim, np.roll(rim, -1), np.full(around, len(vertices) + index)], axis=1))
    return np.concatenate([vertices, [[0, 0, 0], [0, 0, height]]]), np.concatenate([faces, *lids])


def bottle(around: int = 48, along: int = 60):
    """A bottle, open at its neck, with a hole in its side."""
    points, faces = grid(around, along, wrap=(True, False))
    up, angle = points[:, 1], 2 * np.pi * points[:, 0]
    shoulder = np.clip((up - 0.6) / 0.2, 0, 1)
    radius = 0.35 + 0.325 * (1 + np.cos(np.pi * shoulder))
    side = np.stack([radius * np.cos(angle), radius * np.sin(angle), 3 * up], axis=1)
    rim = np.flatnonzero(up == 0)
    rings, floor, count = [rim], [], len(side)
    for part in (0.75, 0.5, 0.25):
        rings.append(count + np.arange(around))
        floor.append(side[rim] * [part, part, 0])
        count += around
    lid = []
    for outer, inner in pairwise(rings):
        lid += [
            np.stack([outer, inner, np.roll(inner, -1)], 1),
            np.stack([outer, np.roll(inner, -1), np.roll(outer, -1)], 1),
        ]
    lid.append(np.stack([rings[-1], np.full(around, count), np.roll(rings[-1], -1)], 1))
    middle = side[faces].mean(axis=1)
    is_wall = ~((np.abs(middle[:, 2] - 1) < 0.3) & (middle[:, 0] > 0.85))
    return np.concatenate([side, *floor, [[0.0, 0.0, 0.0]]]), np.concatenate([faces[is_wall], *lid])


def tube(around: int = 48, along: int = 12):
    """A result: a cylinder about z, unrolled, with two points of the cut marked as cones."""
    angle, z = np.meshgrid(np.arange(around + 1) / around, np.linspace(0.0, 1.0, along), indexing="ij")
    uv = np.column_stack([angle.ravel(), z.ravel() / (2 * np.pi)])
    corner = (np.arange(around)[:, None] * along + np.arange(along - 1)).ravel()
    uv_faces = np.vstack(
        [
            np.column_stack([corner, corner + along, corner + along + 1]),
            np.column_stack([corner, corner + along + 1, corner + 1]),
        ]
    )
    turn = 2 * np.pi * angle[:-1].ravel()
    vertices = np.column_stack([np.cos(turn), np.sin(turn), z[:-1].ravel()])
    seams = np.column_stack([np.arange(along - 1), np.arange(1, along)])
    faces = uv_faces % len(vertices)
    qc = np.linspace(1.0, 1.2, len(faces))
    qc[0] = np.nan
    log_scale = np.full(len(faces), np.log(1 / (2 * np.pi)))
    log_scale[0] = np.nan
    return SimpleNamespace(
        vertices=vertices,
        faces=faces,
        uv=uv,
        uv_faces=uv_faces,
        corner_uv=uv[uv_faces],
        cones=np.array([0, along - 1]),
        curvatures=np.array([1.0, -1.0]),
        seams=seams,
        curvature_residual=np.full(len(vertices), 1e-13),
        distortion=SimpleNamespace(qc=qc, log_area_scale=log_scale, qc_mean=1.1, flipped=0, seam_length=0.4),
        source=None,
    )


def similar(points, reference):
    """Return the points after the similarity that brings them closest to the reference."""
    z, w = points @ [1, 1j], reference @ [1, 1j]
    z, w = z - z.mean(), w - w.mean()
    return np.abs(z * (np.vdot(z, w) / np.vdot(z, z)) - w).max()


def cut_disk(vertices, faces, cones=()):
    """Return a mesh cut open."""
    mesh = check_mesh(vertices, faces).mesh
    costs = np.linalg.norm(np.diff(mesh.vertices[mesh.edges], axis=1)[:, 0], axis=1)
    return cut_open(mesh, find_seams(mesh, np.array(cones, dtype=np.int64), costs)).mesh


def laid_out(metric):
    """Return the layout of a flat metric, whose mesh is cut along short edges."""
    mesh = metric.mesh
    costs = np.linalg.norm(np.diff(mesh.vertices[mesh.edges], axis=1)[:, 0], axis=1)
    seams = find_seams(mesh, metric.cones, costs)
    return lay_out(metric, Cut(cut_open(mesh, seams).mesh, seams))


def lengths_of(mesh):
    return edge_lengths(mesh.vertices, mesh.faces)


def write_obj(path, vertices, faces, uv=None):
    """Write a mesh as OBJ, with a UV point for every vertex if there are any, and return the path."""
    lines = ["v {!r} {!r} {!r}".format(*point) for point in np.asarray(vertices, float).tolist()]
    lines += ["vt {!r} {!r}".format(*point) for point in ([] if uv is None else uv.tolist())]
    corner = "{0}" if uv is None else "{0}/{0}"
    lines += ["f " + " ".join(map(corner.format, face)) for face in (np.asarray(faces) + 1).tolist()]
    path.parent.mkdir(exist_ok=True, parents=True)
    path.write_text("\n".join(lines) + "\n")
    return path
