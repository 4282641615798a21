"""Between the user's numbering of vertices and faces and that of the checked mesh."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

import numpy as np

from ._arrays import BoolArray, FloatArray, IntArray
from .errors import OptionError
from .validation import CheckedMesh


def result_numbering(checked: CheckedMesh, input_count: int) -> tuple[IntArray, IntArray]:
    """Number the checked mesh's vertices as the input does; those that a repair added come after them.

    Returns:
        (n,) the number of each vertex of the checked mesh, and (r,) the input vertex of each number.
    """
    origin = checked.vertex_origin
    is_added = np.zeros(len(origin), dtype=bool)
    is_added[1:] = origin[1:] == origin[:-1]
    number = origin.copy()
    number[is_added] = input_count + np.arange(int(is_added.sum()))
    return number, np.concatenate([np.arange(input_count), origin[is_added]])


Values = TypeVar("Values", IntArray, BoolArray)


def turn_corners(checked: CheckedMesh, per_corner: Values) -> Values:
    """Bring values at the input's triangle corners (m, 3) to the faces of the checked mesh."""
    values = per_corner[checked.face_origin]
    return np.where(checked.is_turned[:, None], values[:, [0, 2, 1]], values)


def locate_cones(checked: CheckedMesh, given: Mapping[int, float | None]) -> tuple[IntArray, FloatArray]:
    """Return given cones as vertices of the checked mesh, and curvatures, NaN where none is given.

    Raises:
        OptionError: a cone is no vertex of the input, has no face, or lies on the boundary.
    """
    names = np.array(list(given), dtype=np.int64)
    highest = int(checked.vertex_origin[-1])
    for name in names[(names < 0) | (names > highest)]:
        raise OptionError(f"cone {name} is no vertex of a face: these are numbered from 0 to {highest}")
    found = np.searchsorted(checked.vertex_origin, names)
    for name in names[checked.vertex_origin[found] != names]:
        raise OptionError(f"cone {name} cannot be used: no face uses this vertex")
    for name in names[checked.mesh.is_boundary_vertex[found]]:
        raise OptionError(
            f"cone {name} lies on the boundary, which is free and takes what curvature it needs: "
            "choose interior vertices"
        )
    curvatures = np.array([np.nan if k is None else k for k in given.values()], dtype=np.float64)
    return found, curvatures
