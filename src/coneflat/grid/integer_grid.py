"""Seamless maps to the integer grid: the squares of the plane become quads of the surface."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import ComplexArray, FloatArray, IntArray
from ..errors import ConvergenceError, GridError, OptionError
from ..geometry.planar import map_factors, sides_between, signed_angles, signed_double_areas
from ..geometry.triangles import double_areas
from ..layout.relax import Lines, PointConstraints, Relaxed, StretchEnergy, relax
from ..layout.relax.relax import rest_sides
from ..mesh import NEXT
from ..pipeline import flatten
from ..progress import Stages
from ..result.flattening import Flattening
from ..result.promises import broken_promises
from ..text import plural
from ..threads import one_blas_thread
from .aligned import Layout, aligned
from .given_cones import require_quarters
from .motions import find_motions
from .rounding import Rounding, find_rounding
from .sharp_edges import sharp_layouts
from .sides import Sides
from .transitions import Transitions, find_transitions

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
# Lattice points that are tried, one after the other.
TRIES = 6
# Newton steps at most, and how many times that of an isometry the energy may become: cones fall together then.
STEPS, HOPELESS = 200, 1e3
# Part of their areas that triangles keep in a start for relaxation.
LEAST_START = 1e-2
# Part of the squares wanted by which there may be more or fewer without a note.
NOTED = 0.1
# Bits after the point that coordinates have at most: so seams fit exactly, and no triangle notices.
BITS = 40


@dataclass(frozen=True, eq=False)
class IntegerGrid:
    """A map of a surface to the plane in which grid lines go on across seams: m triangles, n vertices.

    A half-edge h = 3 f + i is the side of triangle f opposite its corner i, from corner i + 1 to corner i + 2. What is
    x in the frame of the triangle across it is R x + shifts[h] in its own, R being turns[h] quarter turns to the left.

    Attributes:
        vertices: (n, 3) positions in model units.
        faces: (m, 3) vertex indices.
        corner_grid: (m, 3, 2) the point of the grid of every triangle corner, in units of the grid; no triangle is
            turned over.
        turns: (3m,) from 0 to 3; -1 on the boundary.
        shifts: (3m, 2) whole numbers; 0 on the boundary.
        cones: (s,) vertices that lie on grid points and have other than four quads.
        quarters: (s,) how many they have, the quarter turns of their angle.
        size: of a square of the grid, in model units: the root of the surface's area by the grid's.
        move_rms, move_max: by how much rounding has moved the cones, in units of the grid.
        energy_before, energy: the mean distortion that was minimised, in the smooth layout and in the grid.
        qc_before, qc_mean: quasi-conformal distortion, the mean by area, likewise.
        least_area: of any triangle, over what it should have.
        notes: what was done, one sentence each.
        corners: (k,) further vertices on grid points, where straight sides of the boundary, or sharp edges, meet at an
            angle; sides and these lie on grid lines.
        corner_quarters: (k,) the quarter turns of their angle.
        features: (f, 2) vertices of sharp edges that lie on grid lines.
        seconds: wall time of each stage; files do not keep it.
    """

    vertices: FloatArray
    faces: IntArray
    corner_grid: FloatArray
    turns: IntArray
    shifts: IntArray
    cones: IntArray
    quarters: IntArray
    size: float
    move_rms: float
    move_max: float
    energy_before: float
    energy: float
    qc_before: float
    qc_mean: float
    least_area: float
    notes: tuple[str, ...] = ()
    corners: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    corner_quarters: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    features: IntArray = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    seconds: dict[str, float] = field(default_factory=dict)

    def report(self) -> dict[str, float | None]:
        """Return the numbers among the attributes by name, as JSON takes them: None for what is not known."""
        numbers = {name: value for name, value in vars(self).items() if isinstance(value, float)}
        return {name: float(value) if np.isfinite(value) else None for name, value in numbers.items()}

    def save(self, path: str | PathLike[str]) -> Path:
        """Write the grid as .obj or .npz, in full or not at all, and return the path; see `write_grid`.

        Raises:
            UnknownFormatError: the ending is another.
            MeshFileError: the file cannot be written.
        """
        from ..files.grid import write_grid

        return write_grid(path, self)

    @staticmethod
    def load(path: str | PathLike[str]) -> IntegerGrid:
        """Return the grid that an .npz or .obj file holds; see `read_grid`.

        Raises:
            UnknownFormatError: the ending is another.
            MeshFileError: the file is not there, may not be read, or holds no manifold of triangles with UVs.
            GridError: the UVs are no integer-grid map.
        """
        from ..files.grid import read_grid

        return read_grid(path)


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
            curvatures, multiples of pi/2; on surfaces with handles, or several boundaries, few have a grid.

    Raises:
        GridError: no grid of this size was found that turns no triangle over.
        MeshError, CurvatureError, OptionError, SeamError, MetricError: as `coneflat.flatten`.

    Notes:
        A smooth layout with quantised cones (Kaelberer, Nieser, Polthier, "QuadCover", 2007) is scaled; translations of
        seams and places of cones are rounded together, to the lattice point that is nearest by the energy that going
        there costs at least; and the layout is relaxed with these (integer-grid maps: Bommes, Campen, Ebke, Alliez,
        Kobbelt 2013), from the smooth one by steps that turn no triangle over.
    """
    if quads is not None and size is not None:
        raise OptionError("quads and size say the same: give one of them")
    wanted, name = (size, "size") if size is not None else (10_000 if quads is None else quads, "quads")
    if not (np.isfinite(wanted) and wanted > 0):
        raise OptionError(f"{name} must be a positive number, not {wanted!r}")
    stages = Stages(options.get("progress"))
    told: tuple[str, ...] = ()
    if isinstance(mesh, Flattening):
        if faces is not None or options or sharp_angle is not None:
            raise OptionError("a flattening has its faces and options: none can be given beside it")
        result = mesh
    elif sharp_angle is not None:
        given = {**OPTIONS, **options, "sharp_angle": sharp_angle}
        given.pop("progress", None)
        with stages("grid"):
            found = _sharp(
                mesh, faces, None if size is not None else wanted, size, given, StretchEnergy(stretch)
            )
        return replace(found, seconds=stages.seconds)
    else:
        with stages("flatten"):
            result = flatten(mesh, faces, **{**_defaults(options), **options})
        # What a map does not keep of its promises is not what the grid does not keep.
        told = tuple(note for note in result.notes if note not in broken_promises(result))
    stages.done = 1.0
    with stages("grid"), one_blas_thread():
        layout = aligned(result, None if size is not None else wanted, size)
        found = _whole(layout, StretchEnergy(stretch))
    found = replace(found, notes=(*told, *found.notes), seconds=stages.seconds)
    loose = _loose_border(layout) if result.settings.get("boundary") == "straight" else 0
    if not loose:
        return found
    note = (
        f"{plural(loose, 'edge')} of the boundary {'is' if loose == 1 else 'are'} on no grid line: straight sides of "
        "different loops do not point in the same directions, up to quarter turns."
    )
    return replace(found, notes=(*found.notes, note))


