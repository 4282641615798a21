"""The interactive page of a quad mesh: rectangles of quads replace charts, and each checkerboard square is a quad."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ... import Flattening
from ...base import plural
from ...io import UVMesh
from ...quadmesh import QuadMesh, find_domains, measure_quads
from .from_uv import uv_flattening
from .page.payload import PageText
from .page.webpage import page_html


def page_of_quads(quads: QuadMesh, *, name: str = "Quads", show: str | None = None, **look: Any) -> str:
    """Return the HTML page of a quad mesh; arguments and errors are those of `page_html`.

    Triangles are halves of quads. Charts, which are shown first, are the rectangles of `find_domains`, and seams are
    their borders. Irregular vertices are cones: red if fewer than four quads meet there, black if more.
    """
    domains = find_domains(quads)
    result, charts = as_flattening(quads), len(domains.sides)
    irregular = plural(len(quads.irregular), "irregular vertex", "irregular vertices")
    text = PageText(
        title=f"{plural(len(quads.quads), 'quad')}  ·  {irregular}  ·  {plural(charts, 'rectangle')}",
        rows=[
            *measure_quads(quads).rows(),
            ("red dots", f"{(result.curvatures > 0).sum():,}", "vertices with fewer than four quads"),
            ("black dots", f"{(result.curvatures < 0).sum():,}", "vertices with more than four quads"),
            ("charts", f"{charts:,}", "rectangles between lines from the irregular vertices"),
        ],
        squares=float(np.sqrt(len(quads.quads))),
    )
    if show is None:
        show = "charts" if look.get("texture") is None else "picture"
    return page_html(result, name=name, show=show, text=text, **look)


def as_flattening(quads: QuadMesh) -> Flattening:
    """Return the triangles of quads with UVs in which all quads are squares of one size, in disjoint rectangles."""
    corner_uv = quads.uv.reshape(-1, 2)[quads.triangle_corners]
    result = uv_flattening(UVMesh(quads.vertices, quads.triangles, corner_uv, len(quads.quads), 0, 0))
    irregular = quads.irregular
    return replace(
        result, cones=irregular, curvatures=(4 - quads.valences[irregular]) * np.pi / 2, notes=quads.notes
    )
