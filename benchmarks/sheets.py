"""Large open surfaces, as processes: `python benchmarks/sheets.py` prints a Markdown table.

The surface is a rolled sheet with wrinkles, as of a scanned scroll, written as binary PLY or as OBJ. Each row is one
process `coneflat flatten`: seconds, peak memory, and what the report says of the file written. With `--holes`, seams
connect the holes to the border, because the flat metric does not close around a hole.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

OPTIONS = ["--cones", "none"]
COLUMNS = "triangles|file|options|s|peak GB|QC|area std|flips|overlap|charts|MB written"


def scroll(count: int, holes: int = 0, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return about `count` triangles of a sheet of two by one that is rolled up, with wrinkles, and perhaps holes."""
    rows = int(np.sqrt(count / 4))
    u, v = np.meshgrid(np.linspace(0, 2, 2 * rows), np.linspace(0, 1, rows), indexing="ij")
    rng = np.random.default_rng(seed)
    bumps = sum(
        rng.normal() * 0.004 * np.sin(a * u + b * v + c)
        for a, b, c in zip(rng.uniform(5, 60, 12), rng.uniform(5, 60, 12), rng.uniform(0, 6, 12), strict=True)
    )
    # An Archimedean spiral by its length, approximately.
    radius = np.sqrt(0.01 + u * 0.03)
    angle = 2 * (radius - 0.1) / 0.03
    vertices = np.stack(
        [(radius + bumps) * np.cos(angle), (radius + bumps) * np.sin(angle), v], axis=-1
    ).reshape(-1, 3)
    i = (np.arange(2 * rows - 1)[:, None] * rows + np.arange(rows - 1)).reshape(-1)
    faces = np.concatenate([np.stack([i, i + rows, i + rows + 1], 1), np.stack([i, i + rows + 1, i + 1], 1)])
    centres = np.stack([u.reshape(-1)[faces].mean(axis=1), v.reshape(-1)[faces].mean(axis=1)], axis=1)
    kept = np.ones(len(faces), dtype=bool)
    for middle, reach in zip(
        rng.uniform([0, 0], [2, 1], (holes, 2)), rng.uniform(0.002, 0.02, holes), strict=True
    ):
        kept &= ((centres - middle) ** 2).sum(axis=1) > reach**2
    return vertices, faces[kept]


def write(path: Path, vertices: np.ndarray, faces: np.ndarray) -> None:
    """Write a mesh as binary PLY, or as OBJ."""
    if path.suffix == ".obj":
        with path.open("w") as stream:
            np.savetxt(stream, vertices, "v %.7g %.7g %.7g")
            np.savetxt(stream, faces + 1, "f %d %d %d")
        return
    rows = np.empty(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    head += [f"property float {axis}" for axis in "xyz"]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    path.write_bytes("\n".join(head).encode() + vertices.astype("<f4").tobytes() + rows.tobytes())


def run(mesh: Path, output: Path, options: list[str]) -> tuple[float, float, dict]:
    """Return seconds, peak memory in GB and the report of one process."""
    report = output.with_suffix(".json")
    start = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "coneflat", "flatten", mesh, "-o", output, "--report", report, "-q", *options]
    )
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - start
    if status:
        raise SystemExit(f"coneflat ended with {status}")
    return seconds, usage.ru_maxrss / 2**20, json.loads(report.read_text())


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--sizes", default="1,4", help="millions of triangles (%(default)s)")
    parser.add_argument("--formats", default="ply,obj")
    parser.add_argument("--holes", type=int, default=0)
    parser.add_argument("options", nargs="*", default=OPTIONS, help="after --, options of flatten")
    arguments = parser.parse_args()
    print(f"| {' | '.join(COLUMNS.split('|'))} |\n{'| --- ' * (COLUMNS.count('|') + 1)}|")
    with tempfile.TemporaryDirectory() as name:
        for size in arguments.sizes.split(","):
            vertices, faces = scroll(int(float(size) * 1e6), arguments.holes)
            for form in arguments.formats.split(","):
                mesh, output = Path(name) / f"sheet.{form}", Path(name) / f"flat.{form}"
                write(mesh, vertices, faces)
                seconds, memory, report = run(mesh, output, arguments.options)
                cells = [
                    f"{len(faces):,}", form, " ".join(arguments.options), f"{seconds:.0f}", f"{memory:.1f}",
                    f"{report['qc_mean']:.4f}", f"{report['area_std']:.3f}", f"{report['flipped']}",
                    f"{report['overlap']:.2g}", f"{report['charts']}", f"{output.stat().st_size / 1e6:.0f}",
                ]  # fmt: skip
                print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
