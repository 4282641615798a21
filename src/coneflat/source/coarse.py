"""Coarse components, on which the cones of large ones are searched, and variants of them compared."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..base.arrays import IntArray
from ..geometry import coarse_mesh, double_areas, edge_lengths, mollify
from .components import Component
from .fill import Fill

# Number of triangles of a coarse component; one with more than twice as many is large.
COARSE = 4_000


def is_large(component: Component) -> bool:
    """Return whether a component has so many triangles that a coarse one saves time."""
    return len(component.faces) > 2 * COARSE


def coarse_component(component: Component) -> tuple[Component, IntArray]:
    """Return a component with about `COARSE` triangles, and (k,) the vertices of the given one that it keeps.

    Options for vertices are kept, except cones and corners, and the importance of vertices; none of the edges are
    avoided or forbidden.
    """
    coarse = coarse_mesh(component.mesh, COARSE)
    mesh, vertices = coarse.mesh, coarse.vertices
    distances, is_no_edge = edge_lengths(mesh.vertices, mesh.faces), np.zeros(len(mesh.edges), dtype=bool)
    lengths = mollify(distances, mesh)[0]

    def at_vertices(spec: Any, *names: str) -> Any:
        """Return a specification with the values of its arrays (n,) at the vertices that are kept."""
        arrays = {name: getattr(spec, name) for name in names}
        return replace(spec, **{name: array[vertices] for name, array in arrays.items() if array is not None})

    seams = at_vertices(component.seams, "visibility", "weights")
    metric = at_vertices(component.metric, "keeps_length", "names")
    return Component(
        mesh,
        component.vertices[vertices],
        coarse.faces,
        lengths,
        double_areas(distances),
        at_vertices(component.cones, "is_allowed", "absorbs_curvature", "names"),
        metric,
        replace(seams, is_avoided=is_no_edge, is_forbidden=is_no_edge),
        None if component.fill is None else Fill.of(mesh, lengths, metric.keeps_length),
        component.keeps_holes,
    ), vertices
