"""Seamless maps to the integer grid: the squares of the plane become quads of the surface."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import GridError, OptionError
from ..geometry.planar import signed_double_areas
from ..layout.relax import StretchEnergy
from ..mesh import NEXT
from ..pipeline import flatten
from ..progress import Progress, Stages
from ..result.flattening import Flattening
from ..result.promises import broken_promises
from ..text import plural
from ..threads import THREADS, using_threads
from .aligned import Layout, aligned
from .attempt import area_of, attempt, scaled
from .coarsest import TRIES, coarsest_grid
from .given_cones import require_quarters
from .integer_map import IntegerGrid
from .sharp_edges import sharp_layouts
from .split import between_whole, split_edges

# What the grid wants of a flattening: three, five or six quads at a cone, and rotations that are quarter turns.
OPTIONS = {
    "quantise": np.pi / 2,
    "correct_handles": True,
    "charts": "one",
    "min_cone_angle": 1.5 * np.pi,
    "max_cone_angle": 3 * np.pi,
}
# With straight sides, what is said of cones holds for both copies of the surface, glued to each other at the boundary:
# a corner of pi/2 is a cone of pi there.
STRAIGHT = {"min_cone_angle": np.pi / 2}
# Squares by default.
QUADS = 10_000
# Part of the squares wanted by which there may be more or fewer without a note.
NOTED = 0.1
# How many times the squares wanted are tried, when these are too few, to say what would do.
FINER = (2, 4, 8, 16)


def integer_grid(
    mesh: Any,
    faces: ArrayLike | None = None,
    *,
    quads: int | None = None,
    size: float | None = None,
    coarsest: bool = False,
    stretch: float = 0.0,
    sharp_angle: float | str | None = None,
    **options: Any,
) -> IntegerGrid:
    """Return a map of a surface to the integer grid, seamless: unit squares become quads that meet across seams.

    Args:
        mesh, faces: as `coneflat.flatten` takes them; or a `Flattening` with cones quantised to quarter turns.
        quads: about so many unit squares cover the surface; None: 10,000, unless a size is given.
        size: of a square in model units, instead.
        coarsest: the fewest quads for which a grid is found, instead: the patches of a quad layout.
        stretch: from angles, 0, to areas, 1: what the map keeps; see `StretchEnergy`.
        sharp_angle: radians: edges at which the surface bends by more come to lie on grid lines, and the boundary with
            them; None for none.
        options: of `coneflat.flatten`; by default cones have three, five or six quads. Cones that are given have
            curvatures, multiples of pi/2; on surfaces with handles, or several boundaries, few have a grid.

    Raises:
        GridError: no grid of this size was found that turns no triangle over.
        MeshError, CurvatureError, OptionError, SeamError, MetricError: as `coneflat.flatten`.

    Notes:
        A smooth layout with quantised cones (Kaelberer, Nieser, Polthier, "QuadCover", 2007) is scaled; translations of
        seams and places of cones are rounded together, to the lattice point that is nearest by the energy that going
        there costs at least; and the layout is relaxed with these (integer-grid maps: Bommes, Campen, Ebke, Alliez,
        Kobbelt 2013), from the smooth one by steps that turn no triangle over. Edges from cone to cone are split
        before.
    """
    check_extent(quads, size, coarsest)
    progress, energy = options.get("progress"), StretchEnergy(stretch)
    stages = Stages(progress)
    told: tuple[str, ...] = ()
    if isinstance(mesh, Flattening):
        if faces is not None or options.keys() - {"progress"} or sharp_angle is not None:
            raise OptionError("a flattening has its faces and options: none can be given beside it")
        result = mesh
    elif sharp_angle is not None:
        if coarsest:
            raise OptionError(
                "sharp edges need to be told how large quads are: leave out coarsest, or sharp_angle"
            )
        given = {**options, "sharp_angle": sharp_angle}
        given.pop("progress", None)
        with stages("grid"):
            wanted = None if size is not None else quads or QUADS
            found = _sharp(mesh, faces, wanted, size, given, energy, progress)
        return replace(found, seconds=stages.seconds)
    else:
        with stages("flatten"):
            result = flatten(mesh, faces, **{**_defaults(options), **options})
        # What a map does not keep of its promises is not what the grid does not keep.
        told = tuple(note for note in result.notes if note not in broken_promises(result))
    stages.done = 1.0
    with stages("grid"), using_threads(result.settings.get("threads", THREADS)):
        layout = aligned(result, QUADS if quads is None else quads, size)
        found = _of_layout(layout, energy, coarsest, progress)
    loose = _loose_border(layout) if result.settings.get("boundary") == "straight" else 0
    notes = []
    if loose:
        notes.append(
            f"{plural(loose, 'edge')} of the boundary {'is' if loose == 1 else 'are'} on no grid line: straight sides "
            "of different loops do not point in the same directions, up to quarter turns."
        )
    return replace(found, notes=(*told, *found.notes, *notes), seconds=stages.seconds)


def _defaults(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the grid wants of a flattening with these options; cones that are given are not searched for."""
    given = options.get("cones", "auto")
    if isinstance(given, str):
        return OPTIONS if options.get("boundary") != "straight" else {**OPTIONS, **STRAIGHT}
    require_quarters(given)
    return {"charts": "one"}


