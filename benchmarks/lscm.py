"""Our least squares conformal maps beside libigl's: `python benchmarks/lscm.py` prints a Markdown table.

Models of `../shared/meshes`, where they are, and a bumpy sphere, cut open as by default. Both maps have the same two
pinned points; the difference is the largest distance of a point in the two, relative to the size of the map. It needs
libigl's Python bindings.
"""

from __future__ import annotations

import argparse

import igl
import numpy as np
from common import cases, model
from comparisons.disk_maps import least_squares_conformal

from coneflat import flatten
from coneflat.geometry import edge_lengths
from coneflat.layout import far_pins
from coneflat.mesh.connectivity import TriangleMesh


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--models", default="fandisk,hand,bunny,face")
    arguments = parser.parse_args()
    print("| model | triangles | relative difference |\n| --- | --- | --- |")
    for name, rounds in cases(arguments.models.split(","), 60_000):
        if rounds == 0:
            disk = cut_open(*model(name, rounds))
            print(f"| {name} | {len(disk.faces):,} | {difference(disk):.1e} |", flush=True)


def cut_open(vertices: np.ndarray, faces: np.ndarray) -> TriangleMesh:
    """Return a mesh cut to a disk along the default seams."""
    result = flatten(vertices, faces, charts="one")
    points = np.empty((len(result.uv), 3))
    points[result.uv_faces] = result.vertices[result.faces]
    return TriangleMesh(points, result.uv_faces)


def difference(disk: TriangleMesh) -> float:
    """Return the largest distance of a point in both maps, divided by the size of the map."""
    lengths = edge_lengths(disk.vertices, disk.faces)
    ours = least_squares_conformal(disk, lengths)
    pins = far_pins(disk, lengths)
    answer = igl.lscm(disk.vertices, disk.faces, pins, ours[pins])
    theirs = np.asarray(answer[0] if isinstance(answer, tuple) else answer)
    return float(np.linalg.norm(theirs - ours, axis=1).max() / np.ptp(ours, axis=0).max())


if __name__ == "__main__":
    main()
