"""Quad meshing of surfaces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base import Stopwatch, Unmet, plural, warns
from ..errors import GridError, OptionError
from ..options import read_options
from .cross_field import sharp_ends
from .extract import extract_quads, with_borders
from .grid_search import GridSearch
from .integer_map import IntegerGrid
from .limits import NO_LIMIT, SquareLimit
from .options import QuadOptions
from .quad_mesh import CoarseGridError, QuadMesh, least_jacobians
from .simpler_mesh import SimplerMesh, simplified
from .smooth import smooth_quads


@warns()
def quads(
    mesh: Any,
    faces: ArrayLike | None = None,
    *,
    quads: int | None = None,
    size: ArrayLike | None = None,
    stretch: float = QuadOptions.stretch,
    sharp_angle: float | str | None = None,
    smooth: int = QuadOptions.smooth,
    **options: Any,
) -> QuadMesh:
    """Return a quad mesh of a surface; all faces are quads, and irregular vertices are the cones of a flattening.

    Args:
        mesh, faces: as for `coneflat.flatten`; or an `IntegerGrid`, which accepts the options `smooth` and `progress`
            only.
        quads: approximate number of quads; None: 10,000, unless `size` is given.
        size: length of the edges of quads in model units, which replaces `quads`; or relative sizes of quads, see
            `integer_grid`.
        stretch: trade-off between equal angles (0) and also equal areas (1); see `integer_grid`.
        sharp_angle: radians; edges of quads follow edges with a larger dihedral angle; None for none.
        smooth: rounds of smoothing on the surface, see `smooth_quads`; 0 for none.
        options: those of `coneflat.flatten`; by default cones have three, five or six quads.

    Returns:
        The quad mesh, with the position of its vertices on the surface.

    Raises:
        GridError: no grid of this size, or somewhat finer, without flipped triangles was found; or there would be more
            than 16 times as many quads, or more than the triangles of the mesh can carry.
        TooLargeError: the quads do not fit into the free memory.
        OptionError: an option is unknown or invalid.
        MeshError, CurvatureError, SeamError, MetricError: as for `coneflat.flatten`.

    Warns:
        GuaranteeWarning: a guarantee, or a request, is not met; notes of the result say which.

    Examples:
        >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]
        >>> mesh = coneflat.quads(*square, quads=9)
        >>> mesh.quads.shape, mesh.vertices.shape
        ((9, 4), (16, 3))
    """
    own = {"quads": quads, "size": size, "stretch": stretch, "sharp_angle": sharp_angle, "smooth": smooth}
    small, search, source = None, None, None
    if isinstance(mesh, IntegerGrid):
        if any(one is not None for one in (faces, quads, size, sharp_angle)) or options.keys() - {"progress"}:
            raise OptionError("a grid already has faces, size and options: no others can be given")
        read_options(own, QuadOptions)
        grid, stages = mesh, Stopwatch(options.get("progress"))
    else:
        search = replace(GridSearch.of(mesh, faces, own, options), for_quads=True)
        stages = search.stages
        source = search.result.source if search.result else search.source.input_mesh.source
        with stages("coarsen"):
            search, small = simplified(search)
        try:
            grid = search.grid()
        except CoarseGridError as error:
            grid = replace(error.grid, seconds=dict(stages.seconds))
    stages.done = 1.0
    with stages("extract"):
        found = (search and grid.quad_mesh) or extract_quads(grid, leave_out=search is not None)
        grid = replace(grid, quad_mesh=None)
    found = with_borders(found) if found.left_out else found
    features = grid.features
    if small is None and search and not search.result:
        has_all = found.surface.components[0] == search.checked.mesh.components[0]
        small = None if has_all else SimplerMesh.of(search)
    with stages("smooth"):
        if small is not None:
            found, features = small.moved(found), sharp_ends(small.surface)
        found = smooth_quads(found, smooth, features)
        found = found if small is None else small.completed(found)
    _require_sound(found, search.limit if search else NO_LIMIT)
    notes = (
        *(() if small is None else small.notes),
        *grid.notes,
        *found.notes,
        *map(Unmet, _notes(found, small)),
    )
    return replace(found, notes=notes, seconds={**grid.seconds, **stages.seconds}, grid=grid, source=source)


def _require_sound(found: QuadMesh, limit: SquareLimit) -> None:
    """Raise GridError for more quads than a limit, or coordinates that are not finite."""
    if text := limit.excess(len(found.quads)):
        raise GridError(text)
    if bad := int((~np.isfinite(found.vertices).all(axis=1)).sum()):
        raise GridError(f"{plural(bad, 'vertex', 'vertices')} of quads without a place: use fewer quads")


def _notes(found: QuadMesh, small: SimplerMesh | None) -> Iterator[str]:
    """Yield a note for each problem of a quad mesh."""
    if found.left_out:
        share = 100 * found.area_left_out / (found.area_left_out + len(found.quads))
        yield (
            f"Left out {plural(found.left_out, 'square')} that the boundary cuts, {share:.1f} % of the area of the "
            "grid."
        )
    covered = found.euler_characteristic - found.surface_euler
    if covered > 0 and small is not None and small.is_filling.any():
        yield f"Quads cover {plural(covered, 'hole')}."
    elif covered:
        yield (
            f"The Euler characteristic of the quads is {found.euler_characteristic}, that of the "
            f"surface {found.surface_euler}: leaving out squares has opened or split the mesh."
        )
    # An angle of 180 degrees is known up to rounding.
    flipped = int((least_jacobians(found.vertices, found.quads) <= 1e-9).sum())
    if flipped:
        yield f"{plural(flipped, 'quad')} with an angle of 180 degrees or more: use more quads."
