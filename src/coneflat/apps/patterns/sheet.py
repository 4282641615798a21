"""Blanks of sheet metal and the like: one piece of a developable or nearly developable surface, with bend lines."""

from __future__ import annotations

import numpy as np

from ... import TriangleMesh, unwrap
from ...base import IntArray, inner_calls
from ...errors import MeshError
from ...geometry import angle_defect, corner_angles, edge_lengths
from ...seams import find_seams
from .cut_surface import CutSurface
from .development import Development
from .relaxation import relaxed
from .separation import without_overlaps
from .thickness import thickness_of

# Smallest angle defect of a corner, radians: the surface is cut there if all curvature is in a few corners, so that the
# blank is exact.
MIN_CORNER = 0.05
# Largest sum of the other angle defects, radians, and largest number of corners, of a surface that is cut there.
MAX_REST, MAX_CORNERS = 1e-4, 48


def develop_sheet(mesh: TriangleMesh) -> Development:
    """Return one piece for each component of a surface, with as few cuts as possible and little strain.

    Developable surfaces are exact. If the curvature of a surface is in a few corners, such as those of a box without
    lid, it is cut from there to its border, and exact. Other curvature remains as strain. Bends: `find_bends`.

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
        seams.append(vertices[component.edges[_corner_cuts(component)]])
    with inner_calls():
        result = unwrap(mesh.vertices, mesh.faces, seams=("none", np.concatenate(seams)), charts="one")
    return Development(without_overlaps(relaxed(CutSurface.of(result))))


def _corner_cuts(mesh: TriangleMesh) -> IntArray:
    """Return the edges of a connected mesh to cut so that it is developable; none if it is curved beside corners."""
    angles = corner_angles(edge_lengths(mesh.vertices, mesh.faces))
    defect = np.abs(angle_defect(mesh.faces, angles, mesh.is_boundary_vertex))
    defect[mesh.is_boundary_vertex] = 0
    corners = np.flatnonzero(defect > MIN_CORNER)
    rest = defect.sum() - defect[corners].sum()
    if not 0 < len(corners) <= MAX_CORNERS or rest > MAX_REST:
        return np.empty(0, dtype=np.int64)
    ends = mesh.vertices[mesh.edges]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    holes = sorted(mesh.boundary_walks(), key=lambda walk: lengths[mesh.halfedge_edges[walk]].sum())[:-1]
    return find_seams(mesh, corners, lengths, kept_holes=holes)
