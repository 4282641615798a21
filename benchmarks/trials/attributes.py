"""Cases of files with further data: each of them is in the written file, or its note names it."""

from __future__ import annotations

import base64
import json
import re
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import gltf_scenes
import numpy as np
import shapes

from .commands import run_command
from .outcome import Outcome

Random = np.random.Generator
Check = Callable[[Path], bool]

OUTPUTS = (".obj", ".ply", ".glb", ".npz")
QUADS = (".obj", ".ply", ".glb")
#: How a note begins that names what is lost.
LOST = "These data of the input are not kept in "


@dataclass(frozen=True)
class Planted:
    """Data in a file.

    Attributes:
        name: the data.
        words: pattern by which a note names it.
        checks: by the ending of an output, how to find the data there; other outputs cannot have it.
    """

    name: str
    words: str
    checks: Mapping[str, Check] = field(default_factory=dict)


Made = tuple[bytes, list[Planted]]


def attribute_case(rng: Random, outcome: Outcome) -> None:
    """Write a file with some data, flatten or unwrap it, or make quads of it, and look for the data."""
    ending = str(rng.choice(list(MAKERS)))
    vertices, faces = _mesh(rng)
    content, planted = MAKERS[ending](rng, vertices, faces)
    path = Path(f"in{ending}")
    path.write_bytes(content)
    verb = str(rng.choice(["flatten", "unwrap", "quads"], p=[0.5, 0.35, 0.15]))
    out = Path(f"out{rng.choice(QUADS if verb == 'quads' else OUTPUTS)}")
    line = [verb, str(path), "-o", str(out), "--report", "report.json"]
    line += ["--quads", "30"] if verb == "quads" else []
    outcome.recipe = (
        f"{' '.join(line)} of {len(faces)} triangles with {', '.join(data.name for data in planted)}"
    )
    code, _, err = run_command(line)
    if code != 0 or not out.exists():
        outcome.breach(f"attributes: {verb} fails", err)
        return
    notes = json.loads(Path("report.json").read_text())["notes"]
    told = " ".join(note for note in notes if note.startswith(LOST + out.suffix))
    for attribute in planted:
        check = attribute.checks.get(out.suffix)
        if verb == "quads":
            check = (
                check if ending == ".obj" and attribute.name in ("groups", "objects", "materials") else None
            )
        try:
            is_kept = check is not None and check(out)
        except Exception as error:
            outcome.breach(
                f"attributes: {ending} to {out.suffix}: {attribute.name} cannot be read", repr(error)
            )
            continue
        is_named = re.search(attribute.words, told) is not None
        transfer = f"{attribute.name} of {ending} in {out.suffix} by {verb}"
        if not is_kept and not is_named:
            outcome.breach(f"attributes: lost without a note: {transfer}", told)
        if is_kept and is_named:
            outcome.breach(f"attributes: kept, but a note names it: {transfer}", told)


def _mesh(rng: Random) -> tuple[np.ndarray, np.ndarray]:
    kind = int(rng.integers(3))
    if kind == 0:
        return shapes.hill(int(rng.integers(2, 6)), int(rng.integers(2, 6)))
    return shapes.sphere(1) if kind == 1 else shapes.box(1)


def chosen_attributes(rng: Random, planted: list[Any]) -> list[Any]:
    """Return some of the data, in order, at least one."""
    chosen = rng.random(len(planted)) < 0.5
    chosen[rng.integers(len(planted))] = True
    return [attribute for attribute, is_chosen in zip(planted, chosen, strict=True) if is_chosen]


def _has(pattern: bytes) -> Check:
    return lambda path: re.search(pattern, path.read_bytes(), re.MULTILINE) is not None


