"""Atlases against those of others: `python benchmarks/atlas.py` prints a Markdown table.

Every model of `../shared/meshes` that is a manifold, and a bumpy sphere, by coneflat with its default cones and with
more of them, and by what can be installed with pip: xatlas and uvunwrap with their defaults. All are measured by
`coneflat.measure` on the UV points that come out; the seam length is over the square root of the area.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from importlib.util import find_spec

import numpy as np
from common import MODELS, shapes

from coneflat import check_mesh, flatten, read_mesh
from coneflat.distortion import Distortion, measure
from coneflat.errors import ConeflatError
from coneflat.mesh import TriangleMesh

Method = Callable[[TriangleMesh], tuple[np.ndarray, float | None]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--models", default="", help="of all, those whose names are given; with commas")
    parser.add_argument("--more", type=float, default=0.05, help="distortion allowed with more cones")
    parser.add_argument("--largest", type=int, default=120_000, help="triangles")
    arguments = parser.parse_args()
    methods: dict[str, Method] = {
        "coneflat": lambda mesh: ours(mesh),
        f"coneflat, distortion {arguments.more:g}": lambda mesh: ours(mesh, distortion=arguments.more),
    }
    methods |= {name: call for name, call in (("xatlas", xatlas), ("uvunwrap", uvunwrap)) if find_spec(name)}
    print(
        "| model | triangles | method | charts | seam length | QC | area std | flipped | overlaps | packed | s |"
    )
    print("| --- " * 11 + "|")
    flatten(*shapes.sphere(2), charts="atlas")
    sums: dict[str, list[tuple[float, ...]]] = {}
    for name, mesh in models([word for word in arguments.models.split(",") if word], arguments.largest):
        for method, call in methods.items():
            start = time.perf_counter()
            corner_uv, packed = call(mesh)
            seconds = time.perf_counter() - start
            found = measure(mesh, corner_uv)
            packed = area_covered(corner_uv) if packed is None else packed
            sums.setdefault(method, []).append(
                (found.charts, found.seam_length, found.qc_mean, found.area_std, packed)
            )
            print(row(name, mesh, method, found, packed, seconds), flush=True)
    for method, values in sums.items():
        charts, length, qc, std, packed = np.mean(values, axis=0)
        means = f"{charts:.1f} | {length:.2f} | {qc:.4f} | {std:.3f} | | | {packed:.2f} | |"
        print(f"| mean of {len(values)} | | {method} | {means}")


def models(names: list[str], largest: int) -> list[tuple[str, TriangleMesh]]:
    found = [("sphere", check_mesh(*shapes.sphere(5)).mesh)] if not names or "sphere" in names else []
    for path in sorted(MODELS.glob("*.*")):
        if path.suffix == ".md" or (names and path.stem not in names):
            continue
        source = read_mesh(path)
        try:
            mesh = check_mesh(source.vertices, source.corners.reshape(-1, 3)).mesh
        except (ConeflatError, ValueError):
            continue
        if len(mesh.faces) <= largest:
            found.append((path.stem, mesh))
    return found


def row(name: str, mesh: TriangleMesh, method: str, found: Distortion, packed: float, seconds: float) -> str:
    return (
        f"| {name} | {len(mesh.faces):,} | {method} | {found.charts} | {found.seam_length:.2f} | {found.qc_mean:.4f} | "
        f"{found.area_std:.3f} | {found.flipped + found.degenerate} | {found.overlapping_pairs} | {packed:.2f} | "
        f"{seconds:.2f} |"
    )


def area_covered(corner_uv: np.ndarray) -> float:
    """Return the part of the unit square that triangles cover, overlaps counted as often as they are covered."""
    one, two = corner_uv[:, 1] - corner_uv[:, 0], corner_uv[:, 2] - corner_uv[:, 0]
    return float(np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]).sum() / 2)


def ours(mesh: TriangleMesh, **options: float) -> tuple[np.ndarray, None]:
    return flatten(mesh.vertices, mesh.faces, charts="atlas", **options).corner_uv, None


def xatlas(mesh: TriangleMesh) -> tuple[np.ndarray, None]:
    """At a size at which its absolute tolerances do not matter: an area of 10,000."""
    import xatlas

    corners = mesh.vertices[mesh.faces]
    area = (
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
        / 2
    )
    _, faces, uv = xatlas.parametrize(mesh.vertices * (100 / np.sqrt(area)), mesh.faces)
    return np.asarray(uv, dtype=np.float64)[faces], None


def uvunwrap(mesh: TriangleMesh) -> tuple[np.ndarray, float]:
    import uvunwrap

    atlas = uvunwrap.generate([uvunwrap.Mesh(mesh.vertices.ravel().tolist(), mesh.faces.ravel().tolist())])
    uv = np.array(atlas.meshes[0].corner_uvs, dtype=np.float64).reshape(-1, 3, 2)
    return uv, float(atlas.utilization)


if __name__ == "__main__":
    main()
