"""Coarse components, on which the cones of large ones are searched."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..base import IntArray
from ..geometry import coarse_mesh, double_areas, edge_lengths, mollify
from ..source import Component


def coarse_component(component: Component, count: int) -> tuple[Component, IntArray]:
    """Return a component with about `count` triangles, and (k,) the vertices of the given one that it keeps.

    Options for vertices are kept; none of the edges are avoided or forbidden.
    """
    coarse = coarse_mesh(component.mesh, count)
    mesh, vertices = coarse.mesh, coarse.vertices
    lengths, is_no_edge = edge_lengths(mesh.vertices, mesh.faces), np.zeros(len(mesh.edges), dtype=bool)

    def at_vertices(spec: Any, *names: str) -> Any:
        """Return a specification with the values of its arrays (n,) at the vertices that are kept."""
        arrays = {name: getattr(spec, name) for name in names}
        return replace(spec, **{name: array[vertices] for name, array in arrays.items() if array is not None})

    seams = at_vertices(component.seams, "visibility", "weights")
    return Component(
        mesh,
        component.vertices[vertices],
        coarse.faces,
        mollify(lengths, mesh)[0],
        double_areas(lengths),
        at_vertices(component.cones, "is_allowed", "absorbs_curvature", "names"),
        at_vertices(component.metric, "keeps_length", "names"),
        replace(seams, is_avoided=is_no_edge, is_forbidden=is_no_edge),
    ), vertices
