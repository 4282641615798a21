"""Small meshes of all kinds, most of them hostile, from a random generator."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np
import shapes

Mesh = tuple[np.ndarray, np.ndarray]
Random = np.random.Generator

MODELS = Path(__file__).resolve().parents[3] / "shared" / "meshes"
#: Largest size of a model file in bytes; patches are cut from the model, which workers cache.
LARGEST_MODEL = 3_000_000


def _amount(rng: Random, low: float, high: float) -> float:
    """Return a number between two powers of ten."""
    return float(10 ** rng.uniform(low, high))


def sheet(rng: Random) -> Mesh:
    """A grid with waves and normal noise of up to many edge lengths."""
    columns, rows = rng.integers(1, 13, 2)
    vertices, faces = shapes.grid(int(columns), int(rows))
    if rng.random() < 0.4:
        vertices[:, 2] += 0.5 * np.sin(
            rng.uniform(1, 9) * vertices[:, 0] + rng.uniform(0, 6) * vertices[:, 1]
        )
    if rng.random() < 0.6:
        vertices[:, 2] += _amount(rng, -3, 1) / max(columns, rows) * rng.normal(size=len(vertices))
    return vertices, faces


def fan(rng: Random) -> Mesh:
    """A vertex inside a ring on the unit circle, with random heights."""
    count = int(rng.choice([3, 4, 5, 8, 24, 24, 24, 60]))
    angle = 2 * np.pi * np.arange(count) / count
    rim = np.stack(
        [np.cos(angle), np.sin(angle), rng.choice([0.0, 0.5, 2.0, 6.0]) * rng.normal(size=count)], 1
    )
    ring = np.arange(1, count + 1)
    faces = np.stack([np.zeros(count, int), ring, np.roll(ring, -1)], 1)
    vertices = np.concatenate([[[0, 0, 0]], rim])
    for _ in range(int(rng.integers(0, 2)) if count <= 24 else 0):
        vertices, faces = shapes.subdivide(vertices, faces)
    return vertices, faces


def strip(rng: Random) -> Mesh:
    vertices, faces = shapes.grid(int(rng.integers(2, 60)), 1)
    turn = rng.uniform(0, 8) * vertices[:, 0]
    return np.stack([vertices[:, 0], vertices[:, 1] * np.cos(turn), vertices[:, 1] * np.sin(turn)], 1), faces


def ball(rng: Random) -> Mesh:
    vertices, faces = shapes.sphere(int(rng.integers(0, 3)), rng.uniform(0, 1.5), int(rng.integers(99)))
    if rng.random() < 0.3:
        vertices = vertices * (1 + rng.uniform(0, 0.6) * rng.normal(size=(len(vertices), 1)))
    return vertices, faces


def hemisphere(rng: Random) -> Mesh:
    vertices, faces = shapes.sphere(2, rng.uniform(0, 0.5), int(rng.integers(99)))
    if rng.random() < 0.4:
        vertices[:, 2] *= rng.uniform(-1, 3)
    kept = vertices[faces][:, :, 2].mean(axis=1) > rng.uniform(-0.8, 0.5)
    return vertices, faces[kept]


def ring(rng: Random) -> Mesh:
    return shapes.torus(int(rng.integers(3, 20)), int(rng.integers(3, 10)), rng.uniform(0.1, 0.9))


def tube(rng: Random) -> Mesh:
    if rng.random() < 0.4:
        return shapes.annulus(int(rng.integers(3, 24)), int(rng.integers(1, 5)))
    return shapes.cylinder(
        int(rng.integers(3, 24)), int(rng.integers(1, 8)), _amount(rng, -1, 1), bool(rng.random() < 0.5)
    )


def handles(rng: Random) -> Mesh:
    count = int(rng.integers(1, 4))
    return shapes.blocks(
        ["#" * (2 * count + 1), "#" + ".#" * count, "#" * (2 * count + 1)], int(rng.integers(1, 3))
    )


def polycube(rng: Random) -> Mesh:
    """Unit cubes on a plane, at random; where they touch along edges only the surface is not manifold."""
    pattern = ["".join(rng.choice(["#", "#", "."], 3)) for _ in range(int(rng.integers(1, 4)))]
    vertices, faces = shapes.blocks([*pattern, "#.."], int(rng.integers(1, 3)))
    return np.round(vertices) if rng.random() < 0.5 else vertices, faces


def crate(rng: Random) -> Mesh:
    if rng.random() < 0.2:
        return shapes.tetrahedron()
    return shapes.box(int(rng.integers(1, 5)), tuple(10 ** rng.uniform(-1, 1, 3)))


def cone(rng: Random) -> Mesh:
    """A pyramid, open or closed, of any height."""
    count = int(rng.integers(3, 30))
    angle = 2 * np.pi * np.arange(count) / count
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], 1)
    around, top = np.arange(count), np.full(count, count)
    faces = np.stack([around, np.roll(around, -1), top], 1)
    apex = [[0, 0, _amount(rng, -2, 3)]]
    if rng.random() < 0.5:
        return np.concatenate([circle, apex]), faces
    below = np.stack([np.roll(around, -1), around, top + 1], 1)
    return np.concatenate([circle, apex, [[0, 0, -rng.uniform(0, 1)]]]), np.concatenate([faces, below])


def spikes(rng: Random) -> Mesh:
    """A sheet or a ball with vertices pulled far out of it."""
    vertices, faces = shapes.grid(*rng.integers(4, 13, 2)) if rng.random() < 0.6 else shapes.sphere(2)
    out = np.array([0.0, 0, 1]) if vertices[:, 2].max() == 0 else vertices
    chosen = rng.random((len(vertices), 1)) < rng.uniform(0.02, 0.4)
    height = _amount(rng, -1, 2) * rng.uniform(0.5, 1, (len(vertices), 1))
    return vertices + chosen * height * out, faces


def random_hull(rng: Random) -> Mesh:
    """The hull of random points: triangles of all shapes."""
    from scipy.spatial import ConvexHull

    points = rng.normal(size=(int(rng.integers(4, 120)), 3))
    if rng.random() < 0.7:
        points /= np.linalg.norm(points, axis=1, keepdims=True)
    points *= 10 ** rng.uniform(-1, 0, 3)
    hull = ConvexHull(points)
    faces = hull.simplices.astype(np.int64)
    a, b, c = (points[faces[:, i]] for i in range(3))
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    faces[inwards] = faces[inwards][:, ::-1]
    return points, faces


def random_sheet(rng: Random) -> Mesh:
    """A Delaunay triangulation of random points with random heights."""
    from scipy.spatial import Delaunay

    points = rng.random((int(rng.integers(4, 150)), 2))
    vertices = np.column_stack([points, _amount(rng, -3, 0.5) * rng.normal(size=len(points))])
    return vertices, Delaunay(points).simplices.astype(np.int64)


def soup(rng: Random) -> Mesh:
    """Triangles between random points, which are almost never a manifold."""
    count = int(rng.integers(3, 12))
    return rng.normal(size=(count, 3)), rng.integers(0, count, (int(rng.integers(1, 20)), 3))


def one_sided(rng: Random) -> Mesh:
    return shapes.moebius(int(rng.integers(5, 20)), int(rng.integers(1, 3)))


@lru_cache(maxsize=4)
def _model(path: Path) -> tuple[np.ndarray, np.ndarray, list[list[int]]]:
    """Return a model and the faces at each vertex."""
    from coneflat import check_mesh, read_mesh
    from coneflat.geometry.triangulate import triangulate

    file = read_mesh(path)
    mesh = check_mesh(
        file.vertices, triangulate(file.vertices, file.corners, file.offsets)[0], repair=True
    ).mesh
    at: list[list[int]] = [[] for _ in mesh.vertices]
    for number, face in enumerate(mesh.faces.tolist()):
        for vertex in face:
            at[vertex].append(number)
    return mesh.vertices, mesh.faces, at


def patch(rng: Random) -> Mesh:
    """A connected piece of a scan, sometimes with vertices merged in cells; a ball if there are no scans."""
    files = [path for path in sorted(MODELS.glob("*.o*")) if path.stat().st_size < LARGEST_MODEL]
    if not files:
        return ball(rng)
    vertices, faces, at = _model(files[int(rng.integers(len(files)))])
    wanted, queue = int(rng.integers(51, 702)), [int(rng.integers(len(vertices)))]
    seen, taken = set(queue), dict[int, None]()
    for vertex in queue:
        if len(taken) >= wanted:
            break
        taken |= dict.fromkeys(at[vertex])
        for other in np.unique(faces[at[vertex]]).tolist():
            if other not in seen:
                seen.add(other)
                queue.append(other)
    kept = faces[list(taken)[:wanted]]
    used, numbered = np.unique(kept, return_inverse=True)
    return vertices[used], numbered.reshape(-1, 3)


MAKERS: tuple[tuple[Callable[[Random], Mesh], float], ...] = (
    (sheet, 14),
    (fan, 7),
    (strip, 3),
    (ball, 9),
    (hemisphere, 5),
    (ring, 6),
    (tube, 6),
    (handles, 5),
    (polycube, 4),
    (crate, 5),
    (cone, 5),
    (spikes, 7),
    (random_hull, 5),
    (random_sheet, 7),
    (soup, 1),
    (one_sided, 1),
    (patch, 10),
)


def make_mesh(rng: Random) -> tuple[np.ndarray, np.ndarray, str]:
    """Return vertices, faces and a description."""
    weights = np.array([weight for _, weight in MAKERS])
    maker = MAKERS[int(rng.choice(len(MAKERS), p=weights / weights.sum()))][0]
    vertices, faces = maker(rng)
    vertices, faces = np.array(vertices, dtype=np.float64), np.array(faces, dtype=np.int64)
    recipe = [maker.__name__]
    for change, chance in CHANGES:
        if rng.random() < chance and len(faces):
            vertices, faces = change(vertices, faces, rng)
            recipe.append(change.__name__)
    return vertices, faces, f"{' + '.join(recipe)}, {len(vertices)} vertices, {len(faces)} faces"


def pillow(rng: Random) -> Mesh:
    """Two triangles back to back, or, one in two, two polygons of some triangles each."""
    count = int(rng.choice([3, 3, 4, 7]))
    angle = np.sort(rng.uniform(0, 2 * np.pi, count))
    vertices = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], 1)
    middle = np.arange(1, count - 1)
    front = np.stack([np.zeros(count - 2, int), middle, middle + 1], 1)
    return vertices, np.concatenate([front, front[:, ::-1]])


def one_or_two(rng: Random) -> Mesh:
    """One triangle, or two with a common edge."""
    vertices, faces = shapes.grid(1, 1)
    return vertices, faces[: int(rng.integers(1, 3))]


#: Meshes of a few triangles.
TINY = (pillow, pillow, one_or_two, fan, crate, ball, ring, tube, cone)
#: Their most triangles.
TINY_FACES = 24


def make_tiny(rng: Random) -> tuple[np.ndarray, np.ndarray, str]:
    """Return vertices, faces and a description of a mesh of few triangles, one in three of them changed."""
    faces = np.zeros((0, 3), dtype=np.int64)
    while not 0 < len(faces) <= TINY_FACES:
        maker = TINY[int(rng.integers(len(TINY)))]
        vertices, faces = (np.array(one) for one in maker(rng))
    vertices, faces, recipe = vertices.astype(np.float64), faces.astype(np.int64), [maker.__name__]
    if rng.random() < 0.3:
        change = CHANGES[int(rng.integers(len(CHANGES)))][0]
        vertices, faces = change(vertices, faces, rng)
        recipe.append(change.__name__)
    return vertices, faces, f"{' + '.join(recipe)}, {len(vertices)} vertices, {len(faces)} faces"


def hole(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    centre = vertices[faces[rng.integers(len(faces))]].mean(axis=0)
    away = np.linalg.norm(vertices[faces].mean(axis=1) - centre, axis=1)
    count = int(rng.integers(1, max(2, len(faces) // 4)))
    return vertices, faces[np.argsort(away, kind="stable")[count:]]


def jitter(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    edge = np.linalg.norm(vertices[faces[:, 0]] - vertices[faces[:, 1]], axis=1).mean()
    return vertices + _amount(rng, -4, 0) * edge * rng.normal(size=vertices.shape), faces


def slivers(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    """Some vertices nearly on another, or nearly on the opposite side."""
    vertices = vertices.copy()
    for f in rng.integers(0, len(faces), int(rng.integers(1, 6))):
        i, j, k = np.roll(faces[f], rng.integers(3))
        goal = vertices[j] if rng.random() < 0.5 else (vertices[j] + vertices[k]) / 2
        vertices[i] = goal + (vertices[i] - goal) * _amount(rng, -12, -1)
    return vertices, faces


def flat_triangles(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    """Triangles without area."""
    vertices = vertices.copy()
    i, j, k = faces[rng.integers(len(faces))]
    vertices[i] = vertices[j] if rng.random() < 0.5 else (vertices[j] + vertices[k]) / 2
    return vertices, faces


def stretched(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    scale = np.ones(3)
    scale[rng.integers(3)] = _amount(rng, 0.5, 2)
    return vertices * scale, faces


def scaled(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    return vertices * _amount(rng, -6, 6), faces


def extreme(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    return vertices * float(rng.choice([1e-300, 1e-160, 1e-30, 1e30, 1e150, 1e300])), faces


def far_away(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    return vertices + _amount(rng, 1, 9), faces


def two_parts(vertices: np.ndarray, faces: np.ndarray, rng: Random) -> Mesh:
    """Another surface next to this one, or glued to it at a point."""
    other = MAKERS[int(rng.integers(7))][0](rng)
    start = len(vertices)
    merged = shapes.join((vertices, faces), (other[0] + np.array([5.0, 0, 0]), np.asarray(other[1])))
    if rng.random() < 0.5 and len(faces) and len(other[1]):
        merged[1][merged[1] == start + other[1][0, 0]] = faces[0, 0]
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
    known = {tuple(sorted((int(a), int(b)))) for f in faces for a, b in zip(f, np.roll(f, -1), strict=True)}
    for _ in range(int(rng.integers(1, max(2, len(faces) // 5)))):
        f = int(rng.integers(len(faces)))
        p, i, j = np.roll(faces[f], rng.integers(3)).tolist()
        for g in np.flatnonzero((faces == i).any(axis=1) & (faces == j).any(axis=1)):
            rest = [v for v in faces[g].tolist() if v not in (i, j)]
            if g == f or len(rest) != 1 or tuple(sorted((p, rest[0]))) in known or p == rest[0]:
                continue
            known.add(tuple(sorted((p, rest[0]))))
            faces[f], faces[g] = (p, i, rest[0]), (rest[0], j, p)
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
