"""Mesh files of all formats, intact and damaged."""

from __future__ import annotations

import io
import json
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import shapes

Random = np.random.Generator


def small_mesh(rng: Random) -> tuple[np.ndarray, list[list[int]]]:
    """Return vertices and polygons of a small manifold."""
    kind = int(rng.integers(6))
    if kind == 0:  # quads, none of them flat
        columns, rows = (int(n) for n in rng.integers(1, 8, 2))
        vertices, faces = shapes.grid(columns, rows, lambda x, y: np.sin(5 * x) * y)
        half = len(faces) // 2
        quads = np.column_stack([faces[:half], faces[half:, 2]])
        vertices[:, 2] += rng.choice([0.0, 0.1, 1.0]) * rng.normal(size=len(vertices)) / columns
        return vertices, quads.tolist()
    if kind == 1:  # a prism: two polygons and quads
        count = int(rng.integers(3, 20))
        angle = 2 * np.pi * np.arange(count) / count
        radius = 1 + rng.choice([0.0, 0.4]) * np.cos(3 * angle)
        ring = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
        low, high = (np.column_stack([ring, np.full(count, z)]) for z in (0.0, 1.0))
        sides = [[i, (i + 1) % count, (i + 1) % count + count, i + count] for i in range(count)]
        return np.concatenate([low, high]), [*sides, list(range(count))[::-1], list(range(count, 2 * count))]
    if kind == 2:
        vertices, faces = shapes.sphere(int(rng.integers(0, 3)))
    elif kind == 3:
        vertices, faces = shapes.box(2)
    elif kind == 4:
        vertices, faces = shapes.torus(int(rng.integers(4, 12)), int(rng.integers(3, 8)))
    else:  # two balls that may touch in a point
        ball = shapes.sphere(1, 0.0)
        vertices, faces = shapes.join(ball, (ball[0] + [2 * ball[0][:, 0].max(), 0, 0], ball[1]))
    if rng.random() < 0.2:
        vertices = vertices + rng.choice([1e-3, 1e-1]) * rng.normal(size=vertices.shape)
    return vertices * float(rng.choice([1.0, 1.0, 1e-3, 1e4])), faces.tolist()


def _triangles(polygons: list[list[int]]) -> np.ndarray:
    return np.array([[p[0], p[i], p[i + 1]] for p in polygons for i in range(1, len(p) - 1)])


def write_obj(rng: Random, vertices: np.ndarray, polygons: list[list[int]]) -> bytes:
    """An OBJ with, at random, texture coordinates, normals, groups, materials, comments and odd line ends."""
    uv, normals, groups = rng.random(3) < [0.3, 0.3, 0.4]
    end = "\r\n" if rng.random() < 0.1 else "\n"
    lines = ["# a comment", "mtllib some.mtl"] if groups else []
    lines += [f"v {x:.17g} {y:.17g} {z:.17g}" for x, y, z in vertices]
    lines += [f"vt {x:.6g} {y:.6g}" for x, y, _ in vertices] if uv else []
    lines += ["vn 0 0 1"] * len(vertices) if normals else []
    relative = rng.random() < 0.1
    for number, polygon in enumerate(polygons):
        if groups and number % 7 == 0:
            lines += [f"g part{number}", f"usemtl colour{number % 2}", "s off"]
        corners = []
        for v in polygon:
            name = str(v - len(vertices) if relative else v + 1)
            corners.append(
                name + (f"/{name if uv else ''}" + (f"/{name}" if normals else "") if uv or normals else "")
            )
        lines.append("f " + " ".join(corners))
    return (end.join(lines) + end).encode()


def write_off(rng: Random, vertices: np.ndarray, polygons: list[list[int]]) -> bytes:
    lines = ["OFF", f"{len(vertices)} {len(polygons)} 0"]
    lines += [f"{x:.17g} {y:.17g} {z:.17g}" for x, y, z in vertices]
    lines += [" ".join(map(str, [len(polygon), *polygon])) for polygon in polygons]
    return ("\n".join(lines) + "\n").encode()


def write_ply(rng: Random, vertices: np.ndarray, polygons: list[list[int]]) -> bytes:
    form = str(rng.choice(["ascii", "binary_little_endian", "binary_big_endian"]))
    coloured = rng.random() < 0.3
    colour = ["property uchar red", "property uchar green", "property uchar blue"] if coloured else []
    header = ["ply", f"format {form} 1.0", "comment made up", f"element vertex {len(vertices)}"]
    header += [*(f"property double {axis}" for axis in "xyz"), *colour, f"element face {len(polygons)}"]
    header += ["property list uchar int vertex_indices", "end_header\n"]
    if form == "ascii":
        rows = [" ".join(map(repr, [*map(float, p), *([9, 8, 7] if coloured else [])])) for p in vertices]
        rows += [" ".join(map(str, [len(polygon), *polygon])) for polygon in polygons]
        return ("\n".join(header) + "\n".join(rows) + "\n").encode()
    order = "<" if form.endswith("little_endian") else ">"
    body = b"".join(struct.pack(f"{order}3d", *p) + (b"\x09\x08\x07" if coloured else b"") for p in vertices)
    body += b"".join(struct.pack(f"{order}B{len(p)}i", len(p), *p) for p in polygons)
    return "\n".join(header).encode() + body


