"""Seamless maps to the integer grid: the squares of the plane become quads of the surface."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ... import Flattening, check_mesh, flatten
from ...base import THREADS, Progress, Stopwatch, plural, using_threads
from ...errors import CurvatureError, GridError, MetricError, OptionError
from ...geometry import signed_double_areas
from ...io import as_input
from ...layout import StretchEnergy
from ...measure import broken_promises
from ...mesh import NEXT
from ...options import WordOrVertices
from .aligned import Layout, aligned, between_whole, split_edges
from .attempt import area_of, attempt, scaled
from .integer_map import IntegerGrid
from .options import MAX_CONE_ANGLE, MIN_CONE_ANGLE, QUADS
from .sharp_edges import not_taken, sharp_layouts
from .sides import QUARTER

# What the grid wants of a flattening: three, five or six quads at a cone, and rotations that are quarter turns.
OPTIONS = {
    "quantise": np.pi / 2,
    "correct_handles": True,
    "charts": "one",
    "min_cone_angle": MIN_CONE_ANGLE,
    "max_cone_angle": MAX_CONE_ANGLE,
}
# Part of the squares wanted by which there may be more or fewer without a note.
NOTED = 0.1


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
        GridError: no grid of this size was found that turns no triangle over.
        MeshError, CurvatureError, OptionError, SeamError, MetricError: as `coneflat.flatten`.

    Notes:
        A smooth layout with quantised cones (Kaelberer, Nieser, Polthier, "QuadCover", 2007) is scaled; translations of
        seams and places of cones are rounded together, to the lattice point that is nearest by the energy that going
        there costs at least; and the layout is relaxed with these (integer-grid maps: Bommes, Campen, Ebke, Alliez,
        Kobbelt 2013), from the smooth one by steps that turn no triangle over. Edges from cone to cone are split
        before.
    """
    check_extent(quads, size)
    given = {name: value for name, value in options.items() if name != "progress"}
    search = _Search(mesh, faces, quads, size, StretchEnergy(stretch), given, options.get("progress"))
    if isinstance(mesh, Flattening):
        if faces is not None or given or sharp_angle is not None:
            raise OptionError("a flattening has its faces and options: none can be given beside it")
        return search.of_result(mesh)
    boundary = given.pop("boundary", "auto")
    if sharp_angle is not None:
        return search.with_lines(sharp_angle, boundary)
    if boundary != "auto":
        return search.with_boundary(boundary)
    may_be_straight = isinstance(given.get("cones", "auto"), str)
    if may_be_straight and _has_boundary(mesh, faces, bool(given.get("repair", False))):
        try:
            return search.with_boundary("straight", whole_sides=True)
        except (CurvatureError, MetricError) as error:
            why = f"The boundary cuts squares, as none was found with it on grid lines: {error}."
        return _noted(search.with_boundary("free"), why)
    return search.with_boundary("free")


def _has_boundary(mesh: Any, faces: ArrayLike | None, repair: bool) -> bool:
    given = as_input(mesh, faces)
    return bool(check_mesh(given.vertices, given.faces, repair=repair).mesh.is_boundary_edge.any())


def _noted(found: IntegerGrid, *notes: str) -> IntegerGrid:
    return replace(found, notes=(*found.notes, *notes))


