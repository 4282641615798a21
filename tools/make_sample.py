"""Make `src/coneflat/sample/sample.obj`: a small creature whose tail curls back to its body (genus 1).

    python tools/make_sample.py [OUTPUT]

The creature is the zero level of a smooth function: a smooth union of tapered, curved limbs. Marching
cubes gives a first triangulation; rounds of edge flips and tangential relaxation, each followed by
Newton steps back to the surface, make its triangles well shaped. Needs numpy, scipy and scikit-image.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from skimage.measure import marching_cubes

OUTPUT = Path(__file__).resolve().parent.parent / "src" / "coneflat" / "sample" / "sample.obj"
GRID_STEP = 0.0405  # model units; sets the number of triangles
ROUNDS = 40
PIECES_PER_SPAN = 5

# A limb is a smooth curve through points (x, y, z, radius), and how softly it joins those before it.
# x runs from rump to head, y is up, z to the creature's left side; the ground is at about y = 0.
LIMBS = [
    ([(-0.48, 0.72, 0, 0.265), (-0.08, 0.67, 0, 0.275), (0.32, 0.74, 0, 0.245)], 0.00),  # torso
    ([(0.34, 0.84, 0, 0.19), (0.52, 1.06, 0, 0.145), (0.66, 1.28, 0, 0.15)], 0.34),  # neck
    ([(0.66, 1.34, 0, 0.215), (0.77, 1.31, 0, 0.20)], 0.16),  # head
    ([(0.84, 1.25, 0, 0.135), (1.03, 1.17, 0, 0.115)], 0.22),  # muzzle
    ([(0.34, 0.66, 0.13, 0.15), (0.38, 0.36, 0.19, 0.098), (0.38, 0.09, 0.20, 0.088)], 0.24),  # legs
    ([(0.30, 0.66, -0.13, 0.15), (0.26, 0.36, -0.19, 0.098), (0.28, 0.09, -0.20, 0.088)], 0.24),
    ([(-0.50, 0.66, 0.13, 0.18), (-0.49, 0.36, 0.20, 0.105), (-0.54, 0.09, 0.21, 0.088)], 0.24),
    ([(-0.52, 0.66, -0.13, 0.18), (-0.63, 0.36, -0.20, 0.105), (-0.71, 0.09, -0.21, 0.088)], 0.24),
    ([(0.40, 0.085, 0.20, 0.088), (0.47, 0.08, 0.205, 0.08)], 0.12),  # feet
    ([(0.30, 0.085, -0.20, 0.088), (0.37, 0.08, -0.205, 0.08)], 0.12),
    ([(-0.52, 0.085, 0.21, 0.088), (-0.45, 0.08, 0.215, 0.08)], 0.12),
    ([(-0.69, 0.085, -0.21, 0.088), (-0.62, 0.08, -0.215, 0.08)], 0.12),
    ([(0.63, 1.45, 0.10, 0.095), (0.55, 1.60, 0.19, 0.082), (0.43, 1.73, 0.30, 0.042)], 0.10),  # ears
    ([(0.63, 1.45, -0.10, 0.095), (0.55, 1.60, -0.19, 0.082), (0.43, 1.73, -0.30, 0.042)], 0.10),
    (
        [  # the tail rises behind the rump, arches forward and comes down on the back
            (-0.66, 0.82, 0.00, 0.125),
            (-0.93, 1.02, 0.02, 0.098),
            (-0.99, 1.34, 0.03, 0.086),
            (-0.76, 1.58, 0.02, 0.078),
            (-0.44, 1.53, 0.00, 0.072),
            (-0.26, 1.28, 0.00, 0.072),
            (-0.20, 0.92, 0.00, 0.090),
        ],
        0.24,
    ),
]


def smooth_union(p: np.ndarray, q: np.ndarray, softness: float) -> np.ndarray:
    """Return a twice differentiable minimum of p and q, lower than both where they are close."""
    if softness == 0.0:
        return np.minimum(p, q)
    overlap = np.maximum(1.0 - np.abs(p - q) / softness, 0.0)
    return np.minimum(p, q) - overlap**3 * softness / 6.0


def limb_level(points: np.ndarray, nodes: list[tuple[float, ...]]) -> np.ndarray:
    """Return about the signed distance to a tapered limb along the curve through its nodes."""
    spans = len(nodes) - 1
    pieces = PIECES_PER_SPAN * spans if spans > 1 else 1  # through two nodes the curve is straight
    path = CubicSpline(np.arange(spans + 1), nodes)(np.linspace(0.0, spans, pieces + 1))
    level = np.full(len(points), np.inf)
    for start, stop in pairwise(path):
        axis = stop[:3] - start[:3]
        share = np.clip((points - start[:3]) @ axis / (axis @ axis), 0.0, 1.0)
        distance = np.linalg.norm(points - start[:3] - share[:, None] * axis, axis=1)
        level = np.minimum(level, distance - start[3] - share * (stop[3] - start[3]))
    return level


def creature(points: np.ndarray) -> np.ndarray:
    """Return the level of (k, 3) points: negative inside, positive outside, about the distance."""
    level = np.full(len(points), 1e3)
    for nodes, softness in LIMBS:
        level = smooth_union(level, limb_level(points, nodes), softness)
    return level


def gradient(points: np.ndarray, step: float = 1e-4) -> np.ndarray:
    """Return the (k, 3) gradient of the level, by central differences."""
    return np.stack(
        [(creature(points + e) - creature(points - e)) / (2.0 * step) for e in step * np.eye(3)], axis=1
    )


def extract() -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and faces of the creature by marching cubes, oriented outward."""
    nodes = np.concatenate([np.array(limb) for limb, _ in LIMBS])
    low = (nodes[:, :3] - nodes[:, 3:]).min(axis=0) - 0.15
    high = (nodes[:, :3] + nodes[:, 3:]).max(axis=0) + 0.15
    axes = [np.arange(a, b, GRID_STEP) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    levels = creature(grid.reshape(-1, 3)).reshape(grid.shape[:3])
    vertices, faces, _, _ = marching_cubes(levels, 0.0, spacing=(GRID_STEP,) * 3)
    vertices, faces = vertices.astype(float) + low, faces.astype(np.int64)
    return (vertices, faces) if volume(vertices, faces) > 0.0 else (vertices, faces[:, ::-1])


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Return the enclosed volume, positive if the faces are oriented outward."""
    p, q, r = (vertices[faces[:, i]] for i in range(3))
    return float((p * np.cross(q, r)).sum() / 6.0)


def corner_angles(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the (m, 3) angles of the triangles, radians."""
    angles = []
    for i in range(3):
        p, q, r = (vertices[faces[:, (i + k) % 3]] for k in range(3))
        cross = np.linalg.norm(np.cross(q - p, r - p), axis=1)
        angles.append(np.arctan2(cross, ((q - p) * (r - p)).sum(axis=1)))
    return np.stack(angles, axis=1)


def flip_edges(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the faces with edges flipped, where opposite angles sum to more than pi, until none do."""
    faces = faces.copy()
    for _ in range(50):
        count = len(faces)
        opposite = corner_angles(vertices, faces).T.ravel()  # half-edge i * count + f: opposite corner i of f
        tail, head, tip = (np.concatenate([faces[:, (i + k) % 3] for i in range(3)]) for k in (1, 2, 0))
        keys = np.minimum(tail, head) * len(vertices) + np.maximum(tail, head)
        pairs = np.argsort(keys, kind="stable").reshape(-1, 2)
        excess = opposite[pairs].sum(axis=1) - np.pi
        existing, flipped_faces, flipped = set(keys.tolist()), set(), 0
        for k in np.argsort(-excess, kind="stable"):
            if excess[k] < 1e-6:
                break
            first, second = pairs[k]
            f, g, a, b = first % count, second % count, tip[first], tip[second]
            key = min(a, b) * len(vertices) + max(a, b)
            if f in flipped_faces or g in flipped_faces or key in existing:
                continue
            faces[f], faces[g] = (a, tail[first], b), (b, head[first], a)
            flipped_faces |= {f, g}
            existing.add(key)
            flipped += 1
        if not flipped:
            break
    return faces


def relax(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the vertices moved along the surface to the mean of their triangles' centroids."""
    p, q, r = (vertices[faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(q - p, r - p), axis=1)
    weighted, total = np.zeros_like(vertices), np.zeros(len(vertices))
    for i in range(3):
        np.add.at(weighted, faces[:, i], area[:, None] * (p + q + r) / 3.0)
        np.add.at(total, faces[:, i], area)
    move = weighted / total[:, None] - vertices
    normal = gradient(vertices)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return to_surface(vertices + move - (move * normal).sum(axis=1, keepdims=True) * normal)


def to_surface(points: np.ndarray, steps: int = 1) -> np.ndarray:
    """Return the points after Newton steps along the gradient to the zero level."""
    for _ in range(steps):
        slope = gradient(points)
        points = points - (creature(points) / (slope**2).sum(axis=1))[:, None] * slope
    return points


def check(vertices: np.ndarray, faces: np.ndarray) -> None:
    """Raise AssertionError unless the mesh is one closed, oriented surface of genus 1; print its size."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    keys = edges[:, 0] * len(vertices) + edges[:, 1]
    mirrored = edges[:, 1] * len(vertices) + edges[:, 0]
    assert len(np.unique(keys)) == len(keys), "an edge has two faces of opposite orientation"
    assert np.array_equal(np.sort(keys), np.sort(mirrored)), "an edge has only one face"
    assert np.array_equal(np.unique(faces), np.arange(len(vertices))), "a vertex has no face"
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(len(vertices),) * 2)
    assert connected_components(graph, directed=False)[0] == 1, "more than one component"
    assert len(vertices) - len(edges) // 2 + len(faces) == 0, "the genus is not 1"
    assert len(np.unique(vertices, axis=0)) == len(vertices), "two vertices at one place"
    assert volume(vertices, faces) > 0.0, "the faces are oriented inward"
    smallest = np.degrees(corner_angles(vertices, faces).min(axis=1))
    print(f"{len(vertices)} vertices, {len(faces)} triangles, genus 1")
    print(f"smallest angle {smallest.min():.1f} degrees, 1st percentile {np.percentile(smallest, 1):.1f}")


def main(output: Path) -> None:
    """Make the creature and write it to `output`."""
    vertices, faces = extract()
    for _ in range(ROUNDS):
        faces = flip_edges(vertices, faces)
        vertices = relax(vertices, faces)
    vertices = to_surface(vertices, steps=3)
    faces = flip_edges(vertices, faces)
    vertices[:, 1] -= vertices[:, 1].min()
    vertices = np.round(vertices, 6)
    check(vertices, faces)
    lines = ["# The coneflat sample: a creature of genus 1, made by tools/make_sample.py"]
    lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in vertices + 0.0]
    lines += [f"f {a} {b} {c}" for a, b, c in faces + 1]
    output.write_text("\n".join(lines) + "\n", encoding="ascii")
    print(f"wrote {output}, {output.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else OUTPUT)
