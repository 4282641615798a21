"""Unwrapping of any triangles, whether or not they form a surface: each face gets UVs, in its own orientation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
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
from .options import MAX_RESOLUTION, UnwrapOptions
from .unwrapping import unwrap


@dataclass(frozen=True, eq=False)
class UnwrappedSoup:
    """The UVs of m triangles.

    Attributes:
        corner_uv: (m, 3, 2) the point of each corner in the unit square.
        chart: (m,) the chart of each face, from 0; -1 for faces without area.
        efficiency: covered fraction of the square.
        scale: UV units per unit of length; 0 without any face that has area.
        resolution: texels along a side of the texture.
        notes: what was done to the triangles, one sentence each.
    """

    corner_uv: FloatArray
    chart: IntArray
    efficiency: float
    scale: float
    resolution: int
    notes: tuple[str, ...]


def unwrap_soup(vertices: FloatArray, faces: IntArray, **options: Any) -> UnwrappedSoup:
    """Return UVs for triangles.

    Faces are joined along edges with two faces of the same orientation, and layers with several faces at an edge each
    on its own, as by a repair; vertices at the same position are the same.

    Args:
        vertices: (n, 3) positions.
        faces: (m, 3) vertex indices.
        options: those of `coneflat.unwrap`.

    Raises:
        OptionError: an option is invalid, or the padding leaves no space for charts.
    """
    parsed = read_options(options, UnwrapOptions)
    first, place = weld(vertices)
    has_area = _has_three_places(place[faces]) & np.isfinite(vertices[faces]).all(axis=(1, 2))
    chosen = np.flatnonzero(has_area)
    dropped = len(faces) - len(chosen)
    notes = (
        [Unmet(f"{plural(dropped, 'face')} without area: the UVs of each are one point.")] if dropped else []
    )
    if not len(chosen):
        empty = UnwrappedSoup(np.zeros((0, 3, 2)), chosen, 0.0, 0.0, parsed.resolution, ())
        return _among(empty, chosen, len(faces), notes)
    origin, corners = _oriented(vertices[first], place[faces[chosen]])
    points = vertices[first[origin]]
    try:
        result = unwrap(points, corners, repair=True, **options)
    except OptionError:
        raise
    except ConeflatError as error:
        notes.append(Unmet(f"Each face is a chart of its own: {error}."))
        return _among(_packed_separately(points, corners, parsed), chosen, len(faces), notes)
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
    corner_uv, chart = np.zeros((count, 3, 2)), np.full(count, -1)
    corner_uv[faces], chart[faces] = soup.corner_uv, soup.chart
    return replace(soup, corner_uv=corner_uv, chart=chart, notes=(*notes, *soup.notes))


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
    return UnwrappedSoup(
        uv[result.uv_faces],
        label_faces(result.uv_faces, len(uv))[1],
        result.packing_efficiency,
        result.uv_scale,
        result.settings["resolution"],
        tuple(notes),
    )


def _packed_separately(points: FloatArray, corners: IntArray, options: UnwrapOptions) -> UnwrappedSoup:
    """Return the UVs of faces (m, 3), each as a chart."""
    sides = rest_sides(edge_lengths(points, corners))
    flat = np.stack([np.zeros(len(sides)), sides[:, 2], -sides[:, 1]], axis=1)
    charts = as_pairs(flat.ravel()).reshape(-1, 3, 2), np.arange(len(corners))
    resolution, density = options.resolution, options.texel_density
    packed = pack_charts(*charts, resolution=resolution, padding=options.padding)
    while density is not None and resolution * packed.scale < density:
        # The padding, and with it the scale, depends on the resolution.
        resolution = max(2 * resolution, int(np.ceil(min(density / packed.scale, 2.0**62))))
        if resolution > MAX_RESOLUTION:
            raise OptionError(
                f"texel_density is too large: {density:g} texels per unit need {resolution:,} texels per side"
            )
        packed = pack_charts(*charts, resolution=resolution, padding=options.padding)
    return UnwrappedSoup(packed.corner_uv, charts[1], packed.efficiency, packed.scale, resolution, ())


def _oriented(vertices: FloatArray, faces: IntArray) -> tuple[IntArray, IntArray]:
    """Return the vertex of each vertex of oriented surfaces that faces form, and the surfaces as (m, 3) faces.

    Faces are glued as a repair glues them, where they have opposite directions along an edge.
    """
    pairs = glue_layers(vertices, faces, EdgeGroups.of(faces, int(faces.max()) + 1)).pairs
    (start_one, _), (_, end_two) = (end_corners(halfedges) for halfedges in pairs.T)
    opposed = faces.ravel()[start_one] == faces.ravel()[end_two]
    return split_vertices(faces, int(faces.max()) + 1, *pairs[opposed].T)