def _defaults(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the grid wants of a flattening with these options; cones that are given are not searched for."""
    given = options.get("cones", "auto")
    if isinstance(given, str):
        return OPTIONS if options.get("boundary") != "straight" else {**OPTIONS, **STRAIGHT}
    require_quarters(given)
    return {"charts": "one"}


def _sharp(
    mesh: Any,
    faces: ArrayLike | None,
    quads: float | None,
    size: float | None,
    given: dict[str, Any],
    energy: StretchEnergy,
) -> IntegerGrid:
    """Return a grid with as many sharp edges on grid lines as can be."""
    why = "none is long enough for quads of this size"
    for found in sharp_layouts(mesh, faces, quads, size, given):
        with one_blas_thread():
            grid, why = _attempt(found.layout, energy)
        if grid is not None:
            return replace(grid, features=found.features, notes=(*grid.notes, *found.notes))
    plain = integer_grid(
        mesh,
        faces,
        size=size,
        quads=None if quads is None else int(np.ceil(quads)),
        stretch=energy.stretch,
        **{name: value for name, value in given.items() if name != "sharp_angle"},
    )
    return replace(plain, notes=(*plain.notes, f"No sharp edge is on a grid line: {why}."))


def _loose_border(layout: Layout) -> int:
    """Return how many edges of the boundary are not parts of sides on grid lines."""
    border = layout.mesh.edge_halfedges[layout.mesh.is_boundary_edge, 0]
    starts = layout.corners[:, NEXT].ravel()[border]
    return int(np.count_nonzero(~np.isin(starts, layout.sides.points)))


def _whole(layout: Layout, energy: StretchEnergy) -> IntegerGrid:
    """Return the grid of a smooth layout, or say which count of quads has one."""
    found, why = _attempt(layout, energy)
    if found is not None:
        return found
    advice = "none with up to 16 times as many was found, either"
    for factor in (2, 4, 8, 16):
        finer = replace(layout, points=np.sqrt(factor) * layout.points, size=layout.size / np.sqrt(factor))
        if _attempt(finer, energy)[0] is not None:
            advice = f"{_area(finer):,.0f} would do"
            break
    raise GridError(f"no grid of about {_area(layout):,.0f} quads was found: {why}; {advice}")


def _attempt(layout: Layout, energy: StretchEnergy) -> tuple[IntegerGrid | None, str]:
    """Return a grid, if one of the nearest lattice points has one, or else why the last has none."""
    mesh, corners = layout.mesh, layout.corners
    transitions = find_transitions(mesh, corners, layout.points, layout.whole, layout.sides)
    try:
        rounding = find_rounding(mesh, corners, layout.points, layout.whole, transitions)
        candidates = rounding.candidates()
    except GridError as error:
        return None, str(error)
    smooth = transitions.places(layout.points, rounding.smooth)
    tries, why = 0, "all lattice points near it put cones on each other"
    for values in candidates[:TRIES]:
        start = _displaced(layout, smooth, rounding, transitions, values)
        try:
            found = _relaxed(layout, start, transitions, values, energy)
        except ConvergenceError as error:
            tries, why = tries + 1, str(error)
            continue
        points = _snapped(found, transitions, values)
        if (signed_double_areas(_pairs(points)[corners]) > 0).all():
            return _described(layout, smooth, points, found, transitions, tries), ""
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
    before, after = (signed_double_areas(_pairs(points)[layout.corners]) for points in (smooth, moved))
    return moved if (after > LEAST_START * before).all() else smooth


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
    constraints = PointConstraints(
        pinned=pinned,
        places=_pairs(places[pinned]),
        lines=_lines(layout.sides, pinned, values),
        tied=chains.halfedges[one_of, 1],
        translations=values[:count].reshape(-1, 2),
    )
    highest = HOPELESS * float(energy.values(np.ones(1), np.ones(1))[0]) * _model_area(layout)
    return relax(
        layout.mesh,
        _pairs(smooth),
        layout.corners,
        energy,
        constraints,
        lengths=layout.lengths,
        steps=STEPS,
        progress=lambda _, total: total > highest,
    )


def _lines(sides: Sides, pinned: IntArray, values: IntArray) -> Lines | None:
    """Return the grid lines that sides of the boundary come to lie on."""
    if not len(sides.axis):
        return None
    loose = ~np.isin(sides.points, pinned)
    is_upright = sides.axis == 0
    # To the left of upwards is where x falls.
    offsets = np.where(is_upright, -1.0, 1.0) * values[len(values) - len(sides.axis) :]
    directions = np.stack([~is_upright, is_upright], axis=1).astype(np.float64)
    return Lines(sides.points[loose], sides.side[loose], directions, offsets)


def _snapped(found: Relaxed, transitions: Transitions, values: IntArray) -> ComplexArray:
    """Return the points with seams that are whole motions of each other to the last bit, and cones on grid points.

    Coordinates become multiples of a power of two so small that their sums with whole numbers are exact.
    """
    largest = float(np.abs(found.points).max(initial=1.0)) + float(np.abs(values).max(initial=0))
    bits = min(BITS, 50 - int(np.ceil(np.log2(largest))))
    z = found.points[:, 0] + 1j * found.points[:, 1]
    rounded = np.ldexp(np.rint(np.ldexp(_pairs(z), bits)), -bits)
    return transitions.places(rounded[:, 0] + 1j * rounded[:, 1], values.astype(np.float64))


def _described(
    layout: Layout,
    smooth: ComplexArray,
    points: ComplexArray,
    found: Relaxed,
    transitions: Transitions,
    tries: int,
) -> IntegerGrid:
    mesh, corners = layout.mesh, layout.corners
    turns, shifts, _ = find_motions(mesh, _pairs(points)[corners])
    angles = signed_angles(sides_between(_pairs(points)[corners]))
    sums = np.bincount(mesh.faces.ravel(), angles.ravel(), len(mesh.vertices))
    quarters = np.rint(sums / (np.pi / 2)).astype(np.int64)
    move_rms, move_max = _moves(layout, smooth, points)
    notes = []
    if tries:
        notes.append(
            f"The {plural(tries, 'nearest lattice point')} could not be reached without turning triangles over; the "
            "next one could."
        )
    squares, wanted = _area(replace(layout, points=points)), _model_area(layout) / layout.size**2
    if abs(squares - wanted) > NOTED * wanted:
        notes.append(f"The grid has an area of {squares:,.0f} squares, not {wanted:,.0f}.")
    return IntegerGrid(
        vertices=mesh.vertices,
        faces=mesh.faces,
        corner_grid=_pairs(points)[corners],
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
        qc_before=_distortion(layout, smooth)[0],
        qc_mean=_distortion(layout, points)[0],
        least_area=_distortion(layout, points)[1],
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


def _model_area(layout: Layout) -> float:
    return float(double_areas(layout.lengths).sum()) / 2


def _area(layout: Layout) -> float:
    return float(signed_double_areas(_pairs(layout.points)[layout.corners]).sum()) / 2


def _pairs(points: ComplexArray) -> FloatArray:
    return np.stack([points.real, points.imag], axis=-1)
