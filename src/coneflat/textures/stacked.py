"""Components that are copies of others, or the other side of the same cloth: they share the texels of the first.

Mirror images are copies, too. As the other half of a mirrored model, they are flipped in the texture: normal maps are
baked for the first, and renderers mirror the tangents of the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..base import IntArray, plural
from ..mesh import weld
from ..source import Component, Congruence, Prepared, congruence, find_copies, has_vertex_options
from ..source.copies import MAX_COMPARED, numbered_corners, option_labels
from .sharing import SharedTexels

# Largest relative difference of the sizes of copies that share texels: those of other sizes would have another density.
# And of their positions: files have six digits or more.
SAME_SIZE, SAME_PLACE = 1e-4, 1e-5


def without_copies(prepared: Prepared) -> tuple[SharedTexels, Prepared]:
    """Return the copies among the components of an input, and the input without them."""
    components = prepared.components
    corners, partners, copied = list[IntArray](), list[IntArray](), set[int]()
    places = weld(prepared.checked.mesh.vertices)[1]
    first_side = dict[bytes, int]()
    # For each component, the corners in an order of their own, and the corners whose UV they have.
    orders, shown = list[IntArray](), list[IntArray]()
    # Whether each component is a mirror image of that whose texels it shares; the back of cloth is if its front is.
    is_mirrored = list[bool]()
    mirrored_count = 0
    for i, (component, copy) in enumerate(zip(components, _matched_copies(components), strict=True)):
        key, order = _ordered_corners(
            places[component.vertices][component.mesh.faces], option_labels(component)
        )
        side, matched, mirrors = first_side.setdefault(key, i), _corners_of(component), False
        if side != i:
            matched = np.empty_like(matched)
            matched[order] = shown[side][orders[side]]
            mirrors = is_mirrored[side]
        elif copy is not None:
            first, match = copy
            matched = shown[first][match.corners]
            mirrors = match.is_mirrored != is_mirrored[first]
            mirrored_count += mirrors
        is_mirrored.append(mirrors)
        shown.append(matched)
        orders.append(order)
        if matched[0] // 3 != component.faces[0]:
            copied.add(i)
            corners.append(_corners_of(component))
            partners.append(matched)
    remaining = tuple(component for i, component in enumerate(components) if i not in copied)
    note = _note(len(copied), mirrored_count)
    shared = SharedTexels(_joined(corners), _joined(partners), has_own_points=False, note=note)
    return shared, replace(prepared, components=remaining)


def _matched_copies(components: Sequence[Component]) -> list[tuple[int, Congruence] | None]:
    """Return for each component the component of which it is a copy, and how they match; None for the first of a kind.

    Where the numbers of the vertices do not match, or only those of a mirror image, positions are compared: a symmetric
    component is a copy of its mirror image.
    """
    matches, kinds = list[tuple[int, Congruence] | None](), dict[tuple[int, int], list[int]]()
    copies = find_copies(components, rounding=SAME_PLACE)
    for i, (component, copy) in enumerate(zip(components, copies, strict=True)):
        if copy is not None and abs(copy.scale - 1) <= SAME_SIZE:
            corners = numbered_corners(components[copy.first], component)
            by_number = copy.first, Congruence(corners, copy.is_mirrored)
            mirrored = [copy.first] if copy.is_mirrored else []
            matches.append(_first_match(components, mirrored, component) or by_number)
            continue
        kind = kinds.setdefault((len(component.vertices), len(component.faces)), [])
        match = _first_match(components, kind[:MAX_COMPARED], component)
        matches.append(match)
        if match is None and not has_vertex_options(component):
            kind.append(i)
    return matches


def _first_match(
    components: Sequence[Component], kind: Sequence[int], component: Component
) -> tuple[int, Congruence] | None:
    """Return the first of some components to which another one is congruent, and how; None if there is none."""
    for first in kind if not has_vertex_options(component) else ():
        candidate = components[first]
        labels = option_labels(candidate), option_labels(component)
        match = congruence(candidate.mesh, component.mesh, SAME_PLACE, labels)
        if match is not None:
            return first, match
    return None


def _note(count: int, mirrored: int) -> str:
    if not count:
        return "No component shares the texels of another: copies have the same shape, size, triangles and options."
    verb, copula = ("shares" if count == 1 else "share"), ("is" if mirrored == 1 else "are")
    flips = (
        f" {mirrored:,} of them {copula} mirrored, which flips the triangles in the texture."
        if mirrored
        else ""
    )
    return f"{plural(count, 'component')} {verb} the texels of others; all measures are those without them.{flips}"


def _corners_of(component: Component) -> IntArray:
    """Return (3m,) the corners of a component's faces, as indices into all corners of the mesh."""
    return (3 * component.faces[:, None] + np.arange(3)).ravel()


def _joined(arrays: Sequence[IntArray]) -> IntArray:
    return np.concatenate(arrays) if arrays else np.empty(0, dtype=np.int64)


def _ordered_corners(places: IntArray, labels: IntArray) -> tuple[bytes, IntArray]:
    """Return a key that is equal for faces at the same places, of any orientation, and (3m,) the corners in its order.

    Args:
        places: (m, 3) the place of each corner.
        labels: (3m,) further values of the corners that are equal, too.
    """
    within = np.argsort(places, axis=1, kind="stable")
    rows = np.take_along_axis(places, within, axis=1)
    rank = np.lexsort(rows.T[::-1])
    order = (3 * rank[:, None] + within[rank]).ravel()
    return rows[rank].tobytes() + labels[order].tobytes(), order