def _of_layout(
    layout: Layout, energy: StretchEnergy, coarsest: bool, progress: Progress | None
) -> IntegerGrid:
    """Return the grid of a smooth layout, at its size or the coarsest."""
    notes = []
    is_split = between_whole(layout)
    if is_split.any():
        layout = split_edges(layout, is_split)
        notes.append(
            f"Split {plural(int(is_split.sum()), 'edge')} between cones, which triangles cannot follow apart from "
            "each other."
        )

    def tell(squares: float, tries: int) -> None:
        if progress is not None:
            progress(f"coarsest grid: {squares:,.0f} squares", min(tries / TRIES, 1.0))

    found = coarsest_grid(layout, energy, tell) if coarsest else _whole(layout, energy)
    return replace(found, notes=(*found.notes, *notes))


def _sharp(
    mesh: Any,
    faces: ArrayLike | None,
    quads: int | None,
    size: float | None,
    given: dict[str, Any],
    energy: StretchEnergy,
    progress: Progress | None,
) -> IntegerGrid:
    """Return a grid with as many sharp edges on grid lines as can be."""
    why = "none is long enough for quads of this size"
    for found in sharp_layouts(mesh, faces, quads, size, given, OPTIONS, progress):
        with using_threads(given.get("threads", THREADS)):
            grid, why = attempt(found.layout, energy)
        if grid is not None:
            return replace(grid, features=found.features, notes=(*grid.notes, *found.notes))
    plain = integer_grid(
        mesh,
        faces,
        size=size,
        quads=quads,
        progress=progress,
        stretch=energy.stretch,
        **{name: value for name, value in given.items() if name != "sharp_angle"},
    )
    return replace(plain, notes=(*plain.notes, f"No sharp edge is on a grid line: {why}."))


def check_extent(quads: float | None, size: float | None, coarsest: bool) -> None:
    """Raise OptionError unless at most one thing is said of how large quads are to be, and makes sense."""
    if (quads is not None) + (size is not None) + bool(coarsest) > 1:
        raise OptionError("quads, size and coarsest say the same: give one of them")
    wanted, name = (size, "size") if size is not None else (QUADS if quads is None else quads, "quads")
    if not (np.isfinite(wanted) and wanted > 0):
        raise OptionError(f"{name} must be a positive number, not {wanted!r}")


def _loose_border(layout: Layout) -> int:
    """Return how many edges of the boundary are not parts of sides on grid lines."""
    border = layout.mesh.edge_halfedges[layout.mesh.is_boundary_edge, 0]
    starts = layout.corners[:, NEXT].ravel()[border]
    return int(np.count_nonzero(~np.isin(starts, layout.sides.points)))


def _whole(layout: Layout, energy: StretchEnergy) -> IntegerGrid:
    """Return the grid of a smooth layout, or say which count of quads has one."""
    found, why = attempt(layout, energy)
    if found is not None:
        return _nearer(found, layout, energy)
    advice = f"none with up to {FINER[-1]} times as many was found, either"
    for factor in FINER:
        finer = scaled(layout, factor)
        if attempt(finer, energy)[0] is not None:
            advice = f"{area_of(finer):,.0f} would do"
            break
    raise GridError(f"no grid of about {area_of(layout):,.0f} quads was found: {why}; {advice}")


def _nearer(found: IntegerGrid, layout: Layout, energy: StretchEnergy) -> IntegerGrid:
    """Return a grid, or one with more nearly the squares of the layout if rounding has made many more or fewer."""
    wanted, squares = area_of(layout), _squares(found)
    if abs(squares - wanted) <= NOTED * wanted:
        return found
    other, _ = attempt(scaled(layout, wanted / squares), energy)
    if other is not None and abs(np.log(_squares(other) / wanted)) < abs(np.log(squares / wanted)):
        found, squares = replace(other, size=layout.size), _squares(other)
    if abs(squares - wanted) <= NOTED * wanted:
        return found
    return replace(
        found, notes=(*found.notes, f"The grid has an area of {squares:,.0f} squares, not {wanted:,.0f}.")
    )


def _squares(grid: IntegerGrid) -> float:
    return float(signed_double_areas(grid.corner_grid).sum()) / 2
