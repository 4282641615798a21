"""What else may lay out a component better than the cones that the search finds: its corners, or its sharp edges."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import replace

import numpy as np

from .cones import MAX_POLYHEDRON_CORNERS, MAX_SEARCHED, with_corners
from .geometry import dihedral_angles
from .mesh.connectivity import TriangleMesh
from .source.components import Component
from .stages import Layout

# Dihedral angle, radians, above which edges are cut where a solid is too distorted otherwise. The edges between half of
# it and itself then bend the surface by at most this share of what sharper ones do: 0 to 0.07 of it on plates, gears
# and rings, 0.15 and more on noise.
SHARP_ANGLE, MAX_BETWEEN = np.radians(40), 0.1


def with_corners_as_cones(
    parts: Mapping[int, Component], finished: Mapping[int, Layout], distorted: Container[int]
) -> dict[int, Component]:
    """Return the polyhedra among parts that may open better at all their corners, with these as cones.

    Args:
        parts: the parts.
        finished: their layouts with searched cones. An open part that needs no cone gets none.
        distorted: the parts whose layouts are too distorted: for these, any number of corners will do.
    """
    polyhedra = {}
    for i, part in parts.items():
        if i not in distorted and not len(finished[i].cones) and part.mesh.is_boundary_vertex.any():
            continue
        largest_count = MAX_SEARCHED if i in distorted else MAX_POLYHEDRON_CORNERS
        cones = with_corners(part.mesh, part.lengths, part.cones, largest_count)
        if cones is not None:
            polyhedra[i] = replace(part, cones=cones)
    return polyhedra


def is_machined(mesh: TriangleMesh) -> bool:
    """Return whether a mesh is a solid whose edges are either sharp or nearly flat.

    On noise, which bends at all angles, sharp edges would cut a surface into hundreds of charts, and a sheet is rarely
    meant to fall apart.
    """
    if mesh.is_boundary_vertex.any():
        return False
    angles = np.abs(dihedral_angles(mesh))
    ends = mesh.vertices[mesh.edges]
    bending = angles * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    is_between = (angles > SHARP_ANGLE / 2) & (angles <= SHARP_ANGLE)
    return bool(bending[is_between].sum() < MAX_BETWEEN * bending[angles > SHARP_ANGLE].sum())
