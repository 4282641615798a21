"""Cases of models far from the origin: their triangles are in the written file as they are in the input, or a note."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import gltf_scenes
import numpy as np
import shapes

from .attributes import read_ply
from .commands import run_command
from .files import write_obj, write_off, write_stl
from .outcome import Outcome
from .written import read_npz, read_obj

Random = np.random.Generator

OUTPUTS = (".obj", ".ply", ".glb", ".npz")
#: Error of a position of a GLB, relative to the size of the model; beside the rounding of doubles.
SINGLE = 2.0**-22
#: Notes that name triangles that are lost, or without area.
NAMED = r"no area in|rounded to steps|too small for the size"


def offset_case(rng: Random, outcome: Outcome) -> None:
    """Move a small model far away, flatten or unwrap its file, and compare the written triangles with those read."""
    ending = str(rng.choice(list(INPUTS)))
    size, offset = 10.0 ** rng.uniform(-3, 3), float(rng.choice([0, 1])) * 10.0 ** rng.uniform(0, 8)
    vertices, faces = (
        shapes.hill(*map(int, rng.integers(2, 6, 2))) if rng.random() < 0.5 else shapes.sphere(1)
    )
    direction = rng.normal(size=3)
    vertices = size * vertices / np.ptp(vertices, axis=0).max() + offset * direction / np.linalg.norm(
        direction
    )
    content, positions = INPUTS[ending](rng, vertices, faces)
    path = Path(f"in.{ending.split()[-1]}")
    path.write_bytes(content)
    verb, out = str(rng.choice(["flatten", "unwrap"])), Path(f"out{rng.choice(OUTPUTS)}")
    line = [verb, str(path), "-o", str(out), "--report", "report.json"]
    outcome.recipe = (
        f"{' '.join(line)} ({ending}) of {len(faces)} triangles, size {size:.3g}, offset {offset:.3g}"
    )
    code, _, err = run_command(line)
    before = positions[faces]
    intact = _areas(before) > 1e-7 * _longest(before) ** 2
    if code != 0:
        if intact.all():
            outcome.breach(f"offsets: {verb} fails", err)
        outcome.refuse(err.strip().splitlines()[-1], expects_nan=True)
        return
    report = json.loads(Path("report.json").read_text())
    notes = " ".join(report["notes"])
    undefined = [name for name in ("qc_mean", "area_std", "energy", "density_spread") if report[name] is None]
    if undefined and "Measures that are not defined" not in notes:
        outcome.breach("offsets: a measure is NaN without a note", f"{undefined}; {notes}")
    after = READERS[out.suffix](out)
    if not intact.all() and not re.search(NAMED, notes):
        outcome.breach(f"offsets: rounding of {ending} without a note", notes)
    if len(after) < len(before):
        if intact.all():
            outcome.breach(f"offsets: triangles of {ending} lost in {out.suffix}", notes)
        return
    tolerance = 4 * np.finfo(float).eps * np.abs(positions).max()
    tolerance += SINGLE * np.ptp(positions, axis=0).max() if out.suffix == ".glb" else 0.0
    error = np.abs(_sorted(after) - _sorted(before)).max()
    if error > tolerance and not re.search(NAMED, notes):
        outcome.breach(f"offsets: {out.suffix} is another shape", f"{error:.3g} of {tolerance:.3g}; {notes}")
    if (_areas(after)[_areas(after).argsort()] <= 0).any() and intact.all() and not re.search(NAMED, notes):
        outcome.breach(f"offsets: triangles without area in {out.suffix}", notes)


def _areas(corners: np.ndarray) -> np.ndarray:
    sides = corners[:, 1:] - corners[:, :1]
    return np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)


def _longest(corners: np.ndarray) -> np.ndarray:
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)


def _sorted(corners: np.ndarray) -> np.ndarray:
    """Return the lengths of sides of triangles (m, 3, 3), sorted."""
    return np.sort(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).ravel())


Made = tuple[bytes, np.ndarray]


def _by(write: Callable[..., bytes]) -> Callable[[Random, np.ndarray, np.ndarray], Made]:
    return lambda rng, vertices, faces: (write(rng, vertices, faces.tolist()), vertices)


def _stl(rng: Random, vertices: np.ndarray, faces: np.ndarray) -> Made:
    content = b""
    while content[:5] != bytes(5):  # binary
        content = write_stl(rng, vertices, faces.tolist())
    return content, vertices.astype("f4").astype(float)


def _ply(kind: str, word: str) -> Callable[[Random, np.ndarray, np.ndarray], Made]:
    def make(rng: Random, vertices: np.ndarray, faces: np.ndarray) -> Made:
        rows = np.zeros(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
        rows["count"], rows["corners"] = 3, faces
        head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
        head += [*(f"property {word} {axis}" for axis in "xyz"), f"element face {len(faces)}"]
        head += ["property list uchar int vertex_indices", "end_header\n"]
        points = vertices.astype(kind)
        return "\n".join(head).encode() + points.tobytes() + rows.tobytes(), points.astype(float)

    return make


def _glb(is_local: bool) -> Callable[[Random, np.ndarray, np.ndarray], Made]:
    def make(rng: Random, vertices: np.ndarray, faces: np.ndarray) -> Made:
        scene = gltf_scenes.SceneMaker()
        place = vertices.mean(axis=0) if is_local else np.zeros(3)
        points = (vertices - place).astype("f4")
        primitive = {
            "attributes": {"POSITION": scene.accessor(points)},
            "indices": scene.accessor(faces.ravel(), 5125),
        }
        scene.tree |= {"nodes": [{"mesh": 0, "translation": place.tolist()}], "scenes": [{"nodes": [0]}]}
        scene.tree |= {"meshes": [{"primitives": [primitive]}]}
        return scene.glb(), points.astype(float) + place

    return make


INPUTS = {
    "obj": _by(write_obj),
    "off": _by(write_off),
    "double ply": _ply("<f8", "double"),
    "float ply": _ply("<f4", "float"),
    "stl": _stl,
    "glb": _glb(False),
    "local glb": _glb(True),
}


def _read_glb(path: Path) -> np.ndarray:
    """Return the triangles of a GLB whose nodes have translations only."""
    tree, accessor, _ = gltf_scenes.opened(path.read_bytes())
    triangles = []
    for node in tree["nodes"]:
        for primitive in tree["meshes"][node["mesh"]]["primitives"]:
            points = accessor(primitive["attributes"]["POSITION"]).astype(float) + node.get(
                "translation", [0, 0, 0]
            )
            triangles.append(points[gltf_scenes.corners_of(tree, accessor, primitive)])
    return np.concatenate(triangles).reshape(-1, 3, 3)


def _read_ply(path: Path) -> np.ndarray:
    vertices, triangles = read_ply(path)
    return np.stack([vertices[axis] for axis in "xyz"], axis=1)[triangles["vertex_indices"]]


READERS: dict[str, Callable[[Path], np.ndarray]] = {
    ".obj": lambda path: read_obj(path)[0],
    ".ply": _read_ply,
    ".glb": _read_glb,
    ".npz": lambda path: read_npz(path)[0],
}
