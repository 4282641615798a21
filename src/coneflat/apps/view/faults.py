"""Where the UVs of a result are bad: triangles that are flipped, overlap others, or lie outside the unit square."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...base import FloatArray, IntArray
from ...geometry import find_overlaps, signed_double_areas
from ...io import image_numbers
from ...mesh import label_faces, polygon_of
from ..uv_measures import MAX_PAIRS_EACH, MIN_PAIRS
from .from_uv import is_from_file

if TYPE_CHECKING:
    from ... import Flattening

#: The faults of a triangle, as bits; a page shows the first of several, as flipped triangles overlap others, too.
FLIPPED, OVERLAPPING, OUTSIDE = 1, 2, 4
FAULTS = {"flipped": FLIPPED, "overlapping": OVERLAPPING, "outside": OUTSIDE}
#: Largest number of places with a fault that a page lists.
MAX_PLACES = 1000


@dataclass(frozen=True, eq=False)
class UVFaults:
    """The faults of the UVs of m triangles.

    Attributes:
        bits: (m,) the sum of the `FAULTS` of each triangle.
        complete: False if there are so many overlapping pairs that only some of them were searched for.
    """

    bits: NDArray[np.uint8]
    complete: bool

    def counts(self) -> dict[str, int]:
        """Return the number of triangles with each fault."""
        return {name: int(np.count_nonzero(self.bits & bit)) for name, bit in FAULTS.items()}


def uv_faults(result: Flattening) -> UVFaults:
    """Return the faults of the UVs of a result.

    Triangles of different textures do not overlap each other. A triangle is flipped if its orientation is opposite to
    that of most of its chart, by area, as `Distortion.flipped` counts them.

    Examples:
        >>> vertices = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
        >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
        >>> coneflat.apps.view.uv_faults(coneflat.flatten(vertices, faces)).counts()
        {'flipped': 0, 'overlapping': 0, 'outside': 0}
    """
    corner_uv = np.asarray(result.corner_uv)
    bits = np.zeros(len(corner_uv), dtype=np.uint8)
    bits[is_flipped(result)] |= FLIPPED
    bits[((corner_uv < 0) | (corner_uv > 1)).any(axis=(1, 2))] |= OUTSIDE
    complete = True
    if result.distortion.overlapping_pairs != 0:  # Otherwise there are none to search for.
        for triangles in _by_texture(result):
            limit = max(MIN_PAIRS, MAX_PAIRS_EACH * len(triangles))
            overlaps = find_overlaps(corner_uv[triangles], limit=limit)
            bits[triangles[np.unique(overlaps.pairs)]] |= OVERLAPPING
            complete &= overlaps.complete
    return UVFaults(bits, complete)


def is_flipped(result: Flattening) -> NDArray[np.bool_]:
    """Return (m,) whether the orientation of a triangle in the plane is opposite to that of most of its chart."""
    areas = signed_double_areas(result.corner_uv)
    _, chart = np.unique(label_faces(result.uv_faces, len(result.uv))[1], return_inverse=True)
    majority = np.sign(np.bincount(chart.reshape(-1), weights=areas))
    return np.asarray(np.sign(areas) * majority[chart.reshape(-1)] < 0)


def fault_places(bits: NDArray[np.uint8], uv: FloatArray, faces: IntArray) -> IntArray:
    """Return (k, 2) a triangle and its fault for each place with one: connected triangles with the same fault.

    Places are in the order of their faults, the largest first; the triangle is the largest one of the place.

    Args:
        bits: (m,) faults.
        uv: (u, 2) points of the layout.
        faces: (m, 3) triangles of points.
    """
    areas = np.abs(signed_double_areas(uv[faces]))
    places: list[list[int]] = []
    for bit in FAULTS.values():
        triangles = np.flatnonzero(bits & bit)
        if not len(triangles):
            continue
        _, place = np.unique(label_faces(faces[triangles], len(uv))[1], return_inverse=True)
        order = np.lexsort([-areas[triangles], place.reshape(-1)])
        first = order[np.unique(place.reshape(-1)[order], return_index=True)[1]]
        size = np.bincount(place.reshape(-1), weights=areas[triangles])
        by_size = np.argsort(-size, kind="stable")
        places += [[int(triangle), bit] for triangle in triangles[first][by_size]]
    return np.array(places[:MAX_PLACES], dtype=np.int64).reshape(-1, 2)


def _by_texture(result: Flattening) -> list[IntArray]:
    """Return the triangles of each texture; only results read from the UVs of a file have several."""
    everything = np.arange(len(result.faces))
    if result.source is None or result.face_corners is None or not is_from_file(result):
        return [everything]
    images, _ = image_numbers(result.source)
    texture = images[polygon_of(result.face_corners, result.source.offsets)]
    return [everything[texture == number] for number in np.unique(texture)]
