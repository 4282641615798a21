"""Unwrapping of any triangles, whether or not they form a surface: each face gets UVs, in its own orientation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ..atlas import pack_charts, round_safely
from ..base import BoolArray, FloatArray, IntArray, Unmet, plural
from ..errors import ConeflatError, OptionError
from ..geometry import as_pairs, edge_lengths, rest_sides, signed_double_areas
from ..io import stored_in_glb
from ..mesh import EdgeGroups, end_corners, glue_layers, label_faces, split_vertices, weld
from ..options import read_options
from ..result import Flattening
from .options import MAX_RESOLUTION, MAX_TEXTURES, UnwrapOptions
from .several_textures import too_large_charts, unwrap_in_textures
from .unwrapping import unwrap


@dataclass(frozen=True, eq=False)
class UnwrappedSoup:
    """The UVs of m triangles.

    Attributes:
        corner_uv: (m, 3, 2) the point of each corner in the unit square.
        chart: (m,) the chart of each face, from 0; -1 for faces without area.
        texture: (m,) the texture of each face, from 0; -1 for faces without area.
        scale: UV units per unit of length; 0 without any face that has area.
        resolution: texels along a side of the texture.
        notes: what was done to the triangles, one sentence each.
    """

    corner_uv: FloatArray
    chart: IntArray
    texture: IntArray
    scale: float
    resolution: int
    notes: tuple[str, ...]


def unwrap_soup(
    vertices: FloatArray, faces: IntArray, *, density: float | None = None, **options: Any
) -> UnwrappedSoup:
    """Return UVs for triangles.

    Faces are joined along edges with two faces of the same orientation, and layers with several faces at an edge each
    on its own, as by a repair; vertices at the same position are the same.

    Args:
        vertices: (n, 3) positions.
        faces: (m, 3) vertex indices.
        density: texels per unit of length, at least, in as many textures of the resolution as it needs; None for one
            texture.
        options: those of `coneflat.unwrap`.

    Raises:
        OptionError: an option is invalid, or the padding leaves no space for charts.
    """
    parsed = read_options(options, UnwrapOptions)
    density = read_options({"texel_density": density}, UnwrapOptions).texel_density
    first, place = weld(vertices)
    has_area = _has_three_places(place[faces]) & np.isfinite(vertices[faces]).all(axis=(1, 2))
    chosen = np.flatnonzero(has_area)
    dropped = len(faces) - len(chosen)
    notes = (
        [Unmet(f"{plural(dropped, 'face')} without area: the UVs of each are one point.")] if dropped else []
    )
    if not len(chosen):
        empty = UnwrappedSoup(np.zeros((0, 3, 2)), chosen, chosen, 0.0, parsed.resolution, ())
        return _among(empty, chosen, len(faces), notes)
    origin, corners = _oriented(vertices[first], place[faces[chosen]])
    points = vertices[first[origin]]
    try:
        if density is None:
            result = unwrap(points, corners, repair=True, **options)
        else:
            result = unwrap_in_textures(points, corners, density, repair=True, **options)
    except OptionError:
        raise
    except ConeflatError as error:
        notes.append(Unmet(f"Each face is a chart of its own: {error}."))
        return _among(_packed_separately(points, corners, parsed, density), chosen, len(faces), notes)
    assert result.face_origin is not None
    return _among(_rounded(result), chosen[result.face_origin], len(faces), notes)


def _has_three_places(places: IntArray) -> BoolArray:
    """Return (m,) whether the three corners of faces are at different places."""
    a, b, c = places.T
    return (a != b) & (b != c) & (c != a)


def _among(soup: UnwrappedSoup, faces: IntArray, count: int, notes: Sequence[str]) -> UnwrappedSoup:
    """Return the UVs of `count` faces from those of some of them, (k,) `faces`; the others get a point.

    notes: those of the whole, before those of the soup.
    """
    corner_uv, chart, texture = np.zeros((count, 3, 2)), np.full(count, -1), np.full(count, -1)
    corner_uv[faces], chart[faces], texture[faces] = soup.corner_uv, soup.chart, soup.texture
    return replace(soup, corner_uv=corner_uv, chart=chart, texture=texture, notes=(*notes, *soup.notes))


def _of_tiles(corner_uv: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the UVs of triangles in UDIM tiles, each in the unit square, and (m,) the textures of the triangles."""
    corner = np.floor(corner_uv.mean(axis=1))
    _, texture = np.unique(corner[:, ::-1], axis=0, return_inverse=True)
    return corner_uv - corner[:, None], texture.reshape(-1)