def _defaults(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the grid wants of a flattening with these options; cones that are given are not searched for."""
    given = options.get("cones", "auto")
    # With straight sides, what is said of cones holds for both copies of the surface, glued to each other at the
    # boundary: a corner of pi/2 is a cone of pi there.
    if isinstance(given, str):
        return OPTIONS if options.get("boundary") != "straight" else {**OPTIONS, "min_cone_angle": np.pi / 2}
    _require_quarters(given)
    return {"charts": "one"}


def _require_quarters(cones: Any) -> None:
    """Raise OptionError unless cones, as `flatten` takes them, all have curvatures that are multiples of pi/2."""
    parsed = WordOrVertices((), "cone").parse("cones", cones)
    for vertex, curvature in parsed.items() if isinstance(parsed, dict) else ():
        quarters = np.nan if curvature is None else curvature / (np.pi / 2)
        if not abs(quarters - np.rint(quarters)) <= QUARTER:
            raise OptionError(
                f"cones of a grid have curvatures that are multiples of pi/2; that of vertex {vertex} is "
                f"{'not given' if curvature is None else f'{curvature:g}'}"
            )


@dataclass(frozen=True, eq=False)
class _Search:
    """What is asked of a grid; attributes are the arguments of `integer_grid`."""

    mesh: Any
    faces: ArrayLike | None
    quads: int | None
    size: float | None
    energy: StretchEnergy
    options: dict[str, Any]
    progress: Progress | None

    def with_boundary(self, boundary: Any, whole_sides: bool = False) -> IntegerGrid:
        """Return the grid of a flattening with a boundary; with straight sides, all on grid lines if that is wanted.

        Raises:
            GridError: there is none, or straight sides are on no grid lines where they are wanted there.
        """
        stages, options = Stopwatch(self.progress), {**self.options, "boundary": boundary}
        with stages("flatten"):
            result = flatten(
                self.mesh, self.faces, progress=self.progress, **{**_defaults(options), **options}
            )
        # What a map does not keep of its promises is not what the grid does not keep.
        told = tuple(note for note in result.notes if note not in broken_promises(result))
        stages.done = 1.0
        with stages("grid"):
            found = self._of_result(result, options, whole_sides)
        return replace(found, notes=(*told, *found.notes), seconds=stages.seconds)

    def of_result(self, result: Flattening) -> IntegerGrid:
        """Return the grid of a flattening."""
        stages = Stopwatch(self.progress)
        stages.done = 1.0
        with stages("grid"):
            found = self._of_result(result, None, whole_sides=False)
        return replace(found, seconds=stages.seconds)

    def with_lines(self, sharp_angle: float | str, boundary: Any) -> IntegerGrid:
        """Return a grid with as many sharp edges on grid lines as can be, and the boundary with them."""
        stages = Stopwatch(self.progress)
        boundary = "free" if boundary == "auto" else boundary
        with stages("grid"):
            found, why = self._along_axes({**self.options, "sharp_angle": sharp_angle, "boundary": boundary})
        if found is not None:
            return replace(found, seconds=stages.seconds)
        return _noted(self.with_boundary(boundary), f"No sharp edge is on a grid line: {why}.")

    def _of_result(
        self, result: Flattening, options: dict[str, Any] | None, whole_sides: bool
    ) -> IntegerGrid:
        """Return the grid of a flattening with some options; None for one that was given."""
        with using_threads(result.settings.get("threads", THREADS)):
            try:
                layout = aligned(result, QUADS if self.quads is None else self.quads, self.size)
                loose = _loose_border(layout) if result.settings.get("boundary") == "straight" else 0
                if not loose:
                    return _of_layout(layout, self.energy)
                why = (
                    f"{plural(loose, 'edge')} of the boundary {'is' if loose == 1 else 'are'} on no grid line: "
                    "straight sides of different loops do not point in the same directions, up to quarter turns"
                )
            except GridError as error:
                # A triangle between straight sides may have no room; edges that join two of them are split below.
                if result.settings.get("boundary") != "straight":
                    raise
                layout, why = None, str(error)
            if options is not None and not not_taken(options, OPTIONS):
                # Relaxation turns them, which is not conformal.
                turned, _ = self._along_axes(options)
                if turned is not None:
                    return turned
            if whole_sides or layout is None:
                raise GridError(why)
            return _noted(_of_layout(layout, self.energy), f"{why}.")

    def _along_axes(self, options: dict[str, Any]) -> tuple[IntegerGrid | None, str]:
        """Return a grid with the boundary on grid lines, and as many sharp edges as can be; or none, and why."""
        why = "none is long enough for quads of this size"
        wanted = None if self.size is not None else self.quads or QUADS
        for found in sharp_layouts(self.mesh, self.faces, wanted, self.size, options, OPTIONS, self.progress):
            with using_threads(options.get("threads", THREADS)):
                grid, why = attempt(found.layout, self.energy)
            if grid is not None:
                return replace(grid, features=found.features, notes=(*grid.notes, *found.notes)), ""
        return None, why


def _of_layout(layout: Layout, energy: StretchEnergy) -> IntegerGrid:
    """Return the grid of a smooth layout."""
    notes = []
    is_split = between_whole(layout)
    if is_split.any():
        layout = split_edges(layout, is_split)
        notes.append(
            f"Split {plural(int(is_split.sum()), 'edge')} between cones, which triangles cannot follow apart from "
            "each other."
        )

    found = _whole(layout, energy)
    return replace(found, notes=(*found.notes, *notes))


def check_extent(quads: float | None, size: float | None) -> None:
    """Raise OptionError unless at most one thing is said of how large quads are to be, and makes sense."""
    if quads is not None and size is not None:
        raise OptionError("quads and size say the same: give one of them")
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
    most = 4
    advice = f"none with up to {2**most} times as many was found, either"
    for k in range(1, most + 1):
        finer = scaled(layout, 2**k)
        if attempt(finer, energy)[0] is not None:
            advice = f"{area_of(finer):,.0f} would do"
            break
    raise GridError(f"no grid of about {area_of(layout):,.0f} quads was found: {why}; {advice}")


def _nearer(found: IntegerGrid, layout: Layout, energy: StretchEnergy) -> IntegerGrid:
    """Return a grid, or one with more nearly the squares of the layout if rounding has made many more or fewer."""
    wanted, squares = area_of(layout), _squares(found)
    if abs(squares - wanted) <= NOTED * wanted:
        return found
    factor, last = 1.0, squares
    for _ in range(4):
        # Half of the way after the first: squares come and go by whole rows.
        factor *= (wanted / last) if factor == 1.0 else math.sqrt(wanted / last)
        other, _ = attempt(scaled(layout, factor), energy)
        if other is None:
            break
        last = _squares(other)
        if abs(np.log(last / wanted)) < abs(np.log(squares / wanted)):
            found, squares = replace(other, size=layout.size), last
        if abs(squares - wanted) <= NOTED * wanted:
            return found
    return replace(
        found, notes=(*found.notes, f"The grid has an area of {squares:,.0f} squares, not {wanted:,.0f}.")
    )


def _squares(grid: IntegerGrid) -> float:
    return float(signed_double_areas(grid.corner_grid).sum()) / 2
