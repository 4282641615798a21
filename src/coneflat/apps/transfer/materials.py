"""The colours of a textured mesh: glTF materials with their images, one image for all UVs, or vertex colours."""

from __future__ import annotations

from functools import cache, cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from ...base import FloatArray, IntArray
from ...errors import MeshFileError, OptionError
from ...io import as_input, decode_image, read_bytes, read_mesh

CLAMP = 33071  # a wrap mode of glTF; the others repeat


class Channel(NamedTuple):
    """One of the images of a glTF material.

    Attributes:
        name: the property of a material that refers to the image.
        factors: properties that the image is multiplied by, each with its (first) component of RGBA, and its default.
        is_colour: the image is in sRGB, and the factors are linear.
    """

    name: str
    factors: tuple[tuple[str, int, Any], ...] = ()
    is_colour: bool = False


BASE = Channel("baseColorTexture", (("baseColorFactor", 0, 1.0),), is_colour=True)
NORMAL = Channel("normalTexture")
CHANNELS = (
    BASE,
    NORMAL,
    Channel("metallicRoughnessTexture", (("roughnessFactor", 1, 1.0), ("metallicFactor", 2, 1.0))),
    Channel("occlusionTexture"),
    Channel("emissiveTexture", (("emissiveFactor", 0, (0.0, 0.0, 0.0)),), is_colour=True),
)


