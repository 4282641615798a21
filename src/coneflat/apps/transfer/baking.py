"""Baking of colours from the surface of one model into the UVs of another, and writing of the result."""

from __future__ import annotations

from collections.abc import Collection
from copy import deepcopy
from dataclasses import dataclass
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from ... import MeshFile, io
from ...base import BAKED_RESOLUTION, FloatArray, IntArray, Unmet, check_cancelled, unit_exponent, warns
from ...errors import NonFiniteError, OptionError
from ...geometry import TriangleTree, fill_nearest, signed_double_areas, unit_vectors
from ...io import UVMesh, as_bytes, as_path, to_srgb
from ...options import Number
from ..view import Barycentrics, uv_flattening
from .materials import BASE, NORMAL, UNLIT, Channel, Painted

#: Texels that are baked at once, which bounds memory.
TEXELS_AT_ONCE = 2**18
#: Largest side of a texture: that of most graphics cards.
MAX_RESOLUTION = 16384
#: Distance of the models, as a fraction of the diagonal, from which on a note reports it: above the error of 32 bits.
NOTED_DISTANCE = 0.01
ENDINGS = (".glb", ".png")
#: Attributes and extensions of primitives that the material replaces: vertex colours are in the image; tangents may be
#: those of other UVs, and viewers compute them; compressed copies contain both.
VARIANTS = "KHR_materials_variants"
REPLACED = ("COLOR_0", "TANGENT", VARIANTS, "KHR_draco_mesh_compression")
#: Lists of a glTF file that belong to its materials.
MATERIAL_LISTS = ("images", "textures", "samplers", "materials")
#: Channels whose image belongs to the metallic-roughness model in a material.
SURFACE = ("baseColorTexture", "metallicRoughnessTexture")


@dataclass(frozen=True, eq=False)
class Baked:
    """Textures for the UVs of a model.

    Attributes:
        images: (r, r, 4) RGBA by channel of glTF, such as "baseColorTexture"; the first row is the upper one.
        material: the glTF material, without its images.
        notes: what the user should know, one sentence each.
        model: the file of the model.
        uv_mesh: its triangles and UVs.
        uv_set: the number of these UVs in the file, which the material refers to.
    """

    images: dict[str, NDArray[np.uint8]]
    material: dict[str, Any]
    notes: tuple[str, ...]
    model: Path
    uv_mesh: UVMesh
    uv_set: int = 0

    def losses(self, path: str | PathLike[str]) -> tuple[str, ...]:
        """Return a note on what a file with the ending of a path does not keep, if anything."""
        if as_path(path).suffix.lower() != ".png":
            return ()
        lost = [name for name in self.images if name != BASE.name]
        return (f"A .png has the base colour only, not {', '.join(lost)}: .glb keeps all.",) if lost else ()

    def save(self, path: str | PathLike[str]) -> Path:
        """Write the model with its textures (.glb), or the image of its base colour (.png), and return the path.

        Raises:
            UnknownFormatError, MeshFileError: the file cannot be written.
        """
        path = io.checked_target(path, ENDINGS, "textures are written as")
        with io.atomic_write(path) as stream:
            if path.suffix.lower() == ".png":
                stream.write(io.encode_png(self.images[BASE.name]).content)
            else:
                _with_material(self).write(stream)
        return path


