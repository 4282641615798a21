"""The integer grid that triangle corners are in, from their places alone."""

from __future__ import annotations

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from ..errors import GridError
from ..geometry.planar import sides_between, signed_double_areas
from ..geometry.triangles import double_areas, edge_lengths
from ..mesh import NEXT, PREVIOUS, TriangleMesh
from ..text import list_some, plural
from .exact_grid import LOOSE
from .integer_map import IntegerGrid
from .motions import find_motions
from .sides import quarters_around


def grid_of_corners(
    vertices: FloatArray,
    faces: IntArray,
    corner_grid: FloatArray,
    **known: float | tuple[str, ...] | IntArray,
) -> IntegerGrid:
    """Return the integer grid that corners of triangles are in, with all that follows from their places.

    Args:
        vertices, faces: (n, 3), (m, 3) a manifold mesh whose triangles run the same way round.
        corner_grid: (m, 3, 2) the place of every triangle corner, in units of the grid.
        known: measures of the grid, notes and features; measures left out are not a number, but for the size.

    Raises:
        GridError: triangles are turned over, or the sides of seams are no copies of each other by quarter turns and
            whole translations.
    """
    mesh = TriangleMesh(vertices, faces)
    flat = signed_double_areas(corner_grid)
    turned = np.flatnonzero(~(flat > 0))
    if len(turned):
        raise GridError(
            f"{plural(len(turned), 'triangle')} of {len(faces):,} with UVs turned over or without area "
            f"({list_some(turned)}): this is no integer-grid map"
        )
    turns, shifts, off = find_motions(mesh, corner_grid)
    if not off <= LOOSE:
        raise GridError(
            f"the sides of a seam miss each other by {off:.2g} squares, up to quarter turns and whole translations: "
            "this is no integer-grid map"
        )
    quarters = quarters_around(mesh, sides_between(corner_grid))
    cones = np.flatnonzero((quarters != 4) & ~mesh.is_boundary_vertex & _used(mesh))
    corners = np.flatnonzero((quarters != 2) & _between_sides(mesh, corner_grid))
    area = float(double_areas(edge_lengths(vertices, faces)).sum())
    nothing = dict.fromkeys(
        ("move_rms", "move_max", "energy_before", "energy", "qc_before", "qc_mean", "least_area"), np.nan
    )
    return IntegerGrid(
        vertices=vertices,
        faces=faces,
        corner_grid=corner_grid,
        turns=turns,
        shifts=shifts,
        cones=cones,
        quarters=quarters[cones],
        corners=corners,
        corner_quarters=quarters[corners],
        **{"size": float(np.sqrt(area / flat.sum())), **nothing, **known},  # type: ignore[arg-type]
    )


def _used(mesh: TriangleMesh) -> BoolArray:
    return np.bincount(mesh.faces.ravel(), minlength=len(mesh.vertices)) > 0


def _between_sides(mesh: TriangleMesh, corner_grid: FloatArray) -> BoolArray:
    """Return (n,) whether the edges of the boundary at a vertex are all on grid lines; none are inside."""
    border = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
    starts, ends = (corner_grid[:, which].reshape(-1, 2)[border] for which in (NEXT, PREVIOUS))
    is_on = ((starts == ends) & (starts == np.rint(starts))).any(axis=1)
    lines = np.zeros(len(mesh.vertices), dtype=np.int64)
    np.add.at(lines, mesh.edges[mesh.is_boundary_edge].ravel(), np.repeat(is_on, 2))
    return lines == 2
