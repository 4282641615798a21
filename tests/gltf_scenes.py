"""A glTF scene with most of what such scenes may have, and a reader of them by the specification."""

from __future__ import annotations

import json
import struct
from io import BytesIO
from typing import Any

import numpy as np
from shapes import sphere

FORMS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
PNG = b"\x89PNG\r\n\x1a\n" + bytes(range(41))


class SceneMaker:
    """A tree of glTF, and a buffer."""

    def __init__(self):
        self.tree: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "accessors": [],
            "bufferViews": [],
            "buffers": [{}],
        }
        self.binary = bytearray()

    def view(self, content, **properties):
        self.binary += bytes(-len(self.binary) % 4)
        start = len(self.binary)
        self.binary += content
        self.tree["bufferViews"].append(
            {"buffer": 0, "byteOffset": start, "byteLength": len(content), **properties}
        )
        return len(self.tree["bufferViews"]) - 1

    def accessor(self, values, code=5126, kind=None, **properties):
        values = np.asarray(values).astype(FORMS[code])
        values = values.reshape(len(values), -1)
        kind = kind or {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}[values.shape[1]]
        size = values.shape[1] * values.itemsize
        content = np.pad(values.view("u1").reshape(len(values), size), ((0, 0), (0, -size % 4)))
        stride = {"byteStride": content.shape[1]} if size % 4 else {}
        view = self.view(content.tobytes(), **stride)
        item = {"bufferView": view, "componentType": code, "count": len(values), "type": kind, **properties}
        if kind == "VEC3" and code == 5126:
            item |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        self.tree["accessors"].append(item)
        return len(self.tree["accessors"]) - 1

    def glb(self):
        self.tree["buffers"][0] = {"byteLength": len(self.binary)}
        text = json.dumps(self.tree).encode()
        text += b" " * (-len(text) % 4)
        binary = bytes(self.binary) + bytes(-len(self.binary) % 4)
        total = 12 + 8 + len(text) + 8 + len(binary)
        head = struct.pack("<4sII", b"glTF", 2, total) + struct.pack("<I4s", len(text), b"JSON")
        return head + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary


def rich_scene():
    """Return the GLB of a skinned, morphing ball of two materials, a mirrored copy of another, and lines."""
    make = SceneMaker()
    rng = np.random.default_rng(5)
    vertices, faces = sphere(1)
    count = len(vertices)
    top = vertices[faces].mean(axis=1)[:, 2] > 0
    position = make.accessor(vertices)
    attributes = {
        "POSITION": position,
        "NORMAL": make.accessor(vertices / np.linalg.norm(vertices, axis=1, keepdims=True)),
        "TANGENT": make.accessor(rng.normal(size=(count, 4))),
        "TEXCOORD_0": make.accessor(rng.random((count, 2))),
        "TEXCOORD_1": make.accessor(rng.integers(0, 65536, (count, 2)), 5123, normalized=True),
        "COLOR_0": make.accessor(rng.integers(0, 256, (count, 3)), 5121, normalized=True),
        "JOINTS_0": make.accessor(np.zeros((count, 4)), 5121),
        "WEIGHTS_0": make.accessor(np.tile([1.0, 0, 0, 0], (count, 1))),
        "_HEAT": make.accessor(rng.random(count)),
    }
    moved = make.accessor(rng.normal(size=(count, 3)))
    # Some vertices alone are moved, by a sparse array.
    where, replacement = (
        make.view(np.array([1, 3], "<u2").tobytes()),
        make.view(np.ones((2, 3), "<f4").tobytes()),
    )
    sparse = {
        "count": 2,
        "indices": {"bufferView": where, "componentType": 5123},
        "values": {"bufferView": replacement},
    }
    make.tree["accessors"].append({"componentType": 5126, "count": count, "type": "VEC3", "sparse": sparse})
    targets = [{"POSITION": moved}, {"POSITION": len(make.tree["accessors"]) - 1}]
    ball = [
        {
            "attributes": attributes,
            "indices": make.accessor(faces[part].ravel(), 5123),
            "material": material,
            "targets": targets,
            "extras": {"part": material},
        }
        for material, part in enumerate((top, ~top))
    ]
    lines = {"attributes": {"POSITION": position}, "indices": make.accessor(np.arange(8), 5121), "mode": 1}
    strip = np.array([[x, y, 0.1 * x * y] for x in range(5) for y in range(2)], dtype=float)
    ribbon = [{"attributes": {"POSITION": make.accessor(strip)}, "mode": 5}]
    matrices, times = make.accessor(np.eye(4).reshape(1, 16)), make.accessor([0.0, 1.0])
    turns = make.accessor([[0.0, 0, 0, 1], [0, 0, 1, 0]])
    make.tree |= {
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_ior"],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point"}]}},
        "extras": {"made": "by hand"},
        "scene": 0,
        "scenes": [{"name": "stage", "nodes": [0, 3]}],
        "nodes": [
            {"name": "root", "children": [1, 2, 4], "rotation": [0, 0, 0.6, 0.8], "extras": {"id": 7}},
            {"name": "ball", "mesh": 0, "skin": 0, "translation": [3, 0, 0], "weights": [0.5, 0]},
            {"name": "ribbon", "mesh": 1, "scale": [1, -2, 1]},
            {"name": "lamp", "extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"name": "again", "mesh": 1, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]},
        ],
        "meshes": [
            {"name": "body", "primitives": [*ball, lines], "weights": [0, 0], "extras": {"targetNames": ["a", "b"]}},
            {"name": "strip", "primitives": ribbon},
        ],
        "materials": [
            {
                "name": "upper",
                "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
                "extensions": {"KHR_materials_ior": {"ior": 1.4}},
            },
            {"name": "lower", "doubleSided": True, "normalTexture": {"index": 0, "texCoord": 1}},
        ],
        "images": [{"bufferView": make.view(PNG), "mimeType": "image/png", "name": "skin"}],
        "samplers": [{"wrapS": 33071}],
        "textures": [{"source": 0, "sampler": 0}],
        "skins": [{"joints": [0], "inverseBindMatrices": matrices}],
        "animations": [
            {
                "channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}],
                "samplers": [{"input": times, "output": turns}],
            }
        ],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.01}}],
    }  # fmt: skip
    return make.glb()


