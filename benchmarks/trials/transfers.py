"""Cases of `transfer` and `measure`: textured squares in every format, compared with a slow sampler of this benchmark.

A model is a row of squares, each with a material and a rectangle of UVs on a grid of quarters. So the colour of every
texel of the target, and the area that each texture covers, follow from the definitions of the formats.
"""

from __future__ import annotations

import json
import math
import os
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from gltf_scenes import SceneMaker, opened

from .files import damaged_bytes, damaged_scene
from .outcome import Outcome

Random = np.random.Generator

REPEAT, MIRRORED, CLAMP, NEAREST, LINEAR = 10497, 33648, 33071, 9728, 9729
#: Largest difference of 8-bit values: rounding of 32-bit images.
TOLERANCE = 1
#: Displacement of points of images that are not interpolated, where rounding decides between two pixels.
NUDGE = 1e-5


@dataclass
class Material:
    """The material of a square, with all that a format may say of it.

    Attributes:
        image: number of its image; None for none.
        colour: RGBA factor, linear.
        wraps, is_nearest: of its texture.
        offset, rotation, scale: of UVs with v downwards.
    """

    image: int | None
    colour: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0)
    wraps: tuple[int, int] = (REPEAT, REPEAT)
    is_nearest: bool = False
    offset: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)


@dataclass
class Row:
    """A row of squares: corners x, y of square k are at k to k + 1 and 0 to 1.

    Attributes:
        materials: all of them.
        squares: the material of each.
        boxes: u, v, width and height of each, in quarters, v downwards; negative widths mirror.
        tints: linear RGBA of the vertices of each, if there are vertex colours.
    """

    materials: list[Material]
    squares: list[int]
    boxes: list[tuple[int, int, int, int]]
    tints: list[tuple[float, ...]] = field(default_factory=list)

    def uv(self, square: int, x: float, y: float) -> tuple[float, float]:
        """Return the UV, v downwards, at a place of a square."""
        u, v, width, height = self.boxes[square]
        return (u + width * x) / 4, (v + height * (1 - y)) / 4


def transfer_case(rng: Random, outcome: Outcome) -> None:
    """Bake a row of squares into a square texture, and measure its UVs."""
    kind = str(rng.choice(["glb", "obj", "ply"]))
    images = [_image(rng) for _ in range(int(rng.integers(1, 4)))]
    row = _row(rng, kind, len(images))
    side = int(rng.integers(2, 14))
    files = [f"image {number}.png" for number in range(len(images))]
    for (picture, _), name in zip(images, files, strict=True):
        picture.save(name)
    path = {"glb": _write_glb, "obj": _write_obj, "ply": _write_ply}[kind](rng, row, files)
    outcome.recipe = f"transfer .{kind} of {[image[0].mode for image in images]} to {side} texels: {row}"
    if rng.random() < 0.3:
        _try_damaged(rng, outcome, path)
        return
    _check_colours(outcome, row, [pixels for _, pixels in images], path, side)
    _check_measures(outcome, row, path)


def _try_damaged(rng: Random, outcome: Outcome, path: Path) -> None:
    """Bake and measure a model whose file, library, image or scene is damaged: that may be refused."""
    import coneflat
    from coneflat.apps.transfer import transfer

    names = sorted(name for name in os.listdir() if name.endswith((path.suffix, ".png", ".mtl")))
    broken = Path(str(rng.choice(names)))
    if broken.suffix == ".glb" and rng.random() < 0.8:
        tree, _, _ = opened(broken.read_bytes())
        content = broken.read_bytes()
        length = int.from_bytes(content[12:16], "little")
        text = json.dumps(damaged_scene(rng, tree)).encode()
        text += b" " * (-len(text) % 4)
        size = len(content) - length + len(text)
        head = (
            b"glTF" + (2).to_bytes(4, "little") + size.to_bytes(4, "little") + len(text).to_bytes(4, "little")
        )
        broken.write_bytes(head + content[16:20] + text + content[20 + length :])
    else:
        broken.write_bytes(damaged_bytes(rng, broken.read_bytes()))
    outcome.recipe += f"; {broken} is damaged"
    Path("new.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n")
    with outcome.guarded("damaged: ", expects_nan=True):
        transfer(path, "new.obj", resolution=4).save("out.glb")
    with outcome.guarded("damaged: ", expects_nan=True):
        coneflat.measure_uv(path)


