"""Symmetric quads on the surface that is given, compared with those without symmetry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from ..base import Unmet, plural
from ..geometry import face_normals
from ..geometry.nearest import TriangleTree
from ..mesh import label_components
from ..mesh.connectivity import TriangleMesh
from .crease_fit import crease_fit
from .cross_field import is_mechanical
from .mirror_planes import SAME_PLACE, MirrorPlane
from .quad_mesh import QuadMesh
from .quality import corner_angles_of, inverted_count
from .request import GridRequest

# Largest ratio of the number of irregular vertices of symmetric quads to that of others, of the factors by which
# the numbers of quads differ from the requested one, and of mean angles.
MAX_WORSE = 1.1
# Largest share of the length of sharp edges that others follow and symmetric quads do not.
MAX_UNFOLLOWED = 0.02
# By how much the mean and the largest angle of symmetric quads may be farther from 90 degrees, degrees.
MAX_MORE_ON_AVERAGE, MAX_MORE_DEGREES = 0.2, 10.0


def are_symmetric(quads: QuadMesh, plane: MirrorPlane) -> bool:
    """Return whether the mirror images of all vertices of quads are vertices, up to rounding."""
    gaps, images = cKDTree(quads.vertices).query(plane.reflected(quads.vertices))
    return bool((gaps <= SAME_PLACE * plane.size).all()) and len(np.unique(images)) == len(images)


def fault(symmetric: QuadMesh, quads: QuadMesh, request: GridRequest) -> str:
    """Return why symmetric quads of a surface are worse than those without symmetry, "" if they are not."""
    counts, numbers = (
        [len(mesh.irregular) for mesh in (symmetric, quads)],
        [len(symmetric.quads), len(quads.quads)],
    )
    if counts[0] > MAX_WORSE * counts[1]:
        return f"they would have {plural(counts[0], 'irregular vertex', 'irregular vertices')} instead of {counts[1]:,}"
    if topology_gap(symmetric) > topology_gap(quads):
        return "they would have holes or components that it has not"
    requested = request.limit.requested
    ratios = [max(number / requested, requested / number) for number in numbers]
    if ratios[0] > MAX_WORSE * ratios[1]:
        return f"they would be {numbers[0]:,} instead of {numbers[1]:,}"
    return _fault_at_creases(symmetric, quads, request)


def fault_of_angles(symmetric: QuadMesh, quads: QuadMesh) -> str:
    """Return how much worse the angles of smoothed symmetric quads are, "" if they are not."""
    inverted = [inverted_count(mesh) for mesh in (symmetric, quads)]
    if inverted[0] > inverted[1]:
        return f"{inverted[0]:,} would have an angle of 180 degrees or more instead of {inverted[1]:,}"
    off = [np.abs(corner_angles_of(mesh) - 90.0) for mesh in (symmetric, quads)]
    means, largest = [float(angles.mean()) for angles in off], [float(angles.max()) for angles in off]
    if means[0] > MAX_WORSE * means[1] + MAX_MORE_ON_AVERAGE:
        return f"angles would be off by {means[0]:.1f} degrees on average instead of {means[1]:.1f}"
    if largest[0] > largest[1] + MAX_MORE_DEGREES:
        return f"an angle would be off by {largest[0]:.0f} degrees instead of {largest[1]:.0f}"
    return ""


def _fault_at_creases(symmetric: QuadMesh, quads: QuadMesh, request: GridRequest) -> str:
    """Return how much less symmetric quads follow sharp edges, "" if not, or if these need not be followed."""
    if request.sharp_angle is None and not is_mechanical(request.mesh):
        return ""
    shares = [crease_fit(mesh, request.angle).share for mesh in (symmetric, quads)]
    if shares[0] >= shares[1] - MAX_UNFOLLOWED:
        return ""
    percents = [f"{100 * share:.0f} %" for share in shares]
    return f"{percents[0]} of the length of sharp edges would be on edges of quads instead of {percents[1]}"


def asymmetry_note(plane: MirrorPlane, reason: str) -> Unmet:
    """Return a note that a grid is not symmetric about a plane of its surface, and why."""
    return Unmet(f"The quads are not symmetric about {plane}, as the surface is: {reason}.")


def on_given_surface(quads: QuadMesh, mesh: TriangleMesh) -> QuadMesh:
    """Return doubled quads, on a half surface and its image, as those of the given surface.

    Positions stay symmetric. Where only diagonals of polygons differ on both sides of the plane, they are so far from
    the given surface as those of the half are.
    """
    doubled = quads.surface
    directions = face_normals(doubled.vertices, doubled.faces)[quads.faces]
    faces, weights = TriangleTree(mesh.vertices, mesh.faces).nearest(quads.vertices, directions)
    return replace(quads, faces=faces, barycentric=weights, surface=mesh)


def topology_gap(quads: QuadMesh) -> int:
    """Return by how much quads and their surface differ in Euler characteristic and number of components."""
    count, _ = label_components(len(quads.vertices), *quads.edges.T)
    gap = abs(quads.euler_characteristic - quads.surface_euler)
    return gap + abs(count - quads.surface.components[0])
