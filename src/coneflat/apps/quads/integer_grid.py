"""Seamless maps to the integer grid: the squares of the plane become quads of the surface."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ... import Flattening, check_mesh, flatten
from ...base import THREADS, Progress, Stopwatch, plural, using_threads
from ...errors import CurvatureError, GridError, MetricError, OptionError
from ...io import as_input
from ...layout import StretchEnergy
from ...measure import broken_promises
from ...options import WordOrVertices
from .integer_map import IntegerGrid
from .layout import GRID_TOLERANCE, aligned
from .options import QUADS, QuadOptions
from .round_layout import grid_near, grid_of, noted
from .sharp import not_taken, sharp_layouts

# What the grid wants of a flattening: three, five or six quads at a cone, and rotations that are quarter turns.
OPTIONS = {
    "quantise": np.pi / 2,
    "correct_handles": True,
    "charts": "one",
    "min_cone_angle": QuadOptions.min_cone_angle,
    "max_cone_angle": QuadOptions.max_cone_angle,
}


def integer_grid(
    mesh: Any,
    faces: ArrayLike | None = None,
    *,
    quads: int | None = None,
    size: float | None = None,
    stretch: float = 0.0,
    sharp_angle: float | str | None = None,
    **options: Any,
) -> IntegerGrid:
    """Return a map of a surface to the integer grid, seamless: unit squares become quads that meet across seams.

    Args:
        mesh, faces: as `coneflat.flatten` takes them; or a `Flattening` with cones quantised to quarter turns.
        quads: about so many unit squares cover the surface; None: 10,000, unless a size is given.
        size: of a square in model units, instead.
        stretch: from angles, 0, to areas, 1: what the map keeps; see `StretchEnergy`.
        sharp_angle: radians: edges at which the surface bends by more come to lie on grid lines, and the boundary with
            them; None for none.
        options: of `coneflat.flatten`; by default cones have three, five or six quads. Cones that are given have
            curvatures, multiples of pi/2; on surfaces with handles, or several boundaries, few have a grid. boundary
            may be "auto", too, and is by default: "straight" where that has a grid and cones are not given, or "free".

    Raises:
        GridError: no grid of this size was found that flips no triangle.
        MeshError, CurvatureError, OptionError, SeamError, MetricError: as `coneflat.flatten`.

    Notes:
        A smooth layout with quantised cones (Kaelberer, Nieser, Polthier, "QuadCover", 2007) is scaled; translations of
        seams and places of cones are rounded together, to the lattice point that is nearest by the energy that going
        there costs at least; and the layout is relaxed with these (integer-grid maps: Bommes, Campen, Ebke, Alliez,
        Kobbelt 2013), from the smooth one by steps that flip no triangle. Edges from cone to cone are split
        before.

    Examples:
        >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]
        >>> grid = coneflat.integer_grid(*square, quads=16)
        >>> round(grid.size, 6)  # sides of the squares, in model units
        0.25
        >>> grid.corners, grid.corner_quarters
        (array([0, 1, 2, 3]), array([1, 1, 1, 1]))
    """
    wanted, name = (size, "size") if size is not None else (QUADS if quads is None else quads, "quads")
    if quads is not None and size is not None:
        raise OptionError("quads and size say the same: give one of them")
    if not (np.isfinite(wanted) and wanted > 0):
        raise OptionError(f"{name} must be a positive number, not {wanted!r}")
    progress = options.pop("progress", None)
    stages = Stopwatch(progress)
    search = _Search(mesh, faces, quads or QUADS, size, StretchEnergy(stretch), options, progress, stages)
    if isinstance(mesh, Flattening):
        if faces is not None or options or sharp_angle is not None:
            raise OptionError("a flattening has its faces and options: none can be given beside it")
        found = search.of_result(mesh)
    elif sharp_angle is not None:
        found = search.with_lines(sharp_angle, options.pop("boundary", "auto"))
    else:
        found = search.with_boundary(options.pop("boundary", "auto"))
    return replace(found, seconds=stages.seconds)


def _defaults(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the grid wants of a flattening with these options; cones that are given are not searched for.

    Raises:
        OptionError: they have other curvatures than multiples of pi/2.
    """
    given = options.get("cones", "auto")
    # With straight sides, what is said of cones holds for both copies of the surface, glued to each other at the
    # boundary: a corner of pi/2 is a cone of pi there.
    if isinstance(given, str):
        return OPTIONS if options.get("boundary") != "straight" else {**OPTIONS, "min_cone_angle": np.pi / 2}
    parsed = WordOrVertices((), "cone").parse("cones", given)
    for vertex, curvature in parsed.items() if isinstance(parsed, dict) else ():
        quarters = np.nan if curvature is None else curvature / (np.pi / 2)
        if not abs(quarters - np.rint(quarters)) <= GRID_TOLERANCE:
            raise OptionError(
                f"cones of a grid have curvatures that are multiples of pi/2; that of vertex {vertex} is "
                f"{'not given' if curvature is None else f'{curvature:g}'}"
            )
    return {"charts": "one"}


