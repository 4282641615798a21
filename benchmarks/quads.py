"""Quad meshes compared with those of other packages: `python benchmarks/quads.py` prints a Markdown table.

Every model of `../shared/meshes` that is a manifold, some also decimated, symmetric models, mechanical shapes with
fillets, holes and ribs, the same in long thin triangles as CAD programs export them (`cad_parts.py`), and shapes with
thin walls, by coneflat and by what can be installed with pip: QuadriFlow (`pyquadriflow`) and Instant Meshes
(`pynanoinstantmeshes`), each also with its options for boundaries and sharp edges; those that are not installed are
named and left out. Everybody's meshes are written as OBJ and measured on the file by the same programs, `--tool` and
one for strips, which are not ours. Each runs in a process of its own; seconds are CPU time of the call alone, without
start-up. The medians over closed models come last.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import cad_parts
import mechanical
import numpy as np
from common import models, shapes, stored_meshes
from scipy.spatial import cKDTree

from coneflat import check_mesh, quads, read_mesh
from coneflat.errors import ConeflatError
from coneflat.mesh.connectivity import TriangleMesh
from coneflat.quadmesh.mirrored import doubled, half_of

TOOL = stored_meshes.SHARED.parent / "tools" / "quads_aligned.py"
#: Measures strips and patches of quads in an OBJ file.
LOOP_TOOL = TOOL.with_name("quad_loops.py")
#: Models above this number of triangles are measured decimated, too.
DECIMATED = 20_000
#: Dihedral angle of sharp edges, radians.
SHARP_ANGLE = np.deg2rad(40)
#: Columns: the name, the key in the output of the tool, and the format.
COLUMNS = (
    ("irregular", "irregular", "{:.0f}"),
    ("off 90, mean", "off_mean", "{:.2f}"),
    ("95%", "off_p95", "{:.1f}"),
    ("worst", "off_max", "{:.0f}"),
    ("area 95/5", "area_95_5", "{:.2f}"),
    ("creases within 10 degrees", "crease_angle_lt10", "{:.0%}"),
    ("creases within 0.15 edges", "crease_on_edge", "{:.0%}"),
    ("off curvature", "curv_off", "{:.1f}"),
    ("Hausdorff, edges", "haus_edges", "{:.2f}"),
    ("self-intersections", "self", "{:.0f}"),
    ("inverted", "J_neg", "{:.0f}"),
    ("with a partner", "partners", "{:.0%}"),
    ("longest strip, sqrt(quads)", "strip_max", "{:.1f}"),
    ("its share", "top_share", "{:.0%}"),
    ("patches", "base", "{:.0f}"),
    ("s", "seconds", "{:.1f}"),
)

Polygons = tuple[np.ndarray, list[list[int]]]
Maker = Callable[[np.ndarray, np.ndarray, int], Polygons]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--models",
        default="",
        help="of all, those whose names, or kinds, as CAD or thin walls, are given; with commas",
    )
    parser.add_argument("--quads", default="1000,3000,10000", help="how many are asked for; with commas")
    parser.add_argument("--methods", default=",".join(METHODS), help="with commas")
    parser.add_argument(
        "--tool", type=Path, default=TOOL, help="measures quads in an OBJ file against a surface"
    )
    arguments = parser.parse_args()
    if not arguments.tool.exists():
        sys.exit(f"{arguments.tool} is not there: name a program that measures quads with --tool")
    methods = [name for name in arguments.methods.split(",") if find_spec(METHODS[name][0])]
    rows_of: dict[tuple[int, str], list[dict[str, float]]] = defaultdict(list)
    failed: dict[tuple[int, str], int] = defaultdict(int)
    for name in arguments.methods.split(","):
        if name not in methods:
            print(f"{name} is not installed.", file=sys.stderr)
    names = [name for name, _, _ in COLUMNS]
    print("| model | asked | method | quads | " + " | ".join(names) + " |")
    print("| --- " * (4 + len(names)) + "|")
    for name, mesh in chosen([word for word in arguments.models.split(",") if word]):
        for count in map(int, arguments.quads.split(",")):
            for method in methods:
                measures, error = trial(mesh, count, METHODS[method][1], arguments.tool)
                text = row(measures) if measures else f"{error} |" + " |" * len(names)
                print(f"| {name} | {count:,} | {method} | {text}", flush=True)
                if measures and not mesh.is_boundary_edge.any():
                    rows_of[count, method].append(measures)
                failed[count, method] += not measures
    print("\nMedians over closed models:\n")
    print("| asked | method | models | failed | with inverted quads | " + " | ".join(names) + " |")
    print("| --- " * (5 + len(names)) + "|")
    for (count, method), rows in sorted(rows_of.items()):
        middle = {key: median([entry[key] for entry in rows if key in entry]) for _, key, _ in COLUMNS}
        inverted = sum(entry["J_neg"] > 0 for entry in rows)
        cells = " | ".join(form.format(middle[key]) for _, key, form in COLUMNS)
        print(
            f"| {count:,} | {method} | {len(rows)} | {failed[count, method]} | {inverted} | {cells} |",
            flush=True,
        )


def median(values: list[float]) -> float:
    return float(np.median(values)) if values else float("nan")


def chosen(names: list[str]) -> Iterator[tuple[str, TriangleMesh]]:
    """Yield the models, decimated ones, and mechanical shapes; of all, those with the given names."""
    for name, mesh in models():
        if names and name not in names:
            continue
        yield name, mesh
        if len(mesh.faces) > DECIMATED and find_spec("fast_simplification"):
            import fast_simplification

            small = fast_simplification.simplify(
                mesh.vertices, mesh.faces, 1 - DECIMATED / 4 / len(mesh.faces)
            )
            try:
                yield f"{name}, decimated", check_mesh(*small).mesh
            except ConeflatError:
                continue
    for name, shape in mirrored_models().items():
        if not names or name in names:
            yield name, check_mesh(*shape).mesh
    generated = {
        **mechanical.SHAPES,
        **{f"{name}, CAD": make for name, make in cad_parts.SHAPES.items()},
        **{f"{name}, thin walls": make for name, make in mechanical.NARROW_SHAPES.items()},
    }
    for name, make in generated.items():
        if not names or name in names or name.partition(", ")[2] in names:
            yield name, check_mesh(*make()).mesh


def mirrored_models() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return models that are exactly symmetric: halves of spot, and of a bumpy ellipsoid, with their mirror images."""
    models_by_name = {}
    if "spot.obj" in stored_meshes.at_hand("spot.obj"):
        spot = read_mesh(stored_meshes.SHARED / "spot.obj")
        half = half_of(check_mesh(spot.vertices, spot.triangles).mesh)
        assert half is not None
        whole_spot = doubled(half.mesh, half.plane).mesh
        models_by_name["spot, mirrored"] = whole_spot.vertices, whole_spot.faces
    vertices, faces = shapes.sphere(4, bumps=0.0)
    x, y, z = vertices.T
    bumps = 1 + 0.1 * np.sin(5 * y + 2 * z) * np.cos(3 * x)
    models_by_name["ellipsoid, mirrored"] = bumps[:, None] * vertices * [0.8, 1.0, 1.6], faces
    return models_by_name


