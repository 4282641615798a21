"""How much of a texture UVs cover: `python benchmarks/packing.py` prints a Markdown table.

The models are those of `../shared/meshes` with at most 60,000 triangles, and the same with 1,000 and 5,000 triangles,
for which the package `fast-simplification` is needed. Each is unwrapped by `coneflat.unwrap`, once with the charts as
the cut leaves them and once cut further for packing, and by xatlas and uvunwrap, where they are installed.

All leave two texels between charts in a texture of 1024. Efficiency is the area of the triangles over that of the
square, whose side is the longer side of the box around the UVs of the other packages. The gap is the least distance
between charts in texels, measured between points a quarter of a texel apart along their borders. Seams are divided by
the square root of the area.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from common import MODELS
from scipy.spatial import cKDTree

import coneflat
from coneflat import Flattening
from coneflat.apps.peers.packages import installed_peers, run_peer
from coneflat.apps.unwrap import unwrap as unwrapping
from coneflat.errors import ConeflatError
from coneflat.mesh.connectivity import label_components

RESOLUTION, PADDING, LARGEST, STEP = 1024, 2, 60_000, 0.25
CACHE = Path(tempfile.gettempdir()) / "coneflat-packing"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--models", default="", help="of all, those whose names are given; with commas")
    parser.add_argument("--sizes", default="1000,5000,0", help="numbers of triangles, 0: all; with commas")
    arguments = parser.parse_args()
    names = [word for word in arguments.models.split(",") if word]
    peers = [name for name in ("xatlas", "uvunwrap") if name in installed_peers()]
    methods = ["charts of the cut", "coneflat", *peers]
    print("| model | triangles |" + "".join(f" {name} | charts | seams | gap | s |" for name in methods))
    print("| --- " * (2 + 5 * len(methods)) + "|")
    coneflat.unwrap(coneflat.sample_path())
    rows = []
    for name, vertices, faces in models(names, [int(word) for word in arguments.sizes.split(",")]):
        try:
            values = [
                *ours(vertices, faces),
                *(measured(*run_peer(peer, base(vertices, faces))) for peer in peers),
            ]
        except ConeflatError as error:
            print(f"{name}: {error}")
            continue
        rows.append(values)
        print(f"| {name} | {len(faces):,} |" + cells(values), flush=True)
    found = np.array(rows)
    print("| median | |" + cells(np.median(found, axis=0)))
    for i, name in enumerate(peers):
        better = int((found[:, 1, 0] >= found[:, 2 + i, 0]).sum())
        print(f"\nEfficiency at least that of {name}: {better} of {len(rows)}.")
    has_seams = found[:, 0, 2] > 0
    longer = found[has_seams, 1, 2] / found[has_seams, 0, 2] - 1
    print(f"Seams are longer by {np.median(longer):.1%} in the median, {longer.max():.1%} at most.")


def cells(values: list | np.ndarray) -> str:
    return "".join(f" {e:.3f} | {c:.0f} | {s:.2f} | {g:.2f} | {t:.2f} |" for e, c, s, g, t in values)


def models(names: list[str], sizes: list[int]) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield names, vertices and faces."""
    CACHE.mkdir(exist_ok=True)
    for path in sorted(MODELS.glob("*.*")):
        if path.suffix == ".md" or (names and path.stem not in names):
            continue
        source = coneflat.read_mesh(path)
        vertices, faces = np.asarray(source.vertices, dtype=np.float64), np.asarray(source.triangles)
        for size in sizes:
            if not size and len(faces) <= LARGEST:
                yield path.stem, vertices, faces
            elif size and len(faces) > 1.2 * size and find_spec("fast_simplification"):
                yield f"{path.stem}, {size:,}", *decimated(path.stem, vertices, faces, size)


def decimated(name: str, vertices: np.ndarray, faces: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a mesh with fewer triangles, from the cache if it is there."""
    file = CACHE / f"{name}-{size}.npz"
    if not file.exists():
        import fast_simplification

        points, corners = fast_simplification.simplify(vertices, faces.astype(np.int32), target_count=size)
        np.savez(file, vertices=points, faces=corners)
    with np.load(file) as arrays:
        return arrays["vertices"].astype(np.float64), arrays["faces"].astype(np.int64)


def ours(vertices: np.ndarray, faces: np.ndarray) -> Iterator[tuple[float, ...]]:
    """Yield the measures of the charts as the cut leaves them, and of those cut further."""
    cut_for_packing = unwrapping.cut_for_packing
    for cut in (lambda layouts, *_: layouts, cut_for_packing):
        unwrapping.cut_for_packing = cut
        start = time.perf_counter()
        result = base(vertices, faces)
        yield measured(result, time.perf_counter() - start)
    unwrapping.cut_for_packing = cut_for_packing


def base(vertices: np.ndarray, faces: np.ndarray) -> Flattening:
    return coneflat.unwrap(vertices, faces, repair=True, resolution=RESOLUTION, padding=PADDING)


def measured(result: Flattening, seconds: float) -> tuple[float, ...]:
    """Return efficiency, number of charts, length of seams, least distance of charts in texels, and seconds."""
    found = result.distortion
    return result.packing_efficiency, found.charts, found.seam_length, gap(result), seconds


def gap(result: Flattening) -> float:
    """Return the least distance between charts in texels; infinite for one chart."""
    points, corners = result.uv * RESOLUTION, result.uv_faces
    _, chart = label_components(len(points), corners[:, :2].ravel(), corners[:, 1:].ravel())
    sides = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    _, first, count = np.unique(np.sort(sides, axis=1), axis=0, return_index=True, return_counts=True)
    one, other = sides[first[count == 1]].T
    pieces = np.ceil(np.linalg.norm(points[one] - points[other], axis=1) / STEP).astype(int) + 1
    start = np.repeat(np.cumsum(pieces) - pieces, pieces)
    along = ((np.arange(pieces.sum()) - start) / np.repeat(pieces, pieces))[:, None]
    one, other = np.repeat(one, pieces), np.repeat(other, pieces)
    samples, of = (1 - along) * points[one] + along * points[other], chart[one]
    least = np.inf
    for each in range(int(chart.max()) + 1):
        if (of != each).any() and (of == each).any():
            least = min(least, float(cKDTree(samples[of != each]).query(samples[of == each])[0].min()))
    return least


if __name__ == "__main__":
    main()
