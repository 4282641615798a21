"""Materials of mesh files, all in the form of glTF: of scenes, of OBJ libraries, and the images that PLY files name."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import IntArray
from ..base.text import list_some, plural
from ..errors import ConeflatError, MeshFileError
from .attributes import texture_files
from .colours import to_linear
from .files import read_bytes, readable
from .gltf.data import GltfData, Item
from .gltf.read import GltfScene
from .mesh_file import MeshFile
from .mtl import MtlMaterial, libraries_of, materials_of_polygons, parse_mtl, path_of_image
from .obj import ObjText

#: Wrap modes of glTF, and its filter without interpolation.
REPEAT, MIRRORED, CLAMP = 10497, 33648, 33071
NEAREST = 9728
#: Extensions of a glTF texture with an image of another format.
_IMAGE_EXTENSIONS = ("EXT_texture_webp", "EXT_texture_avif")
TRANSFORM = "KHR_texture_transform"
SPECULAR = "KHR_materials_pbrSpecularGlossiness"
#: A material without properties; that of glTF would be of metal.
PLAIN: Item = {"pbrMetallicRoughness": {"metallicFactor": 0.0}}
#: The properties of a material that refer to images, the most important one first.
SLOTS = (
    "baseColorTexture", "normalTexture", "metallicRoughnessTexture", "occlusionTexture", "emissiveTexture",
)  # fmt: skip


class ImageTexture(NamedTuple):
    """An image, and how it continues outside the unit square.

    Attributes:
        name: the image in messages.
        key: equal for textures of the same image.
        read: returns the content of the image file.
        wraps: the wrap modes in the directions of u and v, as in glTF.
        is_nearest: colours are those of the nearest pixel instead of interpolated.
    """

    name: str
    key: Hashable
    read: Callable[[], bytes]
    wraps: tuple[int, int] = (REPEAT, REPEAT)
    is_nearest: bool = False


@dataclass(frozen=True, eq=False)
class Materials:
    """The materials of a mesh file.

    Attributes:
        items: the materials as in glTF; the last one is that of polygons without a material.
        polygon: (p,) the material of each polygon.
        texture: returns the texture with an index, as materials refer to it; raises MeshFileError.
        notes: what is not read, one sentence each.
        unknown: names of materials that are in no library.
    """

    items: list[Item]
    polygon: IntArray
    texture: Callable[[Any], ImageTexture]
    notes: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()


def read_materials(mesh: MeshFile) -> Materials:
    """Return the materials of a mesh file.

    Raises:
        MeshFileError: a library or a material is invalid. Images are not read.
    """
    count = len(mesh.offsets) - 1
    if mesh.scene is not None:
        return _of_scene(mesh.scene)
    if mesh.obj is not None:
        return _of_obj(mesh.path.parent, mesh.obj, count)
    images = tuple(name for _, name in texture_files(mesh))
    if images:
        # Without numbers, the first image is that of all faces.
        numbers = mesh.face_properties.get("texnumber", np.zeros(count))
        return _of_images(mesh.path, images, np.asarray(numbers, np.int64))
    return Materials([PLAIN], np.zeros(count, np.int64), _no_texture(mesh.path))


def slot_of(item: Item, name: str) -> Any:
    """Return a property of a glTF material; None if it is not given."""
    return item.get(name, item.get("pbrMetallicRoughness", {}).get(name))


def image_numbers(mesh: MeshFile) -> tuple[IntArray, tuple[str, ...]]:
    """Return (p,) the number of the image of each polygon's material, and notes on materials that are not known.

    Polygons whose material has no image, or is not known, have the same number.
    """
    try:
        with readable(mesh.path, "model with materials"):
            materials = read_materials(mesh)
            keys: list[Hashable] = [_image_key(materials, item) for item in materials.items]
    except MeshFileError as error:  # Measures need no materials.
        return np.zeros(len(mesh.offsets) - 1, np.int64), (f"All materials count as one texture: {error}.",)
    different = {key: number for number, key in enumerate(dict.fromkeys(keys))}
    numbers = np.array([different[key] for key in keys])[materials.polygon]
    notes: tuple[str, ...] = ()
    if len(materials.unknown) > 1:
        names = list_some(materials.unknown)
        notes = (f"Materials that are in no library that can be read count as one texture: {names}.",)
    return np.unique(numbers, return_inverse=True)[1].reshape(-1), notes


def _image_key(materials: Materials, item: Item) -> Hashable:
    """Return a key that is equal for materials with the same image, None without an image."""
    for name in SLOTS:
        slot = slot_of(item, name)
        if isinstance(slot, dict):
            try:
                return materials.texture(slot.get("index")).key
            except MeshFileError:  # Measures need no image.
                return str(slot.get("index"))
    return None


def _no_texture(path: Path) -> Callable[[Any], ImageTexture]:
    def texture(index: Any) -> ImageTexture:
        raise MeshFileError(f"{path} has no texture {index}")

    return texture


def _of_scene(scene: GltfScene) -> Materials:
    data = scene.data
    items = [_with_diffuse(data, item) for item in data.items("materials")] + [{}]
    primitives = [data.item("meshes", part.mesh)["primitives"][part.primitive] for part in scene.parts]
    numbers = [primitive.get("material", len(items) - 1) for primitive in primitives]
    polygon = np.repeat(numbers, [len(part.corners) // 3 for part in scene.parts])
    return Materials(items, polygon, lambda index: _scene_texture(data, index))


def _with_diffuse(data: GltfData, item: Item) -> Item:
    """Return a material with the diffuse colours of specular-glossiness as its base colour, if it has no other one."""
    extension = data.entry(data.entry(item, "extensions", dict), SPECULAR, dict)
    surface = data.entry(item, "pbrMetallicRoughness", dict)
    if SPECULAR not in item.get("extensions", {}) or "baseColorTexture" in surface:
        return item
    diffuse: Item = {"metallicFactor": 0.0, "baseColorFactor": extension.get("diffuseFactor", [1.0] * 4)}
    glossiness = extension.get("glossinessFactor", 1.0)
    if isinstance(glossiness, (int, float)) and "specularGlossinessTexture" not in extension:
        diffuse["roughnessFactor"] = min(max(1.0 - glossiness, 0.0), 1.0)
    if "diffuseTexture" in extension:
        diffuse["baseColorTexture"] = extension["diffuseTexture"]
    return item | {"pbrMetallicRoughness": diffuse}


def _scene_texture(data: GltfData, index: Any) -> ImageTexture:
    """Return a texture of a glTF file."""
    texture = data.item("textures", index)
    extensions = data.entry(texture, "extensions", dict)
    image_extensions = [
        data.entry(extensions, name, dict) for name in _IMAGE_EXTENSIONS if name in extensions
    ]
    source = next((item["source"] for item in (*image_extensions, texture) if "source" in item), None)
    if source is None:
        names = f" ({', '.join(extensions)})" if extensions else ""
        data.fail(f"texture {index} has no image of a format that is read{names}")
    item, sampler = data.item("images", source), texture.get("sampler")
    modes = {} if sampler is None else data.item("samplers", sampler)
    uri, name = item.get("uri", ""), f"{data.path}: image {source}"
    if not isinstance(uri, str):
        data.fail(f"the URI of image {source} is not a string")

    def content() -> bytes:
        if uri.startswith("data:"):
            return data.decoded(uri, f"image {source}")
        return read_bytes(data.resolve(uri)) if uri else bytes(data.view(item.get("bufferView")))

    is_file = bool(uri) and not uri.startswith("data:")
    return ImageTexture(
        name,
        uri if is_file else source,
        content,
        (modes.get("wrapS", REPEAT), modes.get("wrapT", REPEAT)),
        modes.get("magFilter") == NEAREST,
    )


def _of_obj(folder: Path, text: ObjText, count: int) -> Materials:
    """Return the materials that an OBJ file in a folder uses."""
    names, polygon = materials_of_polygons(text, count)
    library_materials: dict[str, tuple[Path, MtlMaterial]] = {}
    notes = []
    for library in libraries_of(text, folder) if names else []:
        try:
            materials = parse_mtl(read_bytes(library))
        except ConeflatError as error:
            if library.is_file():
                raise
            notes.append(f"The material library cannot be read: {error}.")
            continue
        for name, material in materials.items():
            library_materials.setdefault(name, (library.parent, material))
    unknown = tuple(name for name in names if name not in library_materials)
    if unknown:
        notes.append(f"Materials that are in no library are white: {list_some(unknown)}.")
    textures: dict[tuple[Path, bool], ImageTexture] = {}
    items = [
        _as_item(name, *library_materials[name], textures)
        if name in library_materials
        else {"name": name, **PLAIN}
        for name in names
    ]
    for name in names:
        material = library_materials[name][1] if name in library_materials else MtlMaterial()
        if material.left_out:
            notes.append(f"Not read of the material {name}: {', '.join(material.left_out)}.")
        if material.image is not None and not any(material.colour):
            notes.append(f"The material {name} is black (Kd 0 0 0), and so is its image {material.image}.")
    listed = list(textures.values())
    return Materials([*items, PLAIN], polygon % (len(items) + 1), listed.__getitem__, tuple(notes), unknown)


def _as_item(
    name: str, folder: Path, material: MtlMaterial, textures: dict[tuple[Path, bool], ImageTexture]
) -> Item:
    """Return a material of a library as in glTF, and add its image to the textures."""
    surface: Item = {
        "metallicFactor": 0.0,
        "baseColorFactor": [*to_linear(np.clip(material.colour, 0, 1)).tolist(), material.opacity],
    }
    item = {"name": name, "pbrMetallicRoughness": surface}
    if material.opacity < 1:
        item["alphaMode"] = "BLEND"
    if material.image is not None:
        path = path_of_image(material.image, folder)
        wrap = CLAMP if material.is_clamped else REPEAT
        key = (path, material.is_clamped)
        textures.setdefault(key, ImageTexture(str(path), path, lambda: read_bytes(path), (wrap, wrap)))
        # v points down in glTF.
        offset = [material.offset[0], 1 - material.scale[1] - material.offset[1]]
        transform = {"offset": offset, "scale": list(material.scale)}
        surface["baseColorTexture"] = {
            "index": list(textures).index(key),
            "extensions": {TRANSFORM: transform},
        }
    return item


def _of_images(path: Path, names: tuple[str, ...], image: IntArray) -> Materials:
    """Return a material for each image that a PLY file names; image: (p,) that of each polygon."""

    def texture(index: int) -> ImageTexture:
        file = path.parent / names[index]
        return ImageTexture(str(file), names[index], lambda: read_bytes(file))

    items: list[Item] = [
        {
            "name": name,
            "pbrMetallicRoughness": {"metallicFactor": 0.0, "baseColorTexture": {"index": number}},
        }
        for number, name in enumerate(names)
    ]
    is_known = (image >= 0) & (image < len(names))
    beyond = int(np.count_nonzero(~is_known & (image != -1)))
    notes = []
    if beyond:
        textures = plural(len(names), "texture")
        notes.append(
            f"{plural(beyond, 'face')} of {path.name} with a number that is not one of its {textures}."
        )
    unused = [name for number, name in enumerate(names) if number not in image]
    if unused:
        notes.append(f"No face of {path.name} has the texture {list_some(unused)}.")
    return Materials([*items, PLAIN], np.where(is_known, image, len(names)), texture, tuple(notes))
