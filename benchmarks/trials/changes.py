"""Changes of a mesh, most of which make it hostile, from a random generator."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import shapes
from needles import with_caps, with_needles

from .surfaces import MAKERS, Mesh, Random, amount


def hole(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    centre = vertices[faces[rng.integers(len(faces))]].mean(axis=0)
    away = np.linalg.norm(vertices[faces].mean(axis=1) - centre, axis=1)
    count = int(rng.integers(1, max(2, len(faces) // 4)))
    return vertices, faces[np.argsort(away, kind="stable")[count:]]


def jitter(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    edge = np.linalg.norm(vertices[faces[:, 0]] - vertices[faces[:, 1]], axis=1).mean()
    return vertices + amount(rng, -4, 0) * edge * rng.normal(size=vertices.shape), faces


def slivers(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    """Some vertices nearly on another, or nearly on the opposite side."""
    vertices = vertices.copy()
    for f in rng.integers(0, len(faces), int(rng.integers(1, 6))):
        i, j, k = np.roll(faces[f], rng.integers(3))
        goal = vertices[j] if rng.random() < 0.5 else (vertices[j] + vertices[k]) / 2
        vertices[i] = goal + (vertices[i] - goal) * amount(rng, -12, -1)
    return vertices, faces


def needles(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    """Edges split next to one of their ends, or triangles at a point beside one of their sides, many at all heights."""
    split = (with_caps, with_needles)[int(rng.integers(2))]
    for _ in range(int(rng.integers(1, 4))):
        vertices, faces = split(vertices, faces, amount(rng, -14, -2), int(rng.integers(1, 20)), rng)
    return vertices, faces


def flat_triangles(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    """Triangles without area."""
    vertices = vertices.copy()
    i, j, k = faces[rng.integers(len(faces))]
    vertices[i] = vertices[j] if rng.random() < 0.5 else (vertices[j] + vertices[k]) / 2
    return vertices, faces


def stretched(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    scale = np.ones(3)
    scale[rng.integers(3)] = amount(rng, 0.5, 2)
    return vertices * scale, faces


def scaled(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    return vertices * amount(rng, -6, 6), faces


def extreme(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    return vertices * float(rng.choice([1e-300, 1e-160, 1e-30, 1e30, 1e150, 1e300])), faces


def far_away(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    return vertices + amount(rng, 1, 9), faces


def two_parts(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    """Another surface next to this one, or glued to it at a point."""
    second = MAKERS[int(rng.integers(7))][0](rng)
    start = len(vertices)
    merged = shapes.join((vertices, faces), (second[0] + np.array([5.0, 0, 0]), np.asarray(second[1])))
    if rng.random() < 0.5 and len(faces) and len(second[1]):
        merged[1][merged[1] == start + second[1][0, 0]] = faces[0, 0]
    return merged


def unwelded(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    return vertices[faces.ravel()], np.arange(faces.size).reshape(-1, 3)


def doubled_vertices(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    faces, chosen = faces.copy(), rng.random(len(faces)) < 0.1
    faces[chosen] += len(vertices)
    return np.concatenate([vertices, vertices]), faces


def loose_vertices(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    count = int(rng.integers(1, 5))
    return np.concatenate([rng.normal(size=(count, 3)), vertices, rng.normal(size=(count, 3))]), faces + count


def shuffled(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    return shapes.renumber(vertices, faces, int(rng.integers(1 << 30)))[:2]


def some_turned(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    faces, chosen = faces.copy(), rng.random(len(faces)) < rng.choice([0.1, 0.5, 1.0])
    faces[chosen] = faces[chosen][:, ::-1]
    return vertices, faces


def wing(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    """A third face at an edge, or a face given twice, or one that uses a vertex twice."""
    i, j, k = faces[rng.integers(len(faces))]
    kind = rng.integers(3)
    if kind == 0:
        tip = vertices[[i, j, k]].mean(axis=0) + rng.normal(size=3)
        return np.concatenate([vertices, [tip]]), np.concatenate([faces, [[i, j, len(vertices)]]])
    return vertices, np.concatenate([faces, [[i, j, k] if kind == 1 else [i, j, j]]])


def flips(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    """Some edges replaced by the other diagonal, if the mesh remains a manifold."""
    faces = faces.copy()
    edges = {tuple(sorted((int(a), int(b)))) for f in faces for a, b in zip(f, np.roll(f, -1), strict=True)}
    for _ in range(int(rng.integers(1, max(2, len(faces) // 5)))):
        f = int(rng.integers(len(faces)))
        p, i, j = np.roll(faces[f], rng.integers(3)).tolist()
        for g in np.flatnonzero((faces == i).any(axis=1) & (faces == j).any(axis=1)):
            opposite = [v for v in faces[g].tolist() if v not in (i, j)]
            if g == f or len(opposite) != 1 or tuple(sorted((p, opposite[0]))) in edges or p == opposite[0]:
                continue
            edges.add(tuple(sorted((p, opposite[0]))))
            faces[f], faces[g] = (p, i, opposite[0]), (opposite[0], j, p)
            break
    return vertices, faces


def not_finite(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    vertices = vertices.copy()
    vertices[rng.integers(len(vertices)), rng.integers(3)] = rng.choice([np.nan, np.inf, -np.inf, 1e308])
    return vertices, faces


def bad_index(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    faces = faces.copy()
    faces[rng.integers(len(faces)), rng.integers(3)] = rng.choice([-1, len(vertices), 2**31, 2**62])
    return vertices, faces


CHANGES: tuple[tuple[Callable[[np.ndarray, np.ndarray, Random], Mesh], float], ...] = (
    (hole, 0.12),
    (jitter, 0.12),
    (slivers, 0.08),
    (needles, 0.08),
    (flips, 0.05),
    (flat_triangles, 0.03),
    (two_parts, 0.05),
    (stretched, 0.14),
    (unwelded, 0.01),
    (doubled_vertices, 0.015),
    (loose_vertices, 0.05),
    (some_turned, 0.05),
    (wing, 0.03),
    (shuffled, 0.25),
    (scaled, 0.15),
    (far_away, 0.03),
    (extreme, 0.02),
    (not_finite, 0.01),
    (bad_index, 0.007),
)
