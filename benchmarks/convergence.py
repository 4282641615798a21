"""Two discrete conformal metrics of one smooth surface: `python benchmarks/convergence.py` prints a Markdown table.

Circle patterns (CP) and conformal factors (the exact method) discretise the same smooth problem independently. On a
sequence of finer meshes, with the same cones of the same curvature at the same vertices, their flat edge lengths,
scaled to the same total area, must converge to each other. Differences are those of the log lengths: the mean over the
surface, and the largest at a distance above --away from all cones (next to a cone, the singularity of the smooth
metric, they do not converge). The surface is a bumpy sphere of radius about 1, whose new vertices lie on it, too. The
order is the power of the edge length at which a difference decreases.

    python benchmarks/convergence.py --largest 400000 -o convergence.png
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

import common  # noqa: F401 - finds the shapes of the tests
import numpy as np
import shapes
from comparisons.patterns import circle_patterns

from coneflat.cones import cones_with_curvature
from coneflat.geometry import (
    angle_defect,
    corner_angles,
    cotangent_laplacian,
    cotangents,
    double_areas,
    edge_lengths,
)
from coneflat.mesh.connectivity import TriangleMesh
from coneflat.metric.solve import ExactSolver
from coneflat.stages import MetricSpec, VertexCurvatures

# Vertices of the icosahedron that the sphere is split from, and curvatures that sum to 4 pi.
CONES = np.array([0, 2, 3, 5, 7, 8, 10])
CURVATURES = np.array([1.0, 0.75, 0.5, 0.75, 0.5, 1.0, -0.5]) * np.pi
METHODS = ("CP", "exact")
PAIRS = tuple(combinations(range(len(METHODS)), 2))
COLORS = "#0072b2", "#d55e00", "#009e73"  # distinguishable by colour-blind people


def flat_lengths(mesh: TriangleMesh) -> list[np.ndarray]:
    """Return the (m, 3) log lengths of each method, scaled to the area of the mesh."""
    lengths = edge_lengths(mesh.vertices, mesh.faces)
    solution = cones_with_curvature(
        cotangent_laplacian(mesh.faces, cotangents(lengths), len(mesh.vertices)),
        angle_defect(mesh.faces, corner_angles(lengths), mesh.is_boundary_vertex),
        mesh.is_boundary_vertex,
        mesh.euler_characteristic,
        CONES,
        CURVATURES,
    )
    spec = MetricSpec(
        method="exact",
        boundary="free",
        corners=VertexCurvatures(np.empty(0, dtype=np.int64), np.empty(0)),
        keeps_length=mesh.is_boundary_vertex,
        keeps_area=True,
        scale_at_cones=False,
        quantum=None,
        names=np.arange(len(mesh.vertices)),
    )
    metrics = circle_patterns(mesh, lengths, solution), ExactSolver(mesh, spec).metric(lengths, solution)
    logs = []
    for metric in metrics:
        assert metric.triangles is not None
        logs.append(np.log(np.abs(metric.triangles.sides.reshape(-1, 3)) * metric.scale))
    return logs


def differences(rounds: int, bumps: float, away: float) -> tuple[int, float, np.ndarray]:
    """Return the number of triangles, the mean edge, and the mean and largest difference of each pair (3, 2)."""
    vertices, faces = shapes.sphere(rounds, bumps)
    mesh = TriangleMesh(vertices, faces)
    lengths = edge_lengths(vertices, faces)
    middle = (vertices[faces[:, [1, 2, 0]]] + vertices[faces[:, [2, 0, 1]]]) / 2
    distance = np.linalg.norm(middle[:, :, None] - vertices[CONES], axis=-1).min(axis=-1)
    area = double_areas(lengths)
    flat = flat_lengths(mesh)
    gaps = []
    for first, second in PAIRS:
        difference = np.abs(flat[first] - flat[second])
        gaps.append(
            (float(np.average(difference.mean(axis=1), weights=area)), difference[distance > away].max())
        )
    return len(faces), float(lengths.mean()), np.array(gaps)


def measured(largest: int, bumps: float, away: float) -> Iterator[tuple[int, float, np.ndarray]]:
    """Yield the result of `differences` for a sequence of finer meshes."""
    rounds = 2
    while 20 * 4**rounds <= largest:
        yield differences(rounds, bumps, away)
        rounds += 1


def plot(rows: list[tuple[int, float, np.ndarray]], path: Path) -> None:
    """Draw the differences against the edge length."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    size = np.array([edge for _, edge, _ in rows])
    values = np.stack([gaps for *_, gaps in rows])
    figure, axes = plt.subplots(figsize=(6, 4.5))
    for k, (first, second) in enumerate(PAIRS):
        name = f"{METHODS[first]} and {METHODS[second]}"
        axes.loglog(size, values[:, k, 0], "o-", color=COLORS[k], label=f"{name}, mean")
        axes.loglog(size, values[:, k, 1], "s--", color=COLORS[k], label=f"{name}, largest off cones")
    guide = values[:, :, 0].min() / 2 * (size / size.min()) ** 2
    axes.loglog(size, guide, color="0.6", label="second order")
    axes.set_xticks(size, [f"{edge:.3f}" for edge in size])
    axes.set_xticks([], minor=True)
    axes.set_xlabel("mean edge length")
    axes.set_ylabel("difference of log flat length")
    axes.legend(fontsize=8, frameon=False)
    axes.grid(which="both", alpha=0.2)
    figure.tight_layout()
    figure.savefig(path, dpi=150)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--largest", type=int, default=100_000, help="triangles")
    parser.add_argument("--bumps", type=float, default=0.3, help="height of the bumps; 0 for a round sphere")
    parser.add_argument("--away", type=float, default=0.4, help="distance from cones")
    parser.add_argument("-o", "--output", type=Path, help="a picture of the table, PNG, PDF or SVG")
    arguments = parser.parse_args()
    names = [f"{METHODS[first]}-{METHODS[second]}" for first, second in PAIRS]
    print("| triangles | edge | " + " | ".join(f"{n} mean | order | {n} max | order" for n in names) + " |")
    print("| --- " * (2 + 4 * len(names)) + "|")
    rows: list[tuple[int, float, np.ndarray]] = []
    for count, edge, gaps in measured(arguments.largest, arguments.bumps, arguments.away):
        orders = [["-"] * 2] * len(PAIRS)
        if rows:
            step = np.log(edge / rows[-1][1])
            orders = [[f"{o:.2f}" for o in pair] for pair in np.log(gaps / rows[-1][2]) / step]
        cells = [
            f"{v:.2e} | {o}"
            for pair, order in zip(gaps, orders, strict=True)
            for v, o in zip(pair, order, strict=True)
        ]
        print(f"| {count:,} | {edge:.4f} | " + " | ".join(cells) + " |", flush=True)
        rows.append((count, edge, gaps))
    if arguments.output:
        plot(rows, arguments.output)


if __name__ == "__main__":
    main()
