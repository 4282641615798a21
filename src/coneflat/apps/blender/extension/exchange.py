"""What passes between Blender and the commands: meshes as PLY, options as arguments, results as NPZ; without bpy."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .job import Failure

#: The names of the files of a job in its folder.
MESH, RESULT = "mesh.ply", "result.npz"
#: The factor of a vertex with the full weight of a vertex group, as for vertices of a pure colour.
FULL_WEIGHT = 100.0


@dataclass(frozen=True, eq=False)
class Part:
    """Faces of one mesh, with only the vertices that they use.

    Attributes:
        name: of the object.
        positions: (n, 3) in the space of the scene.
        corners: (c,) vertex of every polygon corner, polygon after polygon.
        sizes: (p,) numbers of corners of the polygons.
        weights: (n,) weights of vertex groups, 0 to 1, by the name of their option.
        lists: (k,) vertices, or (k, 2) edges as pairs of vertices, by the name of their option.
    """

    name: str
    positions: NDArray[np.float64]
    corners: NDArray[np.int64]
    sizes: NDArray[np.int64]
    weights: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    lists: Mapping[str, NDArray[np.int64]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Map:
    """The UVs of a part.

    Attributes:
        uv: (c, 2) point of every polygon corner; NaN for those of dropped polygons.
        seams: (k, 2) edges that were cut, as pairs of vertices.
        cones: (s,) vertices.
        torn: number of polygons that a cut divides, whose UVs are not a polygon.
    """

    uv: NDArray[np.float64]
    seams: NDArray[np.int64]
    cones: NDArray[np.int64]
    torn: int


def names_group(record: Mapping[str, Any], value: Any) -> bool:
    """Return whether the value of an option is the name of a vertex group."""
    if record["kind"] == "text":
        is_number = re.fullmatch(r"[-+]?[\d.]+(e[-+]?\d+)?", value.strip().lower())
        return record["takes_names"] and bool(value) and value not in record["words"] and not is_number
    return record["kind"] in ("weights", "vertices") and bool(value)


def arguments(records: Sequence[Mapping[str, Any]], values: Mapping[str, Any]) -> list[str]:
    """Return the arguments of a command for options that do not have their defaults, without those of `write_parts`.

    Args:
        records: the options of the command.
        values: their values by name; weights are the names of vertex groups.
    """
    words = list[str]()
    for record in records:
        name, value, kind = record["name"], values[record["name"]], record["kind"]
        is_default = value in (record["default"], "")
        if kind in ("number", "angle"):  # Blender's numbers have single precision.
            is_default = np.float32(value) == np.float32(record["default"])
        if not is_default and kind != "vertices":
            # The angles that are wanted exactly are integers in degrees.
            texts = {"angle": "={1:.5g}deg", "number": "={0:.7g}", "flag": ""}
            text = f"={name}" if names_group(record, value) else texts.get(kind, "={0}")
            words.append(_flag(name) + text.format(value, math.degrees(value) if kind == "angle" else 0))
    return words


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def write_parts(folder: Path, parts: Sequence[Part]) -> list[str]:
    """Write meshes as one PLY with a component for each or more, and return the arguments that refer to its files.

    Vertices at the same position are not merged, since objects that touch must stay separate.
    """
    starts = _starts(parts)
    names = sorted(set().union(*(part.weights for part in parts)))
    kinds = [*((axis, "<f8") for axis in "xyz"), *((name, "<f8") for name in names)]
    rows = np.empty(starts[-1], kinds)
    for axis, column in zip("xyz", np.concatenate([part.positions for part in parts]).T, strict=True):
        rows[axis] = column
    for name in names:
        weights = [part.weights.get(name, np.zeros(len(part.positions))) for part in parts]
        rows[name] = FULL_WEIGHT ** np.clip(np.concatenate(weights), 0, 1)
    sizes, corners = _joined(parts)
    # Each polygon is its number of corners and its corners, all of them 32-bit integers.
    words = np.empty(len(sizes) + len(corners), "<i4")
    heads = np.cumsum(sizes) - sizes + np.arange(len(sizes))
    is_corner = np.ones(len(words), bool)
    is_corner[heads] = False
    words[heads], words[is_corner] = sizes, corners
    properties = "".join(f"property double {name}\n" for name, _ in kinds)
    properties += f"element face {len(sizes)}\nproperty list int int vertex_indices\n"
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{properties}end_header\n"
    (folder / MESH).write_bytes(header.encode() + rows.tobytes() + words.tobytes())
    options = [MESH, "-o", RESULT, "--no-weld"]
    for name in sorted(set().union(*(part.lists for part in parts))):
        pairs = zip(parts, starts, strict=False)
        rows = np.concatenate([part.lists[name] + start for part, start in pairs if name in part.lists])
        if len(rows):
            np.savetxt(folder / f"{name}.txt", rows, fmt="%d")
            options += [_flag(name), f"{name}.txt"]
    return options


def _starts(parts: Sequence[Part]) -> list[int]:
    """Return the first vertex of each part, and the number of all vertices."""
    return [0, *np.cumsum([len(part.positions) for part in parts]).tolist()]


def _joined(parts: Sequence[Part]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the sizes and the corners of the polygons of all parts."""
    corners = [part.corners + start for part, start in zip(parts, _starts(parts), strict=False)]
    return np.concatenate([part.sizes for part in parts]), np.concatenate(corners)