def _image(rng: Random) -> tuple[Any, np.ndarray]:
    """Return a small image of Pillow of any bit depth, and its (h, w, 4) pixels."""
    from PIL import Image

    shape = tuple(rng.integers(1, 6, 2).tolist())
    mode = str(rng.choice(["1", "L", "LA", "P", "RGB", "RGBA", "I;16"]))
    grey, pixels = rng.integers(0, 256, shape), rng.integers(0, 256, (*shape, 4))
    if mode in ("1", "L", "LA", "I;16"):
        pixels[..., :3] = grey[..., None]
    if mode == "1":
        pixels[..., :3] = np.where(pixels[..., :3] > 127, 255, 0)
    if mode not in ("LA", "RGBA"):
        pixels[..., 3] = 255
    eight = pixels.astype(np.uint8)
    if mode == "I;16":
        values = rng.integers(0, 65536, shape).astype(np.uint16)
        pixels[..., :3] = np.round(values / 257)[..., None]
        return Image.fromarray(values), pixels.astype(np.uint8)
    if mode == "P":
        picture = Image.new("P", shape[::-1])
        picture.putpalette(eight[..., :3].reshape(-1).tolist())
        picture.putdata(list(range(shape[0] * shape[1])))
        return picture, eight
    if mode == "LA":
        return Image.merge("LA", [Image.fromarray(eight[..., i]) for i in (0, 3)]), eight
    image = Image.fromarray(eight)
    return (image if mode == "RGBA" else image.convert("RGB").convert(mode)), eight


def _row(rng: Random, kind: str, images: int) -> Row:
    """Return a row of squares that a format can store."""
    materials = []
    for _ in range(int(rng.integers(1, 4))):
        material = Material(None if rng.random() < 0.25 else int(rng.integers(images)))
        if kind != "ply" and rng.random() < 0.5:
            material.colour = tuple(np.round(rng.random(4), 3).tolist())
        if kind == "glb":
            material.wraps = tuple(rng.choice([REPEAT, MIRRORED, CLAMP], 2).tolist())
            material.is_nearest = bool(rng.random() < 0.3)
        if kind == "obj" and rng.random() < 0.3:
            material.wraps = (CLAMP, CLAMP)
        if kind != "ply" and rng.random() < 0.4:
            material.offset = tuple(np.round(rng.uniform(-2, 2, 2), 3).tolist())
            material.scale = tuple(np.round(rng.uniform(-3, 3, 2), 3).tolist())
            material.rotation = float(rng.uniform(-4, 4)) if kind == "glb" else 0.0
        materials.append(material)
    count = int(rng.integers(1, 5))
    reach = 4 if rng.random() < 0.5 else 12
    boxes = [
        (
            *rng.integers(-reach, reach, 2).tolist(),
            *(rng.choice([-1, 1], 2) * rng.integers(1, reach + 1, 2)).tolist(),
        )
        for _ in range(count)
    ]
    tints = (
        [tuple((rng.integers(0, 256, 4) / 255).tolist()) for _ in range(count)] if rng.random() < 0.3 else []
    )
    return Row(materials, rng.integers(0, len(materials), count).tolist(), boxes, tints)


def _corners(square: int) -> list[tuple[int, int]]:
    return [(square, 0), (square + 1, 0), (square + 1, 1), (square, 1)]


