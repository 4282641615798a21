"""Between the user's numbering of vertices and faces and that of the checked mesh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np

from ._arrays import BoolArray, FloatArray, IntArray
from .errors import OptionError
from .mesh import TriangleMesh
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


def at_unit_size(checked: CheckedMesh) -> CheckedMesh:
    """Return the mesh scaled by a power of two, which rounds nothing, so that squares of lengths are no extremes."""
    size = float(np.abs(checked.mesh.vertices).max())
    exponent = -int(np.frexp(size)[1])
    mesh = TriangleMesh(np.ldexp(checked.mesh.vertices, exponent), checked.mesh.faces)
    return replace(checked, mesh=mesh, exponent=exponent)


def turn_corners(checked: CheckedMesh, per_corner: Values) -> Values:
    """Bring values at the input's triangle corners (m, 3) to the faces of the checked mesh."""
    values = per_corner[checked.face_origin]
    return np.where(checked.is_turned[:, None], values[:, [0, 2, 1]], values)


def locate(checked: CheckedMesh, noun: str, given: Mapping[int, float | None]) -> tuple[IntArray, FloatArray]:
    """Return given cones or corners as vertices of the checked mesh, with curvatures, NaN where none is given.

    Args:
        checked: the mesh.
        noun: "cone", which must be inside, or "corner", which must be on the boundary.
        given: input vertex -> curvature or None.

    Raises:
        OptionError: one is no vertex of the input, has no face, or is not where it must be.
    """
    names = np.array(list(given), dtype=np.int64)
    highest = int(checked.vertex_origin[-1])
    for name in names[(names < 0) | (names > highest)]:
        raise OptionError(f"{noun} {name} is no vertex of a face: these are numbered from 0 to {highest}")
    found = np.searchsorted(checked.vertex_origin, names)
    for name in names[checked.vertex_origin[found] != names]:
        raise OptionError(f"{noun} {name} cannot be used: no face uses this vertex")
    on_boundary = checked.mesh.is_boundary_vertex[found]
    if noun == "cone":
        for name in names[on_boundary]:
            raise OptionError(
                f"cone {name} lies on the boundary, which takes what curvature it needs: choose inner vertices, "
                "or prescribe the boundary's curvature (boundary, --corner)"
            )
    else:
        for name in names[~on_boundary]:
            raise OptionError(f"corner {name} does not lie on the boundary")
    curvatures = np.array([np.nan if k is None else k for k in given.values()], dtype=np.float64)
    return found, curvatures


def select(given: tuple[IntArray, FloatArray], vertices: IntArray) -> tuple[IntArray, FloatArray]:
    """Return those of the given vertices that are in a component, numbered there.

    Args:
        given: vertices of the whole mesh, and a value for each.
        vertices: (n,) vertices of the component, ascending.
    """
    inside = np.isin(given[0], vertices)
    return np.searchsorted(vertices, given[0][inside]), given[1][inside]
