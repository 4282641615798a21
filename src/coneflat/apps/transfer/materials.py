"""The colours of a textured mesh: its materials with their images, one image for all UVs, or vertex colours."""

from __future__ import annotations

from functools import cache, cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...base import FloatArray, IntArray, Unmet, plural
from ...errors import MeshFileError, NonFiniteError, OptionError
from ...io import (
    SPECULAR,
    TRANSFORM,
    ImageTexture,
    Materials,
    as_input,
    decode_image,
    linear_colours,
    read_bytes,
    read_materials,
    read_mesh,
    readable,
    slot_of,
)
from ...mesh import polygon_of
from .sampling import Sampler

UNLIT = "KHR_materials_unlit"
#: The alpha modes of glTF, the most transparent one last.
ALPHA_MODES = ("OPAQUE", "MASK", "BLEND")


class Channel(NamedTuple):
    """One of the images of a glTF material.

    Attributes:
        name: the property of a material that refers to the image.
        factors: properties that the image is multiplied by, each with its (first) component of RGBA, and its default.
        is_colour: the image is in sRGB, and the factors are linear.
    """

    name: str
    factors: tuple[tuple[str, int, tuple[float, ...]], ...] = ()
    is_colour: bool = False


BASE = Channel("baseColorTexture", (("baseColorFactor", 0, (1.0,) * 4),), is_colour=True)
NORMAL = Channel("normalTexture")
CHANNELS = (
    BASE,
    NORMAL,
    Channel("metallicRoughnessTexture", (("roughnessFactor", 1, (1.0,)), ("metallicFactor", 2, (1.0,)))),
    Channel("occlusionTexture"),
    Channel("emissiveTexture", (("emissiveFactor", 0, (0.0,) * 3),), is_colour=True),
)


class Layer(NamedTuple):
    """The image of a channel in a material.

    Attributes:
        texture: index of the texture.
        uv_set: number of the set of UVs.
        matrix, offset: (2, 2), (2,) the image at uv @ matrix + offset is shown, v downwards.
        strength: of occlusion, or scale of normals.
    """

    texture: Any
    uv_set: int
    matrix: FloatArray
    offset: FloatArray
    strength: float


