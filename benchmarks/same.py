"""Comparison of two versions of the package by measures of results for many meshes and options.

    python benchmarks/same.py keep before.json
    python benchmarks/same.py keep after.json
    python benchmarks/same.py compare before.json after.json

Meshes are the models of `../shared/meshes` and 50 deformed ones of them: noise, stretch, holes, slivers, other scales,
other numberings. Each is flattened as one chart, as an atlas and in two of the other ways in turn, unwrapped, and every
third one made into quads. Measures are compared with a tolerance for rounding, those of the published method as hashes
of the points, bit for bit. The exit code of `compare` is 1 if any measure differs.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import time
import warnings
from collections.abc import Iterator
from multiprocessing import Pool
from pathlib import Path

import numpy as np

import coneflat

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
    "paper": {**coneflat.PAPER, "charts": "one"},
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
#: Number of quads that are asked for, and each how many meshes are made into quads.
QUADS, QUADS_EVERY = 1500, 3
#: Relative difference of measures that rounding explains.
ROUNDING = 1e-6


def deformed(name: str, how: str) -> tuple[np.ndarray, np.ndarray]:
    """Return a model with a deformation that depends only on the two names."""
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
    rare_ways = [way for way in WAYS if way not in ("one", "atlas")]
    listed = []
    for i, (name, how) in enumerate(meshes):
        ways = ["one", "atlas", rare_ways[2 * i % len(rare_ways)], rare_ways[(2 * i + 1) % len(rare_ways)]]
        ways += ["unwrap", *(["quads"] if i % QUADS_EVERY == 0 else [])]
        listed += [(name, how, way) for way in ways]
    return listed


def measures_of(case: tuple[str, str, str]) -> dict[str, object]:
    """Return the measures of a case.

    Raises:
        ConeflatError: the case is refused.
    """
    name, how, way = case
    vertices, faces = deformed(name, how) if how else (MODELS / name, None)
    if way == "quads":
        quad_mesh = coneflat.quads(vertices, faces, quads=QUADS, repair=True)
        measured = coneflat.measure_quads(quad_mesh)
        of_quads = (
            "quads",
            "irregular",
            "euler_characteristic",
            "angle_mean",
            "edge_cv",
            "jacobian_min",
            "left_out",
        )
        return {name: getattr(measured, name) for name in of_quads} | {"notes": len(quad_mesh.notes)}
    if way == "unwrap":
        result = coneflat.unwrap(vertices, faces, repair=True)
    else:
        result = coneflat.flatten(vertices, faces, repair=True, **WAYS[way])
    names = (
        "charts", "seam_length", "qc_mean", "qc_max", "area_std", "energy", "flipped", "degenerate",
        "overlapping_pairs", "seam_mismatch_max", "angle_sum_error",
    )  # fmt: skip
    measures: dict[str, object] = {name: getattr(result.distortion, name) for name in names}
    measures |= {"cones": len(result.cones), "packing": result.packing_efficiency, "notes": len(result.notes)}
    if way == "paper":
        points = np.ascontiguousarray(result.uv[result.uv_faces])
        measures["points"] = hashlib.sha256(points.tobytes()).hexdigest()[:16]
    return measures


def run(case: tuple[str, str, str]) -> tuple[str, dict[str, object]]:
    """Return the name of a case, and its measures with the processor seconds, or why it is refused."""
    name, how, way = case
    key, start = f"{name} {how or 'as it is'} {way}", time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            measures = measures_of(case)
        except Exception as error:
            return key, {"error": f"{type(error).__name__}: {error}"}
    return key, measures | {"seconds": round(time.process_time() - start, 3)}


def differences(before: dict[str, object], after: dict[str, object]) -> Iterator[str]:
    """Yield the measures that differ by more than rounding, with both values."""
    for name in sorted({*before, *after} - {"seconds"}):
        values = before.get(name), after.get(name)
        if all(isinstance(value, float) for value in values):
            first, second = (float(str(value)) for value in values)
            # Errors of rounding's size are no measures.
            if abs(first - second) <= ROUNDING * max(1e-3, abs(first), abs(second)) or first == second:
                continue
        elif values[0] == values[1]:
            continue
        yield f"{name} {str(values[0])[:120]} -> {str(values[1])[:120]}"


def compare(before: dict[str, dict[str, object]], after: dict[str, dict[str, object]]) -> int:
    """Print the differences, sums and times by way, and return the number of cases that differ."""
    differing = 0
    for key in before:
        changes = list(differences(before[key], after[key]))
        differing += bool(changes)
        if changes:
            print(f"{key}: {'; '.join(changes)}")
    print(f"\n{differing} of {len(before)} cases differ\n")
    print(
        "| way | cases | cones | seams | irregular | CPU s | ratio |\n| --- | --- | --- | --- | --- | --- | --- |"
    )
    for way in sorted({key.split()[-1] for key in before}):
        keys = [
            key for key in before if key.split()[-1] == way and "error" not in {**before[key], **after[key]}
        ]
        sums = {
            name: [sum(float(str(cases[key].get(name, 0))) for key in keys) for cases in (before, after)]
            for name in ("cones", "seam_length", "irregular", "seconds")
        }
        columns = [f"{first:.6g} -> {second:.6g}" for first, second in sums.values()]
        ratio = sums["seconds"][1] / max(sums["seconds"][0], 1e-9)
        print(f"| {way} | {len(keys)} | {' | '.join(columns)} | {ratio:.3f} |")
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
        before, after = (json.loads(path.read_text()) for path in (arguments.before, arguments.after))
        sys.exit(bool(compare({key: before[key] for key in before if key in after}, after)))
    with Pool(arguments.jobs) as pool:
        results = dict(pool.imap_unordered(run, cases()[:: arguments.every]))
    arguments.file.write_text(json.dumps(results, indent=1, sort_keys=True, default=float))
    print(f"{len(results)} cases, {sum('error' in measures for measures in results.values())} refused")


if __name__ == "__main__":
    main()
