"""A page of quads: the rectangles that they form take the place of charts, and a square of the board is a quad."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...grid.domains import Domains, arranged, find_domains
from ...grid.quality import measure_quads
from ...result.from_uv import flattening_of
from ...result.mapped import Mapped
from ...text import plural
from .payload import Told
from .webpage import page_of

if TYPE_CHECKING:
    from ...grid import QuadMesh
    from ...result.flattening import Flattening


def page_of_quads(quads: QuadMesh, *, name: str = "Quads", show: str | None = None, **look: Any) -> str:
    """Return the page of a mesh of quads as text; arguments and errors are those of `page_of`.

    Triangles are halves of quads. Charts, which it shows first, are the rectangles of `find_domains`, laid out apart,
    and seams their borders. Irregular vertices are cones: red where fewer than four quads meet, black where more do.
    """
    domains = find_domains(quads)
    result, charts = as_flattening(quads, domains), len(domains.sides)
    told = Told(
        title="  ·  ".join(
            (
                plural(len(quads.quads), "quad"),
                plural(len(quads.irregular), "irregular vertex", "irregular vertices"),
                plural(charts, "rectangle"),
            )
        ),
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
    return page_of(result, name=name, show=show, told=told, **look)


def as_flattening(quads: QuadMesh, domains: Domains) -> Flattening:
    """Return the triangles of quads with UVs in which all are squares of one size, in rectangles that lie apart."""
    places, side = arranged(domains)
    corner_uv = places.reshape(-1, 2)[quads.triangle_corners] / side
    result = flattening_of(Mapped(quads.vertices, quads.triangles, corner_uv, len(quads.quads), 0, 0))
    irregular = quads.irregular
    return replace(
        result,
        cones=irregular,
        curvatures=(4 - quads.valences[irregular]) * np.pi / 2,
        notes=quads.notes,
    )