def share_with_partner(mesh: TriangleMesh, path: Path) -> dict[str, float]:
    """Return the share of the irregular vertices of quads whose mirror images are near irregular vertices.

    Near is a tenth of the mean edge length. The share is missing if the surface is not symmetric.

    Args:
        mesh: the surface.
        path: the quads.
    """
    half = half_of(mesh)
    if half is None:
        return {}
    quad_file = read_mesh(path)
    corners, offsets = quad_file.corners, quad_file.offsets
    after = np.arange(1, len(corners) + 1)
    after[offsets[1:] - 1] = offsets[:-1]
    pairs = np.sort(np.stack([corners, corners[after]], axis=1), axis=1)
    edges, counts = np.unique(pairs, axis=0, return_counts=True)
    valences = np.bincount(edges.ravel(), minlength=len(quad_file.vertices))
    is_inner = ~np.isin(np.arange(len(valences)), edges[counts == 1]) & (valences > 0)
    irregular = quad_file.vertices[is_inner & (valences != 4)]
    if not len(irregular):
        return {}
    reach = 0.1 * np.linalg.norm(np.diff(quad_file.vertices[edges], axis=1), axis=2).mean()
    gaps = cKDTree(irregular).query(half.plane.reflected(irregular))[0]
    return {"partners": float((gaps <= reach).mean())}


def row(measures: dict[str, float]) -> str:
    """Return the cells of a row."""
    cells = [form.format(measures[key]) if key in measures else "" for _, key, form in COLUMNS]
    return f"{measures['quads']:,.0f} | " + " | ".join(cells) + " |"


