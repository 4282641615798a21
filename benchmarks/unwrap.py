"""Textures compared with other packages: `python benchmarks/unwrap.py` prints Markdown tables.

Models: those of `../shared/meshes`, decimated to 1,000, 5,000 and 20,000 triangles, and generated ones: a noisy surface
with 50 handles, a noisy figure, 3,000 components, extruded letters, an assembly of 30 parts, and those of
`brought_models.py`. Packages: `coneflat.unwrap` with its defaults, xatlas with 2 texels of padding at 1,024 texels, and
uvunwrap with its defaults. All results are measured by `coneflat.measure` on the UVs that the packages return; seconds
are those of processors. The second table has totals of all models but those brought, the third of these. Needs the
extra `bench`. For another version of the package, set PYTHONPATH to its folder `src`.

Options: --only NAME,... (models), --packages coneflat,xatlas,uvunwrap, --largest 120000 (triangles), --sizes
1000,5000,20000, --brought (only those brought), --save FOLDER (the results).
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from brought_models import brought_models
from common import models, shapes

from coneflat import check_mesh, measure, unwrap
from coneflat.geometry import double_areas, edge_lengths
from coneflat.mesh.connectivity import TriangleMesh

RESOLUTION, PADDING = 1024, 2
COLUMNS = ("energy", "area_std", "flipped", "overlapping_pairs", "charts", "seam_length")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="")
    parser.add_argument("--largest", type=int, default=120_000)
    parser.add_argument("--sizes", default="1000,5000,20000")
    parser.add_argument("--packages", default=",".join(PACKAGES))
    parser.add_argument("--brought", action="store_true")
    parser.add_argument("--save", type=Path)
    arguments = parser.parse_args()
    only, sizes = set(filter(None, arguments.only.split(","))), [int(n) for n in arguments.sizes.split(",")]
    packages = arguments.packages.split(",")
    print(
        "| model | triangles | package | energy | area std | flipped | overlaps | charts | seams | covered | CPU s |"
    )
    print("| --- " * 11 + "|")
    unwrap(*shapes.sphere(2))
    groups = [brought()] if arguments.brought else [cases(sizes, arguments.largest), brought()]
    totals = []
    for group in groups:
        rows: dict[str, list[tuple[float, ...]]] = {name: [] for name in packages}
        for case in group:
            if only and case.name not in only:
                continue
            for package in packages:
                corner_uv, seconds = timed(PACKAGES[package], case)
                rows[package].append(print_row(case, package, corner_uv, seconds))
                if arguments.save and package == "coneflat":
                    save(case, corner_uv, arguments.save)
        totals.append(rows)
    for rows in totals:
        summarize(rows)


@dataclass(frozen=True)
class Case:
    """A model: its name, the arrays that packages get, and the mesh of their triangles on which UVs are measured."""

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    mesh: TriangleMesh


def timed(run: Callable[[Case], np.ndarray], case: Case) -> tuple[np.ndarray, float]:
    """Return the UVs (m, 3, 2) of a package, and the processor seconds that it took."""
    start = os.times()
    corner_uv = run(case)
    end = os.times()
    return corner_uv, end.user + end.system - start.user - start.system


def print_row(case: Case, package: str, corner_uv: np.ndarray, seconds: float) -> tuple[float, ...]:
    """Print the measures of UVs as a row of the table, and return them."""
    measures = measure(case.mesh, corner_uv)
    values = *(float(getattr(measures, key)) for key in COLUMNS), covered(corner_uv), seconds
    energy, std, flipped, overlaps, charts, seams, share, _ = values
    print(
        f"| {case.name} | {len(case.faces):,} | {package} | {energy:.3f} | {std:.3f} | {flipped:.0f} | "
        f"{overlaps:.0f} | {charts:.0f} | {seams:.2f} | {share:.3f} | {seconds:.2f} |",
        flush=True,
    )
    return values


def save(case: Case, corner_uv: np.ndarray, folder: Path) -> None:
    """Write a model with its UVs."""
    folder.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(
        folder / f"{case.name}.npz", vertices=case.vertices, faces=case.faces, corner_uv=corner_uv
    )


def summarize(rows: dict[str, list[tuple[float, ...]]]) -> None:
    """Print a row for each package: worst energy, medians, and totals."""
    print(
        "\n| package | models | energy, worst | area std, worst | flipped | overlaps | charts | seams | covered "
        "| CPU s |"
    )
    print("| --- " * 10 + "|")
    ours = np.array(rows.get("coneflat", []))
    for package, values in rows.items():
        if not values:
            continue
        energy, std, flipped, overlaps, charts, seams, share, seconds = np.array(values).T
        print(
            f"| {package} | {len(values)} | {np.nanmax(energy):.3f} | {np.nanmax(std):.3f} | {flipped.sum():.0f} | "
            f"{(overlaps > 0).sum()} | {charts.sum():.0f} | {seams.sum():.1f} | {np.median(share):.3f} | "
            f"{seconds.sum():.1f} |"
        )
        if package != "coneflat" and len(ours):
            times = charts.sum() / ours[:, 4].sum(), seams.sum() / ours[:, 5].sum()
            fewer, slower = (share < ours[:, 6]).sum(), (seconds > ours[:, 7]).sum()
            print(
                f"| | | | | | | {times[0]:.1f} times | {times[1]:.2f} times | less: {fewer} | slower: {slower} |"
            )


def cases(sizes: list[int], largest: int) -> Iterator[Case]:
    """Yield all models but those brought."""
    for name, mesh in models(repair=True):
        if len(mesh.faces) <= largest:
            yield of_mesh(name, mesh)
        for size in sizes:
            if size < len(mesh.faces):
                yield of_mesh(f"{name}-{size}", decimated(mesh, size))
        if name == "human":
            yield of_mesh(f"{name}-noisy", noisy(decimated(mesh, 10_000)))
    yield of_mesh("handles", check_mesh(*noisy_handles(), repair=True).mesh)
    yield of_mesh("crumbs", check_mesh(*crumbs()).mesh)
    yield of_mesh("letters", check_mesh(*letters(), repair=True).mesh)
    yield of_mesh("assembly", check_mesh(*assembly()).mesh)


def of_mesh(name: str, mesh: TriangleMesh) -> Case:
    return Case(name, mesh.vertices, mesh.faces, mesh)


def brought() -> Iterator[Case]:
    """Yield the models as people bring them of which no triangle is dropped."""
    for name, (vertices, faces) in brought_models():
        mesh = check_mesh(vertices, faces, repair=True).mesh
        if len(mesh.faces) == len(faces):
            yield Case(name, np.asarray(vertices, dtype=np.float64), faces, mesh)


def decimated(mesh: TriangleMesh, count: int) -> TriangleMesh:
    """Return a mesh with about so many triangles."""
    import fast_simplification

    vertices, faces = fast_simplification.simplify(
        mesh.vertices.astype(np.float32), mesh.faces, 1 - count / len(mesh.faces)
    )
    return check_mesh(vertices.astype(np.float64), faces, repair=True).mesh


def noisy(mesh: TriangleMesh) -> TriangleMesh:
    """Return a mesh with four times as many triangles and normal noise of a fifth of their median edge length."""
    vertices, faces = shapes.subdivide(mesh.vertices, mesh.faces)
    noise = np.random.default_rng(4).standard_normal(vertices.shape)
    size = 0.2 * np.median(edge_lengths(vertices, faces))
    return check_mesh(vertices + size * noise, faces, repair=True).mesh


def noisy_handles() -> tuple[np.ndarray, np.ndarray]:
    """Return a surface by marching cubes of a block with about 50 tunnels and noise."""
    from skimage.measure import marching_cubes

    random = np.random.default_rng(1)
    x, y, z = np.mgrid[-1.2:1.2:64j, -1.2:1.2:64j, -0.5:0.5:27j]
    value = np.maximum.reduce([np.abs(x) - 1, np.abs(y) - 1, np.abs(z) - 0.35])
    for a, b in np.stack(np.meshgrid(np.linspace(-0.85, 0.85, 7), np.linspace(-0.85, 0.85, 7)), -1).reshape(
        -1, 2
    ):
        value = np.maximum(value, 0.075 - np.hypot(x - a, y - b))
    value += 0.004 * random.standard_normal(value.shape)
    vertices, faces, _, _ = marching_cubes(value, 0.0)
    return vertices, faces


def crumbs() -> tuple[np.ndarray, np.ndarray]:
    """Return 3,000 small components."""
    random = np.random.default_rng(2)
    kinds = [shapes.sphere(1), shapes.box(), shapes.sphere(0)]
    parts = []
    for i in range(3000):
        vertices, faces = kinds[i % 3]
        parts.append((np.asarray(vertices) * random.uniform(0.2, 1, 3) + random.uniform(-40, 40, 3), faces))
    return shapes.join(*parts)


def letters() -> tuple[np.ndarray, np.ndarray]:
    """Return extruded letters."""
    from mapbox_earcut import triangulate_float64
    from matplotlib.path import Path as Outline
    from matplotlib.textpath import TextPath

    vertices, faces = np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    for i, letter in enumerate("GEOMETRY"):
        rings = [np.asarray(ring)[:-1] for ring in TextPath((10 * i, 0), letter, size=12).to_polygons()]
        rings.sort(key=lambda ring: -np.ptp(ring, axis=0).prod())
        outer = Outline(rings[0])
        rings = [rings[0], *(ring for ring in rings[1:] if outer.contains_point(ring[0]))]
        flat, ends = np.concatenate(rings), np.cumsum([len(ring) for ring in rings])
        top = triangulate_float64(flat, ends.astype(np.uint32)).reshape(-1, 3).astype(np.int64)
        count = len(flat)
        # Sides of the outline, oriented as in the top.
        sides = np.concatenate([top[:, [0, 1]], top[:, [1, 2]], top[:, [2, 0]]])
        side_set = set(map(tuple, sides.tolist()))
        border = np.array([side for side in side_set if side[::-1] not in side_set])
        walls = np.concatenate(
            [np.column_stack([border[:, ::-1], border[:, 0] + count]),
             np.column_stack([border[:, 0] + count, border[:, 1] + count, border[:, 1]])]
        )  # fmt: skip
        part = np.concatenate([top, top[:, ::-1] + count, walls]) + len(vertices)
        vertices = np.concatenate(
            [vertices, np.pad(flat, ((0, 0), (0, 1)), constant_values=2.0), np.pad(flat, ((0, 0), (0, 1)))]
        )
        faces = np.concatenate([faces, part])
    return vertices, faces


def assembly() -> tuple[np.ndarray, np.ndarray]:
    """Return an assembly of 30 boxes, tubes and rings."""
    random = np.random.default_rng(3)
    kinds = [shapes.subdivide(*shapes.subdivide(*shapes.box())), shapes.torus(36, 18), shapes.sphere(3)]
    parts = []
    for i in range(30):
        vertices, faces = kinds[i % 3]
        parts.append((np.asarray(vertices) * random.uniform(0.3, 2, 3) + random.uniform(-9, 9, 3), faces))
    return shapes.join(*parts)


def covered(corner_uv: np.ndarray) -> float:
    """Return the fraction of the unit square inside triangles."""
    first_side, second_side = corner_uv[:, 1] - corner_uv[:, 0], corner_uv[:, 2] - corner_uv[:, 0]
    return float(
        np.abs(first_side[:, 0] * second_side[:, 1] - first_side[:, 1] * second_side[:, 0]).sum() / 2
    )


def by_coneflat(case: Case) -> np.ndarray:
    return unwrap(case.vertices, case.faces, repair=True, resolution=RESOLUTION, padding=PADDING).corner_uv


def by_xatlas(case: Case) -> np.ndarray:
    import xatlas

    atlas, pack = xatlas.Atlas(), xatlas.PackOptions()
    pack.padding, pack.resolution = PADDING, RESOLUTION
    # xatlas depends on the unit of length.
    area = double_areas(edge_lengths(case.vertices, case.faces)).sum() / 2
    atlas.add_mesh((case.vertices * (100 / np.sqrt(area))).astype(np.float32), case.faces.astype(np.uint32))
    atlas.generate(xatlas.ChartOptions(), pack)
    _, indices, uvs = atlas[0]
    return uvs[indices].astype(np.float64) * [atlas.width, atlas.height] / max(atlas.width, atlas.height)


def by_uvunwrap(case: Case) -> np.ndarray:
    import uvunwrap

    uv_mesh = uvunwrap.Mesh(case.vertices.ravel().tolist(), case.faces.ravel().tolist())
    return np.array(uvunwrap.generate([uv_mesh]).meshes[0].corner_uvs, dtype=np.float64).reshape(-1, 3, 2)


PACKAGES: dict[str, Callable[[Case], np.ndarray]] = {
    "coneflat": by_coneflat,
    "xatlas": by_xatlas,
    "uvunwrap": by_uvunwrap,
}

if __name__ == "__main__":
    main()
