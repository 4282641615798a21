"""Comparison of two versions of the package by hashes and measures of results for many meshes and options.

    python benchmarks/same.py keep before.json
    python benchmarks/same.py keep after.json
    python benchmarks/same.py compare before.json after.json

Meshes are the models of `../shared/meshes` and 50 deformed ones of them: noise, stretch, holes, slivers, other scales,
other numberings. Each is flattened as one chart, as an atlas and in two of the other ways in turn; what comes out is
hashed bit for bit (points, faces, cones, seams, scales, the report but for times), and so are the files written.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import tempfile
import time
from multiprocessing import Pool
from pathlib import Path

import numpy as np

MODELS = Path(__file__).resolve().parents[2] / "shared" / "meshes"
BASES = (
    "3holes.off", "knight.off", "elephant.obj", "fandisk.obj", "spot.obj", "plane-holes.obj", "rocker-arm.obj",
    "hand.obj", "camelhead.off", "face.obj",
)  # fmt: skip
DEFORMATIONS = ("noise", "stretch", "holes", "slivers", "shuffled")
RIGHT = np.pi / 2
WAYS: dict[str, dict[str, object]] = {
    "one": {"charts": "one"},
    "atlas": {"charts": "atlas"},
    "paper": {"PAPER": True, "charts": "one"},
    "quantised": {"quantise": RIGHT, "charts": "atlas"},
    "handles": {"quantise": RIGHT, "correct_handles": True, "charts": "one"},
    "disk": {"boundary": "disk", "charts": "one"},
    "straight": {"boundary": "straight", "charts": "one"},
    "lengths": {"boundary": "lengths", "charts": "atlas"},
    "fine": {"distortion": 0.1, "charts": "atlas", "up": (0.0, 1.0, 0.0)},
    "counted": {"cone_count": 12, "charts": "one"},
    "none": {"cones": "none", "charts": "atlas"},
    "greedy": {"cones": "greedy", "charts": "one"},
    "sharp": {"sharp_angle": 0.7, "charts": "atlas", "padding": 4.0},
    "hidden": {"hide_seams": 1.0, "charts": "atlas"},
    "positive": {"positive_only": True, "distortion": 0.5, "charts": "one"},
    "tiles": {"tiles": 2, "sharp_angle": 0.9, "charts": "atlas"},
    "linear": {"method": "linear", "charts": "one"},
}


def deformed(name: str, how: str) -> tuple[np.ndarray, np.ndarray]:
    """Return a model with a deformation that depends only on the two names."""
    import coneflat

    mesh = coneflat.read_mesh(MODELS / name)
    points = np.asarray(mesh.vertices, dtype=float).copy()
    faces = mesh.triangles.copy()
    random = np.random.default_rng(sum(map(ord, name + how)))
    sides = np.linalg.norm(points[faces[:, 1]] - points[faces[:, 0]], axis=1)
    if how == "noise":
        points += 0.25 * sides.mean() * random.normal(size=points.shape)
    elif how == "stretch":
        points *= [4.0, 1.0, 0.7]
    elif how == "holes":
        middles = points[faces].mean(axis=1)
        for centre in middles[random.choice(len(faces), 4)]:
            away = np.linalg.norm(middles - centre, axis=1)
            faces = faces[away > 0.04 * np.ptp(points)]
            middles = points[faces].mean(axis=1)
        points *= 1e6
    elif how == "slivers":
        moved = random.choice(len(faces), len(faces) // 40, replace=False)
        points[faces[moved, 0]] += 0.97 * (points[faces[moved, 1]] - points[faces[moved, 0]])
        points *= 1e-6
    elif how == "shuffled":
        order = random.permutation(len(points))
        place = np.empty_like(order)
        place[order] = np.arange(len(order))
        points, faces = points[order], place[faces][random.permutation(len(faces))]
    return points, faces


def cases() -> list[tuple[str, str, str]]:
    """Return the model, deformation and options of each case."""
    meshes = [(path.name, "") for path in sorted(MODELS.glob("*.*")) if path.suffix != ".md"]
    meshes += [(base, how) for base in BASES for how in DEFORMATIONS]
    others = [way for way in WAYS if way not in ("one", "atlas")]
    listed = []
    for i, (name, how) in enumerate(meshes):
        ways = ["one", "atlas", others[2 * i % len(others)], others[(2 * i + 1) % len(others)]]
        listed += [(name, how, way) for way in ways]
    return listed


def digest(*arrays: object) -> str:
    """Return a hash of arrays."""
    one = hashlib.sha256()
    for array in arrays:
        values = np.ascontiguousarray(array)
        one.update(f"{values.dtype.kind}{values.shape}".encode())
        one.update(values.tobytes())
    return one.hexdigest()[:16]


def run(case: tuple[str, str, str]) -> tuple[str, dict[str, object]]:
    """Return the hashes and measures of a case."""
    import coneflat

    name, how, way = case
    key = f"{name} {how or 'as it is'} {way}"
    options = dict(WAYS[way])
    if options.pop("PAPER", False):
        options = {**coneflat.PAPER, **options}
    start = time.perf_counter()
    try:
        source = MODELS / name if not how else None
        if source is None:
            given = deformed(name, how)
            result = coneflat.flatten(*given, repair=True, **options)
        else:
            result = coneflat.flatten(source, repair=True, **options)
    except Exception as error:
        return key, {"error": f"{type(error).__name__}: {error}"}
    seconds = time.perf_counter() - start
    report = result.report()
    for gone in ("seconds", "settings", "version", "total_seconds"):
        report.pop(gone, None)
    kept: dict[str, object] = {
        "uv": digest(result.uv, result.uv_faces),
        "mesh": digest(result.vertices, result.faces),
        "cones": digest(result.cones, result.curvatures),
        "scale": digest(result.log_scale, result.curvature_residual),
        "seams": digest(result.seams),
        "report": report,
        "count": len(result.cones),
        "seconds": round(seconds, 3),
    }
    if way in ("atlas", "sharp", "tiles"):
        with tempfile.TemporaryDirectory() as folder:
            for ending in (".obj", ".ply", ".glb"):
                file = result.save(Path(folder) / f"flat{ending}")
                kept[ending] = hashlib.sha256(file.read_bytes()).hexdigest()[:16]
    return key, kept


def compare(before: dict[str, dict], after: dict[str, dict]) -> int:
    """Print the differences, and return the number of cases that differ."""
    differing = 0
    for key in before:
        one, two = dict(before[key]), dict(after.get(key, {}))
        one.pop("seconds", None), two.pop("seconds", None)
        one, two = json.loads(json.dumps(one)), json.loads(json.dumps(two))
        if one == two:
            continue
        differing += 1
        names = [name for name in sorted({*one, *two}) if one.get(name) != two.get(name)]
        print(f"{key}: {', '.join(names)}")
        if "error" in names:
            print(f"    {one.get('error')}\n    {two.get('error')}")
        first, second = one.get("report") or {}, two.get("report") or {}
        if isinstance(first, dict) and isinstance(second, dict):
            for name in sorted({*first, *second}):
                if first.get(name) != second.get(name):
                    print(f"    {name}: {str(first.get(name))[:150]} -> {str(second.get(name))[:150]}")
    totals = [sum(one.get("count", 0) for one in each.values()) for each in (before, after)]
    times = [sum(one.get("seconds", 0) for one in each.values()) for each in (before, after)]
    print(
        f"{differing} of {len(before)} cases differ; cones {totals[0]:,} -> {totals[1]:,}; "
        f"seconds {times[0]:.0f} -> {times[1]:.0f}"
    )
    return differing


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    keep = commands.add_parser("keep")
    keep.add_argument("file", type=Path)
    keep.add_argument("--jobs", type=int, default=2)
    keep.add_argument("--every", type=int, default=1, help="of so many cases, one")
    comparing = commands.add_parser("compare")
    comparing.add_argument("before", type=Path)
    comparing.add_argument("after", type=Path)
    arguments = parser.parse_args()
    if arguments.command == "compare":
        before, after = (json.loads(each.read_text()) for each in (arguments.before, arguments.after))
        sys.exit(bool(compare({key: before[key] for key in before if key in after}, after)))
    with Pool(arguments.jobs) as pool:
        found = dict(pool.imap_unordered(run, cases()[:: arguments.every]))
    arguments.file.write_text(json.dumps(found, indent=1, sort_keys=True, default=str))
    print(f"{len(found)} cases, {sum('error' in one for one in found.values())} refused")


if __name__ == "__main__":
    main()
