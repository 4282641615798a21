"""Quad meshes of surfaces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from numpy.typing import ArrayLike

from ...base import Stopwatch, plural
from ...errors import OptionError
from .extract import extract_quads
from .integer_grid import integer_grid
from .integer_map import IntegerGrid
from .options import ROUNDS
from .quad_mesh import QuadMesh, least_jacobians
from .smooth import smooth_quads, untangled


def quads(
    mesh: Any,
    faces: ArrayLike | None = None,
    *,
    quads: int | None = None,
    size: float | None = None,
    stretch: float = 0.0,
    sharp_angle: float | str | None = None,
    smooth: int = ROUNDS,
    **options: Any,
) -> QuadMesh:
    """Return a quad mesh of a surface: all faces are quads, and irregular vertices are the cones of a flattening.

    Args:
        mesh, faces: as `coneflat.flatten` takes them; or an `IntegerGrid`, and of the options only `smooth` and
            `progress`.
        quads: about how many; None: 10,000, unless a size is given.
        size: of a quad's edges in model units, instead.
        stretch: from angles, 0, to areas, 1: what quads are to be alike in; see `integer_grid`.
        sharp_angle: radians: quads' edges run along edges at which the surface bends by more; None for none.
        smooth: rounds of smoothing on the surface, see `smooth_quads`; 0 for none.
        options: of `coneflat.flatten`; by default cones have three, five or six quads.

    Raises:
        GridError: no grid of this size was found that flips no triangle, or it is too coarse for quads.
        OptionError: an option makes no sense.
        MeshError, CurvatureError, SeamError, MetricError: as `coneflat.flatten`.

    Examples:
        >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]
        >>> mesh = coneflat.quads(*square, quads=9)
        >>> mesh.quads.shape, mesh.vertices.shape
        ((9, 4), (16, 3))
    """
    progress = options.get("progress")
    if isinstance(mesh, IntegerGrid):
        said = (faces, quads, size, sharp_angle)
        if any(one is not None for one in said) or options.keys() - {"progress"}:
            raise OptionError("a grid has its faces, size and options: none can be given beside it")
        grid = mesh
    else:
        grid = integer_grid(
            mesh, faces, quads=quads, size=size, stretch=stretch, sharp_angle=sharp_angle, **options
        )
    stages = Stopwatch(progress)
    stages.done = 1.0
    with stages("extract"):
        found = extract_quads(grid)
    with stages("smooth"):
        found = smooth_quads(found, smooth, grid.features)
        if smooth:
            found = untangled(found)
    return replace(found, notes=(*grid.notes, *_notes(found)), seconds={**grid.seconds, **stages.seconds})


def _notes(found: QuadMesh) -> Iterator[str]:
    """Yield what falls short."""
    if found.left_out:
        share = 100 * found.area_left_out / (found.area_left_out + len(found.quads))
        yield (
            f"Left out {plural(found.left_out, 'square')} that the boundary cuts, and with them {share:.1f} % of the "
            "surface as the grid has it."
        )
    if found.euler_characteristic != found.surface_euler:
        yield (
            f"The Euler characteristic of the quads is {found.euler_characteristic}, that of the "
            f"surface {found.surface_euler}: what was left out has opened or parted it."
        )
    turned = int((least_jacobians(found.vertices, found.quads) <= 0).sum())
    if turned:
        yield f"{plural(turned, 'quad')} with an angle of 180 degrees or more: more quads would help."
