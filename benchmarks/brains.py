"""Flat maps of the cortex against FreeSurfer's own: `python benchmarks/brains.py` prints a Markdown table.

The surfaces are those of fsaverage5 in the package nilearn, with FreeSurfer's flat map of both hemispheres, which has
five cuts by an expert. Ours cut off the medial wall, and find relief cuts automatically. The measures are those of
the files written. `--fine` subdivides the left pial surface twice, to 163,842 vertices. `--figures DIR` draws the maps
with sulcal depth.

`--autoflatten PYTHON` also runs the package autoflatten, in the environment of that Python, on the patch that we write,
with the same cuts. Its seconds include what JAX compiles.
"""

from __future__ import annotations

import argparse
import gzip
import subprocess
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from common import shapes

from coneflat import make_figure, read_mesh, save_figure
from coneflat.apps.brains import FlatMeasures, flatten_cortex, measure_flat, read_flat
from coneflat.apps.view import own_quantity

SIDES = {"lh": "left", "rh": "right"}
AUTOFLATTEN = """
import sys, time
start = time.perf_counter()
from autoflatten.backends.pyflatten import PyflattenBackend
PyflattenBackend().flatten(*sys.argv[1:], verbose=False)
print("seconds", time.perf_counter() - start)
"""
COLUMNS = "surface|map|triangles|QC|area std|metric %|areal|inverted|charts|s"


def data_folder() -> Path:
    """Return the folder of fsaverage5 in nilearn."""
    package = find_spec("nilearn")
    if package is None or package.origin is None:
        raise SystemExit("the surfaces are those of nilearn: pip install nilearn")
    return Path(package.origin).parent / "datasets" / "data" / "fsaverage5"


def prepare(folder: Path) -> None:
    """Write surfaces, flat maps, sulcal depth and medial walls of both hemispheres as files."""
    import nibabel

    for short, side in SIDES.items():
        for name, stem in {"pial": "pial", "white": "white", "flat": "flat", "sulc": "sulc"}.items():
            content = gzip.decompress((data_folder() / f"{stem}_{side}.gii.gz").read_bytes())
            (folder / f"{short}.{name}.gii").write_bytes(content)
        surface, flat = (read_mesh(folder / f"{short}.{name}.gii") for name in ("pial", "flat"))
        nibabel.freesurfer.write_morph_data(
            folder / f"{short}.wall.curv", medial_wall(surface.triangles, flat.triangles).astype(np.float32)
        )


def medial_wall(faces: np.ndarray, flat_faces: np.ndarray) -> np.ndarray:
    """Return (n,) the vertices of the medial wall: those missing in a flat map, without its cuts, which are lines."""
    missing = np.ones(faces.max() + 1, dtype=bool)
    missing[flat_faces] = False
    inner = missing.copy()
    inner[faces[~missing[faces].all(axis=1)]] = False
    grown = inner.copy()
    grown[faces[inner[faces].any(axis=1)]] = True
    return grown & missing


