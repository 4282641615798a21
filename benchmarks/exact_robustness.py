"""How robust the exact metric is: `python benchmarks/exact_robustness.py` prints a Markdown table.

In the manner of Campen et al., "Efficient and robust discrete conformal equivalence with boundary", 2021:
random cone sets on spheres, random boundary curvatures on disks, one cone on surfaces of genus 1 to 5; then
the models of `../shared/meshes`, where they are, as they are and with noise, slivers and flipped edges. For
every row: how many metrics converged, the worst curvature error, Newton steps and flips; and for layouts on
the input's own triangles how many were inverted, before and after untangling, and the worst relative mismatch
of a seam edge's two lengths.

Options: --sets 200 (cone sets of each kind), --variants 16 (of each model), --models fandisk,bunny.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import ConvexHull

ROOT = Path(__file__).resolve().parents[1]
MODELS = ROOT.parent / "shared" / "meshes"
sys.path.insert(0, str(ROOT / "src"))
sys.path.insert(0, str(ROOT / "tests"))

import shapes  # noqa: E402

from coneflat.files import read_mesh  # noqa: E402
from coneflat.flat.exact.metric import ExactMetric, exact_metric  # noqa: E402
from coneflat.geometry import edge_lengths  # noqa: E402
from coneflat.geometry.planar import heights  # noqa: E402
from coneflat.geometry.straight import straight_triangles  # noqa: E402
from coneflat.geometry.triangles import mollify  # noqa: E402
from coneflat.input.triangulate import triangulate  # noqa: E402
from coneflat.input.validation import check_mesh  # noqa: E402
from coneflat.layout.patches import DEGENERATE  # noqa: E402
from coneflat.layout.unfold import unfold  # noqa: E402
from coneflat.layout.untangle import untangle  # noqa: E402
from coneflat.mesh import TriangleMesh  # noqa: E402
from coneflat.quality.distortion import measure  # noqa: E402
from coneflat.seams import cut_open, find_seams  # noqa: E402


@dataclass
class Row:
    """What a set of solves has in common."""

    name: str
    metrics: list[ExactMetric] = field(default_factory=list)
    seconds: float = 0.0
    inverted: int = 0
    left: int = 0
    moved: int = 0
    way: float = 0.0
    seam: float = 0.0
    flipped: int = 0
    layouts: int = 0
    qc: float = 0.0

    HEADER = (
        "| set | solved | worst error | steps, median / most | flips Euclid / Ptolemy, median "
        "| doubled | inverted | left | UV flipped | moved | longest move | seam mismatch | QC of the first | s |\n"
        + "| --- " * 14
        + "|"
    )

    def __str__(self) -> str:
        steps = [metric.steps for metric in self.metrics]
        euclid = np.median([metric.euclidean_flips for metric in self.metrics])
        ptolemy = np.median([metric.ptolemy_flips for metric in self.metrics])
        layout = (
            f"{self.inverted} | {self.left} | {self.flipped} | {self.moved} | {self.way:.2f} "
            f"| {self.seam:.1e} | {self.qc:.4f}"
            if self.layouts
            else "| | | | | |"
        )
        return (
            f"| {self.name} | {sum(m.converged for m in self.metrics)} / {len(self.metrics)} "
            f"| {max(metric.residual for metric in self.metrics):.1e} | {np.median(steps):.0f} / {max(steps)} "
            f"| {euclid:.0f} / {ptolemy:.0f} | {sum(m.doubled for m in self.metrics)} | {layout} "
            f"| {self.seconds:.1f} |"
        )


def solve(row: Row, mesh: TriangleMesh, target: np.ndarray, **options: object) -> ExactMetric:
    """Solve, and count."""
    began = time.perf_counter()
    lengths, _ = mollify(edge_lengths(mesh.vertices, mesh.faces))
    metric = exact_metric(mesh, lengths, target, **options)  # type: ignore[arg-type]
    row.seconds += time.perf_counter() - began
    row.metrics.append(metric)
    return metric


def random_sphere(count: int, rng: np.random.Generator) -> TriangleMesh:
    """The convex hull of random points on a sphere, outward oriented."""
    points = rng.normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    faces = ConvexHull(points).simplices.astype(np.int64)
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    faces[inward] = faces[inward][:, ::-1]
    return TriangleMesh(points, faces)


def random_curvatures(count: int, total: float, rng: np.random.Generator) -> np.ndarray:
    """Cone curvatures of the given sum, for cone angles between 0.1 pi and 8 pi."""
    low, high = -6 * np.pi, 1.9 * np.pi
    values = rng.uniform(low, high, count)
    for _ in range(1000):
        values = np.clip(values + (total - values.sum()) / count, low, high)
    return values


def spheres(count: int, sets: int) -> Row:
    """Random cones on a sphere of so many vertices."""
    row = Row(f"sphere, {count} vertices, 3 to 30 cones of 0.1 pi to 8 pi")
    for seed in range(sets):
        rng = np.random.default_rng(seed)
        mesh = random_sphere(count, rng)
        cones = rng.choice(count, rng.integers(3, 31), replace=False)
        target = np.zeros(count)
        target[cones] = random_curvatures(len(cones), 4 * np.pi, rng)
        solve(row, mesh, target)
    return row


def disks(sets: int) -> Row:
    """Random boundary curvatures on a hilly disk."""
    row = Row("disk, 525 vertices, random curvature at every boundary vertex")
    for seed in range(sets):
        rng = np.random.default_rng(seed)
        mesh = TriangleMesh(*shapes.hill())
        border = np.flatnonzero(mesh.is_boundary_vertex)
        curvature = rng.normal(0, rng.uniform(0.1, 1.2), len(border))
        for _ in range(1000):
            curvature = np.minimum(curvature + (2 * np.pi - curvature.sum()) / len(border), 0.95 * np.pi)
        target = np.zeros(len(mesh.vertices))
        target[border] = curvature
        solve(row, mesh, target)
    return row


def handles() -> Row:
    """One cone on surfaces of genus 1 to 5."""
    row = Row("one cone on genus 1 to 5, at 8 vertices each")
    for genus in range(1, 6):
        mesh = TriangleMesh(*shapes.genus(genus))
        for cone in np.random.default_rng(genus).choice(len(mesh.vertices), 8, replace=False):
            target = np.zeros(len(mesh.vertices))
            target[cone] = 2 * np.pi * (2 - 2 * genus)
            solve(row, mesh, target)
    return row


def spread_cones(mesh: TriangleMesh, count: int) -> np.ndarray:
    """Cones far from each other and from the boundary, along the edges."""
    costs = np.linalg.norm(np.diff(mesh.vertices[mesh.edges], axis=1)[:, 0], axis=1)
    size = len(mesh.vertices)
    graph = coo_matrix((costs + 1e-12 * costs.max(), mesh.edges.T), shape=(size, size)).tocsr()
    border = np.flatnonzero(mesh.is_boundary_vertex)
    cones: list[int] = []
    distance = dijkstra(graph, directed=False, indices=border if len(border) else 0, min_only=len(border) > 0)
    while len(cones) < count:
        cones.append(int(distance.argmax()))
        if len(cones) == 1 and not len(border):
            distance = np.full(size, np.inf)
        distance = np.minimum(distance, dijkstra(graph, directed=False, indices=cones[-1]))
    return np.array(cones)


def layout(row: Row, mesh: TriangleMesh, metric: ExactMetric, cones: np.ndarray) -> None:
    """Lay the metric out on the mesh's own triangles, and count."""
    edge_costs = np.linalg.norm(np.diff(mesh.vertices[mesh.edges], axis=1)[:, 0], axis=1)
    cut_mesh = cut_open(mesh, find_seams(mesh, cones, edge_costs + 1e-12 * edge_costs.max()))
    began = time.perf_counter()
    flat = straight_triangles(metric.triangulation, metric.flips, len(mesh.faces))
    pinned = np.zeros(len(mesh.vertices), dtype=bool)
    pinned[cones] = True
    on_seam = np.bincount(cut_mesh.origin, minlength=len(pinned)) > 1
    untangled = untangle(flat, mesh.faces, pinned, on_seam, mesh.is_boundary_vertex)
    sides = cut_mesh.mesh.edge_halfedges
    cut = np.zeros(mesh.faces.size, dtype=bool)
    cut[sides[sides[:, 1] < 0, 0]] = True
    corners = cut_mesh.mesh.faces
    uv = unfold(untangled.flat, corners)
    row.seconds += time.perf_counter() - began
    points = (uv[:, 0] + 1j * uv[:, 1])[corners]
    steps = points[:, [2, 0, 1]] - points[:, [1, 2, 0]]
    seam = np.flatnonzero(cut & (flat.twin >= 0))
    here, there = np.abs(steps.ravel()[seam]), np.abs(steps.ravel()[flat.twin[seam]])
    if row.layouts == 0:
        row.qc = measure(mesh, uv[corners]).qc_mean
    row.layouts += 1
    row.inverted += int((heights(flat.sides.reshape(-1, 3)) <= DEGENERATE).sum())
    row.left += len(untangled.left)
    row.flipped += int((heights(steps) <= 0).sum())
    row.moved += len(untangled.moved)
    row.way = max(row.way, untangled.largest_move)
    if len(seam):
        row.seam = max(row.seam, float((np.abs(here - there) / here).max()))