def _gltf_materials(rng: Random, row: Row) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return the materials and the textures of a row; some materials are of specular-glossiness."""
    textures: list[dict[str, Any]] = []
    materials: list[dict[str, Any]] = []
    for painted in row.materials:
        surface: dict[str, Any] = {"baseColorFactor": list(painted.colour)}
        if painted.image is not None:
            transform = {
                "offset": list(painted.offset),
                "rotation": painted.rotation,
                "scale": list(painted.scale),
            }
            surface["baseColorTexture"] = {
                "index": len(textures),
                "extensions": {"KHR_texture_transform": transform},
            }
            textures.append({"source": painted.image, "sampler": len(textures)})
        item: dict[str, Any] = {"pbrMetallicRoughness": surface}
        if rng.random() < 0.3:
            named = {"diffuseFactor": surface["baseColorFactor"]}
            if painted.image is not None:
                named["diffuseTexture"] = surface["baseColorTexture"]
            item = {"extensions": {"KHR_materials_pbrSpecularGlossiness": named}}
        materials.append(item)
    return materials, textures


def _write_glb(rng: Random, row: Row, files: list[str]) -> Path:
    make, primitives = SceneMaker(), []
    materials, textures = _gltf_materials(rng, row)
    for square, material in enumerate(row.squares):
        points = np.array([(*corner, 0) for corner in _corners(square)], float)
        uv = np.array([row.uv(square, x - square, y) for x, y in _corners(square)])
        attributes = {"POSITION": make.accessor(points), "TEXCOORD_0": make.accessor(uv)}
        if row.tints:
            attributes["COLOR_0"] = make.accessor(np.tile(row.tints[square], (4, 1)))
        indices = make.accessor([0, 1, 2, 0, 2, 3], 5125)
        primitives.append({"attributes": attributes, "indices": indices, "material": material})
    textured = [painted for painted in row.materials if painted.image is not None]
    make.tree |= {
        "images": [
            {"bufferView": make.view(Path(name).read_bytes()), "mimeType": "image/png"} for name in files
        ],
        "samplers": [
            {
                "wrapS": painted.wraps[0],
                "wrapT": painted.wraps[1],
                "magFilter": NEAREST if painted.is_nearest else LINEAR,
            }
            for painted in textured
        ],
        "textures": textures,
        "materials": materials,
        "meshes": [{"primitives": primitives}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
    path = Path("old.glb")
    path.write_bytes(make.glb())
    return path


def _write_obj(rng: Random, row: Row, files: list[str]) -> Path:
    lines, library = ["mtllib the library.mtl"], []
    for number, painted in enumerate(row.materials):
        # The diffuse colour is in sRGB.
        library += [
            f"newmtl material {number}",
            "Kd " + " ".join(str(_to_srgb(c)) for c in painted.colour[:3]),
        ]
        library += [f"d {painted.colour[3]}"]
        if painted.image is not None:
            # v points upwards.
            up = 1 - painted.scale[1] - painted.offset[1]
            options = [f"-o {painted.offset[0]} {up!r}", f"-s {painted.scale[0]} {painted.scale[1]} 1"]
            options += ["-clamp on"] if painted.wraps[0] == CLAMP else []
            rng.shuffle(options)
            library += [f"map_Kd {' '.join(options)} {files[painted.image]}"]
    for square, material in enumerate(row.squares):
        tint = " " + " ".join(str(_to_srgb(c)) for c in row.tints[square][:3]) if row.tints else ""
        lines += [f"v {x} {y} 0{tint}" for x, y in _corners(square)]
        for x, y in _corners(square):
            u, v = row.uv(square, x - square, y)
            lines.append(f"vt {u} {1 - v}")
        lines += [
            f"usemtl material {material}",
            "f " + " ".join(f"{4 * square + i}/{4 * square + i}" for i in range(1, 5)),
        ]
    Path("the library.mtl").write_text("\n".join(library) + "\n")
    path = Path("old.obj")
    path.write_text("\n".join(lines) + "\n")
    return path


def _write_ply(rng: Random, row: Row, files: list[str]) -> Path:
    colours = (
        "".join(f"property uchar {name}\n" for name in ("red", "green", "blue", "alpha")) if row.tints else ""
    )
    header = "ply\nformat ascii 1.0\n" + "".join(f"comment TextureFile {name}\n" for name in files)
    header += f"element vertex {4 * len(row.squares)}\nproperty float x\nproperty float y\nproperty float z\n{colours}"
    header += f"element face {len(row.squares)}\nproperty list uchar int vertex_indices\n"
    header += "property list uchar float texcoord\nproperty int texnumber\nend_header\n"
    vertices, faces = [], []
    for square, material in enumerate(row.squares):
        shades = [round(255 * _to_srgb(c)) for c in row.tints[square][:3]] if row.tints else []
        alpha = [round(255 * row.tints[square][3])] if row.tints else []
        vertices += [[x, y, 0, *shades, *alpha] for x, y in _corners(square)]
        uv = [number for x, y in _corners(square) for number in _up(row.uv(square, x - square, y))]
        image = row.materials[material].image
        faces.append([4, *range(4 * square, 4 * square + 4), 8, *uv, -1 if image is None else image])
    path = Path("old.ply")
    path.write_text(header + "\n".join(" ".join(map(str, line)) for line in (*vertices, *faces)) + "\n")
    return path


def _up(uv: tuple[float, float]) -> tuple[float, float]:
    return uv[0], 1 - uv[1]


def _check_colours(outcome: Outcome, row: Row, images: list[np.ndarray], path: Path, side: int) -> None:
    """Compare the baked texture with the colours at the centres of its texels."""
    from coneflat.apps.transfer import transfer

    count = len(row.squares)
    lines = [f"v {x} {y} 0\nvt {x / count} {y}" for x, y in ((0, 0), (count, 0), (count, 1), (0, 1))]
    Path("new.obj").write_text("\n".join([*lines, "f 1/1 2/2 3/3 4/4", ""]))
    materials = [row.materials[number] for number in set(row.squares)]
    # A colour that is the same everywhere is not worth a texture, and vertex colours of an image are not shown.
    has_colours = (
        any(material.image is not None for material in materials)
        or len({material.colour for material in materials}) > 1
        or bool(row.tints)
    )
    baked = None
    with outcome.guarded():
        baked = transfer(path, "new.obj", resolution=side)
    if baked is None:
        if has_colours and outcome.message:
            outcome.breach("transfer: refused", outcome.message)
        return
    # Materials of specular-glossiness are not metallic, which is in an image if the others are.
    if not has_colours and path.suffix != ".glb":
        outcome.breach("transfer: a model without colours is baked")
    texels = baked.images["baseColorTexture"].astype(int)
    for line in range(side):
        for column in range(side):
            x, y = (column + 0.5) / side * count, 1 - (line + 0.5) / side
            square = int(x)
            if count > 1 and min(x - square, square + 1 - x) < 1e-9:
                continue
            choices = _expected(row, images, path.suffix, square, x - square, y)
            difference = min(np.abs(texels[line, column] - colour).max() for colour in choices)
            if difference > TOLERANCE:
                outcome.breach(
                    f"transfer: colours of {path.suffix}",
                    f"texel {line}, {column}: {texels[line, column]} instead of {choices[0]}",
                )
                return


def _expected(
    row: Row, images: list[np.ndarray], ending: str, square: int, x: float, y: float
) -> list[np.ndarray]:
    """Return the RGBA of 0 to 255 that a place may have: one, or at the border of pixels several."""
    material = row.materials[row.squares[square]]
    u, v = row.uv(square, x, y)
    colours = []
    for du, dv in (
        (0, 0),
        *((NUDGE * i, NUDGE * j) for i in (-1, 1) for j in (-1, 1) if material.is_nearest),
    ):
        linear = np.array(material.colour)
        if material.image is not None:
            cos, sin = math.cos(material.rotation), math.sin(material.rotation)
            p, q = u * material.scale[0], v * material.scale[1]
            at = (p * cos + q * sin + material.offset[0] + du, q * cos - p * sin + material.offset[1] + dv)
            linear = linear * _sample(images[material.image], *at, material)
        if row.tints:
            tint = np.array(row.tints[square])
            tint = tint if ending != ".obj" else np.append(tint[:3], 1.0)
            if ending == ".ply":
                tint = np.append([_to_linear(round(255 * _to_srgb(c)) / 255) for c in tint[:3]], tint[3])
            if ending == ".glb":
                linear = linear * tint
            elif material.image is None:
                linear = tint
        colours.append(np.array([*(255 * _to_srgb(c) for c in linear[:3]), 255 * linear[3]]))
    return colours


def _sample(pixels: np.ndarray, u: float, v: float, material: Material) -> np.ndarray:
    """Return the linear RGBA of an image at a point, v downwards: the mean of four pixels by their distances."""
    height, width = pixels.shape[:2]
    x, y = u * width, v * height
    if material.is_nearest:
        return _pixel(pixels, math.floor(x), math.floor(y), material)
    left, top = math.floor(x - 0.5), math.floor(y - 0.5)
    s, t = x - 0.5 - left, y - 0.5 - top
    upper = (1 - s) * _pixel(pixels, left, top, material) + s * _pixel(pixels, left + 1, top, material)
    lower = (1 - s) * _pixel(pixels, left, top + 1, material) + s * _pixel(
        pixels, left + 1, top + 1, material
    )
    return (1 - t) * upper + t * lower


def _pixel(pixels: np.ndarray, column: int, line: int, material: Material) -> np.ndarray:
    height, width = pixels.shape[:2]
    shade = (
        pixels[_wrapped(line, height, material.wraps[1]), _wrapped(column, width, material.wraps[0])] / 255
    )
    return np.array([*map(_to_linear, shade[:3]), shade[3]])


def _wrapped(place: int, size: int, wrap: int) -> int:
    """Return the pixel that an image shows at a place: step by step, as one would unfold a strip of paper."""
    if wrap == CLAMP:
        return min(max(place, 0), size - 1)
    tile, inside = divmod(place, size)
    return size - 1 - inside if wrap == MIRRORED and tile % 2 else inside


def _to_linear(value: float) -> float:
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def _to_srgb(value: float) -> float:
    return value * 12.92 if value <= 0.0031308 else 1.055 * value ** (1 / 2.4) - 0.055


def _check_measures(outcome: Outcome, row: Row, path: Path) -> None:
    """Compare the report with the cells of quarters that each texture covers."""
    import coneflat

    report = None
    with outcome.guarded("measure: "):
        report = coneflat.measure_uv(path).report()
    if report is None:
        return
    covered: Counter[tuple[int | None, int, int]] = Counter()
    for square, material in enumerate(row.squares):
        u, v, width, height = row.boxes[square]
        for i in range(min(u, u + width), max(u, u + width)):
            for j in range(min(v, v + height), max(v, v + height)):
                covered[row.materials[material].image, i, j] += 1
    area = len(covered) / 16
    expected = {
        "textures": len({image for image, _, _ in covered}),
        "overlap": sum(count > 1 for count in covered.values()) / len(covered),
        "packing_efficiency": area / report["tiles"],
    }
    for name, value in expected.items():
        if abs(report[name] - value) > 1e-6 * max(1.0, value):
            outcome.breach(f"measure: {name}", f"{report[name]} instead of {value}")
    if (report["overlapping_pairs"] > 0) != (expected["overlap"] > 0):
        outcome.breach("measure: pairs", report["overlapping_pairs"])