@dataclass(frozen=True, eq=False)
class _Search:
    """What is asked of a grid; attributes are the arguments of `integer_grid`, and the times of the stages."""

    mesh: Any
    faces: ArrayLike | None
    quads: float
    size: float | None
    energy: StretchEnergy
    options: dict[str, Any]
    progress: Progress | None
    stages: Stopwatch

    def with_boundary(self, boundary: Any) -> IntegerGrid:
        """Return a grid with a boundary as `integer_grid` takes it."""
        if boundary != "auto":
            return self._of_flattening(boundary)
        may_be_straight = isinstance(self.options.get("cones", "auto"), str)
        if not (may_be_straight and self._has_boundary()):
            return self._of_flattening("free")
        try:
            return self._of_flattening("straight", whole_sides=True)
        except (CurvatureError, MetricError) as error:
            why = f"The boundary cuts squares, as none was found with it on grid lines: {error}."
        return noted(self._of_flattening("free"), why)

    def with_lines(self, sharp_angle: float | str, boundary: Any) -> IntegerGrid:
        """Return a grid with as many sharp edges on grid lines as can be, and the boundary with them."""
        boundary = "free" if boundary == "auto" else boundary
        with self.stages("grid"):
            found, why = self._along_axes({**self.options, "sharp_angle": sharp_angle, "boundary": boundary})
        if found is not None:
            return found
        return noted(self._of_flattening(boundary), f"No sharp edge is on a grid line: {why}.")

    def _has_boundary(self) -> bool:
        given, repair = as_input(self.mesh, self.faces), bool(self.options.get("repair", False))
        return bool(check_mesh(given.vertices, given.faces, repair=repair).mesh.is_boundary_edge.any())

    def _of_flattening(self, boundary: Any, whole_sides: bool = False) -> IntegerGrid:
        """Return the grid of a flattening with a boundary; with straight sides, all on grid lines if that is wanted.

        Raises:
            GridError: there is none, or straight sides are on no grid lines where they are wanted there.
        """
        options = {**self.options, "boundary": boundary}
        self.stages.done = 0.0
        with self.stages("flatten"):
            result = flatten(
                self.mesh, self.faces, progress=self.progress, **{**_defaults(options), **options}
            )
        # What a map does not keep of its promises is not what the grid does not keep.
        told = tuple(note for note in result.notes if note not in broken_promises(result))
        found = self.of_result(result, options, whole_sides)
        return replace(found, notes=(*told, *found.notes))

    def of_result(
        self, result: Flattening, options: dict[str, Any] | None = None, whole_sides: bool = False
    ) -> IntegerGrid:
        """Return the grid of a flattening with some options; None for one that was given."""
        is_straight = result.settings.get("boundary") == "straight"
        self.stages.done = 1.0
        with self.stages("grid"), using_threads(result.settings.get("threads", THREADS)):
            try:
                layout = aligned(result, self.quads, self.size)
                starts = layout.ends[0][layout.border]
                loose = int((~np.isin(starts, layout.sides.points)).sum()) if is_straight else 0
                if not loose:
                    return grid_of(layout, self.energy)
                why = (
                    f"{plural(loose, 'edge')} of the boundary {'is' if loose == 1 else 'are'} on no grid line: "
                    "straight sides of different loops do not point in the same directions, up to quarter turns"
                )
            except GridError as error:
                # A triangle between straight sides may have no room; edges that join two of them are split below.
                if not is_straight:
                    raise
                layout, why = None, str(error)
            if options is not None and not not_taken(options, OPTIONS):
                # Relaxation turns them, which is not conformal.
                turned, _ = self._along_axes(options)
                if turned is not None:
                    return turned
            if whole_sides or layout is None:
                raise GridError(why)
            return noted(grid_of(layout, self.energy), f"{why}.")

    def _along_axes(self, options: dict[str, Any]) -> tuple[IntegerGrid | None, str]:
        """Return a grid with the boundary on grid lines, and as many sharp edges as can be; or none, and why."""
        why = "none is long enough for quads of this size"
        for layout, features, notes in sharp_layouts(
            self.mesh, self.faces, self.quads, self.size, options, OPTIONS, self.progress
        ):
            with using_threads(options.get("threads", THREADS)):
                grid, why = grid_near(layout, self.energy)
            if grid is not None:
                return replace(grid, features=features, notes=(*grid.notes, *notes)), ""
        return None, why
