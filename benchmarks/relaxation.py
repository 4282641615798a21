"""Layouts before and after relaxation: `python benchmarks/relaxation.py` prints Markdown tables.

The models of `../shared/meshes`, as they are and decimated to so many triangles (by fast_simplification, where it is
installed; a decimated mesh that is not manifold is left out), each flattened three times: `relax="off"`, the default
and `relax="whole"`. QC is the ratio of singular values, by area; std that of the log of the scale. With `--dial` the
models named are flattened at several values of `stretch` instead, and with the number of cones that has the same
area distortion without it.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from importlib.util import find_spec
from typing import Any

import numpy as np
from common import MODELS, with_cones_for

import coneflat
from coneflat.errors import ConeflatError

DIALS = (0.0, 0.1, 0.25, 0.5, 0.75, 1.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--models", default="", help="of all, those whose names are given; with commas")
    parser.add_argument("--decimated", default="2000,5000,15000", help="numbers of triangles; with commas")
    parser.add_argument("--dial", action="store_true", help="the curve from angles to areas instead")
    arguments = parser.parse_args()
    names = [name for name in arguments.models.split(",") if name]
    sizes = [int(word) for word in arguments.decimated.split(",") if word]
    if arguments.dial:
        dial(names)
    else:
        before_and_after(names, sizes)


def before_and_after(names: list[str], sizes: list[int]) -> None:
    """Print a row for each mesh."""
    print(
        "| model | triangles | QC mean | | | QC worst | | | area std | | | vertices moved | flipped | "
        "seam mismatch | s, of which relaxing |"
    )
    print("| --- " * 15 + "|")
    for name, vertices, faces in meshes(names, sizes):
        try:
            results = [flattened(vertices, faces, relax=relax) for relax in ("off", "auto", "whole")]
        except ConeflatError as error:
            print(f"| {name} | {len(faces):,} | {error} |")
            continue
        d = [result.distortion for result, _ in results]
        chosen, seconds = results[1]
        cells = [
            " | ".join(f"{one.qc_mean:.4f}" for one in d),
            " | ".join(f"{one.qc_max:.3g}" for one in d),
            " | ".join(f"{one.area_std:.3f}" for one in d),
            f"{chosen.solve.relaxed_vertices / len(chosen.vertices):.0%}",
            str(max(one.flipped for one in d)),
            f"{max(one.seam_mismatch_max for one in d):.0e}",
            f"{seconds:.2f}, {chosen.seconds.get('relax', 0.0):.2f}",
        ]
        print(f"| {name} | {len(faces):,} | " + " | ".join(cells) + " |", flush=True)


def dial(names: list[str]) -> None:
    """Print a row for each model and stretch."""
    print(
        "| model | stretch | QC mean | QC worst | area std | texel density spread | cones | cones for this std "
        "without | s |"
    )
    print("| --- " * 9 + "|")
    for name, vertices, faces in meshes(names, []):
        for stretch in DIALS:
            result, seconds = flattened(vertices, faces, stretch=stretch)
            d = result.distortion
            instead = len((with_cones_for(vertices, faces, d.area_std) if stretch else result).cones)
            print(
                f"| {name} | {stretch:g} | {d.qc_mean:.3f} | {d.qc_max:.3g} | {d.area_std:.3f} | "
                f"{d.density_spread:.2f} | {len(result.cones)} | {instead} | {seconds:.2f} |",
                flush=True,
            )


def flattened(vertices: np.ndarray, faces: np.ndarray, **options: Any) -> tuple[coneflat.Flattening, float]:
    """Return a flattening, and the seconds it took."""
    start = time.perf_counter()
    result = coneflat.flatten(vertices, faces, **options)
    return result, time.perf_counter() - start


def meshes(names: list[str], sizes: list[int]) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield the models and their decimated versions."""
    for path in sorted(MODELS.glob("*.*")):
        if path.suffix == ".md" or path.stem == "nonmanifold" or (names and path.stem not in names):
            continue
        model = coneflat.read_mesh(path)
        vertices, faces = model.vertices, model.triangles
        yield path.stem, vertices, faces
        for size in sizes if find_spec("fast_simplification") else []:
            if size >= len(faces):
                continue
            from fast_simplification import simplify

            fewer = simplify(vertices, faces.astype(np.int32), target_count=size)
            try:
                checked = coneflat.check_mesh(fewer[0].astype(np.float64), fewer[1].astype(np.int64)).mesh
            except ConeflatError:
                continue
            yield path.stem, checked.vertices, checked.faces


if __name__ == "__main__":
    main()
