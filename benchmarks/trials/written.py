"""Checks of written files, which are read by other libraries and compared with the result."""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from . import plane
from .outcome import Outcome

Read = tuple[np.ndarray, np.ndarray]  # (m, 3, 3) corners in space, (m, 3, 2) in the plane


def read_obj(path: Path) -> Read:
    """Return the triangles of an OBJ, with polygons as fans, like nearly all software."""
    points: list[list[float]] = []
    uv: list[list[float]] = []
    space, flat = [], []
    # Not by `splitlines`, which ends lines at form feeds and the like, too.
    text = path.read_bytes().decode("utf-8", "replace").replace("\\\n", " ")
    for line in re.split(r"\r\n|\n|\r", text):
        words = line.split()
        if words[:1] == ["v"]:
            points.append([float(word) for word in words[1:4]])
        elif words[:1] == ["vt"]:
            uv.append([float(word) for word in words[1:3]])
        elif words[:1] == ["f"]:
            corners = [f"{word}//".split("/")[:2] for word in words[1:]]
            for i in range(1, len(corners) - 1):
                three = [corners[0], corners[i], corners[i + 1]]
                space.append([points[_number(v, len(points))] for v, _ in three])
                flat.append([uv[_number(t, len(uv))] for _, t in three])
    return np.array(space), np.array(flat)


def _number(word: str, count: int) -> int:
    number = int(word)
    index = number - 1 if number > 0 else count + number
    if not 0 <= index < count:
        raise IndexError(f"{word} of {count}")
    return index


def read_ply(path: Path) -> Read:
    """Return the triangles of a PLY, read by meshio."""
    import meshio

    mesh = meshio.read(path)
    corners = np.concatenate([block.data for block in mesh.cells])
    uv = np.column_stack([mesh.point_data["s"], mesh.point_data["t"]])
    return mesh.points[corners], uv[corners]