def to_linear(values: NDArray[Any]) -> FloatArray:
    """Return linear values of sRGB ones, both from 0 to 1."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def to_srgb(values: FloatArray) -> FloatArray:
    """Return sRGB values of linear ones, both from 0 to 1."""
    return np.where(values <= 0.0031308, values * 12.92, 1.055 * values ** (1 / 2.4) - 0.055)


class Painted:
    """A mesh with colours.

    Args:
        path: the file.
        picture: the image of its UVs, instead of its materials; or None.

    Raises:
        MeshFileError: the file cannot be read.
    """

    def __init__(self, path: Path, picture: Path | None) -> None:
        self.mesh, self.picture = read_mesh(path, weld=False), picture
        given = as_input(self.mesh)
        self.vertices, self.faces = self.mesh.vertices, np.asarray(given.faces)
        self.corners = np.asarray(given.face_corners)
        self.materials: list[dict[str, Any]] = [{} if picture is None else {BASE.name: {"index": 0}}]
        self.material = np.zeros(len(self.faces), np.int64)
        self.primitives: list[tuple[dict[str, Any], IntArray]] = []
        if self.mesh.scene is not None and picture is None:
            data = self.mesh.scene.data
            self.primitives = [
                (data.item("meshes", part.mesh)["primitives"][part.primitive], part.corners)
                for part in self.mesh.scene.parts
            ]
            self.materials = [*data.items("materials"), {}]
            numbers = [one.get("material", len(self.materials) - 1) for one, _ in self.primitives]
            self.material = np.repeat(numbers, [len(corners) // 3 for _, corners in self.primitives])
        self.used: list[int] = np.unique(self.material).tolist()
        self.uv, self.image, self.linear = cache(self._read_uv), cache(self._read_image), cache(self._linear)

    @cached_property
    def colours(self) -> FloatArray | None:
        """(m, 3, 4) linear vertex colours, if any."""
        if any("COLOR_0" in one["attributes"] for one, _ in self.primitives):
            return self._attribute("COLOR_0", 4)
        if not self.mesh.has_colours or self.picture is not None:
            return None
        values = self.mesh.properties
        rgb = to_linear(np.stack([values[name] for name in ("red", "green", "blue")], axis=1))
        return np.column_stack([rgb, values.get("alpha", np.ones(len(rgb)))])[self.faces]

    def _read_uv(self, number: int) -> FloatArray:
        """Return (m, 3, 2) a set of UVs, v downwards as in glTF."""
        if self.primitives:
            return self._attribute(f"TEXCOORD_{number}", 2)
        uv, points = self.mesh.uv, self.mesh.texture
        if uv is None or points is None or (points[self.corners] < 0).any():
            raise MeshFileError(f"{self.mesh.path} must have UVs at all corners for its texture")
        return uv[points[self.corners]] * [1, -1] + [0, 1]

    def uv_of(self, slot: Any) -> FloatArray:
        """Return (m, 3, 2) the UVs that a property of a material refers to, without its transform."""
        return self.uv(0 if self.mesh.scene is None else self.mesh.scene.data.uv_set(slot))

    def normal_uv(self) -> FloatArray:
        """Return (m, 3, 2) the UVs of normal maps, 0 for triangles without one."""
        found = np.zeros((len(self.faces), 3, 2))
        for i in self.used:
            own, slot = self.material == i, self.value(NORMAL.name, i)
            found[own] = self.uv_of(slot)[own] if slot else 0.0
        return found

    def _attribute(self, name: str, columns: int) -> FloatArray:
        """Return (m, 3, columns) an attribute at the corners of a glTF scene, 1 where missing."""
        assert self.mesh.scene is not None
        data, rows = self.mesh.scene.data, []
        for primitive, corners in self.primitives:
            rows.append(np.ones((len(corners), columns)))
            if name in primitive["attributes"]:
                index = primitive["attributes"][name]
                width = min(data.accessor(index).rows, columns)
                rows[-1][:, :width] = data.values(index, width)[corners]
        return np.concatenate(rows).reshape(-1, 3, columns)

    def value(self, name: str, material: int) -> Any:
        """Return a property of a material; None if it is not given."""
        item = self.materials[material]
        return item.get(name, item.get("pbrMetallicRoughness", {}).get(name))

    def factor(self, channel: Channel, material: int) -> FloatArray:
        """Return RGBA by which the image of a material is multiplied."""
        found = np.ones(4)
        for name, begin, default in channel.factors:
            value = self.value(name, material)
            value = default if value is None else value
            found[begin : begin + np.size(value)] = value
        return found

    def channels(self) -> list[Channel]:
        """Return the channels to bake: those with images, and those whose factors differ between materials.

        Raises:
            OptionError: there are none, and no vertex colours.
        """
        found = [
            channel
            for channel in CHANNELS
            if any(self.value(channel.name, i) for i in self.used)
            or np.ptp([self.factor(channel, i) for i in self.used], axis=0).any()
        ]
        if not found and self.colours is None:
            raise OptionError(
                f"{self.mesh.path} must have textures or vertex colours, got neither: give a texture"
            )
        return found if BASE in found else [BASE, *found]

    def at(self, channel: Channel, faces: IntArray, weights: FloatArray) -> FloatArray:
        """Return (q, 4) the linear values of a channel at points given by triangles and barycentric coordinates."""
        values = np.tile([0.5, 0.5, 1.0, 1.0] if channel is NORMAL else [1.0] * 4, (len(faces), 1))
        for i in self.used:
            own, slot = np.flatnonzero(self.material[faces] == i), self.value(channel.name, i)
            if slot:
                sampled = self._sampled(slot, faces[own], weights[own], channel.is_colour)
                # Normals have a scale, and occlusion has a strength.
                values[own] += slot.get("scale", slot.get("strength", 1.0)) * (sampled - values[own])
            values[own] *= self.factor(channel, i)
        if channel is BASE and self.colours is not None:
            values *= np.einsum("qi,qic->qc", weights, self.colours[faces])
        return values

    def _sampled(self, slot: Any, faces: IntArray, weights: FloatArray, is_colour: bool) -> FloatArray:
        """Return (q, 4) the linear values of the image that a property `slot` of a material refers to."""
        shift, uv = slot.get("extensions", {}).get("KHR_texture_transform", {}), self.uv_of(slot)[faces]
        cos, sin = np.cos(shift.get("rotation", 0.0)), np.sin(shift.get("rotation", 0.0))
        uv = np.einsum("qi,qic->qc", weights, uv) * shift.get("scale", (1, 1)) @ [[cos, -sin], [sin, cos]]
        index = slot.get("index")
        image, (_, wraps) = self.linear(index, is_colour), self.image(index)
        size = np.array(image.shape[1::-1])
        place = (uv + shift.get("offset", (0, 0))) * size - 0.5
        place = np.where(np.equal(wraps, CLAMP), np.clip(place, 0, size - 1), place)[:, ::-1].T
        bands = [map_coordinates(image[..., i], place, float, 1, "grid-wrap") for i in range(4)]
        return np.stack(bands, axis=1)

    def _linear(self, index: int | None, is_colour: bool) -> NDArray[np.float32]:
        """Return (h, w, 4) the linear values of an image; `is_colour`: it is in sRGB, but for its alpha."""
        image, values = self.image(index)[0], np.arange(256) / 255
        found = values.astype(np.float32)[image]
        if is_colour:
            found[..., :3] = to_linear(values).astype(np.float32)[image[..., :3]]
        return found

    def _read_image(self, index: int | None) -> tuple[NDArray[np.uint8], tuple[Any, Any]]:
        """Return (h, w, 4) the image of a texture, and its wrap modes."""
        if self.picture is not None:
            return decode_image(read_bytes(self.picture), self.picture), (None, None)
        assert self.mesh.scene is not None
        data = self.mesh.scene.data
        texture = data.item("textures", index)
        source = texture.get("extensions", {}).get("EXT_texture_webp", texture).get("source")
        item, sampler = data.item("images", source), texture.get("sampler")
        uri, name = item.get("uri", ""), f"{data.path}: image {source}"
        if uri.startswith("data:"):
            content = data.decoded(uri, name)
        else:
            content = read_bytes(data.resolve(uri)) if uri else bytes(data.view(item.get("bufferView")))
        modes = {} if sampler is None else data.item("samplers", sampler)
        return decode_image(content, name), (modes.get("wrapS"), modes.get("wrapT"))
