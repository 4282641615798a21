"""Seams along sharp edges, where these are what bends a surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..geometry import dihedral_angles
from ..mesh.connectivity import joined_meshes
from ..source import Component

# Dihedral angle of sharp edges in radians; and the preference for seams along them if only they bend the surface: twice
# their length costs as much as that of other edges.
SHARP, CREASES = np.radians(40), 0.3


def along_sharp_edges(components: Sequence[Component]) -> list[Component]:
    """Return components that prefer seams along sharp edges, in proportion to their share of the bending.

    On machined parts, seams along sharp edges are short and hidden; on noise, sharp edges say nothing of the shape.
    """
    starts = np.cumsum([0, *(len(component.vertices) for component in components)])
    mesh, count = joined_meshes([component.mesh for component in components]), len(components)
    angles = np.abs(dihedral_angles(mesh))
    lengths = np.concatenate([component.lengths.ravel() for component in components])
    bending = angles * lengths[mesh.edge_halfedges[:, 0]]
    component_of_edge = np.arange(count).repeat(np.diff(starts))[mesh.edges[:, 0]]
    sharp = np.bincount(component_of_edge, np.where(angles > SHARP, bending, 0.0), count)
    shares = sharp / np.maximum(np.bincount(component_of_edge, bending, count), 1e-300)
    return [
        _with_creases(component, CREASES * share)
        for share, component in zip(shares.tolist(), components, strict=True)
    ]


def _with_creases(component: Component, strength: float) -> Component:
    """Return a component that prefers seams along sharp edges by at least a strength."""
    if strength <= component.seams.creases:
        return component
    return replace(component, seams=replace(component.seams, creases=strength))
