"""Detection of components that are copies of each other, such as bolts or leaves; their layout is computed once.

For 60 copies of a sphere of 320 triangles this reduces the time to 44%.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..stages import Layout
from .components import Component
from .congruent import best_orthogonal, has_same_sides, position_tolerance

# Largest distance of the vertices of a copy from the transformed vertices of the first, relative to the largest
# coordinates: rounding errors. And largest relative difference of side lengths: a tenth of the accuracy of metrics.
COPY_ROUNDING, SIDE_TOLERANCE = 2.0**-48, 1e-10
# Digits of the values by which possible copies are grouped before they are compared.
MATCHED_DIGITS = 6
# Largest number of kinds of the same group with which a component is compared. Copies of a coarser precision, such as
# that of a file, would all be kinds of their own.
MAX_COMPARED = 8


@dataclass(frozen=True)
class Copy:
    """A reference to the component of which another is a copy.

    Attributes:
        first: index of the first component of its kind.
        scale: size of the copy divided by the size of the first.
        is_mirrored: whether it is a mirror image.
    """

    first: int
    scale: float
    is_mirrored: bool = False


def find_copies(
    components: Sequence[Component], excluded: Container[int] = (), rounding: float | None = None
) -> list[Copy | None]:
    """Return for each component the component of which it is a copy, None for the first of a kind.

    Copies have the same connectivity with the same numbering and the same options for vertices and edges; a rotation, a
    translation and a uniform scaling map one to the other. With a rounding, corners of a face may be in any order, and
    mirror images, whose faces have the opposite orientation, are copies, too.

    Args:
        components: the components.
        excluded: indices of components that are not compared.
        rounding: rounding errors of positions, relative to the largest coordinates, see `position_tolerance`; copies
            then have the same size. None for copies of any size that are exact up to the rounding of doubles.
    """
    copies: list[Copy | None] = [None] * len(components)
    if len(components) == 1:
        return copies
    kinds: dict[tuple[object, ...], list[int]] = {}
    for i, component in enumerate(components):
        if i in excluded or has_vertex_options(component):
            continue
        key = _copy_key(component) if rounding is None else _numbered_key(component)
        alike = kinds.setdefault(key, [])
        for first in alike[:MAX_COMPARED]:
            is_reversed = _reversed_faces(components[first], component)
            if is_reversed.any() != is_reversed.all():
                continue
            is_mirrored = bool(is_reversed.all())
            scale = _scale_of_copy(components[first], component, rounding, is_mirrored)
            if scale is not None:
                copies[i] = Copy(first, scale, is_mirrored)
                break
        else:
            alike.append(i)
    return copies


def numbered_corners(first: Component, component: Component) -> IntArray:
    """Return (3m,) the corners of the first component that those of another one with the same numbering are.

    The corners of a face may be in another order.
    """
    orders = [_order_by_vertex(part.mesh.faces) for part in (first, component)]
    corners = np.empty_like(orders[0])
    corners[orders[1]] = orders[0]
    return corners


def _order_by_vertex(faces: IntArray) -> IntArray:
    """Return (3m,) the corners of faces (m, 3), those of each face by their vertices."""
    return (3 * np.arange(len(faces))[:, None] + np.argsort(faces, axis=1)).ravel()


def copied(first: Layout, component: Component, scale: float) -> Layout:
    """Return the layout of a copy from the layout of the first component of its kind."""
    return replace(first, mesh=component.mesh, lengths=component.lengths, points=scale * first.points)


def has_vertex_options(component: Component) -> bool:
    """Return whether options name single vertices of a component."""
    cones = component.cones
    weights = cones.weights, component.seams.weights, component.seams.visibility
    return bool(
        len(cones.prescribed)
        or len(component.metric.corners)
        or len(cones.required)
        or any(per_vertex is not None for per_vertex in weights)
    )


def option_labels(component: Component) -> IntArray:
    """Return (3m,) the options for the vertex and the opposite side of each corner, as bits: equal for copies."""
    vertices, edges = component.mesh.faces.ravel(), component.mesh.halfedge_edges
    flags = (
        component.seams.is_avoided[edges],
        component.seams.is_forbidden[edges],
        component.cones.is_allowed[vertices],
        component.metric.keeps_length[vertices],
    )
    return sum((flag.astype(np.int64) << bit for bit, flag in enumerate(flags)), np.zeros_like(vertices))


def _numbered_key(component: Component) -> tuple[object, ...]:
    """Return a hash key that is equal for the same faces with the same options, with their corners in any order."""
    faces = component.mesh.faces
    labels = option_labels(component)[_order_by_vertex(faces)]
    return np.sort(faces, axis=1).tobytes(), labels.tobytes()


def _copy_key(component: Component) -> tuple[object, ...]:
    """Return a hash key that is equal for copies, and differs for most other components."""
    lengths = component.lengths
    size = np.sqrt((lengths * lengths).sum())
    shape = [
        float(f"{value / size:.{MATCHED_DIGITS}g}") for value in (lengths[0, 0], lengths.sum(), lengths.max())
    ]
    return (component.mesh.faces.tobytes(), option_labels(component).tobytes(), *shape)


def _reversed_faces(first: Component, component: Component) -> BoolArray:
    """Return (m,) the faces that have the opposite orientation in a component with the same vertices of each face."""
    is_odd = [
        (rows[:, 0] > rows[:, 1]) ^ (rows[:, 1] > rows[:, 2]) ^ (rows[:, 0] > rows[:, 2])
        for rows in (first.mesh.faces, component.mesh.faces)
    ]
    return is_odd[0] != is_odd[1]


def _scale_of_copy(
    first: Component, component: Component, rounding: float | None, is_mirrored: bool = False
) -> float | None:
    """Return the size of a component relative to the component of which it is a copy; None if it is not a copy.

    Args:
        first, component: the two components.
        rounding: as of `find_copies`.
        is_mirrored: whether mirror images are copies, instead of others.
    """
    first_centred, centred = (p.mesh.vertices - p.mesh.vertices.mean(axis=0) for p in (first, component))
    sizes = np.sqrt((first_centred * first_centred).sum()), np.sqrt((centred * centred).sum())
    if not (sizes[0] > 0 and sizes[1] > 0):
        return None
    scale = float(sizes[1] / sizes[0])
    motion = best_orthogonal(first_centred, centred, -1.0 if is_mirrored else 1.0)
    off: FloatArray = np.abs((first_centred @ motion) * scale - centred).max(axis=1)
    reach = float(np.abs(component.mesh.vertices).max() + scale * np.abs(first.mesh.vertices).max())
    sides = np.abs(scale * first.lengths - component.lengths)
    if rounding is not None:
        is_close = off.max() <= position_tolerance(first.mesh, component.mesh, rounding)
        corners = numbered_corners(first, component)
        return scale if is_close and has_same_sides(first.mesh, component.mesh, corners) else None
    is_copy = off.max() <= COPY_ROUNDING * reach and (sides <= SIDE_TOLERANCE * component.lengths).all()
    return scale if is_copy else None
