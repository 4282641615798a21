"""What the search for cones costs: `python benchmarks/cones.py` prints a Markdown table.

The default search, and the paper's, against one factorization of the same Laplacian in the same process. Models of
`../shared/meshes` where they are, split in four over and over up to --largest triangles, and a sphere in any case.
Wall time, the best of --runs.
"""

from __future__ import annotations

import argparse
import math

import numpy as np
from common import best_time, meshes
from coneflat.cones.pursuit import PursuedCones, open_search, pursue

from coneflat import edge_lengths, mollify
from coneflat.cones import greedy_cones
from coneflat.cones.choose import Surface
from coneflat.geometry.ties import tie_key
from coneflat.solver import factorize

MODELS = "fandisk,rocker-arm,hand,bunny,camelhead,face,3holes,elephant,horse,kitten,stanford-bunny"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--models", default=MODELS)
    parser.add_argument("--largest", type=int, default=110_000, help="triangles")
    parser.add_argument("--smallest", type=int, default=0, help="triangles")
    parser.add_argument("--distortion", type=float, default=0.2)
    parser.add_argument("--min-cone-angle", type=float, default=0.5, help="of pi")
    parser.add_argument("--runs", type=int, default=2)
    arguments = parser.parse_args()
    print("| model | vertices | cones | E | greedy: cones | E | factorization, s | search | greedy |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for name, mesh in meshes(arguments.models.split(","), arguments.largest):
        if len(mesh.faces) < arguments.smallest and name != "sphere":
            continue
        lengths, _ = mollify(edge_lengths(mesh.vertices, mesh.faces))
        surface = Surface.of(mesh, lengths)
        given = (
            surface.laplacian,
            surface.curvature,
            surface.areas,
            mesh.is_boundary_vertex,
            mesh.euler_characteristic,
        )
        free = np.flatnonzero(~mesh.is_boundary_vertex)
        free = free if mesh.is_boundary_vertex.any() else free[1:]
        inner = surface.laplacian[free][:, free]
        found: list[PursuedCones] = []

        def search() -> None:
            opened = open_search(
                *given,  # noqa: B023
                tie_key=tie_key(mesh.vertices),  # noqa: B023
                min_cone_angle=arguments.min_cone_angle * math.pi,
            )
            found.append(pursue(opened, distortion=arguments.distortion))  # noqa: B023

        if name == "sphere":
            search()  # compiles, or loads what was compiled
        factor = best_time(lambda: factorize(inner), arguments.runs)  # noqa: B023
        ours = best_time(search, arguments.runs)
        greedy = greedy_cones(*given[:2], *given[3:])
        paper = best_time(lambda: greedy_cones(*given[:2], *given[3:]), arguments.runs)  # noqa: B023
        share = surface.areas / surface.areas.sum()
        spread = np.sqrt(share @ (greedy.log_scale - share @ greedy.log_scale) ** 2)
        print(
            f"| {name} | {len(mesh.vertices):,} | {len(found[-1].solution.cones)} | {found[-1].distortion:.3f} "
            f"| {len(greedy.cones)} | {spread:.3f} | {factor:.3f} | {ours / factor:.1f} | {paper / factor:.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