@warns("baked.notes")
def transfer(
    old: str | PathLike[str],
    new: str | PathLike[str],
    *,
    resolution: int = BAKED_RESOLUTION,
    texture: str | PathLike[str] | None = None,
    uv_set: int = 0,
) -> Baked:
    """Bake the colours of a model into the UVs of another model of the same shape.

    Each texel gets the colour at the nearest point of the old surface; texels without a triangle get the colour of the
    nearest texel with one. The materials of the old model become one. The triangles may differ.

    Args:
        old: a file with textures or vertex colours (.gltf, .glb, .obj with its .mtl, .ply), or with UVs for `texture`.
        new: a file with UVs, in the same position and scale.
        resolution: texels along a side of the new textures.
        texture: the image of the UVs of `old`, instead of its materials.
        uv_set: the number of the UVs of `new` in a glTF: 1 for TEXCOORD_1, as of lightmaps. The materials of `old` say
            which of its UVs they use.

    Raises:
        OptionError: Pillow is not installed; `uv_set` is not an integer from 0 on; `old` has no colours or no size; UVs
            of `new` are outside the unit square.
        MissingUVError: `new` has no UVs.
        NonFiniteError: a position is not finite.
        MeshFileError: a file, a material or an image cannot be read.

    Examples:
        >>> from coneflat.apps.transfer import transfer
        >>> transfer("old.glb", "new.glb").save("baked.glb")  # doctest: +SKIP
    """
    side = int(Number(1, MAX_RESOLUTION, is_integer=True).parse("resolution", resolution) or 1)
    painted = Painted(as_path(old), None if texture is None else as_path(texture))
    new = as_path(new)
    target = io.as_uv_mesh(new, weld=False, uv_set=uv_set)
    measured = np.flatnonzero(target.has_uv & (signed_double_areas(target.corner_uv) != 0))
    corner_uv, corners = target.corner_uv[measured], target.vertices[target.faces[measured]]
    if not np.isfinite(corners).all():
        raise NonFiniteError(f"{new} has positions that are NaN or infinite")
    if corner_uv.min(initial=0) < -1 / side or corner_uv.max(initial=1) > 1 + 1 / side:
        raise OptionError(
            f"the UVs of {new} must be in the unit square, got {corner_uv.min():.3g} to {corner_uv.max():.3g}"
        )
    texels = corner_uv * [side, -side] + [0, side]
    owner, twice = _owners(texels, side)
    if owner.max() < 0:
        raise OptionError(f"no texel of {side} x {side} is in a triangle of {new}: raise the resolution")
    images, farthest = _bake(painted, corners, texels, owner)
    source = distance_transform_edt(owner < 0, return_distances=False, return_indices=True)
    notes = [*painted.notes, *target.notes]
    notes += _replaced(painted.mesh, target.source)
    if twice:
        notes.append(
            Unmet(f"UVs overlap: {twice:,} texels are in several triangles, and show the first of them.")
        )
    if farthest > NOTED_DISTANCE:
        notes.append(
            Unmet(f"The models differ: points are up to {farthest:.1%} of the size from the old surface.")
        )
    filled = {channel.name: image[tuple(source)] for channel, image in images.items()}
    return Baked(filled, _material(painted, filled), tuple(notes), new, target, int(uv_set))


def _replaced(source: MeshFile, target: MeshFile | None) -> list[str]:
    """Return notes on what the material of a GLB replaces."""
    source_tree, target_tree = (
        {} if model is None or model.scene is None else model.scene.data.tree for model in (source, target)
    )
    notes = []
    primitives = [primitive for mesh in target_tree.get("meshes", []) for primitive in mesh["primitives"]]
    if any("TANGENT" in primitive["attributes"] for primitive in primitives):
        notes.append("Tangents are left out of a GLB: viewers compute those of the new UVs.")
    if any(VARIANTS in tree.get("extensions", {}) for tree in (source_tree, target_tree)):
        notes.append(f"Variants of materials ({VARIANTS}) are left out: the default ones are kept.")
    return notes


def _bake(
    painted: Painted, corners: FloatArray, texels: FloatArray, owner: IntArray
) -> tuple[dict[Channel, NDArray[np.uint8]], float]:
    """Return the images of all channels, filled where a texel has an owner, and the largest relative distance.

    Args:
        painted: the old model.
        corners, texels: (m, 3, 3), (m, 3, 2) corners of the new triangles in space and in the texture.
        owner: (r, r) the triangle of each texel, -1 for none.
    """
    # Squares of distances are finite at unit size.
    exponent = unit_exponent(painted.vertices[painted.faces])
    vertices, corners = np.ldexp(painted.vertices, -exponent), np.ldexp(corners, -exponent)
    tree, farthest, side = TriangleTree(vertices, painted.faces), 0.0, len(owner)
    if not tree.diagonal > 0:
        raise OptionError(
            f"all points of {painted.mesh.path} are at one position, so no colours can be found there"
        )
    images = {channel: np.zeros((side, side, 4), np.uint8) for channel in painted.channels()}
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if NORMAL in images:
        axes = _tangents(corners, texels)
        old_axes = _tangents(vertices[painted.faces], painted.normal_uv())
    places = Barycentrics(texels.reshape(-1, 2), np.arange(3 * len(texels)).reshape(-1, 3))
    every = np.flatnonzero(owner.reshape(-1) >= 0)
    for begin in range(0, len(every), TEXELS_AT_ONCE):
        check_cancelled()
        place = every[begin : begin + TEXELS_AT_ONCE]
        faces = owner.reshape(-1)[place]
        weights = places.of(faces, place % side, place // side)
        points = np.einsum("qi,qix->qx", weights, corners[faces])
        on, at = tree.nearest(points, normals[faces])
        nearest = np.einsum("qi,qix->qx", at, vertices[painted.faces[on]])
        farthest = max(farthest, float(np.linalg.norm(nearest - points, axis=1).max()) / tree.diagonal)
        for channel, image in images.items():
            values = painted.at(channel, on, at)
            if channel is NORMAL:
                turns = np.einsum("qax,qbx->qab", axes[faces], old_axes[on])
                values[:, :2] = 0.5 + np.einsum("qab,qb->qa", turns, values[:, :2] - 0.5)
            if channel.is_colour:
                values[:, :3] = to_srgb(np.clip(values[:, :3], 0, 1))
            image.reshape(-1, 4)[place] = as_bytes(values)
    return images, farthest


def _tangents(corners: FloatArray, uv: FloatArray) -> FloatArray:
    """Return (q, 2, 3) orthonormal directions of u and of v upwards on triangles (q, 3, 3) with UVs (v downwards)."""
    (b, c), (s, t) = ((x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]) for x in (corners, uv))
    sign = np.sign(s[:, :1] * t[:, 1:] - s[:, 1:] * t[:, :1])
    along = unit_vectors((b * t[:, 1:] - c * s[:, 1:]) * sign)
    return np.stack([along, np.cross(along, unit_vectors(np.cross(b, c))) * sign], axis=1)