def opened(content):
    """Return the tree and a reader of accessors and one of views, by the letter of the specification."""
    length = struct.unpack_from("<I", content, 12)[0]
    tree = json.loads(content[20 : 20 + length])
    binary = content[28 + length :]
    assert len(content) == struct.unpack_from("<I", content, 8)[0]
    assert tree["buffers"][0]["byteLength"] <= len(binary)

    def view(i):
        item = tree["bufferViews"][i]
        start = item.get("byteOffset", 0)
        assert start + item["byteLength"] <= len(binary)
        return binary[start : start + item["byteLength"]]

    def rows(part, count, code, width, stride=None):
        form = np.dtype(FORMS[code])
        stride = stride or width * form.itemsize
        return np.array(
            [
                np.frombuffer(view(part["bufferView"]), form, width, part.get("byteOffset", 0) + k * stride)
                for k in range(count)
            ]
        )

    def accessor(i):
        item = tree["accessors"][i]
        code, width = item["componentType"], WIDTHS[item["type"]]
        if "bufferView" in item:
            stride = tree["bufferViews"][item["bufferView"]].get("byteStride")
            values = rows(item, item["count"], code, width, stride)
        else:
            values = np.zeros((item["count"], width), FORMS[code])
        if "sparse" in item:
            sparse = item["sparse"]
            where = rows(sparse["indices"], sparse["count"], sparse["indices"]["componentType"], 1)
            values[where.ravel()] = rows(sparse["values"], sparse["count"], code, width)
        if "min" in item:
            np.testing.assert_array_equal(values.min(axis=0), np.array(item["min"], values.dtype))
            np.testing.assert_array_equal(values.max(axis=0), np.array(item["max"], values.dtype))
        return values

    return tree, accessor, view


def corners_of(tree, accessor, primitive):
    """Return the vertices at the corners of a primitive of triangles or a strip."""
    count = tree["accessors"][primitive["attributes"]["POSITION"]]["count"]
    order = accessor(primitive["indices"]).ravel() if "indices" in primitive else np.arange(count)
    if primitive.get("mode", 4) == 4:
        return order.astype(int)
    assert primitive["mode"] == 5
    return np.concatenate([order[[i, i + 1 + i % 2, i + 2 - i % 2]] for i in range(len(order) - 2)])


def coloured_ball(size=(4, 2), image=None, slot=None):
    """Return a GLB of a ball whose texture is red where x > 0 and green elsewhere, and of a plain triangle."""
    from PIL import Image
    from shapes import sphere

    vertices, faces = sphere(3)
    corners = vertices[faces].reshape(-1, 3)
    is_red = np.repeat(vertices[faces].mean(axis=1)[:, 0] > 0, 3)
    uv = np.stack([np.where(is_red, 0.25, 0.75), np.full(len(corners), 0.5)], axis=1)
    stream, pixels = BytesIO(), np.zeros((size[1], size[0], 3), np.uint8)
    pixels[:, : size[0] // 2, 0] = pixels[:, size[0] // 2 :, 1] = 255
    Image.fromarray(pixels).save(stream, format="PNG")
    make = SceneMaker()
    content = stream.getvalue() if image is None else image
    make.tree |= {
        "images": [{"bufferView": make.view(content), "mimeType": "image/png"}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": slot or {"index": 0}}}, {}],
    }
    ball = {
        "attributes": {
            "POSITION": make.accessor(corners),
            "TEXCOORD_0": make.accessor(uv + np.array([1, 0])),
        },
        "material": 0,
    }
    plain = {"attributes": {"POSITION": make.accessor([[3.0, 0, 0], [4, 0, 0], [3, 1, 0]])}, "material": 1}
    make.tree |= {
        "meshes": [{"primitives": [plain, ball]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
    return make.glb()