def trial(mesh: TriangleMesh, count: int, make: Maker, tool: Path) -> tuple[dict[str, float], str]:
    """Return the measures of a method on a mesh, or none and the error."""
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(1) as pool:
        surface, path = Path(folder) / "surface.obj", Path(folder) / "quads.obj"
        write_polygons(surface, mesh.vertices, mesh.faces.tolist())
        try:
            pool.submit(be_silent).result()
            pool.submit(warm_up, make).result()
            seconds = pool.submit(write, path, mesh, count, make).result()
            partners = share_with_partner(mesh, path)
            answer = {**answer_of(LOOP_TOOL, path), **answer_of(tool, surface, path)}
        except BrokenProcessPool:
            return {}, "crashed"
        except Exception as error:  # Other packages raise any type.
            return {}, f"{type(error).__name__}: {str(error)[:120]}"
    return {**numbers(answer), **partners, "quads": answer["topo"]["F"], "seconds": seconds}, ""


def answer_of(tool: Path, *paths: Path) -> dict[str, Any]:
    """Return what a tool prints on files; nothing if it is not there."""
    if not tool.exists():
        return {}
    answer: dict[str, Any] = json.loads(
        subprocess.check_output([sys.executable, tool, *paths], stderr=subprocess.DEVNULL)
    )
    return answer


def numbers(row: dict[str, Any]) -> dict[str, float]:
    """Return the measures of the tool that are numbers; self-intersecting pairs are the first of two."""
    pairs = row.get("selfint")
    plain = {key: float(value) for key, value in row.items() if isinstance(value, (int, float))}
    return {**plain, **({"self": float(pairs[0])} if isinstance(pairs, list) else {})}


def be_silent() -> None:
    """Discard what other packages print from compiled code."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


def warm_up(make: Maker) -> None:
    """Load the packages of a method."""
    vertices, faces = shapes.sphere(3)
    make(vertices, faces, 200)


def write(path: Path, mesh: TriangleMesh, count: int, make: Maker) -> float:
    """Write the result of a method on a mesh as OBJ, and return its seconds."""
    start = time.process_time()
    vertices, polygons = make(mesh.vertices, mesh.faces, count)
    seconds = time.process_time() - start
    write_polygons(path, vertices, polygons)
    return seconds


def write_polygons(path: Path, vertices: np.ndarray, polygons: list[list[int]]) -> None:
    with path.open("w") as file:
        file.writelines(f"v {x!r} {y!r} {z!r}\n" for x, y, z in vertices.tolist())
        file.writelines(f"f {' '.join(str(corner + 1) for corner in polygon)}\n" for polygon in polygons)


def by_coneflat(vertices: np.ndarray, faces: np.ndarray, count: int, **options: Any) -> Polygons:
    mesh = quads(vertices, faces, quads=count, **options)
    return mesh.vertices, mesh.quads.tolist()


def by_quadriflow(vertices: np.ndarray, faces: np.ndarray, count: int, sharp: bool = False) -> Polygons:
    """Return the quads of QuadriFlow; `sharp` preserves sharp edges and the boundary."""
    from pyQuadriFlow.pyQuadriFlow import pyquadriflow

    quad_arrays = pyquadriflow(count, 0, vertices.tolist(), faces.tolist(), sharp, sharp, False, False, False)
    return np.array(quad_arrays["vertices"]), quad_arrays["faces"]


def by_instant_meshes(vertices: np.ndarray, faces: np.ndarray, count: int, **options: Any) -> Polygons:
    """Convert the number: the package counts vertices before it splits all faces into quads, usually four."""
    import pynanoinstantmeshes

    points, polygons = pynanoinstantmeshes.remesh(
        vertices.astype(np.float32),
        faces.astype(np.uint32),
        vertex_count=count // 4,
        deterministic=True,
        **options,
    )
    return points.astype(np.float64), polygons.tolist()


METHODS: dict[str, tuple[str, Maker]] = {
    "coneflat": ("coneflat", by_coneflat),
    "coneflat; loops": ("coneflat", partial(by_coneflat, loops=True)),
    "coneflat; sharp": ("coneflat", partial(by_coneflat, sharp_angle=SHARP_ANGLE)),
    "coneflat; fewest cones": ("coneflat", partial(by_coneflat, cones="sparse", distortion=0.2)),
    "QuadriFlow": ("pyQuadriFlow", by_quadriflow),
    "QuadriFlow; sharp": ("pyQuadriFlow", partial(by_quadriflow, sharp=True)),
    "Instant Meshes": ("pynanoinstantmeshes", by_instant_meshes),
    "Instant Meshes; sharp": (
        "pynanoinstantmeshes",
        partial(by_instant_meshes, align_to_boundaries=True, creaseAngle=30.0),
    ),
}

if __name__ == "__main__":
    main()