def make_obj(rng: Random, vertices: np.ndarray, faces: np.ndarray) -> Made:
    shades = rng.integers(0, 256, (len(vertices), 3))
    planted = chosen_attributes(
        rng,
        [
            Planted("groups", r"\bgroups\b", {".obj": _has(rb"^g left arm\s*$")}),
            Planted("objects", r"\bobjects\b", {".obj": _has(rb"^o thing\s*$")}),
            Planted("materials", r"\bmaterials\b", {".obj": _has(rb"^usemtl paint\s*$")}),
            Planted("lines", r"\blines and points\b", {".obj": _has(rb"^l 1 2\s*$")}),
            Planted("curves", r"\bcurves and surfaces\b", {".obj": _has(rb"^curv 0 1 1 2\s*$")}),
            _colours(shades, {".obj": _obj_colours(shades)}),
        ],
    )
    names = {attribute.name for attribute in planted}
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    if "colours" in names:
        lines = [
            f"{line} {r / 255} {g / 255} {b / 255}" for line, (r, g, b) in zip(lines, shades, strict=True)
        ]
    lines += ["o thing"] * ("objects" in names) + ["usemtl paint"] * ("materials" in names)
    for i, face in enumerate(faces.tolist()):
        lines += ["g left arm"] * ("groups" in names and i == len(faces) // 2)
        lines.append("f " + " ".join(str(v + 1) for v in face))
    lines += ["l 1 2"] * ("lines" in names)
    lines += ["cstype bezier", "deg 1", "curv 0 1 1 2", "end"] if "curves" in names else []
    return ("\n".join(lines) + "\n").encode(), planted


def _obj_colours(shades: np.ndarray) -> Check:
    def check(path: Path) -> bool:
        rows = [line.split()[1:] for line in path.read_text().splitlines() if line.startswith("v ")]
        return np.allclose(255 * np.array([row[3:6] for row in rows], dtype=float), shades, atol=1e-6)

    return check


def _colours(shades: np.ndarray, further: Mapping[str, Check]) -> Planted:
    """Colours (n, 3) of vertices, in bytes."""

    def in_ply(path: Path) -> bool:
        rows = read_ply(path)[0]
        colours = np.stack([rows[name] for name in ("red", "green", "blue")], axis=1)
        return np.array_equal(colours, shades[rows["source_vertex"]])

    def in_glb(path: Path) -> bool:
        colours, source = glb_rows(path, "COLOR_0"), glb_rows(path, "_SOURCE_VERTEX").astype(int)[:, 0]
        linear = colours[:, :3] / 65535
        back = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
        return np.array_equal(np.rint(255 * back), shades[source])

    return Planted("colours", r"\bvertex colours\b", {".ply": in_ply, ".glb": in_glb, **further})


def make_ply(rng: Random, vertices: np.ndarray, faces: np.ndarray) -> Made:
    properties = PlyProperties.random(rng, len(vertices), len(faces))
    planted = chosen_attributes(rng, properties.attributes(faces))
    names = {attribute.name for attribute in planted}
    if "colours" in names and rng.random() < 0.5:
        planted.append(properties.alpha_attribute())
        names.add("alpha")
    form = str(rng.choice(["ascii", "binary_little_endian", "binary_big_endian"]))
    columns = properties.vertex_columns(vertices, names)
    on_faces = [(word, name, x) for name, (word, x) in properties.of_face.items() if f"face {name}" in names]
    head = ply_header(form, len(vertices), len(faces), columns, on_faces, names)
    return head + ply_body(form, ply_rows(faces, columns, on_faces, names)), planted


#: The type, the name and the values of a property.
Column = tuple[str, str, np.ndarray]


@dataclass(frozen=True)
class PlyProperties:
    """Random properties of a PLY file.

    Attributes:
        shades: (n, 3) colours of the vertices.
        alpha: (n,) their opacity.
        of_vertex, of_face: type and values of further properties by name.
    """

    shades: np.ndarray
    alpha: np.ndarray
    of_vertex: Mapping[str, tuple[str, np.ndarray]]
    of_face: Mapping[str, tuple[str, np.ndarray]]

    @classmethod
    def random(cls, rng: Random, n: int, m: int) -> PlyProperties:
        """Return properties of n vertices and m faces."""
        return cls(
            rng.integers(0, 256, (n, 3)),
            rng.integers(0, 256, n),
            {
                "quality": ("float", rng.normal(size=n).astype("f4")),
                "label": ("int", rng.integers(-(2**31), 2**31, n)),
                "weight": ("double", rng.normal(size=n)),
                "small": ("uchar", rng.integers(0, 256, n)),
            },
            {
                "texnumber": ("int", rng.integers(0, 4, m)),
                "red": ("uchar", rng.integers(0, 256, m)),
                "area": ("float", rng.random(m).astype("f4")),
                "segment": ("short", rng.integers(-(2**15), 2**15, m)),
            },
        )

    def attributes(self, faces: np.ndarray) -> list[Planted]:
        """Return all data that a file may have in addition to the mesh."""
        of_vertex = [
            Planted(
                name, rf"vertex properties \([^)]*\b{name}\b", {".ply": _vertex_check(name, word, values)}
            )
            for name, (word, values) in self.of_vertex.items()
        ]
        of_face = [
            Planted(
                f"face {name}",
                rf"face properties \([^)]*\b{name}\b",
                {".ply": _face_check(name, values, faces)},
            )
            for name, (_, values) in self.of_face.items()
        ]
        comment = {".ply": _has(rb"^comment TextureFile skin.png$")}
        return [
            _colours(self.shades, {}),
            *of_vertex,
            *of_face,
            Planted("textures", r"texture files \([^)]*skin\.png", comment),
            Planted("edges", r"elements \([^)]*\bedge\b"),
            Planted("vertex lists", r"vertex properties \([^)]*\bnear\b"),
            Planted("face lists", r"face properties \([^)]*\bcurve\b"),
        ]

    def alpha_attribute(self) -> Planted:
        """Return the opacity of the colours."""
        checks = {".ply": _vertex_check("alpha", "uchar", self.alpha), ".glb": _alpha_in_glb(self.alpha)}
        return Planted("alpha", r"vertex properties \([^)]*\balpha\b", checks)

    def vertex_columns(self, vertices: np.ndarray, names: set[str]) -> list[Column]:
        """Return the columns of the vertices: their positions and the chosen properties."""
        columns: list[Column] = [("double", axis, vertices[:, i]) for i, axis in enumerate("xyz")]
        if "colours" in names:
            columns += [("uchar", name, self.shades[:, i]) for i, name in enumerate(("red", "green", "blue"))]
        columns += [("uchar", "alpha", self.alpha)] * ("alpha" in names)
        return columns + [(word, name, x) for name, (word, x) in self.of_vertex.items() if name in names]


def ply_header(
    form: str, n: int, m: int, columns: list[Column], on_faces: list[Column], names: set[str]
) -> bytes:
    """Return the header of a PLY file with the chosen data."""
    lines = ["ply", f"format {form} 1.0", *["comment TextureFile skin.png"] * ("textures" in names)]
    lines += [f"element vertex {n}", *(f"property {word} {name}" for word, name, _ in columns)]
    lines += ["property list uchar int near"] * ("vertex lists" in names)
    lines += [f"element face {m}", "property list uchar int vertex_indices"]
    lines += [f"property {word} {name}" for word, name, _ in on_faces]
    lines += ["property list uchar float curve"] * ("face lists" in names)
    lines += ["element edge 1", "property int vertex1", "property int vertex2"] if "edges" in names else []
    return ("\n".join([*lines, "end_header"]) + "\n").encode()


def ply_rows(
    faces: np.ndarray, columns: list[Column], on_faces: list[Column], names: set[str]
) -> list[list[tuple[str, Any]]]:
    """Return the rows of vertices, faces and edges: each value with its type."""
    rows: list[list[tuple[str, Any]]] = []
    for i in range(len(columns[0][2])):
        rows.append([(word, values[i]) for word, _, values in columns])
        rows[-1] += [("uchar", 2), ("int", 0), ("int", 1)] if "vertex lists" in names else []
    for i, face in enumerate(faces.tolist()):
        rows.append(
            [("uchar", 3), *(("int", v) for v in face), *((word, values[i]) for word, _, values in on_faces)]
        )
        rows[-1] += [("uchar", 1), ("float", 0.5)] if "face lists" in names else []
    return rows + [[("int", 0), ("int", 1)]] * ("edges" in names)


def ply_body(form: str, rows: list[list[tuple[str, Any]]]) -> bytes:
    """Return the rows of a PLY file as text, or in binary."""
    if form == "ascii":
        return "".join(
            " ".join(repr(value.item() if hasattr(value, "item") else value) for _, value in row) + "\n"
            for row in rows
        ).encode()
    order = "<" if "little" in form else ">"
    return b"".join(
        struct.pack(order + "".join(CODES[word] for word, _ in row), *(value for _, value in row))
        for row in rows
    )


CODES = {"uchar": "B", "short": "h", "int": "i", "float": "f", "double": "d"}


def _vertex_check(name: str, word: str, values: np.ndarray) -> Check:
    def check(path: Path) -> bool:
        rows = read_ply(path)[0]
        kind = np.dtype(CODES[word]).itemsize
        return rows[name].itemsize == kind and np.array_equal(rows[name], values[rows["source_vertex"]])

    return check


def _alpha_in_glb(alpha: np.ndarray) -> Check:
    def check(path: Path) -> bool:
        source = glb_rows(path, "_SOURCE_VERTEX").astype(int)[:, 0]
        return np.array_equal(np.rint(glb_rows(path, "COLOR_0")[:, 3] / 257), alpha[source])

    return check


def _face_check(name: str, values: np.ndarray, faces: np.ndarray) -> Check:
    def check(path: Path) -> bool:
        vertices, triangles = read_ply(path)
        number = {frozenset(face): i for i, face in enumerate(faces.tolist())}
        corners = vertices["source_vertex"][triangles["vertex_indices"]].tolist()
        return np.array_equal(triangles[name], values[[number[frozenset(three)] for three in corners]])

    return check


def read_ply(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows of the vertices and of the triangles of a binary little-endian PLY."""
    head, _, body = path.read_bytes().partition(b"end_header\n")
    kinds: list[list[tuple[Any, ...]]] = []
    counts = []
    for line in head.decode("latin-1").splitlines():
        words = line.split()
        if words[0] == "element":
            counts.append(int(words[2]))
            kinds.append([])
        elif words[:2] == ["property", "list"]:
            kinds[-1] += [("count", f"<{CODES[words[2]]}"), (words[4], f"<{CODES[words[3]]}", 3)]
        elif words[0] == "property":
            kinds[-1].append((words[2], f"<{CODES[words[1]]}"))
    vertices = np.frombuffer(body, np.dtype(kinds[0]), counts[0])
    triangles = np.frombuffer(body, np.dtype(kinds[1]), counts[1], vertices.nbytes)
    if vertices.nbytes + triangles.nbytes != len(body) or (triangles["count"] != 3).any():
        raise ValueError("the file does not have what its header declares")
    return vertices, triangles


def glb_rows(path: Path, name: str) -> np.ndarray:
    """Return the rows of an attribute of the first primitive of a GLB."""
    tree, accessor, _ = gltf_scenes.opened(path.read_bytes())
    return np.asarray(accessor(tree["meshes"][0]["primitives"][0]["attributes"][name]))


def make_off(rng: Random, vertices: np.ndarray, faces: np.ndarray) -> Made:
    shades = rng.integers(0, 256, (len(vertices), 3))
    planted = chosen_attributes(rng, [_colours(shades, {}), Planted("face colours", r"\bface colours\b")])
    names = {attribute.name for attribute in planted}
    lines = ["COFF" if "colours" in names else "OFF", f"{len(vertices)} {len(faces)} 0"]
    for (x, y, z), shade in zip(vertices.tolist(), shades.tolist(), strict=True):
        lines.append(f"{x!r} {y!r} {z!r}" + (" {} {} {} 255".format(*shade) if "colours" in names else ""))
    lines += ["3 {} {} {}".format(*face) + " 9 8 7" * ("face colours" in names) for face in faces.tolist()]
    return ("\n".join(lines) + "\n").encode(), planted


def make_stl(rng: Random, vertices: np.ndarray, faces: np.ndarray) -> Made:
    corners = vertices[faces]
    if rng.random() < 0.5:
        facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        rows = np.zeros(len(corners), facet)
        rows["corners"], rows["attribute"] = corners, 77
        content = bytes(80) + struct.pack("<I", len(rows)) + rows.tobytes()
        return content, [Planted("facet colours", "attributes of facets")]
    lines = ["solid left arm"]
    for corner_points in corners.tolist():
        lines += [
            "facet normal 0 0 0",
            "outer loop",
            *("vertex {!r} {!r} {!r}".format(*p) for p in corner_points),
        ]
        lines += ["endloop", "endfacet"]
    return ("\n".join([*lines, "endsolid left arm"]) + "\n").encode(), [
        Planted("names of solids", r"\bsolids\b")
    ]


#: Data of a glTF file that are not arrays of vertices, and the words of a note that names them.
GLTF_DATA = {
    "materials": r"\bmaterials\b",
    "cameras": r"\bcameras\b",
    "extras": r"\bextras\b",
    "morph targets": r"\bmorph targets\b",
    "lines": r"\blines and points\b",
    "nodes": r"\bnodes\b",
    "extension": r"extensions \([^)]*KHR_lights_punctual",
    "animations": r"\banimations\b",
}


def make_glb(rng: Random, vertices: np.ndarray, faces: np.ndarray) -> Made:
    make, points = gltf_scenes.SceneMaker(), vertices.astype("<f4")
    arrays = random_arrays(rng, len(vertices))
    of_vertex = [
        Planted(name, rf"vertex attributes \([^)]*\b{name}\b", {".glb": _glb_check(name, points, array[0])})
        for name, array in arrays.items()
    ]
    of_file = [Planted(name, words, {".glb": _TREE_CHECKS[name]}) for name, words in GLTF_DATA.items()]
    planted = chosen_attributes(rng, [*of_vertex, *of_file])
    names = {attribute.name for attribute in planted}
    primitive: dict[str, Any] = {
        "attributes": {"POSITION": make.accessor(points)},
        "indices": make.accessor(faces.ravel(), 5125),
    }
    for name, (values, code, options) in arrays.items():
        if name in names:
            primitive["attributes"][name] = make.accessor(values, code, **options)
    add_primitive_data(rng, make, primitive, names, len(vertices))
    primitives = [primitive]
    if "lines" in names:
        primitives.append(
            {"attributes": dict(primitive["attributes"]), "indices": make.accessor([0, 1], 5121), "mode": 1}
        )
    add_scene_data(make, names)
    make.tree["meshes"] = [{"primitives": primitives}]
    return make.glb(), planted


def random_arrays(rng: Random, n: int) -> dict[str, tuple[np.ndarray, int, dict[str, Any]]]:
    """Return attributes of n vertices: values, the code of their type, and properties of the accessor."""
    return {
        "TEXCOORD_1": (rng.random((n, 2)), 5126, {}),
        "COLOR_0": (rng.integers(0, 256, (n, 4)), 5121, {"normalized": True}),
        "COLOR_1": (rng.random((n, 3)), 5126, {}),
        "JOINTS_0": (np.zeros((n, 4)), 5121, {}),
        "WEIGHTS_0": (np.tile([1.0, 0, 0, 0], (n, 1)), 5126, {}),
        "_HEAT": (rng.random((n, 1)), 5126, {}),
    }


def add_primitive_data(
    rng: Random, make: gltf_scenes.SceneMaker, primitive: dict[str, Any], names: set[str], n: int
) -> None:
    """Add those of `GLTF_DATA` that belong to a primitive of n vertices."""
    if "materials" in names:
        paint = {"name": "paint", "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}}
        make.tree["materials"] = [paint]
        primitive["material"] = 0
    if "extras" in names:
        primitive["extras"] = {"part": 7}
    if "morph targets" in names:
        primitive["targets"] = [{"POSITION": make.accessor(rng.normal(size=(n, 3)))}]


def add_scene_data(make: gltf_scenes.SceneMaker, names: set[str]) -> None:
    """Add a scene, and those of `GLTF_DATA` that belong to it."""
    nodes: list[dict[str, Any]] = [{"mesh": 0, "name": "thing"}]
    if "cameras" in names:
        make.tree["cameras"] = [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.01}}]
    if "nodes" in names:
        nodes = [{"name": "root", "children": [1]}, {**nodes[0], "translation": [1.0, 2, 3]}]
    if "extension" in names:
        make.tree |= {"extensionsUsed": ["KHR_lights_punctual"]}
        make.tree |= {"extensions": {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}}
    if "animations" in names:
        times, turns = make.accessor([0.0, 1.0]), make.accessor([[0.0, 0, 0, 1], [0, 0, 1, 0]])
        channel = {"sampler": 0, "target": {"node": 0, "path": "rotation"}}
        make.tree["animations"] = [{"channels": [channel], "samplers": [{"input": times, "output": turns}]}]
    make.tree |= {"scene": 0, "scenes": [{"nodes": [0]}], "nodes": nodes}


def make_gltf(rng: Random, vertices: np.ndarray, faces: np.ndarray) -> Made:
    content, planted = make_glb(rng, vertices, faces)
    length = struct.unpack_from("<I", content, 12)[0]
    tree, binary = json.loads(content[20 : 20 + length]), content[28 + length :]
    tree["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(binary).decode()
    return json.dumps(tree).encode(), planted


def _glb_check(name: str, points: np.ndarray, values: np.ndarray) -> Check:
    values_at = {tuple(point): row for point, row in zip(points.tolist(), values.tolist(), strict=True)}

    def check(path: Path) -> bool:
        rows = glb_rows(path, name)
        expected = np.array([values_at[tuple(point)] for point in glb_rows(path, "POSITION").tolist()])
        return np.array_equal(rows, expected.astype(rows.dtype))

    return check


def _tree(test: Callable[[dict[str, Any]], Any]) -> Check:
    return lambda path: bool(test(gltf_scenes.opened(path.read_bytes())[0]))


def _has_paint(tree: dict[str, Any]) -> bool:
    (name,) = {
        tree["materials"][primitive["material"]]["name"] for primitive in tree["meshes"][0]["primitives"][:1]
    }
    return name == "paint"


_TREE_CHECKS: dict[str, Check] = {
    "materials": _tree(_has_paint),
    "cameras": _tree(lambda tree: tree["cameras"][0]["perspective"]["yfov"] == 0.7),
    "extras": _tree(lambda tree: tree["meshes"][0]["primitives"][0]["extras"] == {"part": 7}),
    "morph targets": _tree(lambda tree: len(tree["meshes"][0]["primitives"][0]["targets"]) == 1),
    "lines": _tree(lambda tree: [part.get("mode") for part in tree["meshes"][0]["primitives"]][1:] == [1]),
    "nodes": _tree(lambda tree: tree["nodes"][1]["translation"] == [1, 2, 3]),
    "extension": _tree(
        lambda tree: tree["extensions"]["KHR_lights_punctual"]["lights"] == [{"type": "point"}]
    ),
    "animations": _tree(lambda tree: tree["animations"][0]["channels"][0]["target"]["path"] == "rotation"),
}


def make_gii(rng: Random, vertices: np.ndarray, faces: np.ndarray) -> Made:
    import nibabel

    gifti = nibabel.gifti
    meta = {"AnatomicalStructurePrimary": "CortexLeft", "AnatomicalStructureSecondary": "MidThickness"}
    planted = chosen_attributes(rng, [Planted(name, rf"metadata \([^)]*\b{name}\b") for name in meta])
    chosen = gifti.GiftiMetaData({attribute.name: meta[attribute.name] for attribute in planted})
    image = nibabel.GiftiImage()
    for values, intent, kind, options in (
        (vertices, "POINTSET", np.float32, {"meta": chosen}),
        (faces, "TRIANGLE", np.int32, {}),
    ):
        code = f"NIFTI_INTENT_{intent}"
        image.add_gifti_data_array(
            gifti.GiftiDataArray(values.astype(kind), intent=code, datatype=kind, **options)
        )
    return image.to_bytes(), planted


MAKERS: dict[str, Callable[[Random, np.ndarray, np.ndarray], Made]] = {
    ".obj": make_obj,
    ".ply": make_ply,
    ".off": make_off,
    ".stl": make_stl,
    ".glb": make_glb,
    ".gltf": make_gltf,
    ".gii": make_gii,
}
