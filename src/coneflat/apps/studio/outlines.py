"""A layout as a drawing: the outlines of its charts, to print, cut out or paint on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...mesh import TriangleMesh, end_corners
from ...view.page.content import outline_halfedges

if TYPE_CHECKING:
    from ...result.flattening import Flattening

SIDE = 1000  # units along a side of the texture
DIGITS = 3


def layout_svg(result: Flattening) -> str:
    """Return an SVG drawing of the unit square, v upwards: seams in black, the boundary in grey, cones as dots."""
    outline, seams = outline_halfedges(TriangleMesh(result.vertices, result.faces), result.uv_faces)
    begin, end = (result.uv_faces.reshape(-1)[corners] for corners in end_corners(outline))
    places = np.round(np.column_stack([result.uv[:, 0], 1 - result.uv[:, 1]]) * SIDE, DIGITS)

    def path(chosen: slice, name: str) -> str:
        lines = (
            f"M{a[0]:g} {a[1]:g}L{b[0]:g} {b[1]:g}"
            for a, b in zip(places[begin[chosen]].tolist(), places[end[chosen]].tolist(), strict=True)
        )
        return f'<path class="{name}" d="{"".join(lines)}"/>'

    is_cone = np.isin(result.faces.reshape(-1), result.cones)
    dots = (
        f'<circle cx="{x:g}" cy="{y:g}" r="3"/>'
        for x, y in places[np.unique(result.uv_faces.reshape(-1)[is_cone])].tolist()
    )
    return "\n".join(
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {SIDE} {SIDE}" width="{SIDE}" height="{SIDE}">',
            "<style>path{fill:none;stroke-width:1.5;stroke-linecap:round}.seam{stroke:#000}.boundary{stroke:#777}"
            "circle{fill:#d62121}</style>",
            path(slice(2 * seams), "seam"),
            path(slice(2 * seams, None), "boundary"),
            *dots,
            "</svg>\n",
        )
    )