def _owners(texels: FloatArray, side: int) -> tuple[IntArray, int]:
    """Return (r, r) the triangle at the centre of each texel, -1 for none, and the number of texels with several.

    texels, side: (m, 3, 2) corners of triangles with area in the texture, and its r rows.
    """
    faces = np.arange(3 * len(texels)).reshape(-1, 3)
    owners = [np.full((side, side), -1) for _ in range(2)]
    # Depths are the numbers of the triangles, so that of several triangles the first one is found, and the last one.
    for sign, owner in zip((1.0, -1.0), owners, strict=True):
        points = np.column_stack([texels.reshape(-1, 2), sign * np.repeat(np.arange(len(texels)), 3)])
        fill_nearest(points, faces, np.full((side, side), np.inf), owner)
    return owners[0], int(np.count_nonzero(owners[0] != owners[1]))


def _material(painted: Painted, names: Collection[str]) -> dict[str, Any]:
    """Return a glTF material without images, like the first one of a model; `names`: channels that get images."""
    items = [painted.items[i] for i in painted.shown]
    surface = items[0].get("pbrMetallicRoughness", {"metallicFactor": 0.0})
    factors = () if "metallicRoughnessTexture" in names else ("metallicFactor", "roughnessFactor")
    item: dict[str, Any] = {"doubleSided": any(material.get("doubleSided", False) for material in items)}
    item |= {name: items[0][name] for name in ("alphaCutoff", "emissiveFactor") if name in items[0]}
    item |= {"emissiveFactor": [1.0] * 3} if "emissiveTexture" in names else {}
    item["alphaMode"] = painted.alpha_mode
    if painted.is_unlit:
        item["extensions"] = {UNLIT: {}}
    return item | {"pbrMetallicRoughness": {name: surface[name] for name in factors if name in surface}}


def _with_material(baked: Baked) -> io.Glb:
    """Return the model as GLB, with one material instead of its own."""
    source = baked.uv_mesh.source
    if source is None or source.scene is None:
        stream = BytesIO()
        io.write_stream(uv_flattening(baked.uv_mesh), stream, ".glb")
        source = io.read_mesh_from(stream.getvalue(), baked.model)
    assert source.scene is not None
    data = source.scene.data
    glb = io.Glb({name: deepcopy(item) for name, item in data.tree.items() if name not in MATERIAL_LISTS})
    owners = [glb.tree]
    for mesh in glb.tree["meshes"]:
        for primitive in mesh["primitives"]:
            primitive["material"] = 0
            owners += [primitive["attributes"], primitive, *primitive.get("targets", [])]
    for owner in owners:
        for name in REPLACED:
            owner.pop(name, None)
            owner.get("extensions", {}).pop(name, None)
    glb.copy_arrays(data)
    item = baked.material | {"pbrMetallicRoughness": dict(baked.material["pbrMetallicRoughness"])}
    for name, image in baked.images.items():
        texture = io.encode_png(image)
        number = glb.add("images", {"bufferView": glb.add_view(texture.content), "mimeType": texture.kind})
        place = item["pbrMetallicRoughness"] if name in SURFACE else item
        chosen_set = {"texCoord": baked.uv_set} if baked.uv_set else {}
        place[name] = {"index": glb.add("textures", {"source": number})} | chosen_set
    glb.add("materials", item)
    _declare_extensions(glb.tree, {name: data.tree[name] for name in MATERIAL_LISTS if name in data.tree})
    return glb


def _declare_extensions(tree: dict[str, Any], removed: dict[str, Any]) -> None:
    """List the extensions of the new material, and no longer those that only removed objects had."""
    # Extensions such as KHR_mesh_quantization are used without an object of their name.
    dropped = {*io.keys_of(removed), *REPLACED} - {*io.keys_of(tree)}
    for name in ("extensionsUsed", "extensionsRequired"):
        left = [extension for extension in tree.pop(name, []) if extension not in dropped]
        if name == "extensionsUsed":
            left = list(dict.fromkeys([*left, *tree["materials"][0].get("extensions", {})]))
        if left:
            tree[name] = left
    if tree.get("extensions") == {}:
        del tree["extensions"]
