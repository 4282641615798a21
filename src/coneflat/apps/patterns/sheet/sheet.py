"""Blanks of sheet metal and the like: one piece of a developable or nearly developable surface, with bend lines."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .... import TriangleMesh, unwrap
from ....base import IntArray, inner_calls, list_some, plural
from ....errors import MeshError
from ....geometry import angle_defect, corner_angles, edge_lengths
from ....mesh import find_holes
from ....seams import find_seams
from ..pieces.cut_surface import CutSurface, lengths_of_edges
from ..pieces.development import Development
from ..pieces.relaxing import least_strained
from ..pieces.separation import without_overlaps
from ..units import percentage
from .bends import DEVELOPABLE, largest_strains
from .thickness import thickness_of

# Smallest angle defect of a corner, radians: the surface is cut there if all curvature is in a few corners, so that the
# blank is exact.
MIN_CORNER = 0.05
# Largest sum of the other angle defects, radians, and largest number of corners, of a surface that is cut there.
MAX_REST, MAX_CORNERS = 1e-4, 48


def develop_sheet(mesh: TriangleMesh) -> Development:
    """Return a piece for each component of a surface, with as few cuts as possible and little strain.

    A piece that would overlap itself is divided. Developable surfaces are exact. If the curvature of a surface is in a
    few corners, such as those of a box without lid, it is cut from there to its border, and exact. Other curvature
    remains as strain. Bends: `find_bends`.

    Args:
        mesh: a mesh of one side of the sheet; closed surfaces are cut.

    Raises:
        MeshError: the mesh is a solid: a sheet with two sides.
    """
    seams = []
    for component, vertices, _ in mesh.split_components():
        thickness = thickness_of(component)
        if thickness is not None:
            raise MeshError(
                f"the mesh is a solid that is {thickness:.3g} mm thick, but a sheet is given by one of its sides: "
                f"delete the other side and the edges between them"
            )
        seams.append(vertices[component.edges[_cuts(component)]])
    with inner_calls():
        result = unwrap(mesh.vertices, mesh.faces, seams=("none", np.concatenate(seams)), charts="one")
    surface = without_overlaps(least_strained(CutSurface.of(result)))
    return Development(surface, notes=tuple(_notes_on_strain(surface)))


def _notes_on_strain(surface: CutSurface) -> Iterator[str]:
    """Yield a sentence about the pieces that are stretched."""
    strains = largest_strains(surface)
    pieces = np.flatnonzero(strains > DEVELOPABLE)
    if len(pieces):
        yield (
            f"no bend lines in {len(pieces)} of {plural(len(strains), 'piece')} ({list_some((pieces + 1).tolist())}), "
            f"curved in two directions: lengths change by up to {percentage(strains.max())}; kinds gores and cloth "
            "change them less"
        )


def _cuts(mesh: TriangleMesh) -> IntArray:
    """Return the edges of a connected mesh to cut so that it is developable; none if it is curved beside corners.

    Cuts reach all corners, and holes around which directions turn, such as the upper rim of a truncated cone.
    """
    angles = corner_angles(edge_lengths(mesh.vertices, mesh.faces))
    defect = angle_defect(mesh.faces, angles, mesh.is_boundary_vertex)
    inner = np.where(mesh.is_boundary_vertex, 0.0, np.abs(defect))
    corners = np.flatnonzero(inner > MIN_CORNER)
    holes = find_holes(mesh)
    flat_holes = [walk for walk in holes if abs(defect[mesh.tails[walk]].sum() + 2 * np.pi) <= MAX_REST]
    is_curved = inner.sum() - inner[corners].sum() > MAX_REST or len(corners) > MAX_CORNERS
    if is_curved or (not len(corners) and len(flat_holes) == len(holes)):
        return np.empty(0, dtype=np.int64)
    return find_seams(mesh, corners, lengths_of_edges(mesh), kept_holes=flat_holes)