def read_glb(path: Path) -> Read:
    """Return the triangles of a binary glTF without transforms, float32 as they are stored, v downwards."""
    content = path.read_bytes()
    length = struct.unpack_from("<I", content, 12)[0]
    scene, binary = json.loads(content[20 : 20 + length]), content[28 + length :]

    def accessor(number: int) -> np.ndarray:
        accessor = scene["accessors"][number]
        view = scene["bufferViews"][accessor["bufferView"]]
        kind = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}[accessor["componentType"]]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[accessor["type"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        stride = view.get("byteStride", np.dtype(kind).itemsize * width)
        rows = np.ndarray((accessor["count"], width), kind, binary, start, (stride, np.dtype(kind).itemsize))
        return rows if width > 1 else rows[:, 0]

    space, flat = [], []
    for mesh in scene["meshes"]:
        for primitive in mesh["primitives"]:
            corners = accessor(primitive["indices"]).reshape(-1, 3).astype(np.int64)
            space.append(accessor(primitive["attributes"]["POSITION"])[corners])
            flat.append(accessor(primitive["attributes"]["TEXCOORD_0"])[corners])
    return np.concatenate(space), np.concatenate(flat)


def read_trimesh(path: Path) -> Read:
    """Return the triangles read by trimesh, with transforms, v upwards."""
    import trimesh

    mesh = _load(path)
    assert isinstance(mesh.visual, trimesh.visual.TextureVisuals)
    return mesh.vertices[mesh.faces], np.asarray(mesh.visual.uv)[mesh.faces]


def _load(path: Path) -> Any:
    import trimesh

    mesh = trimesh.load(path, process=False, force="mesh")
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh


def read_npz(path: Path) -> Read:
    with np.load(path, allow_pickle=False) as arrays:
        return arrays["vertices"][arrays["faces"]], arrays["uv"][arrays["uv_faces"]]


READERS: dict[str, Callable[[Path], Read]] = {
    ".obj": read_obj,
    ".ply": read_ply,
    ".glb": read_glb,
    ".npz": read_npz,
}


def check_file(outcome: Outcome, result: Any, path: Path) -> None:
    """Read a written file, and compare its geometry and layout with the result."""
    ending = path.suffix.lower()
    readers: list[Callable[[Path], Read]] = [READERS[ending]]
    if ending in (".obj", ".glb"):
        readers.append(read_trimesh)
    for reader in readers:
        name = f"file {ending} by {reader.__name__}"
        try:
            space, flat = reader(path)
        except Exception as error:
            # trimesh drops the UVs of what has no material.
            drops = reader is read_trimesh and ending == ".glb" and isinstance(error, AttributeError)
            if not drops and not _reads_otherwise(reader, result.source, ending):
                outcome.breach(f"{name}: cannot be read", f"{type(error).__name__}: {error}")
            continue
        if len(space) == len(result.faces) or not _reads_otherwise(reader, result.source, ending):
            _compare(outcome, name, result, space, flat, reader is read_glb)
    if ending == ".npz":
        from coneflat import read_flattening

        again = read_flattening(path)
        if not (np.array_equal(again.uv, result.uv) and np.array_equal(again.faces, result.faces)):
            outcome.breach("file .npz: reads back differently", "")


def _reads_otherwise(reader: Callable[[Path], Read], source: Any, ending: str) -> bool:
    """Return whether this reader reads the input otherwise than coneflat does.

    Statements that a format does not know are copied verbatim. Where a lenient reader takes one for a face, in the
    input as in the output, its triangles cannot be compared.
    """
    family = {".gltf": ".glb"}  # materials are copied from one to the other
    if source is None or not source.path.is_file():
        return False
    if family.get(source.path.suffix.lower(), source.path.suffix.lower()) != ending:
        return False
    try:
        # Of trimesh without the UVs, which the input need not have.
        count = len(_load(source.path).faces) if reader is read_trimesh else len(reader(source.path)[0])
    except Exception as error:
        return not isinstance(error, AttributeError)
    return count != len(source.corners) - 2 * (len(source.offsets) - 1)


def check_report(outcome: Outcome, report: dict[str, Any], path: Path) -> None:
    """Read a file written by the command, and compare its report with it."""
    reader = READERS[path.suffix.lower()]
    name = f"report of {path.suffix}"
    try:
        space, flat = reader(path)
    except Exception as error:
        outcome.breach(f"{name}: file cannot be read", f"{type(error).__name__}: {error}")
        return
    if len(space) != report["triangles"]:
        outcome.breach(f"{name}: number of triangles", f"{len(space)} read, {report['triangles']} reported")
    if reader is read_glb:
        flat = flat * np.array([1, -1], dtype=flat.dtype)
    flipped = _count_flipped(flat)
    if flipped > report["flipped"] and not report["mirrored_charts"]:
        outcome.breach(f"{name}: flipped triangles", f"{flipped}, {report['flipped']} reported")
    if report["overlapping_pairs"] == 0:
        _check_overlap(outcome, name, flat)


def _count_flipped(flat: np.ndarray) -> int:
    """Return the number of triangles with an area that is negative beyond rounding."""
    areas = plane.double_areas(flat.astype(np.float64))
    return int((areas < -1e-9 * plane.side_lengths(flat).max(axis=1) ** 2).sum())


def _compare(
    outcome: Outcome, name: str, result: Any, space: np.ndarray, flat: np.ndarray, stored: bool
) -> None:
    """Compare triangles that were read with the result; stored: v points downwards, as in glTF."""
    ending = name.split()[1]
    if len(space) != len(result.faces):
        outcome.breach(
            f"{name}: number of triangles", f"{len(space)} read, {len(result.faces)} in the result"
        )
        return
    if not np.isfinite(flat).all():
        outcome.breach(f"{name}: not finite", "")
        return
    expected = result.vertices[result.faces]
    extent = np.abs(expected).max()
    fine = 1e-6 if ending in (".glb", ".obj") else 1e-12
    # At a size of one: squares of 32-bit numbers are soon none.
    exponent = int(np.frexp(extent)[1])
    sides = [
        np.sort(plane.side_lengths(np.ldexp(corners.astype(np.float64), -exponent)).ravel())
        for corners in (space, expected)
    ]
    extent = float(np.ldexp(extent, -exponent))
    is_polygon = result.source is not None and len(result.source.offsets) - 1 < len(result.faces)
    if not is_polygon and np.abs(sides[0] - sides[1]).max() > fine * max(extent, np.finfo(float).tiny):
        outcome.breach(f"{name}: another shape", np.abs(sides[0] - sides[1]).max() / extent)
    if stored:
        flat = flat * np.array([1, -1], dtype=flat.dtype)
    areas = plane.double_areas(flat.astype(np.float64))
    total = plane.double_areas(result.corner_uv)
    rounding = (
        4 * np.finfo(np.float32).eps * plane.side_lengths(result.corner_uv).sum() if ending == ".glb" else 0.0
    )
    if abs(areas.sum() - total.sum()) > 1e-6 * np.abs(total).sum() + rounding:
        outcome.breach(f"{name}: another layout", f"area {areas.sum():.9g}, in the result {total.sum():.9g}")
    flipped = _count_flipped(flat)
    if flipped > max(result.distortion.flipped, result.distortion.mirrored_charts * len(areas)):
        outcome.breach(f"{name}: flipped triangles", f"{flipped}, {result.distortion.flipped} reported")
    if result.distortion.overlapping_pairs == 0:
        _check_overlap(outcome, name, flat)


def _check_overlap(outcome: Outcome, name: str, flat: np.ndarray) -> None:
    """Check that nothing overlaps in the numbers of the file, without tolerance, if the report says so."""
    from coneflat.geometry.overlap import find_overlaps

    pairs = find_overlaps(flat.astype(np.float64)).pairs
    if len(pairs):
        outcome.breach(f"{name}: overlap", f"{len(pairs)} pairs, none in the report")