def read(path: Path) -> TriangleMesh:
    """The largest component of a model."""
    file = read_mesh(path)
    faces, _ = triangulate(file.vertices, file.corners, file.offsets)
    parts = check_mesh(file.vertices, faces, repair=True).mesh.split_components()
    return max((part[0] for part in parts), key=lambda part: len(part.faces))


def variants(mesh: TriangleMesh, count: int) -> Iterator[TriangleMesh]:
    """The mesh itself, then with noise, slivers and flipped edges in turn, more of them each time."""
    yield mesh
    makers: list[Callable[[TriangleMesh, float, np.random.Generator], TriangleMesh]] = [
        noisy,
        slivered,
        flipped,
    ]
    for k in range(count - 1):
        yield makers[k % 3](mesh, 0.5 ** (4 - min(k // 3, 4)), np.random.default_rng(k))


def noisy(mesh: TriangleMesh, amount: float, rng: np.random.Generator) -> TriangleMesh:
    """Every vertex moved by up to 0.4 of the mean edge there."""
    ends = mesh.vertices[mesh.edges]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    total = np.bincount(mesh.edges.ravel(), np.repeat(length, 2), len(mesh.vertices))
    mean = total / np.bincount(mesh.edges.ravel(), minlength=len(mesh.vertices))
    shift = rng.uniform(-1, 1, mesh.vertices.shape) * (0.4 * amount * mean)[:, None]
    return TriangleMesh(mesh.vertices + shift, mesh.faces)


def slivered(mesh: TriangleMesh, amount: float, rng: np.random.Generator) -> TriangleMesh:
    """Some vertices moved along an edge, almost onto the other end or onto the middle of an opposite side."""
    vertices = mesh.vertices.copy()
    chosen = rng.permutation(len(mesh.faces))[: int(0.02 * amount * len(mesh.faces)) + 1]
    for f in chosen:
        i, j, k = np.roll(mesh.faces[f], rng.integers(3))
        goal = vertices[j] if rng.random() < 0.5 else (vertices[j] + vertices[k]) / 2
        vertices[i] = goal + (vertices[i] - goal) * 10 ** rng.uniform(-5, -1)
    return TriangleMesh(vertices, mesh.faces)


def flipped(mesh: TriangleMesh, amount: float, rng: np.random.Generator) -> TriangleMesh:
    """Some edges replaced by the other diagonal of their two triangles."""
    faces = mesh.faces.copy()
    sides = mesh.edge_halfedges
    pairs = set(map(tuple, mesh.edges.tolist()))
    touched = np.zeros(len(faces), dtype=bool)
    for e in rng.permutation(np.flatnonzero(sides[:, 1] >= 0))[: int(0.3 * amount * len(sides))]:
        f, g = sides[e] // 3
        if touched[f] or touched[g]:
            continue
        i, j = faces[f][(sides[e, 0] + 1) % 3], faces[f][(sides[e, 0] + 2) % 3]
        p, q = faces[f][sides[e, 0] % 3], faces[g][sides[e, 1] % 3]
        if (min(p, q), max(p, q)) in pairs:
            continue
        pairs.add((min(p, q), max(p, q)))
        faces[f], faces[g] = (p, i, q), (q, j, p)
        touched[f] = touched[g] = True
    return TriangleMesh(mesh.vertices, faces)


def models(names: list[str], count: int) -> Iterator[Row]:
    """Metric and layout of the variants of each model: 20 cones (fewer on small models) and the boundary at 0."""
    for path in sorted(MODELS.iterdir()):
        if path.suffix not in (".obj", ".off", ".ply") or path.stem == "nonmanifold":
            continue
        if names and path.stem not in names:
            continue
        mesh = read(path)
        row = Row(f"{path.stem}, {len(mesh.faces)} triangles, {count} variants")
        cones = spread_cones(mesh, min(20, len(mesh.faces) // 100))
        fixed = mesh.is_boundary_vertex.copy()
        fixed[cones] = True
        for variant in variants(mesh, count):
            metric = solve(row, variant, np.zeros(len(fixed)), fixed=fixed)
            if metric.converged:
                layout(row, variant, metric, cones)
        yield row


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=200)
    parser.add_argument("--variants", type=int, default=16)
    parser.add_argument("--models", default="")
    chosen = parser.parse_args()
    print(Row.HEADER, flush=True)
    if chosen.sets:
        print(spheres(1000, chosen.sets), flush=True)
        print(spheres(10000, chosen.sets), flush=True)
        print(disks(chosen.sets), flush=True)
        print(handles(), flush=True)
    if chosen.variants:
        for row in models([name for name in chosen.models.split(",") if name], chosen.variants):
            print(row, flush=True)


if __name__ == "__main__":
    main()
