"""Packing of charts compared with other packages: `python benchmarks/packing.py` prints a Markdown table.

The charts are those of `flatten(charts="atlas")` of the models of `../shared/meshes`, cut along the borders between
random faces' neighbourhoods into so many pieces, and scaled to the areas that they have in space. All packers leave two
texels between them in a texture of 1024, and half a texel at its border, as xatlas does. xatlas is given these charts,
too; it turns charts by swapping u and v, which mirrors them, unless that is forbidden, and stretches each to whole
texels. With `--up` charts stand upright: all packers are given them so, and none may turn them. Efficiency is the area
of the charts over that of the square. A chart alone that may not be turned, or one as long as the square, bounds it:
there all packers come out alike.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from collections.abc import Callable
from importlib.util import find_spec

import numpy as np
from common import MODELS
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

import coneflat
from coneflat.atlas import orient_charts, pack_charts
from coneflat.errors import ConeflatError
from coneflat.geometry.planar import signed_double_areas
from coneflat.mesh.connectivity import label_components

RESOLUTION, PADDING, MARGIN = 1024, 2, 0.5
Packer = Callable[[np.ndarray, np.ndarray], float]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--models", default="", help="of all, those whose names are given; with commas")
    parser.add_argument("--pieces", default="1,2,3,5,10", help="numbers of charts, at least; with commas")
    parser.add_argument("--up", help="direction that is up in all models, as 0,1,0")
    arguments = parser.parse_args()
    up = [float(word) for word in arguments.up.split(",")] if arguments.up else None
    packers = all_packers(is_upright=up is not None)
    pieces = [int(word) for word in arguments.pieces.split(",")]
    print("| model | charts | " + " | ".join(f"{name} | s" for name in packers) + " |")
    print("| --- " * (2 + 2 * len(packers)) + "|")
    means: dict[int, list[list[float]]] = defaultdict(list)
    for path in sorted(MODELS.glob("*.*")):
        if path.suffix == ".md" or (arguments.models and path.stem not in arguments.models.split(",")):
            continue
        try:
            result = coneflat.flatten(path, charts="atlas")
        except ConeflatError:
            continue
        for number in pieces:
            corner_uv, chart = cut(result, number)
            if up is not None:
                corner_uv = orient_charts(corner_uv, chart, corners=result.vertices[result.faces], up=up)
            values = []
            for pack in packers.values():
                start = time.perf_counter()
                values += [pack(corner_uv, chart), time.perf_counter() - start]
            means[number].append(values)
            print(row(path.stem, str(chart.max() + 1), values), flush=True)
    for number, found in means.items():
        print(row(f"mean of {len(found)}", f"{number}+", np.mean(found, axis=0)))


def all_packers(is_upright: bool) -> dict[str, Packer]:
    """Return the packers; only those that do not rotate charts if these must remain upright."""
    if is_upright:
        packers = {"coneflat, not turned": ours("none")}
        others = {"xatlas, not turned": xatlas(rotate_charts=False, to_axis=False)}
    else:
        packers = {
            "coneflat": ours("any"),
            "coneflat, quarter turns": ours("quarter"),
            "coneflat, not turned": ours("none"),
        }
        others = {
            "xatlas": xatlas(rotate_charts=True, to_axis=True),
            "xatlas, none mirrored": xatlas(rotate_charts=False, to_axis=True),
        }
    return packers | others if find_spec("xatlas") else packers


def row(name: str, charts: str, values: list[float] | np.ndarray) -> str:
    cells = (f"{values[i]:.3f} | {values[i + 1]:.2f}" for i in range(0, len(values), 2))
    return f"| {name} | {charts} | " + " | ".join(cells) + " |"


def cut(result: coneflat.Flattening, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Return at least a given number of charts, scaled to their areas in space, and the chart of each face."""
    points, corner_uv = result.uv_faces, result.corner_uv.copy()
    _, chart = label_components(len(result.uv), points[:, :2].ravel(), points[:, 1:].ravel())
    chart = chart[points[:, 0]]
    if number > chart.max() + 1:
        chart = neighbourhoods(corner_uv, points, chart, number)
    corners = result.vertices[result.faces]
    space = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    ratio = np.bincount(chart, weights=space) / np.bincount(
        chart, weights=np.abs(signed_double_areas(corner_uv)) / 2
    )
    return corner_uv * np.sqrt(ratio / space.sum())[chart][:, None, None], chart


def neighbourhoods(corner_uv: np.ndarray, points: np.ndarray, chart: np.ndarray, number: int) -> np.ndarray:
    """Return for each face the nearest of random faces, by paths across edges within its chart."""
    sides = np.sort(np.concatenate([points[:, [1, 2]], points[:, [2, 0]], points[:, [0, 1]]]), axis=1)
    _, edge = np.unique(sides, axis=0, return_inverse=True)
    order = np.argsort(edge.ravel(), kind="stable")
    twice = np.flatnonzero(edge.ravel()[order[1:]] == edge.ravel()[order[:-1]])
    one, two = order[twice] % len(points), order[twice + 1] % len(points)
    middle = corner_uv.mean(axis=1)
    steps = np.linalg.norm(middle[one] - middle[two], axis=1) + 1e-12
    graph = coo_matrix((steps, (one, two)), shape=(len(points), len(points))).tocsr()
    weights = np.abs(signed_double_areas(corner_uv)) / 2
    seeds = np.random.default_rng(0).choice(len(points), number, replace=False, p=weights / weights.sum())
    first = np.unique(chart, return_index=True)[1]
    seeds = np.unique(np.concatenate([seeds, first[~np.isin(chart[first], chart[seeds])]]))
    _, _, nearest = dijkstra(graph, directed=False, indices=seeds, min_only=True, return_predecessors=True)
    return np.unique(nearest, return_inverse=True)[1]


def ours(rotate: str) -> Packer:
    def pack(corner_uv: np.ndarray, chart: np.ndarray) -> float:
        return pack_charts(
            corner_uv, chart, resolution=RESOLUTION, padding=PADDING, margin=MARGIN, rotate=rotate
        ).efficiency

    return pack


def xatlas(rotate_charts: bool, to_axis: bool) -> Packer:
    """Every chart as a mesh with given UVs; twice, because the texture becomes larger than requested.

    Args:
        rotate_charts: whether u and v may be swapped.
        to_axis: whether charts are first turned to lie straight.
    """

    def pack(corner_uv: np.ndarray, chart: np.ndarray) -> float:
        import xatlas

        options = xatlas.PackOptions()
        options.padding, options.resolution = PADDING, RESOLUTION
        options.rotate_charts, options.rotate_charts_to_axis = rotate_charts, to_axis
        for _ in range(2):
            atlas = xatlas.Atlas()
            for c in range(chart.max() + 1):
                points, corners = np.unique(corner_uv[chart == c].reshape(-1, 2), axis=0, return_inverse=True)
                atlas.add_uv_mesh(points.astype(np.float32), corners.reshape(-1, 3).astype(np.uint32))
            atlas.generate(pack_options=options)
            side = max(atlas.width, atlas.height)
            options.resolution, options.texels_per_unit = 0, atlas.texels_per_unit * RESOLUTION / side
        return float((atlas.texels_per_unit / side) ** 2 * np.abs(signed_double_areas(corner_uv)).sum() / 2)

    return pack


if __name__ == "__main__":
    main()