def refine(folder: Path, rounds: int = 2) -> None:
    """Write the left pial surface subdivided and smoothed, and its medial wall."""
    import nibabel

    mesh = read_mesh(folder / "lh.pial.gii")
    vertices, faces = mesh.vertices, mesh.triangles
    wall = nibabel.freesurfer.read_morph_data(folder / "lh.wall.curv")
    for _ in range(rounds):
        ends = np.unique(np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
        between = np.min(wall[ends], axis=1)
        middles = vertices[ends].mean(axis=1)
        count = len(vertices)
        vertices, faces = shapes.subdivide(vertices, faces)
        # Each new vertex is the middle of an edge, in the order of the subdivision.
        order = np.lexsort(vertices[count:].T)
        of_wall = np.empty(len(ends))
        of_wall[order] = between[np.lexsort(middles.T)]
        wall = np.append(wall, of_wall)
        vertices = smoothed(vertices, faces)
    nibabel.freesurfer.write_geometry(folder / "lh.fine.pial", vertices, faces)
    nibabel.freesurfer.write_morph_data(folder / "lh.fine.curv", wall.astype(np.float32))


def smoothed(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return vertices moved halfway to the mean of their neighbours."""
    tails, heads = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    sums = np.stack([np.bincount(tails, vertices[heads, k], len(vertices)) for k in range(3)], axis=1)
    return (vertices + sums / np.bincount(tails, minlength=len(vertices))[:, None]) / 2


def run_autoflatten(folder: Path, surface: str, faces: np.ndarray, python: str) -> None:
    """Print the line of autoflatten for the patch of some triangles of a surface."""
    import nibabel

    mesh = read_mesh(folder / surface)
    base, patch, output = (folder / f"auto.{name}" for name in ("base", "patch.3d", "flat.patch.3d"))
    nibabel.freesurfer.write_geometry(base, mesh.vertices, mesh.triangles)
    write_folded_patch(patch, mesh.vertices, faces)
    command = [python, "-c", AUTOFLATTEN, *map(str, (patch, base, output))]
    printed = subprocess.run(
        command, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ).stdout
    seconds = float(printed.rsplit("seconds", 1)[1])
    print(line(surface, "autoflatten .3d", measure_flat(read_flat(output, base)), seconds), flush=True)


def write_folded_patch(path: Path, vertices: np.ndarray, faces: np.ndarray) -> None:
    """Write the vertices of triangles as a FreeSurfer patch that is not flat yet; those on its border are negative."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    pairs, count = np.unique(edges, axis=0, return_counts=True)
    inside = np.unique(faces)
    rows = np.empty(len(inside), np.dtype([("vertex", ">i4"), ("point", ">f4", 3)]))
    rows["vertex"] = np.where(np.isin(inside, pairs[count == 1]), -1 - inside, inside + 1)
    rows["point"] = vertices[inside]
    path.write_bytes(np.array([-1, len(rows)], ">i4").tobytes() + rows.tobytes())


def line(surface: str, name: str, flat: FlatMeasures, seconds: float) -> str:
    d = flat.uv.distortion
    cells = [
        surface, name, f"{len(flat.uv.mesh.faces):,}", f"{d.qc_mean:.3f}", f"{d.area_std:.3f}", f"{flat.metric:.2f}",
        f"{flat.areal:.3f}", f"{flat.inverted}", f"{d.charts}", f"{seconds:.1f}" if seconds else "",
    ]  # fmt: skip
    return f"| {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--distortion", type=float, default=0.2)
    parser.add_argument("--fine", action="store_true")
    parser.add_argument("--figures", type=Path)
    parser.add_argument("--autoflatten", metavar="PYTHON")
    arguments = parser.parse_args()
    print(f"| {' | '.join(COLUMNS.split('|'))} |\n{'| --- ' * (COLUMNS.count('|') + 1)}|")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        prepare(folder)
        surfaces = [
            (side, f"{side}.{kind}.gii", f"{side}.wall.curv") for side in SIDES for kind in ("pial", "white")
        ]
        if arguments.fine:
            refine(folder)
            surfaces.append(("", "lh.fine.pial", "lh.fine.curv"))
        flatten_cortex(folder / surfaces[0][1], remove=[str(folder / surfaces[0][2])])  # loads the kernels
        for side, surface, wall in surfaces:
            start = time.perf_counter()
            flat = flatten_cortex(
                folder / surface, remove=[str(folder / wall)], distortion=arguments.distortion
            )
            seconds = time.perf_counter() - start
            for ending in (".gii", ".3d"):
                path = flat.save(folder / f"flat{ending}")
                print(
                    line(surface, f"coneflat {ending}", measure_flat(flat.uv_mesh(path)), seconds),
                    flush=True,
                )
            if side:
                theirs = measure_flat(read_flat(folder / f"{side}.flat.gii", folder / surface))
                print(line(surface, "FreeSurfer", theirs, 0.0), flush=True)
            if side and arguments.autoflatten:
                faces = flat.uv_mesh(Path("flat.3d")).faces
                run_autoflatten(folder, surface, faces, arguments.autoflatten)
            if side and arguments.figures is not None:
                arguments.figures.mkdir(parents=True, exist_ok=True)
                depth = own_quantity(flat.result, str(folder / f"{side}.sulc.gii"))
                eyes = ("left", "right")
                figure = make_figure(flat.result, "color", own=depth, up="z", eyes=eyes, dpi=110.0)
                save_figure(figure, arguments.figures / f"{surface}.png")


if __name__ == "__main__":
    main()
