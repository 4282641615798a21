"""Small surfaces of all kinds, from a random generator."""

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


def amount(rng: Random, low: float, high: float) -> float:
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
        vertices[:, 2] += amount(rng, -3, 1) / max(columns, rows) * rng.normal(size=len(vertices))
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
    is_above = vertices[faces][:, :, 2].mean(axis=1) > rng.uniform(-0.8, 0.5)
    return vertices, faces[is_above]


def ring(rng: Random) -> Mesh:
    return shapes.torus(int(rng.integers(3, 20)), int(rng.integers(3, 10)), rng.uniform(0.1, 0.9))


def tube(rng: Random) -> Mesh:
    if rng.random() < 0.4:
        return shapes.annulus(int(rng.integers(3, 24)), int(rng.integers(1, 5)))
    return shapes.cylinder(
        int(rng.integers(3, 24)), int(rng.integers(1, 8)), amount(rng, -1, 1), bool(rng.random() < 0.5)
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


def plate(rng: Random) -> Mesh:
    """A plate with rectangular windows, as coarse as CAD exports it: cells of all sizes, without vertices inside."""
    columns, rows = rng.integers(1, 8, 2).tolist()
    pattern = ["".join(rng.choice(["#", "#", "#", "."], rows)) for _ in range(columns)] + ["#" * rows]
    places = np.rint(shapes.blocks(pattern, 1)[0]).astype(int)
    faces = shapes.blocks(pattern, 1)[1]
    steps = [np.cumsum(10 ** rng.uniform(-1, 1, count)) for count in places.max(axis=0) + 1]
    return np.stack([step[places[:, axis]] for axis, step in enumerate(steps)], axis=1), faces


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
    apex = [[0, 0, amount(rng, -2, 3)]]
    if rng.random() < 0.5:
        return np.concatenate([circle, apex]), faces
    below = np.stack([np.roll(around, -1), around, top + 1], 1)
    return np.concatenate([circle, apex, [[0, 0, -rng.uniform(0, 1)]]]), np.concatenate([faces, below])


def needle(rng: Random) -> Mesh:
    """A body of revolution that gets as thin as a hair, open below; its tip is a ring of vertices in one place, or not.

    Its radius falls with a power of the height.
    """
    around, rings = int(rng.integers(3, 10)), int(rng.integers(2, 6))
    power, height, end = rng.uniform(0.5, 6), amount(rng, -1, 5), float(rng.choice([1.0, 1.0, 0.95]))
    angle = 2 * np.pi * np.arange(around) / around
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(around)], 1)
    up = np.linspace(0, end, rings)
    vertices = np.concatenate([circle * (1 - u) ** power + [0, 0, height * u] for u in up])
    first = np.arange(around * (rings - 1))
    second = first - first % around + (first + 1) % around
    faces = np.concatenate(
        [np.stack([first, second, second + around], 1), np.stack([first, second + around, first + around], 1)]
    )
    return vertices, faces


def spikes(rng: Random) -> Mesh:
    """A sheet or a ball with vertices pulled far out of it."""
    vertices, faces = shapes.grid(*rng.integers(4, 13, 2)) if rng.random() < 0.6 else shapes.sphere(2)
    out = np.array([0.0, 0, 1]) if vertices[:, 2].max() == 0 else vertices
    chosen = rng.random((len(vertices), 1)) < rng.uniform(0.02, 0.4)
    height = amount(rng, -1, 2) * rng.uniform(0.5, 1, (len(vertices), 1))
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
    vertices = np.column_stack([points, amount(rng, -3, 0.5) * rng.normal(size=len(points))])
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
    count, queue = int(rng.integers(51, 702)), [int(rng.integers(len(vertices)))]
    seen, taken = set(queue), dict[int, None]()
    for vertex in queue:
        if len(taken) >= count:
            break
        taken |= dict.fromkeys(at[vertex])
        for face in np.unique(faces[at[vertex]]).tolist():
            if face not in seen:
                seen.add(face)
                queue.append(face)
    chosen = faces[list(taken)[:count]]
    vertex_numbers, numbered = np.unique(chosen, return_inverse=True)
    return vertices[vertex_numbers], numbered.reshape(-1, 3)


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
    (plate, 4),
    (crate, 5),
    (cone, 5),
    (spikes, 7),
    (random_hull, 5),
    (random_sheet, 7),
    (soup, 1),
    (one_sided, 1),
    (patch, 10),
)


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
