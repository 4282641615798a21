"""Time of the exact metric and layout: `python benchmarks/metric_and_layout.py` prints a Markdown table.

Metric and layout, given cones, by the exact metric and its unfolding against the paper's linear metric and its
least squares layout, in the same process. Models of `../shared/meshes` where they are, split in four over and over
up to --largest triangles, and a bumpy sphere in any case. Wall time, the best of --runs.
"""

from __future__ import annotations

import argparse

from common import best_time, meshes

from coneflat.cones import greedy_cones
from coneflat.geometry import angle_defect, corner_angles, cotangent_laplacian, cotangents, edge_lengths
from coneflat.layout import lay_out
from coneflat.mesh import cut_open
from coneflat.metric import ExactChoices, exact_flat_metric, linear_flat_metric
from coneflat.seams import find_seams
from coneflat.stages import Cut, Layout

CONES = 20


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--models", default="bunny,hand,kitten")
    parser.add_argument("--largest", type=int, default=500_000, help="triangles")
    parser.add_argument("--runs", type=int, default=2)
    arguments = parser.parse_args()
    print(
        "| model | triangles | Newton steps | flips | exact + unfolding, s | linear + least squares, s | ratio |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name, mesh in meshes(arguments.models.split(","), arguments.largest):
        lengths = edge_lengths(mesh.vertices, mesh.faces)
        curvature = angle_defect(mesh.faces, corner_angles(lengths), mesh.is_boundary_vertex)
        laplacian = cotangent_laplacian(mesh.faces, cotangents(lengths), len(mesh.vertices))
        surface = laplacian, curvature, mesh.is_boundary_vertex, mesh.euler_characteristic
        solution = greedy_cones(*surface, max_cones=CONES)
        seams = find_seams(mesh, solution.cones, lengths.ravel()[mesh.edge_halfedges[:, 0]])
        cut = Cut(cut_open(mesh, seams).mesh, seams)
        found: list[Layout] = []

        def exact() -> None:
            metric = exact_flat_metric(mesh, lengths, solution, ExactChoices())  # noqa: B023
            found.append(lay_out(metric, cut))  # noqa: B023

        def linear() -> None:
            lay_out(linear_flat_metric(mesh, lengths, solution), cut)  # noqa: B023

        if name == "sphere":
            exact()  # This compiles or loads the kernels.
        one, two = best_time(exact, arguments.runs), best_time(linear, arguments.runs)
        statistics = found[-1].statistics
        flips = statistics.euclidean_flips + statistics.ptolemy_flips
        print(
            f"| {name} | {len(mesh.faces):,} | {statistics.newton_steps} | {flips:,} | {one:.2f} | {two:.2f} "
            f"| {one / two:.2f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