def read_maps(folder: Path, parts: Sequence[Part]) -> tuple[list[Map], dict[str, Any]]:
    """Return the UVs of each part from the result of a command, and the report of the command.

    The result has triangles: k - 2 for a polygon of k corners, in the order of the polygons. Repair may have dropped,
    reversed or subdivided some, and duplicated vertices.

    Raises:
        Failure: the result does not fit the parts.
    """
    result = _load(folder)
    sizes, corners = _joined(parts)
    starts = _starts(parts)
    count = starts[-1]
    origin = result["vertex_origin"]
    polygon = np.repeat(np.arange(len(sizes)), sizes - 2)[result["face_origin"]]
    corner_keys = polygon[:, None] * count + origin[result["faces"]]
    polygon_keys = np.repeat(np.arange(len(sizes)), sizes) * count + corners
    order = np.argsort(polygon_keys)
    place = np.minimum(np.searchsorted(polygon_keys, corner_keys, sorter=order), len(polygon_keys) - 1)
    corner = order[place]
    is_there = polygon_keys[corner] == corner_keys
    points = result["uv"][result["uv_faces"]]
    uv = np.full((len(corners), 2), np.nan)
    uv[corner[is_there]] = points[is_there]
    differs = is_there & (uv[corner] != points).any(axis=2)
    torn = np.unique(polygon[differs.any(axis=1)])
    seams, cones = origin[result["seams"]].reshape(-1, 2), origin[result["cones"]]
    lengths = [(len(part.positions), len(part.corners), len(part.sizes)) for part in parts]
    # The part of each vertex, corner and polygon.
    of_vertex, of_corner, of_polygon = (
        np.repeat(np.arange(len(parts)), lengths_of) for lengths_of in zip(*lengths, strict=True)
    )
    maps = []
    for i, start in enumerate(starts[:-1]):
        own_seams = seams[of_vertex[seams[:, 0]] == i] - start
        own_cones = cones[of_vertex[cones] == i] - start
        maps.append(Map(uv[of_corner == i], own_seams, own_cones, int((of_polygon[torn] == i).sum())))
    return maps, json.loads(str(result["report"]))


def read_quads(folder: Path) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """Return vertices, quads and irregular vertices of the result of `coneflat quads`, and its notes.

    Raises:
        Failure: there is no result.
    """
    result = _load(folder)
    return result, json.loads(str(result["report"]))["notes"]


def _load(folder: Path) -> dict[str, NDArray[Any]]:
    try:
        with np.load(folder / RESULT, allow_pickle=False) as archive:
            return dict(archive)
    except (OSError, ValueError) as error:
        raise Failure(f"the result of coneflat cannot be read: {' '.join(str(error).split())}") from error
