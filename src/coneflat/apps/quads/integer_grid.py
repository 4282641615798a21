"""Seamless maps to the integer grid: the squares of the plane become quads of the surface."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ... import Flattening, check_mesh, flatten
from ...base import THREADS, ComplexArray, IntArray, Progress, Stopwatch, plural, using_threads
from ...errors import ConvergenceError, CurvatureError, GridError, MetricError, OptionError
from ...geometry import as_complex, as_pairs, double_areas, map_factors, sides_between, signed_double_areas
from ...io import as_input
from ...layout import Lines, PointConstraints, Relaxed, StretchEnergy, relax, rest_sides
from ...measure import broken_promises
from ...options import WordOrVertices
from .integer_map import IntegerGrid, find_motions
from .layout import LOOSE, Layout, aligned, between_whole, quarters_around, split_edges
from .options import QUADS, QuadOptions
from .rounding import Rounding, find_rounding
from .sharp import not_taken, sharp_layouts
from .transitions import Transitions, find_transitions

# What the grid wants of a flattening: three, five or six quads at a cone, and rotations that are quarter turns.
OPTIONS = {
    "quantise": np.pi / 2,
    "correct_handles": True,
    "charts": "one",
    "min_cone_angle": QuadOptions.min_cone_angle,
    "max_cone_angle": QuadOptions.max_cone_angle,
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
        if not abs(quarters - np.rint(quarters)) <= LOOSE:
            raise OptionError(
                f"cones of a grid have curvatures that are multiples of pi/2; that of vertex {vertex} is "
                f"{'not given' if curvature is None else f'{curvature:g}'}"
            )
    return {"charts": "one"}


def _noted(found: IntegerGrid, note: str) -> IntegerGrid:
    return replace(found, notes=(*found.notes, note))


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
        return _noted(self._of_flattening("free"), why)

    def with_lines(self, sharp_angle: float | str, boundary: Any) -> IntegerGrid:
        """Return a grid with as many sharp edges on grid lines as can be, and the boundary with them."""
        boundary = "free" if boundary == "auto" else boundary
        with self.stages("grid"):
            found, why = self._along_axes({**self.options, "sharp_angle": sharp_angle, "boundary": boundary})
        if found is not None:
            return found
        return _noted(self._of_flattening(boundary), f"No sharp edge is on a grid line: {why}.")

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
                    return _of_layout(layout, self.energy)
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
            return _noted(_of_layout(layout, self.energy), f"{why}.")

    def _along_axes(self, options: dict[str, Any]) -> tuple[IntegerGrid | None, str]:
        """Return a grid with the boundary on grid lines, and as many sharp edges as can be; or none, and why."""
        why = "none is long enough for quads of this size"
        for layout, features, notes in sharp_layouts(
            self.mesh, self.faces, self.quads, self.size, options, OPTIONS, self.progress
        ):
            with using_threads(options.get("threads", THREADS)):
                grid, why = _attempt(layout, self.energy)
            if grid is not None:
                return replace(grid, features=features, notes=(*grid.notes, *notes)), ""
        return None, why


def _of_layout(layout: Layout, energy: StretchEnergy) -> IntegerGrid:
    """Return the grid of a smooth layout, or say which count of quads has one.

    Where rounding makes many more or fewer squares than the layout has, the size is corrected.
    """
    is_split = between_whole(layout)
    split = int(is_split.sum())
    if split:
        layout = split_edges(layout, is_split)
    found, why = _attempt(layout, energy)
    wanted = layout.area
    if found is None:
        most = 4
        advice = f"none with up to {2**most} times as many was found, either"
        for k in range(1, most + 1):
            finer = layout.scaled(2**k)
            if _attempt(finer, energy)[0] is not None:
                advice = f"{finer.area:,.0f} would do"
                break
        raise GridError(f"no grid of about {wanted:,.0f} quads was found: {why}; {advice}")
    factor, last = 1.0, _squares(found)
    for _ in range(4):
        if abs(_squares(found) - wanted) <= NOTED * wanted:
            break
        # Half of the way after the first: squares come and go by whole rows.
        factor *= (wanted / last) if factor == 1.0 else math.sqrt(wanted / last)
        other, _ = _attempt(layout.scaled(factor), energy)
        if other is None:
            break
        last = _squares(other)
        if abs(np.log(last / wanted)) < abs(np.log(_squares(found) / wanted)):
            found = replace(other, size=layout.size)
    squares = _squares(found)
    if abs(squares - wanted) > NOTED * wanted:
        found = _noted(found, f"The grid has an area of {squares:,.0f} squares, not {wanted:,.0f}.")
    if split:
        found = _noted(
            found,
            f"Split {plural(split, 'edge')} between cones, which triangles cannot follow apart from each other.",
        )
    return found


def _squares(grid: IntegerGrid) -> float:
    return float(signed_double_areas(grid.corner_grid).sum()) / 2


def _attempt(layout: Layout, energy: StretchEnergy) -> tuple[IntegerGrid | None, str]:
    """Return a grid, if one of the nearest lattice points has one, or else why the last has none."""
    transitions = find_transitions(layout)
    try:
        rounding = find_rounding(layout, transitions)
        candidates = rounding.candidates()
    except GridError as error:
        return None, str(error)
    smooth = transitions.places(layout.points, rounding.smooth)
    tries, why = 0, "all lattice points near it put cones on each other"
    for values in candidates[:3]:
        start = _displaced(layout, smooth, rounding, transitions, values)
        try:
            found = _relaxed(layout, start, transitions, values, energy)
        except (ConvergenceError, OptionError) as error:
            tries, why = tries + 1, str(error)
            continue
        points = _snapped(found, transitions, values)
        if (replace(layout, points=points).double_areas() > 0).all():
            return _described(layout, smooth, points, found, tries), ""
        tries, why = tries + 1, "a triangle so small was left that rounding turned it over"
    return None, why


def _displaced(
    layout: Layout, smooth: ComplexArray, rounding: Rounding, transitions: Transitions, values: IntArray
) -> ComplexArray:
    """Return the layout with seams and cones where they are to be, moved by the shift of least energy.

    Where that makes a triangle too small the smooth layout itself: relaxation may find a way.
    """
    shift = rounding.stiffness.displacement((values - rounding.smooth)[:, None])[:, 0]
    moved = transitions.places(smooth + shift[0::2] + 1j * shift[1::2], values.astype(np.float64))
    before, after = (replace(layout, points=points).double_areas() for points in (smooth, moved))
    return moved if (after > 0.01 * before).all() else smooth


def _relaxed(
    layout: Layout, smooth: ComplexArray, transitions: Transitions, values: IntArray, energy: StretchEnergy
) -> Relaxed:
    """Return the layout relaxed with whole translations of seams and cones on whole places.

    Raises:
        ConvergenceError: they cannot be reached without turning a triangle over.
    """
    chains, count = transitions.chains, 2 * len(transitions.quarters)
    places = transitions.places(smooth, values.astype(np.float64))
    pinned = np.flatnonzero(transitions.held.all(axis=1))
    _, one_of = np.unique(chains.chain, return_index=True)
    # To the left of upwards is where x falls.
    sides, lines = layout.sides, None
    if len(sides.axis):
        loose = ~np.isin(sides.points, pinned)
        offsets = np.where(sides.axis == 0, -1.0, 1.0) * values[len(values) - len(sides.axis) :]
        lines = Lines(sides.points[loose], sides.side[loose], sides.directions, offsets)
    constraints = PointConstraints(
        pinned=pinned,
        places=as_pairs(places[pinned]),
        lines=lines,
        tied=chains.halfedges[one_of, 1],
        translations=values[:count].reshape(-1, 2),
    )
    # A thousand times the energy of an isometry: cones fall together then. Of 60 cases of benchmarks/grids.py the
    # slowest takes 1.7 times as long without this.
    hopeless = (
        1e3 * float(energy.values(np.ones(1), np.ones(1))[0]) * float(double_areas(layout.lengths).sum()) / 2
    )
    return relax(
        layout.mesh,
        as_pairs(smooth),
        layout.corners,
        energy,
        constraints,
        lengths=layout.lengths,
        steps=200,
        progress=lambda _, total: total > hopeless,
    )


def _snapped(found: Relaxed, transitions: Transitions, values: IntArray) -> ComplexArray:
    """Return the points with seams that are whole motions of each other to the last bit, and cones on grid points.

    Coordinates become multiples of a power of two so small that their sums with integers are exact.
    """
    largest = float(np.abs(found.points).max(initial=1.0)) + float(np.abs(values).max(initial=0))
    bits = min(40, 50 - int(np.ceil(np.log2(largest))))
    rounded = np.ldexp(np.rint(np.ldexp(found.points, bits)), -bits)
    return transitions.places(as_complex(rounded), values.astype(np.float64))


def _described(
    layout: Layout, smooth: ComplexArray, points: ComplexArray, found: Relaxed, tries: int
) -> IntegerGrid:
    mesh, corner_grid = layout.mesh, as_pairs(points)[layout.corners]
    turns, shifts, _ = find_motions(mesh, corner_grid)
    quarters = quarters_around(mesh, sides_between(corner_grid))
    qc_before, _ = _distortion(layout, smooth)
    qc_mean, least_area = _distortion(layout, points)
    move_rms, move_max = _moves(layout, smooth, points)
    notes = []
    if tries:
        notes.append(
            f"The {plural(tries, 'nearest lattice point')} could not be reached without turning triangles over; the "
            "next one could."
        )
    return IntegerGrid(
        vertices=mesh.vertices,
        faces=mesh.faces,
        corner_grid=corner_grid,
        turns=turns,
        shifts=shifts,
        cones=layout.cones,
        quarters=quarters[layout.cones],
        corners=layout.sides.corners,
        corner_quarters=quarters[layout.sides.corners],
        size=layout.size,
        move_rms=move_rms,
        move_max=move_max,
        energy_before=found.energy_before,
        energy=found.energy,
        qc_before=qc_before,
        qc_mean=qc_mean,
        least_area=least_area,
        notes=tuple(notes),
    )


def _moves(layout: Layout, smooth: ComplexArray, points: ComplexArray) -> tuple[float, float]:
    """Return the root mean square and the largest move of cones, in units, beside one that all points share."""
    at = np.isin(layout.mesh.faces, layout.whole)
    if not at.any():
        return 0.0, 0.0
    move = (points - smooth)[np.unique(layout.corners[at])]
    size = np.abs(move - move.mean())
    return float(np.sqrt((size**2).mean())), float(size.max())


def _distortion(layout: Layout, points: ComplexArray) -> tuple[float, float]:
    """Return the mean quasi-conformal distortion by area, and the least area of a triangle over what it should be."""
    areas = double_areas(layout.lengths) / 2
    real = areas > 0
    along, across = map_factors(rest_sides(layout.lengths[real] / layout.size))
    places = points[layout.corners[real]]
    places = places - places[:, :1]
    one, two = np.abs((along * places).sum(axis=1)), np.abs((across * places).sum(axis=1))
    ratio = (one + two) / (one - two)
    return float(np.average(ratio, weights=areas[real])), float((one**2 - two**2).min())