class Painted:
    """A mesh with colours.

    Args:
        path: the file.
        picture: the image of its UVs, instead of its materials; or None.

    Raises:
        MeshFileError: the file or its materials cannot be read, or its UVs are missing.
        NonFiniteError: a position is not finite.

    Attributes:
        vertices, faces: (n, 3), (m, 3) the mesh.
        corners: (m, 3) the polygon corner of the file at each triangle corner.
        material: (m,) the material of each triangle.
        shown: the materials that triangles have.
        items: all materials as in glTF.
        notes: what of the colours is left out, one sentence each.
    """

    def __init__(self, path: Path, picture: Path | None) -> None:
        self.mesh = read_mesh(path, weld=False)
        surface = as_input(self.mesh)
        self.vertices, self.faces = self.mesh.vertices, np.asarray(surface.faces)
        self.corners = np.asarray(surface.face_corners)
        if not np.isfinite(self.vertices[self.faces]).all():
            raise NonFiniteError(f"{path} has positions that are NaN or infinite")
        with readable(path, "model with materials"):
            polygons = len(self.mesh.offsets) - 1
            self._materials = read_materials(self.mesh) if picture is None else _picture(picture, polygons)
            self.items = self._materials.items
            self.material = self._materials.polygon[polygon_of(self.corners, self.mesh.offsets)]
            self.shown: list[int] = np.unique(self.material).tolist()
            self._layers = self._read_layers()
            self._factors = {
                (channel.name, i): _factor(path, channel, self.items[i])
                for channel in CHANNELS
                for i in self.shown
            }
        self._uses_scene = self.mesh.scene is not None and picture is None
        self._has_picture = picture is not None
        self._sampler = cache(lambda index, is_colour: Sampler.of(self._materials.texture(index), is_colour))
        self.uv = cache(self._read_uv)
        self.notes = (*self._materials.notes, *self._missing_uvs(), *self._left_out())

    @property
    def is_unlit(self) -> bool:
        """Return True if all materials are shown without light."""
        return all(UNLIT in self.items[i].get("extensions", {}) for i in self.shown)

    @cached_property
    def colours(self) -> FloatArray | None:
        """(m, 3, 4) linear vertex colours, if any."""
        if self._uses_scene:
            return self._attribute("COLOR_0", 4, 1.0) if self._has_attribute("COLOR_0") else None
        colours = None if self._has_picture else linear_colours(self.mesh)
        return None if colours is None else colours[self.faces]

    @property
    def alpha_mode(self) -> str:
        """Return the most transparent alpha mode of the materials, and of vertex colours without a material."""
        modes = [mode for i in self.shown if (mode := self.items[i].get("alphaMode")) in ALPHA_MODES]
        is_shown = not self._uses_scene and not self._layers
        if is_shown and self.colours is not None and self.colours[..., 3].min() < 1:
            modes.append(ALPHA_MODES[-1])
        return max(modes, key=ALPHA_MODES.index, default=ALPHA_MODES[0])

    def _read_layers(self) -> dict[tuple[str, int], Layer]:
        """Return the image of each channel and used material that has one."""
        layers = {}
        for channel in CHANNELS:
            for i in self.shown:
                slot = slot_of(self.items[i], channel.name)
                if slot:
                    layers[channel.name, i] = self._layer(slot)
        return layers

    def _layer(self, slot: Any) -> Layer:
        """Return what a property of a material that refers to an image says."""
        shift = slot.get("extensions", {}).get(TRANSFORM, {})
        cos, sin = np.cos(shift.get("rotation", 0.0)), np.sin(shift.get("rotation", 0.0))
        scale = np.array(shift.get("scale", (1.0, 1.0)), np.float64).reshape(2, 1)
        self._materials.texture(slot.get("index"))  # There is one.
        return Layer(
            slot.get("index"),
            0 if self.mesh.scene is None else self.mesh.scene.data.uv_set(slot),
            scale * [[cos, -sin], [sin, cos]],
            np.array(shift.get("offset", (0.0, 0.0)), np.float64).reshape(2),
            # Normals have a scale, and occlusion has a strength.
            float(slot.get("scale", slot.get("strength", 1.0))),
        )

    def _read_uv(self, number: int) -> FloatArray:
        """Return (m, 3, 2) a set of UVs, v downwards as in glTF; NaN where missing."""
        if self._uses_scene:
            return self._attribute(f"TEXCOORD_{number}", 2, np.nan)
        if self.mesh.uv is None or self.mesh.texture is None:
            return np.full((len(self.faces), 3, 2), np.nan)
        points = np.append(self.mesh.uv, [[np.nan, np.nan]], axis=0)
        return points[self.mesh.texture[self.corners]] * [1, -1] + [0, 1]

    def _missing_uvs(self) -> tuple[str, ...]:
        """Return a note on triangles whose material has an image for which they have no UVs.

        Raises:
            MeshFileError: no triangle has the UVs that its material needs.
        """
        needs, lacks = np.zeros((2, len(self.faces)), bool)
        for (_, i), layer in self._layers.items():
            chosen = self.material == i
            needs |= chosen
            lacks |= chosen & ~np.isfinite(self.uv(layer.uv_set)).all(axis=(1, 2))
        if not lacks.any():
            return ()
        if lacks.sum() == needs.sum():
            raise MeshFileError(f"{self.mesh.path} must have UVs at all corners for its texture")
        return (
            Unmet(
                f"{plural(int(lacks.sum()), 'triangle')} of {self.mesh.path.name} without UVs for a texture: "
                "the plain colour of the material instead."
            ),
        )

    def _left_out(self) -> tuple[str, ...]:
        """Return notes on what of the materials is not baked."""
        notes, name = [], self.mesh.path.name
        materials = [self.items[i] for i in self.shown]
        extensions = dict.fromkeys(key for item in materials for key in item.get("extensions", {}))
        if SPECULAR in extensions:
            notes.append(f"Specular colours of {name} ({SPECULAR}) are left out: diffuse colours are kept.")
        if UNLIT in extensions and not self.is_unlit:
            notes.append(f"Some materials of {name} are unlit ({UNLIT}); the baked one is lit.")
        ignored = [key for key in extensions if key not in (SPECULAR, UNLIT)]
        if ignored:
            notes.append(f"Extensions of the materials of {name} are left out: {', '.join(ignored)}.")
        has_image = any(channel == BASE.name for channel, _ in self._layers)
        if has_image and not self._uses_scene and self.colours is not None:
            notes.append(f"Vertex colours of {name} are left out where it has a texture.")
        return tuple(notes)

    def layer(self, channel: Channel, material: int) -> Layer | None:
        """Return the image of a channel in a material, if it has one."""
        return self._layers.get((channel.name, material))

    def placed(self, layer: Layer) -> FloatArray:
        """Return (m, 3, 2) the points of an image at the corners of all triangles, v downwards; NaN without UVs."""
        return self.uv(layer.uv_set) @ layer.matrix + layer.offset

    def pixels(self, layer: Layer) -> NDArray[np.uint8]:
        """Return (h, w, 4) the RGBA of an image."""
        texture = self._materials.texture(layer.texture)
        return decode_image(texture.read(), texture.name)

    def normal_uv(self) -> FloatArray:
        """Return (m, 3, 2) the UVs of normal maps, 0 for triangles without one."""
        points = np.zeros((len(self.faces), 3, 2))
        for i in self.shown:
            chosen, layer = self.material == i, self.layer(NORMAL, i)
            points[chosen] = 0.0 if layer is None else np.nan_to_num(self.uv(layer.uv_set)[chosen])
        return points

    def _attribute(self, name: str, columns: int, missing: float) -> FloatArray:
        """Return (m, 3, columns) an attribute at the corners of a glTF scene; colours without alpha are opaque."""
        assert self.mesh.scene is not None
        data, rows = self.mesh.scene.data, []
        for part in self.mesh.scene.parts:
            attributes = data.item("meshes", part.mesh)["primitives"][part.primitive]["attributes"]
            rows.append(np.full((len(part.corners), columns), missing))
            if name in attributes:
                width = min(data.accessor(attributes[name]).rows, columns)
                rows[-1][:, :width] = data.values(attributes[name], width)[part.corners]
        return np.concatenate(rows)[self.corners]

    def _has_attribute(self, name: str) -> bool:
        """Return True if a primitive of the glTF scene has an attribute."""
        assert self.mesh.scene is not None
        meshes, parts = self.mesh.scene.data.tree["meshes"], self.mesh.scene.parts
        return any(name in meshes[part.mesh]["primitives"][part.primitive]["attributes"] for part in parts)

    def channels(self) -> list[Channel]:
        """Return the channels to bake: those with images, and those whose factors differ between materials.

        Raises:
            OptionError: there are none, and no vertex colours.
        """
        channels = [
            channel
            for channel in CHANNELS
            if any((channel.name, i) in self._layers for i in self.shown)
            or np.ptp([self._factors[channel.name, i] for i in self.shown], axis=0).any()
        ]
        if not channels and self.colours is None:
            raise OptionError(
                f"{self.mesh.path} must have textures or vertex colours, got neither: give a texture"
                + "".join(f" ({note})" for note in self._materials.notes[:1])
            )
        return channels if BASE in channels else [BASE, *channels]

    def at(self, channel: Channel, faces: IntArray, weights: FloatArray) -> FloatArray:
        """Return (q, 4) the linear values of a channel at points given by triangles and barycentric coordinates."""
        values = np.tile([0.5, 0.5, 1.0, 1.0] if channel is NORMAL else [1.0] * 4, (len(faces), 1))
        is_sampled = np.zeros(len(faces), bool)
        for i in self.shown:
            rows, layer = np.flatnonzero(self.material[faces] == i), self.layer(channel, i)
            if layer is not None:
                points = np.einsum("qi,qic->qc", weights[rows], self.uv(layer.uv_set)[faces[rows]])
                points = points @ layer.matrix + layer.offset
                has_uv = np.isfinite(points).all(axis=1)
                shown = rows[has_uv]
                is_sampled[shown] = True
                sampled = self._sampler(layer.texture, channel.is_colour).at(points[has_uv])
                values[shown] += layer.strength * (sampled - values[shown])
            values[rows] *= self._factors[channel.name, i]
        if channel is BASE and self.colours is not None:
            tints = np.einsum("qi,qic->qc", weights, self.colours[faces])
            # Vertex colours multiply the image in glTF. In other files, which contain scans, both are the same colours.
            if self._uses_scene:
                values *= tints
            else:
                values[~is_sampled] = tints[~is_sampled]
        return values


def _picture(path: Path, polygons: int) -> Materials:
    """Return a material for all polygons whose image is a file."""
    texture = ImageTexture(str(path), path, lambda: read_bytes(path))
    return Materials([{BASE.name: {"index": 0}}], np.zeros(polygons, np.int64), lambda _: texture)


def _factor(path: Path, channel: Channel, item: dict[str, Any]) -> FloatArray:
    """Return RGBA by which the image of a material is multiplied.

    Raises:
        MeshFileError: a factor is not a number, or a list of another length.
    """
    factor = np.ones(4)
    for name, begin, default in channel.factors:
        value = slot_of(item, name)
        numbers = default if value is None else np.atleast_1d(np.array(value, np.float64))
        if np.shape(numbers) != np.shape(default) or not np.isfinite(numbers).all():
            raise MeshFileError(f"{path}: the {name} of a material is {value!r:.60}")
        factor[begin : begin + len(default)] = numbers
    return factor