def write_stl(rng: Random, vertices: np.ndarray, polygons: list[list[int]]) -> bytes:
    corners = vertices[_triangles(polygons)]
    if rng.random() < 0.5:
        rows = ["solid thing"]
        for triangle in corners:
            rows += ["facet normal 0 0 0", "outer loop"]
            rows += ["vertex {:.9g} {:.9g} {:.9g}".format(*p) for p in triangle] + ["endloop", "endfacet"]
        return ("\n".join([*rows, "endsolid thing"]) + "\n").encode()
    facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    facets = np.zeros(len(corners), facet)
    facets["corners"] = corners
    return bytes(80) + struct.pack("<I", len(corners)) + facets.tobytes()


def _gltf(rng: Random, vertices: np.ndarray, polygons: list[list[int]]) -> tuple[dict, bytes]:
    """A scene of one mesh or, at random, of the same mesh twice under nodes with transforms."""
    corners = _triangles(polygons).astype("<u4")
    points = vertices.astype("<f4")
    if rng.random() < 0.4:  # every vertex as often as it has faces, as normals would have it
        points, corners = points[corners.ravel()], np.arange(corners.size, dtype="<u4").reshape(-1, 3)
    binary = points.tobytes() + corners.tobytes()
    nodes = [{"mesh": 0, "name": "one"}]
    if rng.random() < 0.4:
        width = float(np.ptp(points[:, 0]))
        nodes.append({"mesh": 0, "name": "two", "translation": [width * float(rng.choice([1.0, 1.5])), 0, 0]})
    scene = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "materials": [{"name": "paint", "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": len(points),
                "type": "VEC3",
                "min": points.min(axis=0).tolist(),
                "max": points.max(axis=0).tolist(),
            },
            {"bufferView": 1, "componentType": 5125, "count": corners.size, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": points.nbytes},
            {"buffer": 0, "byteOffset": points.nbytes, "byteLength": corners.nbytes},
        ],
        "buffers": [{"byteLength": len(binary)}],
    }
    return scene, binary


def damaged_scene(rng: Random, scene: dict) -> dict:
    """A scene with one entry changed, removed or much too large; sometimes a sparse accessor."""
    if rng.random() < 0.2:
        accessor = scene["accessors"][int(rng.integers(2))]
        accessor["count"] = int(rng.choice([0, -1, 1 << 20, 1 << 30, 1 << 40]))
        if rng.random() < 0.5:
            accessor.pop("bufferView", None)
        if rng.random() < 0.5:
            accessor["sparse"] = {
                "count": 1,
                "indices": {"bufferView": 1, "componentType": 5125},
                "values": {"bufferView": 0},
            }
        return scene
    places: list[tuple[dict | list, str | int]] = []

    def collect(part: object) -> None:
        for key, value in part.items() if isinstance(part, dict) else enumerate(part):  # type: ignore[arg-type]
            places.append((part, key))  # type: ignore[arg-type]
            if isinstance(value, (dict, list)):
                collect(value)

    collect(scene)
    part, key = places[int(rng.integers(len(places)))]
    values = [None, -1, 0, 7, 1 << 31, 1 << 50, 1.5, "x", "", [], {}, [1e308] * 3, True, 5120, "MAT4"]
    if rng.random() < 0.2:
        del part[key]  # type: ignore[arg-type]
    else:
        part[key] = values[int(rng.integers(len(values)))]  # type: ignore[index]
    return scene


def write_glb(rng: Random, vertices: np.ndarray, polygons: list[list[int]], damage: bool = False) -> bytes:
    scene, binary = _gltf(rng, vertices, polygons)
    if damage:
        scene = damaged_scene(rng, scene)
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    length = 12 + 8 + len(text) + 8 + len(binary)
    return (
        struct.pack("<4sII", b"glTF", 2, length)
        + struct.pack("<I4s", len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(binary), b"BIN\0")
        + binary
    )


