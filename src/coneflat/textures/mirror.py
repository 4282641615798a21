"""Models that are mirrored vertex by vertex: one half is unwrapped, and the other one shares its texels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from ..base import BoolArray, FloatArray, IntArray, Unmet, plural
from ..errors import OptionError
from ..mesh.connectivity import TriangleMesh, are_among
from ..options import Options
from ..source import Component, Prepared, Source
from .sharing import SharedTexels

# Largest distance of a vertex from the mirror image of another, and of a vertex on the plane from it, relative to the
# extent of the mesh: files have six digits or more.
SAME_PLACE = 1e-5


@dataclass(frozen=True, eq=False)
class Mirror:
    """The symmetry of a mesh of m faces about a plane that no face crosses.

    Attributes:
        plane: (4,) the unit normal of the plane, and its distance from the origin along it.
        is_half: (m,) the faces on the side of the normal.
        corners: (h, 3) the corners of these faces, as indices into all corners.
        images: (h, 3) the corners that are their mirror images.
        middle: (k,) the edges on the plane between the two halves.
    """

    plane: FloatArray
    is_half: BoolArray
    corners: IntArray
    images: IntArray
    middle: IntArray


@dataclass(frozen=True)
class NoMirror:
    """The reason why a plane is not one of symmetry.

    Attributes:
        share: fraction of the vertices or faces that are exceptions.
        reason: a text for the user.
    """

    share: float
    reason: str


def half_of(prepared: Prepared, source: Source, options: Options) -> tuple[SharedTexels, Prepared]:
    """Return which half of an input shares the texels of the other, and the other half, cut along the mirror plane.

    An edge is cut if it or its mirror image is marked, unless its half forbids it. Others are not cut if they or their
    mirror images are forbidden.

    Args:
        prepared: the input.
        source, options: those that it was prepared with.

    Raises:
        OptionError: as of `find_mirror`.
        SeamError: an edge on the plane must not be cut.
    """
    checked = prepared.checked
    mirror = find_mirror(checked.mesh)
    ends = checked.mesh.edges[mirror.middle]
    options, notes = _with_images_of_forbidden(mirror, prepared, options)
    cut = _with_images_of_marks(mirror, ends, source, options)
    half = [_with_free(component, ends) for component in cut.components if mirror.is_half[component.faces[0]]]
    plane = [*mirror.plane[:3].tolist(), float(np.ldexp(mirror.plane[3], -checked.exponent))]
    shared = SharedTexels(
        mirror.images.ravel(),
        mirror.corners.ravel(),
        has_own_points=True,
        note="The two halves share their texels; all measures are those of one half.",
        settings={"mirror_plane": plane},
    )
    return shared, replace(cut, components=tuple(half), notes=(*cut.notes, *notes))


def _with_images_of_forbidden(
    mirror: Mirror, prepared: Prepared, options: Options
) -> tuple[Options, tuple[Unmet, ...]]:
    """Return options that forbid the mirror images of forbidden edges, too, and a note on those that are marked."""
    pairs = _forbidden_in(prepared)
    images = np.sort(_images_of(mirror, prepared.checked.mesh)[pairs], axis=1)
    is_marked = are_among(images, prepared.seams)
    if not len(pairs):
        return options, ()
    ends = np.unique(np.concatenate([pairs, images[~is_marked]]), axis=0)
    options = replace(options, no_seams=prepared.checked.vertex_origin[ends])
    if not is_marked.any():
        return options, ()
    count, verb = plural(int(is_marked.sum()), "edge"), "is" if is_marked.sum() == 1 else "are"
    note = f"{count} that must not be cut {verb} cut: in the half that is unwrapped, the mirror images are marked."
    return options, (Unmet(note),)


def _forbidden_in(prepared: Prepared) -> IntArray:
    """Return (k, 2) the vertices of the edges that must not be cut."""
    return np.concatenate(
        [
            np.sort(component.vertices[component.mesh.edges[component.seams.is_forbidden]], axis=1)
            for component in prepared.components
        ]
    )


def _images_of(mirror: Mirror, mesh: TriangleMesh) -> IntArray:
    """Return (n,) the mirror images of vertices in the half that is unwrapped; for those of this half, themselves."""
    corners = mesh.faces.ravel()
    image = np.arange(len(mesh.vertices))
    image[corners[mirror.images.ravel()]] = corners[mirror.corners.ravel()]
    return image


def _with_images_of_marks(mirror: Mirror, ends: IntArray, source: Source, options: Options) -> Prepared:
    """Return the input cut along the mirror plane and marked edges, those of the other half at their mirror images too.

    Args:
        mirror, ends: the symmetry, and (k, 2) the edges on the plane.
        source, options: the input, and the options for it.
    """
    cut = _with_seams(source, options, ends)
    images = _images_of(mirror, cut.checked.mesh)[cut.seams]
    is_blocked = are_among(images, _forbidden_in(cut))
    is_missing = ~are_among(images, cut.seams) & ~is_blocked
    if is_missing.any():
        cut = _with_seams(source, options, np.concatenate([ends, images[is_missing]]))
    if not is_blocked.any():
        return cut
    count, verb = plural(int(is_blocked.sum()), "marked edge"), "is" if is_blocked.sum() == 1 else "are"
    note = Unmet(f"{count} {verb} not cut: in the half that is unwrapped, the mirror images must not be cut.")
    return replace(cut, notes=(*cut.notes, note))


def _with_seams(source: Source, options: Options, pairs: IntArray) -> Prepared:
    """Return the input with further marked edges, pairs (k, 2) of vertices of the checked mesh."""
    origin = source.checked(options.repair).vertex_origin
    return source.prepared(replace(options, seams=_with_further_seams(options.seams, origin[pairs])))


def _with_further_seams(seams: Any, pairs: IntArray) -> Any:
    """Return the option `seams` with further edges, pairs (k, 2) of vertices."""
    if isinstance(seams, str):
        return seams, pairs
    if isinstance(seams, tuple):
        return seams[0], np.concatenate([seams[1], pairs])
    return pairs if seams is None else np.concatenate([np.asarray(seams), pairs])


def _with_free(component: Component, ends: IntArray) -> Component:
    """Return a component whose sides along the mirror plane need not keep their lengths."""
    keeps = component.metric.keeps_length & ~np.isin(component.vertices, ends)
    metric = replace(component.metric, keeps_length=keeps, keeps_area=not keeps.any())
    return replace(component, metric=metric)


def find_mirror(mesh: TriangleMesh) -> Mirror:
    """Return the symmetry of a mesh about the first plane, across an axis or a principal axis, that has one.

    Raises:
        OptionError: there is none; the message is about the plane with the smallest share of exceptions.
    """
    failures = list[NoMirror]()
    for plane in _planes(mesh.vertices):
        mirror = _mirror_at(plane, mesh)
        if isinstance(mirror, Mirror):
            return mirror
        failures.append(mirror)
    best = min(failures, key=lambda failure: failure.share)
    raise OptionError(f"stack mirrored needs a model that is mirrored vertex by vertex: {best.reason}")


def _planes(points: FloatArray) -> Iterator[FloatArray]:
    """Yield planes: those across the axes through the centre, and those across the principal axes."""
    for normals, centre in (
        (np.eye(3), (points.min(axis=0) + points.max(axis=0)) / 2),
        (np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2], points.mean(axis=0)),
    ):
        for normal in normals:
            signed_normal = normal * np.sign(normal[np.abs(normal).argmax()]) + 0.0  # without -0
            yield np.append(signed_normal, centre @ signed_normal)


def _mirror_at(plane: FloatArray, mesh: TriangleMesh) -> Mirror | NoMirror:
    """Return the symmetry about a plane, or why there is none."""
    name = f"the plane across ({', '.join(f'{x:.3g}' for x in plane[:3])})"
    tolerance = SAME_PLACE * float(np.ptp(mesh.vertices, axis=0).max())
    positions, place = np.unique(mesh.vertices, axis=0, return_inverse=True)
    image = _images(positions, plane, tolerance)
    count = int((image == len(positions)).sum())
    if count:
        nouns = plural(count, "vertex", "vertices")
        return NoMirror(
            count / len(positions), f"{nouns} of {len(positions):,} without an image about {name}"
        )
    place = place.ravel()
    faces = place[mesh.faces]
    matched = _matched_corners(mesh, faces, image[faces])
    count, total = int(matched.is_missing.sum()), len(faces)
    if count:
        return NoMirror(count / total, f"{plural(count, 'face')} of {total:,} without an image about {name}")
    height = positions @ plane[:3] - plane[3]
    height[np.abs(height) <= tolerance] = 0
    low, high = height[faces].min(axis=1), height[faces].max(axis=1)
    is_half = (low >= 0) & (high > 0)
    count = int((is_half == is_half[matched.partner]).sum())
    if count:
        verb = "crosses or lies" if count == 1 else "cross or lie"
        return NoMirror(count / total, f"{plural(count, 'face')} of {total:,} {verb} in {name}")
    sides = is_half[np.maximum(mesh.edge_halfedges, 0) // 3]
    middle = np.flatnonzero((sides[:, 0] != sides[:, 1]) & ~mesh.is_boundary_edge)
    return Mirror(plane, is_half, matched.corners[is_half], matched.images[is_half], middle)


def _images(positions: FloatArray, plane: FloatArray, tolerance: float) -> IntArray:
    """Return (n,) the position nearest to the mirror image of each, n if none is within the tolerance."""
    reflected = positions - 2 * (positions @ plane[:3] - plane[3])[:, None] * plane[:3]
    return np.asarray(cKDTree(positions).query(reflected, distance_upper_bound=tolerance)[1])


@dataclass(frozen=True, eq=False)
class _MatchedFaces:
    """The m faces of a mesh, and their mirror images among them.

    Attributes:
        partner: (m,) the face that is the image of each.
        corners: (m, 3) the corners of each face.
        images: (m, 3) the corners of its image that are the images of these.
        is_missing: (m,) faces whose image is not a face, or whose vertices have other images in other faces.
    """

    partner: IntArray
    corners: IntArray
    images: IntArray
    is_missing: BoolArray


def _matched_corners(mesh: TriangleMesh, faces: IntArray, mirrored: IntArray) -> _MatchedFaces:
    """Return which faces are images of which.

    Args:
        mesh: the mesh.
        faces, mirrored: (m, 3) the positions of the corners of each face, and the positions of their images.
    """
    # The corners of each face in order, and those of its image in the reverse order, from the smallest position.
    start = 3 * np.arange(len(faces))[:, None]
    in_order, in_reverse = (
        start + (rows.argmin(axis=1)[:, None] + sign * np.arange(3)) % 3
        for rows, sign in ((faces, 1), (mirrored, -1))
    )
    rows = np.concatenate([faces.ravel()[in_order], mirrored.ravel()[in_reverse]])
    key, image_key = np.split(np.unique(rows, axis=0, return_inverse=True)[1].ravel(), 2)
    # Of faces at the same place, which are layers of the surface, the first is the image of the first, and so on.
    order = np.argsort(key, kind="stable")
    layer = np.empty_like(order)
    layer[order] = np.arange(len(order)) - np.searchsorted(key[order], key[order])
    partner = order[np.minimum(np.searchsorted(key[order], image_key) + layer, len(key) - 1)]
    is_missing = (key[partner] != image_key) | (partner[partner] != np.arange(len(faces)))
    vertices, at_corner = np.full(len(mesh.vertices), -1), mesh.faces.ravel()
    with_image = np.flatnonzero(~is_missing)
    vertices[at_corner[in_reverse[with_image]]] = at_corner[in_order[partner[with_image]]]
    is_missing |= (vertices[at_corner[in_reverse]] != at_corner[in_order[partner]]).any(axis=1)
    return _MatchedFaces(partner, in_reverse, in_order[partner], is_missing)
