"""Models that are mirrored vertex by vertex: the map of one half, and that of both, which share their texels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from ..base import BoolArray, FloatArray, IntArray, plural
from ..errors import OptionError
from ..mesh.connectivity import TriangleMesh
from ..options import Options
from ..result import Flattening
from ..source import Component, Prepared, Source, result_numbering

# Largest distance of a vertex from the mirror image of another, and of a vertex on the plane from it, relative to the
# extent of the mesh: files have six digits or more.
SAME_PLACE = 1e-5


@dataclass(frozen=True, eq=False)
class Mirror:
    """The symmetry of a mesh of n vertices and m faces about a plane that no face crosses.

    Attributes:
        plane: (4,) the unit normal of the plane, and its distance from the origin along it.
        vertices: (n,) the mirror image of each vertex.
        is_half: (m,) the faces on the side of the normal.
        corners: (h, 3) the corners of these faces, as indices into all corners.
        images: (h, 3) the corners that are their mirror images.
        middle: (k,) the edges on the plane between the two halves.
    """

    plane: FloatArray
    vertices: IntArray
    is_half: BoolArray
    corners: IntArray
    images: IntArray
    middle: IntArray


def find_mirror(mesh: TriangleMesh) -> Mirror:
    """Return the symmetry of a mesh about the first plane, across an axis or a principal axis, that has one.

    Raises:
        OptionError: there is none; the message is about the plane with the smallest share of exceptions.
    """
    failures = list[tuple[float, str]]()
    for plane in _planes(mesh.vertices):
        found = _mirror_at(plane, mesh)
        if isinstance(found, Mirror):
            return found
        failures.append(found)
    why = min(failures, key=lambda one: one[0])[1]
    raise OptionError(f"stack mirrored needs a model that is mirrored vertex by vertex: {why}")


def half_of(prepared: Prepared, source: Source, options: Options) -> tuple[Mirror, Prepared]:
    """Return the symmetry of an input, and its half, cut along the mirror plane.

    Args:
        prepared: the input.
        source, options: those that it was prepared with.

    Raises:
        OptionError: as of `find_mirror`.
        SeamError: an edge on the plane must not be cut.
    """
    checked, seams = prepared.checked, options.seams
    mirror = find_mirror(checked.mesh)
    ends = checked.mesh.edges[mirror.middle]
    pairs = checked.vertex_origin[ends]
    if isinstance(seams, str):
        seams = seams, pairs
    elif isinstance(seams, tuple):
        seams = seams[0], np.concatenate([seams[1], pairs])
    else:
        seams = pairs if seams is None else np.concatenate([np.asarray(seams), pairs])
    whole = source.prepared(replace(options, seams=seams))
    components = [
        _with_free(component, ends) for component in whole.components if mirror.is_half[component.faces[0]]
    ]
    return mirror, replace(whole, components=tuple(components))


def both_halves(half: Flattening, mirror: Mirror, prepared: Prepared) -> Flattening:
    """Return the result for both halves from that of one; the measures remain those of one half.

    Args:
        half: the result for the half in `prepared`.
        mirror, prepared: as `half_of` returns them.
    """
    checked = prepared.checked
    number, _ = result_numbering(checked, len(np.asarray(prepared.input_mesh.vertices)))
    faces, chosen, partner = number[checked.mesh.faces], mirror.corners[:, 0] // 3, mirror.images[:, 0] // 3
    image = np.arange(len(half.vertices))
    image[number] = number[mirror.vertices]
    uv_faces = np.empty(faces.shape, dtype=np.int64)
    uv_faces[chosen] = half.uv_faces
    uv_faces.ravel()[mirror.images] = uv_faces.ravel()[mirror.corners] + len(half.uv)

    def of_faces(values: FloatArray) -> FloatArray:
        found = np.empty(len(faces))
        found[chosen] = found[partner] = values
        return found

    def of_vertices(values: FloatArray) -> FloatArray:
        return np.where(np.isnan(values), values[image], values)

    measures = half.distortion
    cones, first = np.unique(np.concatenate([half.cones, image[half.cones]]), return_index=True)
    plane = [*mirror.plane[:3].tolist(), float(np.ldexp(mirror.plane[3], -checked.exponent))]
    return replace(
        half,
        faces=faces,
        face_origin=checked.face_origin,
        uv=np.concatenate([half.uv, half.uv]),
        uv_faces=uv_faces,
        cones=cones,
        curvatures=np.tile(half.curvatures, 2)[first],
        seams=np.unique(np.sort(np.concatenate([half.seams, image[half.seams]]), axis=1), axis=0),
        log_scale=of_vertices(half.log_scale),
        prescribed=of_vertices(half.prescribed),
        curvature_residual=of_vertices(half.curvature_residual),
        distortion=replace(
            measures, qc=of_faces(measures.qc), log_area_scale=of_faces(measures.log_area_scale)
        ),
        notes=(*half.notes, "The two halves share their texels; all measures are those of one half."),
        settings={**half.settings, "mirror_plane": plane},
    )


def _planes(points: FloatArray) -> Iterator[FloatArray]:
    """Yield planes: those across the axes through the centre, and those across the principal axes."""
    for normals, centre in (
        (np.eye(3), (points.min(axis=0) + points.max(axis=0)) / 2),
        (np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2], points.mean(axis=0)),
    ):
        for normal in normals:
            own = normal * np.sign(normal[np.abs(normal).argmax()]) + 0.0  # without -0
            yield np.append(own, centre @ own)


def _mirror_at(plane: FloatArray, mesh: TriangleMesh) -> Mirror | tuple[float, str]:
    """Return the symmetry about a plane, or what is in its way: the share of exceptions, and a text."""
    extent = float(np.ptp(mesh.vertices, axis=0).max())
    positions, place = np.unique(mesh.vertices, axis=0, return_inverse=True)
    height = positions @ plane[:3] - plane[3]
    height[np.abs(height) <= SAME_PLACE * extent] = 0
    reflected = positions - 2 * (positions @ plane[:3] - plane[3])[:, None] * plane[:3]
    _, image = cKDTree(positions).query(reflected, distance_upper_bound=SAME_PLACE * extent)
    name = f"the plane across ({', '.join(f'{x:.3g}' for x in plane[:3])})"
    if (image == len(positions)).any():
        count = int((image == len(positions)).sum())
        return (
            count / len(positions),
            f"{plural(count, 'vertex', 'vertices')} of {len(positions):,} without an image about {name}",
        )
    # The corners of each face in order, and in the reverse order, from the smallest position.
    own, turned = place.ravel()[mesh.faces], image[place.ravel()[mesh.faces]]
    start = 3 * np.arange(len(own))[:, None]
    here, there = (
        start + (rows.argmin(axis=1)[:, None] + sign * np.arange(3)) % 3
        for rows, sign in ((own, 1), (turned, -1))
    )
    rows = np.concatenate([own.ravel()[here], turned.ravel()[there]])
    key, back = np.split(np.unique(rows, axis=0, return_inverse=True)[1].ravel(), 2)
    # Of faces at the same place, which are layers of the surface, the first is the image of the first, and so on.
    order = np.argsort(key, kind="stable")
    layer = np.empty_like(order)
    layer[order] = np.arange(len(order)) - np.searchsorted(key[order], key[order])
    partner = order[np.minimum(np.searchsorted(key[order], back) + layer, len(key) - 1)]
    is_missing = (key[partner] != back) | (partner[partner] != np.arange(len(own)))
    vertices = np.full(len(mesh.vertices), -1)
    of_corners, known = mesh.faces.ravel(), np.flatnonzero(~is_missing)
    vertices[of_corners[there[known]]] = of_corners[here[partner[known]]]
    is_missing |= (vertices[of_corners[there]] != of_corners[here[partner]]).any(axis=1)
    if is_missing.any():
        count = int(is_missing.sum())
        return count / len(own), f"{plural(count, 'face')} of {len(own):,} without an image about {name}"
    low, high = height[own].min(axis=1), height[own].max(axis=1)
    is_half = (low >= 0) & (high > 0)
    crosses = is_half == is_half[partner]
    if crosses.any():
        count = int(crosses.sum())
        verb = "crosses or lies" if count == 1 else "cross or lie"
        return count / len(own), f"{plural(count, 'face')} of {len(own):,} {verb} in {name}"
    sides = is_half[np.maximum(mesh.edge_halfedges, 0) // 3]
    middle = np.flatnonzero((sides[:, 0] != sides[:, 1]) & ~mesh.is_boundary_edge)
    return Mirror(plane, vertices, is_half, there[is_half], here[partner[is_half]], middle)


def _with_free(component: Component, ends: IntArray) -> Component:
    """Return a component whose sides along the mirror plane need not keep their lengths."""
    keeps = component.metric.keeps_length & ~np.isin(component.vertices, ends)
    return replace(
        component, metric=replace(component.metric, keeps_length=keeps, keeps_area=not keeps.any())
    )