def write_gltf(rng: Random, vertices: np.ndarray, polygons: list[list[int]], damage: bool = False) -> bytes:
    import base64

    scene, binary = _gltf(rng, vertices, polygons)
    scene["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(binary).decode()
    return json.dumps(damaged_scene(rng, scene) if damage else scene).encode()


def write_npz(rng: Random, vertices: np.ndarray, polygons: list[list[int]], damage: bool = False) -> bytes:
    """A result file of the package, at random with a member replaced, removed or enlarged."""
    import coneflat

    result = coneflat.flatten(vertices, _triangles(polygons), charts="atlas", max_cones=8, repair=True)
    stream = io.BytesIO()
    from coneflat.io.npz import write_npz as write

    write(result, stream)
    if not damage:
        return stream.getvalue()
    with zipfile.ZipFile(stream) as members:
        parts = {name: members.read(name) for name in members.namelist()}
    name = sorted(parts)[int(rng.integers(len(parts)))]
    kind = int(rng.integers(6))
    if kind == 0:
        del parts[name]
    elif kind == 1:
        parts[name] = damaged_bytes(rng, parts[name])
    elif kind == 2:  # much more than is there
        parts[name] = _npy_header((int(rng.choice([1 << 20, 1 << 31, 1 << 45])), 3)) + parts[name][128:]
    elif kind == 3:  # zeros, which compress a thousandfold
        parts[name] = _npy_header((4_000_000, 3)) + bytes(96_000_000)
    else:
        array = io.BytesIO()
        arrays = [
            np.array([1e9]),
            np.full((3, 3), 10**9),
            np.full((4, 2), np.nan),
            np.array(["a"]),
            np.array(3),
        ]
        np.save(array, arrays[int(rng.integers(len(arrays)))])
        parts[name] = array.getvalue()
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as members:
        for name, content in parts.items():
            members.writestr(name, content)
    return packed.getvalue()


def _npy_header(shape: tuple[int, ...]) -> bytes:
    text = repr({"descr": "<f8", "fortran_order": False, "shape": shape}).encode()
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", 118) + text.ljust(117) + b"\n"


WRITERS: dict[str, Callable[..., bytes]] = {
    ".obj": write_obj,
    ".ply": write_ply,
    ".stl": write_stl,
    ".off": write_off,
    ".glb": write_glb,
    ".gltf": write_gltf,
    ".npz": write_npz,
}
#: Formats whose structure is damaged, not only their bytes.
STRUCTURED = (".glb", ".gltf", ".npz")
# fmt: off
#: Words that take the place of others in a damaged text.
TOKENS = (
    b"nan", b"inf", b"1e999", b"-1", b"0", b"999999999", b"99999999999999999999", b"", b"x", b"\xff\xfe", b"1/2/3/4",
    b"f", b"v", b"1e-400", b"/", b"//", b"0x10", b"1,5", b"\0", b"element vertex 4000000000", b"\\",
)
# fmt: on


def damaged_bytes(rng: Random, content: bytes) -> bytes:
    """Bytes with bits flipped, cut off, pieces moved, or words replaced."""
    raw, kind = bytearray(content), int(rng.integers(7))
    if not raw:
        return content
    if kind == 0:
        for _ in range(int(rng.integers(1, 12))):
            raw[rng.integers(len(raw))] ^= 1 << int(rng.integers(8))
    elif kind == 1:
        del raw[int(rng.integers(len(raw))) :]
    elif kind == 2:
        at = int(rng.integers(len(raw)))
        raw[at:at] = rng.integers(0, 256, int(rng.integers(1, 40)), dtype=np.uint8).tobytes()
    elif kind == 3:
        at, length = int(rng.integers(len(raw))), int(rng.integers(1, 60))
        raw[at:at] = raw[at : at + length]
    elif kind == 4:
        at, length = int(rng.integers(len(raw))), int(rng.integers(1, 60))
        del raw[at : at + length]
    else:  # words of the first lines are those that count
        early = content[: max(200, len(raw) // 8)] if kind == 5 else content
        words = early.split(b" ")
        for _ in range(int(rng.integers(1, 4))):
            words[rng.integers(len(words))] = TOKENS[int(rng.integers(len(TOKENS)))]
        return b" ".join(words) + content[len(early) :]
    return bytes(raw)


def make_file(rng: Random, folder: Path) -> tuple[Path, str]:
    """Write a file, damaged in two of three cases, and return its path and a description."""
    ending = str(rng.choice(list(WRITERS), p=[0.27, 0.2, 0.12, 0.1, 0.15, 0.08, 0.08]))
    vertices, polygons = small_mesh(rng)
    damage = rng.random() < 0.6
    structure = damage and ending in STRUCTURED and rng.random() < 0.6
    content = WRITERS[ending](rng, vertices, polygons, *([True] if structure else []))
    recipe = f"{ending} of {len(vertices)} vertices, {len(polygons)} polygons"
    if damage and not structure:
        content, recipe = damaged_bytes(rng, content), f"damaged {recipe}"
    elif structure:
        recipe = f"{recipe}, its structure damaged"
    if rng.random() < 0.03:
        content, recipe = b"", f"empty {ending}"
    if rng.random() < 0.03:
        ending, recipe = str(rng.choice(list(WRITERS))), f"{recipe}, named otherwise"
    path = folder / f"thing{ending}"
    path.write_bytes(content)
    return path, recipe
