"""Components that are copies of others, or the other side of the same cloth: they share the texels of the first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base import FloatArray, IntArray, mask_of, plural
from ..mesh import weld
from ..result import Flattening
from ..source import Component, Prepared, find_copies, result_numbering

# Largest relative difference of the sizes of copies that share texels: those of other sizes would have another density.
# And of their positions: files have six digits or more.
SAME_SIZE, SAME_PLACE = 1e-4, 1e-5


@dataclass(frozen=True, eq=False)
class Stacked:
    """The corners of copies, and those of the components whose texels they share.

    Attributes:
        corners: (c,) corners of faces of the checked mesh, as indices into all corners.
        partners: (c,) the corners whose UV points they have.
        count: the number of copies.
    """

    corners: IntArray
    partners: IntArray
    count: int


def without_copies(prepared: Prepared) -> tuple[Stacked, Prepared]:
    """Return the copies among the components of an input, and the input without them."""
    components = prepared.components
    corners, partners, left_out = list[IntArray](), list[IntArray](), set[int]()
    places = weld(prepared.checked.mesh.vertices)[1]
    sides = dict[bytes, int]()
    # The corners, in an order of their own, that have the UV points of each component or those of an earlier one.
    shown, orders = list[IntArray](), list[IntArray]()
    for i, (component, copy) in enumerate(
        zip(components, find_copies(components, rounding=SAME_PLACE), strict=True)
    ):
        key, order = _ordered_corners(places[component.vertices][component.mesh.faces])
        side, matched = sides.setdefault(key, i), _corners_of(component)
        if side != i:
            matched = np.empty_like(matched)
            matched[order] = shown[side][orders[side]]
        elif copy is not None and abs(copy.scale - 1) <= SAME_SIZE:
            matched = shown[copy.first]
        shown.append(matched)
        orders.append(order)
        if matched[0] != _corners_of(component)[0]:
            left_out.add(i)
            corners.append(_corners_of(component))
            partners.append(matched)
    remaining = tuple(component for i, component in enumerate(components) if i not in left_out)
    stacked = Stacked(_joined(corners), _joined(partners), len(left_out))
    return stacked, replace(prepared, components=remaining)


def with_copies_stacked(alone: Flattening, stacked: Stacked, prepared: Prepared) -> Flattening:
    """Return the result for all components from that without copies; the measures remain those without copies.

    Args:
        alone: the result for the input in `prepared`.
        stacked, prepared: as `without_copies` returns them.
    """
    checked = prepared.checked
    number, _ = result_numbering(checked, len(np.asarray(prepared.input_mesh.vertices)))
    faces = number[checked.mesh.faces]
    chosen = np.sort(np.concatenate([component.faces for component in prepared.components]))
    of_corners = np.full(faces.size, -1)
    of_corners[(3 * chosen[:, None] + np.arange(3)).ravel()] = alone.uv_faces.ravel()
    of_corners[stacked.corners] = of_corners[stacked.partners]
    partner = np.arange(len(faces))
    partner[stacked.corners // 3] = stacked.partners // 3
    row_of_face = np.full(len(faces), -1)
    row_of_face[chosen] = np.arange(len(chosen))
    row = row_of_face[partner]
    # The vertex of the first component for each vertex of a copy.
    source = np.arange(len(alone.vertices))
    source[faces.ravel()[stacked.corners]] = faces.ravel()[stacked.partners]
    is_cone = mask_of(len(source), alone.cones)
    used = mask_of(len(source), faces)
    cones = np.flatnonzero(is_cone[source] & used)
    curvature = np.zeros(len(source))
    curvature[alone.cones] = alone.curvatures

    def of_vertices(values: FloatArray) -> FloatArray:
        return np.where(np.isnan(values), values[source], values)

    measures = alone.distortion
    return replace(
        alone,
        faces=faces,
        face_origin=checked.face_origin,
        uv_faces=of_corners.reshape(-1, 3),
        cones=cones,
        curvatures=curvature[source[cones]],
        seams=_seams_of_all(alone.seams, faces, stacked),
        log_scale=of_vertices(alone.log_scale),
        prescribed=of_vertices(alone.prescribed),
        curvature_residual=of_vertices(alone.curvature_residual),
        distortion=replace(measures, qc=measures.qc[row], log_area_scale=measures.log_area_scale[row]),
        notes=(*alone.notes, *_notes(stacked)),
    )


def _notes(stacked: Stacked) -> tuple[str, ...]:
    if not stacked.count:
        return (
            "No component shares the texels of another: copies have the same vertices in the same order.",
        )
    verb = "shares" if stacked.count == 1 else "share"
    return (
        f"{plural(stacked.count, 'component')} {verb} the texels of others; all measures are those without them.",
    )


def _seams_of_all(seams: IntArray, faces: IntArray, stacked: Stacked) -> IntArray:
    """Return (k, 2) the seams (j, 2), and the edges of copies whose partners are seams."""
    partner = np.full(faces.size, -1)
    partner[stacked.corners] = stacked.partners
    corners = stacked.corners.reshape(-1, 3)
    ends = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2)
    own, of_first = (np.sort(faces.ravel()[at], axis=1) for at in (ends, partner[ends]))
    seams, unit = np.sort(seams, axis=1), int(faces.max()) + 1
    is_seam = np.isin(of_first @ [unit, 1], seams @ [unit, 1])
    return np.unique(np.concatenate([seams, own[is_seam]]), axis=0)


def _corners_of(component: Component) -> IntArray:
    """Return (3m,) the corners of a component's faces, as indices into all corners of the mesh."""
    return (3 * component.faces[:, None] + np.arange(3)).ravel()


def _joined(arrays: Sequence[IntArray]) -> IntArray:
    return np.concatenate(arrays) if arrays else np.empty(0, dtype=np.int64)


def _ordered_corners(places: IntArray) -> tuple[bytes, IntArray]:
    """Return a key that is equal for faces at the same places, of any orientation, and (3m,) the corners in its order.

    places: (m, 3) the place of each corner.
    """
    within = np.argsort(places, axis=1, kind="stable")
    rows = np.take_along_axis(places, within, axis=1)
    order = np.lexsort(rows.T[::-1])
    return rows[order].tobytes(), (3 * order[:, None] + within[order]).ravel()