def _rounded(result: Flattening) -> UnwrappedSoup:
    """Return the UVs of a result, rounded to single precision.

    Where charts touch themselves, this may make overlaps, which notes report.
    """
    uv, overlaps = round_safely(result.uv, result.uv_faces, stored_in_glb)
    notes = list(result.notes)
    if len(overlaps.pairs) > result.distortion.overlapping_pairs:
        count = plural(len(overlaps.pairs), "pair")
        notes.append(Unmet(f"{count} of triangles overlap in single precision."))
    flipped = int(np.count_nonzero(signed_double_areas(uv[result.uv_faces]) < 0))
    if flipped > result.distortion.flipped:
        notes.append(Unmet(f"{plural(flipped, 'triangle is', 'triangles are')} flipped in single precision."))
    corner_uv, texture = _of_tiles(uv[result.uv_faces])
    return UnwrappedSoup(
        corner_uv,
        label_faces(result.uv_faces, len(uv))[1],
        texture,
        result.uv_scale,
        result.settings["resolution"],
        tuple(notes),
    )


def _packed_separately(
    points: FloatArray, corners: IntArray, options: UnwrapOptions, needed: float | None
) -> UnwrappedSoup:
    """Return the UVs of faces (m, 3), each as a chart; needed: the density of `unwrap_soup`."""
    sides = rest_sides(edge_lengths(points, corners))
    flat = np.stack([np.zeros(len(sides)), sides[:, 2], -sides[:, 1]], axis=1)
    charts = as_pairs(flat.ravel()).reshape(-1, 3, 2), np.arange(len(corners))
    resolution, density = options.resolution, options.texel_density
    pack = partial(pack_charts, *charts, padding=options.padding, block_size=options.block_size)
    packed = pack(resolution=resolution)
    while density is not None and resolution * packed.scale < density:
        # The padding, and with it the scale, depends on the resolution.
        resolution = max(2 * resolution, int(np.ceil(min(density / packed.scale, 2.0**62))))
        if resolution > MAX_RESOLUTION:
            raise OptionError(
                f"texel_density is too large: {density:g} texels per unit need {resolution:,} texels per side"
            )
        packed = pack(resolution=resolution)
    textures = 1
    while (
        needed is not None
        and resolution * packed.scale < needed
        and textures < min(len(corners), MAX_TEXTURES)
    ):
        # A chart needs one texture at most, where it limits the scale.
        ratio = min(needed / (resolution * packed.scale), float(MAX_TEXTURES))
        textures = min(max(math.ceil(textures * ratio**2), textures + 1), len(corners), MAX_TEXTURES)
        packed = pack(resolution=resolution, tiles=textures)
    notes: tuple[str, ...] = ()
    if needed is not None and resolution * packed.scale < needed:
        notes = (too_large_charts(resolution * packed.scale, needed),)
    corner_uv, texture = _of_tiles(packed.corner_uv)
    return UnwrappedSoup(corner_uv, charts[1], texture, packed.scale, resolution, notes)


def _oriented(vertices: FloatArray, faces: IntArray) -> tuple[IntArray, IntArray]:
    """Return the vertex of each vertex of oriented surfaces that faces form, and the surfaces as (m, 3) faces.

    Faces are glued as a repair glues them, where they have opposite directions along an edge.
    """
    pairs = glue_layers(vertices, faces, EdgeGroups.of(faces, int(faces.max()) + 1)).pairs
    (start_one, _), (_, end_two) = (end_corners(halfedges) for halfedges in pairs.T)
    opposed = faces.ravel()[start_one] == faces.ravel()[end_two]
    return split_vertices(faces, int(faces.max()) + 1, *pairs[opposed].T)
