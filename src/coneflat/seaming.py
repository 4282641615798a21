"""Where to cut, as the options and the user's wishes have it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ._arrays import BoolArray, FloatArray, dots
from .atlas import Seams, injective_charts
from .methods import LaidOut
from .options import Options
from .prepare import Component
from .seams import edge_costs


def seam_costs(part: Component, options: Options) -> tuple[FloatArray, BoolArray, BoolArray]:
    """Return (e,) what each edge costs as part of a seam, whether it is to be avoided, and whether it is forbidden."""
    sides = part.mesh.edge_halfedges[:, 0]
    costs = edge_costs(
        part.mesh,
        part.lengths.ravel()[sides],
        creases=options.creases,
        hiding=options.hide_seams,
        visibility=part.visibility,
        vertex_weights=part.wishes.seam_weights,
    )
    return costs, part.is_avoided.ravel()[sides], part.is_forbidden.ravel()[sides]


def without_overlaps(laid_out: LaidOut, part: Component, options: Options) -> LaidOut:
    """Return the layout split, as little as can be, into charts that do not overlap themselves."""
    mesh = laid_out.mesh
    if mesh is part.mesh:
        costs, avoided, forbidden = seam_costs(part, options)
        costs = np.where(avoided | forbidden, costs + costs.sum(), costs)
    else:  # a refinement has edges of its own
        ends = mesh.vertices[mesh.edges]
        costs = np.sqrt(dots(ends[:, 1] - ends[:, 0], ends[:, 1] - ends[:, 0]))
    charts = injective_charts(mesh, laid_out.points, laid_out.corners, costs)
    return replace(
        laid_out,
        points=charts.points,
        corners=charts.corners,
        chart=charts.chart,
        seams=mesh.edges[Seams(mesh, charts).edges],
    )
