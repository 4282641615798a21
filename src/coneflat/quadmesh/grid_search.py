"""Computation of integer-grid maps: seamless maps for which unit squares of the plane become quads of the surface."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base import THREADS, FloatArray, Stopwatch, Unmet, limit_threads, plural, warns
from ..errors import ConvergenceError, CurvatureError, GridError, MetricError, OptionError, SeamError
from ..flattener import flatten_source
from ..geometry import double_areas, edge_lengths
from ..io import as_input
from ..measures import unmet_guarantees
from ..mesh import CheckedMesh
from ..optimise import StretchEnergy
from ..options import SEARCH_OPTIONS, Options, read_options
from ..result import Flattening
from ..source import Source
from .aligned_cones import COARSE, aligned_flattening
from .cross_field import SHARP_ANGLE, sharp_ends
from .extract import extract_quads
from .features import edge_indices
from .integer_map import IntegerGrid, joined_grids
from .layout import GridLayout, aligned
from .limits import NO_LIMIT, SquareLimit
from .lines import grid_with_lines, with_sides
from .options import QUADS, QuadOptions, flattening_defaults
from .quad_mesh import CoarseGridError
from .round_layout import grid_about, split_between_nodes, with_note
from .rounding import find_rounding
from .sizes import note_on_sizes, target_scales

# Options that only the search for the fewest cones takes into account.
SPARSE_OPTIONS = (*SEARCH_OPTIONS, "max_cones", "lengths")

# With fewer quads, a cone costs more than 1, in proportion.
QUADS_AT_UNIT_PRICE = 2_000
# Errors for which another grid is searched.
NO_GRID = (ConvergenceError, CurvatureError, GridError, MetricError, SeamError)


@warns("grid.notes")
def integer_grid(
    mesh: Any,
    faces: ArrayLike | None = None,
    *,
    quads: int | None = None,
    size: ArrayLike | None = None,
    stretch: float = QuadOptions.stretch,
    sharp_angle: float | str | None = None,
    **options: Any,
) -> IntegerGrid:
    """Return a seamless map of a surface to the integer grid: unit squares become quads that match across seams.

    Args:
        mesh, faces: as for `coneflat.flatten`; or a `Flattening` with cones quantised to quarter turns.
        quads: approximate number of unit squares that cover the surface; None: 10,000, unless `size` is given.
        size: edge length of a square in model units, which replaces `quads`; or relative sizes of squares: (n,)
            numbers, the name of a vertex property of the file, or "curvature", for squares up to four times smaller
            where the surface is more curved.
        stretch: trade-off between angles (0) and areas (1); see `StretchEnergy`.
        sharp_angle: radians; edges with a larger dihedral angle, and the boundary, are put on grid lines; None for
            none.
        options: those of `coneflat.flatten`; by default cones have three, five or six quads. Given cones need
            curvatures, multiples of pi/2; on surfaces with handles or several boundaries, a grid rarely exists for
            them. boundary may also be "auto", the default: "straight" if such a grid is found and cones are not given,
            else "free".

    Returns:
        The map, with its cones and measures.

    Raises:
        GridError: no grid of this size without flipped triangles was found; or there would be more than 16 times as
            many squares, or more than the triangles of the mesh can carry.
        TooLargeError: the grid does not fit into the free memory.
        MeshError, CurvatureError, OptionError, SeamError, MetricError: as for `coneflat.flatten`.

    Warns:
        GuaranteeWarning: a guarantee, or a request, is not met; notes of the result say which.

    Notes:
        A smooth layout with quantised cones (Kaelberer, Nieser, Polthier, "QuadCover", 2007) is scaled. Translations of
        seams and positions of cones are rounded together, to the nearest lattice point in the metric of the least
        energy that a displacement needs. The layout is then relaxed to these constraints (integer-grid maps: Bommes,
        Campen, Ebke, Alliez, Kobbelt 2013), from the smooth one by steps that flip no triangle. Edges between cones are
        split before.

    Examples:
        >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]
        >>> grid = coneflat.integer_grid(*square, quads=16)
        >>> round(grid.size, 6)  # sides of the squares, in model units
        0.25
        >>> grid.corners, grid.corner_quarters
        (array([0, 1, 2, 3]), array([1, 1, 1, 1]))
    """
    own = {"quads": quads, "size": size, "stretch": stretch, "sharp_angle": sharp_angle}
    return GridSearch.of(mesh, faces, own, options).grid()


@dataclass(frozen=True, eq=False)
class GridSearch:
    """The search for a grid.

    Attributes:
        source: the mesh.
        result: its flattening, if it is given.
        size: the side of squares in model units.
        sizes: relative sizes of squares, or None.
        energy: the energy of the grid.
        sharp_angle: the dihedral angle of edges required on grid lines, or None.
        limit: largest number of squares of a grid.
        boundary: the option of that name of `integer_grid`.
        options: the other options, those of the flattening.
        stages: the stopwatch.
        for_quads: search until quads can be extracted from the grid.
        known: flattenings with aligned cones, by the price of a cone and whether the mesh is split for them; sizes with
            the same price share one.
    """

    source: Source
    result: Flattening | None
    size: float
    sizes: Any
    energy: StretchEnergy
    sharp_angle: float | None
    limit: SquareLimit
    boundary: Any
    options: Mapping[str, Any]
    stages: Stopwatch
    for_quads: bool = False
    known: dict[tuple[float, bool], Flattening] = field(default_factory=dict, init=False)

    @classmethod
    def of(
        cls, mesh: Any, faces: ArrayLike | None, own: Mapping[str, Any], options: Mapping[str, Any]
    ) -> GridSearch:
        """Return the search for arguments of `integer_grid`; `own` are its named options.

        Raises:
            OptionError: options are invalid.
            MeshError, MeshFileError: the mesh cannot be read.
        """
        o = read_options(own, QuadOptions)
        length, sizes = (o.size, None) if isinstance(o.size, float) else (None, o.size)
        if o.quads is not None and length is not None:
            raise OptionError("quads and size must not be given together")
        is_auto = str(options.get("boundary", "auto")) == "auto"
        rest = {name: one for name, one in options.items() if name != "boundary"}
        shared = {"sharp_angle": o.sharp_angle, "boundary": "free" if is_auto else options["boundary"]}
        parsed = read_options({**flattening_defaults(options), **rest, **shared}, Options)
        stages = Stopwatch(parsed.progress)
        result = mesh if isinstance(mesh, Flattening) else None
        given = any(one is not None for one in (faces, sizes, o.sharp_angle)) or options.keys() - {"progress"}
        if result and given:
            raise OptionError("a flattening already has faces and options: no others can be given")
        source = Source(as_input(*((result.vertices, result.faces) if result else (mesh, faces))))
        boundary = parsed.boundary.tolist() if isinstance(parsed.boundary, np.ndarray) else parsed.boundary
        energy, boundary = StretchEnergy(o.stretch), "auto" if is_auto else boundary
        found = cls(source, result, 1.0, sizes, energy, o.sharp_angle, NO_LIMIT, boundary, rest, stages)
        size, extent = length or found.extent / float(np.sqrt(o.quads or QUADS)), found.extent
        # Sizes beyond this range, whose squares could overflow, fail as those at its ends.
        size = min(max(size, 1e-75 * extent), 1e75 * extent)
        squares = o.quads or (extent / size) ** 2
        limit = SquareLimit.of(squares, len(found.checked.mesh.faces), extent)
        return replace(found, size=size, limit=limit)

    def grid(self) -> IntegerGrid:
        """Return the grid, with the time of each stage; errors are those of `integer_grid`."""
        self.stages.done = 0.0
        return replace(self.of_any_size(), seconds=dict(self.stages.seconds))

    def of_any_size(self, tries: int = 3) -> IntegerGrid:
        """Return a grid, with more squares if some quads of one of the requested size are degenerate.

        This is so where the surface is as thin as a square. A grid of more than 1,000 squares, and four times as many
        as requested, is not refined, since each try repeats the search.

        Raises:
            CoarseGridError: none was found, with the grid of the requested size.
        """
        try:
            return self._as_given()
        except CoarseGridError as error:
            coarse, squares = error.with_traceback(None), error.grid.squares
        more = min(max(1.6 * squares, 32.0), self.limit.squares)
        finer = self.extent / float(np.sqrt(more))
        if tries == 1 or more < 1.2 * squares or (squares > 1000 and finer < 0.4 * self.size):
            raise coarse
        search = replace(self, size=finer)
        search.known.update(self.known)
        try:
            found = search.of_any_size(tries - 1)
        except NO_GRID:
            raise coarse from None
        return with_note(found, Unmet("More quads than requested: with fewer, some are degenerate."))

    def _as_given(self) -> IntegerGrid:
        """Return a grid for the options as given."""
        if self.result:
            return self.of_result(self.result)
        if not self._may_align():
            if self.sizes is not None:
                raise OptionError("sizes cannot be combined with options of cones, boundaries or weights")
            return self._with_fewest_cones()
        if self.checked.mesh.components[0] > 1:
            return self._of_components()
        what = "the boundary, sharp edges or curvature" + ", nor for requested sizes" * (
            self.sizes is not None
        )
        failed = list[Exception]()
        # On a coarse mesh that is split, costlier cones are others, for which there may be a grid.
        # With so many holes and handles, costlier cones hardly ever help, nor others if rotations are not reached.
        mesh, has_many_loops = self.checked.mesh, self.checked.mesh.euler_characteristic < -24
        for price_factor in (1.0, 4.0) if 6 * len(mesh.faces) < COARSE and not has_many_loops else (1.0,):
            try:
                return self._of_aligned_cones(price_factor)
            except NO_GRID as error:
                is_coarse, is_far = isinstance(error, CoarseGridError), isinstance(error, ConvergenceError)
                if (is_coarse and self.sizes is not None) or (is_far and has_many_loops):
                    raise
                # With its traceback, it would keep this frame, and all arrays, in memory.
                failed.append(error.with_traceback(None))
            # Where rotations are not reached, others hardly ever help, and each metric takes long.
            if is_far:
                break
        note = Unmet(
            f"Cones are not chosen for {what}, because no grid with such cones was found: {failed[-1]}."
        )
        try:
            return self._of_flattening(note=note)
        except NO_GRID as error:
            raise next((one for one in failed if isinstance(one, CoarseGridError)), error) from None

    def _of_components(self) -> IntegerGrid:
        """Return the grid of the components, each with a search of its own.

        One that needs a finer grid, or that has none, thus does not change those of the others. On human.obj, five
        components, 3,000 quads become 3,099 in half the time; 12,040 if all are rounded together.

        Raises:
            GridError: no component has a grid.
        """
        checked, found, why = self.checked, list[IntegerGrid](), list[str]()
        mesh, grow = checked.mesh, np.exp2(-checked.exponent)
        scales = np.zeros(len(mesh.vertices)) if self.scales is None else self.scales
        areas = double_areas(edge_lengths(mesh.vertices, mesh.faces))
        of_face = scales[mesh.faces].mean(axis=1)
        # Nothing of a component without area can be seen.
        for part, vertices, faces in (each for each in mesh.split_components() if areas[each[2]].any()):
            # The mean of the log scale on the component, relative to that on all components.
            mean = np.average(of_face[faces], weights=areas[faces]) - np.average(of_face, weights=areas)
            search = replace(
                self,
                source=Source(as_input(part.moved_to(grow * part.vertices))),
                size=self.size * float(np.exp(-mean)),
                sizes=None if self.sizes is None else np.exp(-scales[vertices]),
            )
            try:
                found.append(search.of_any_size())
            except CoarseGridError as error:  # its bad quads are left out
                found.append(error.grid)
            except NO_GRID as error:
                why.append(
                    Unmet(f"No grid for a component of {plural(len(part.faces), 'triangle')}: {error}.")
                )
            if text := self.limit.excess(sum(grid.squares for grid in found)):
                raise GridError(text)
        if not found:
            reason = why[0] if why else "they have no area."
            raise GridError(f"no grid was found for any of {mesh.components[0]} components: {reason}")
        return joined_grids(found, (*checked.notes, *why))

    def _may_align(self) -> bool:
        """Return whether the options leave open which cones a grid has."""
        cones = self.options.get("cones", "auto")
        if not (isinstance(cones, str) and cones == "auto") or any(n in self.options for n in SPARSE_OPTIONS):
            return False
        return self.boundary in ("auto", "straight") or not self.checked.mesh.is_boundary_edge.any()

    def _of_aligned_cones(self, price_factor: float) -> IntegerGrid:
        """Return a grid of a connected mesh whose cones are chosen for even sizes and its directions.

        price_factor: factor of the price of cones.
        """
        price = price_factor * max(1.0, QUADS_AT_UNIT_PRICE * (self.size / self.extent) ** 2)
        # With costlier cones the mesh is split, for more places for them.
        key = price, price_factor > 1
        if key not in self.known:
            self.known[key] = aligned_flattening(
                self.checked, *key, self.options, self.stages, self.sharp_angle, self.scales, self.limit
            )
        return self.of_result(self.known[key], True, True)

    def _with_fewest_cones(self) -> IntegerGrid:
        """Return a grid with the fewest cones."""
        may_be_straight = self.boundary == "auto" and isinstance(self.options.get("cones", "auto"), str)
        if not (may_be_straight and self.checked.mesh.is_boundary_edge.any()):
            return self._of_flattening()
        try:
            return self._of_flattening("straight", all_sides=True)
        except NO_GRID as error:
            if isinstance(error, CoarseGridError):
                raise
            why = Unmet(
                f"The boundary cuts squares, because no grid with the boundary on grid lines was found: {error}."
            )
        return self._of_flattening(note=why)

    @property
    def checked(self) -> CheckedMesh:
        """The checked mesh, at about unit size."""
        return self.source.checked(bool(self.options.get("repair", False)))

    @property
    def extent(self) -> float:
        """The root of the area of the mesh, in model units."""
        checked, given = self.checked, self.result.lengths if self.result else self.options.get("lengths")
        options = read_options({"lengths": given, "repair": self.options.get("repair", False)}, Options)
        own = None if given is None else self.source.prepared(options).user_lengths
        lengths = edge_lengths(checked.mesh.vertices, checked.mesh.faces) if own is None else own
        return float(np.ldexp(max(np.sqrt(double_areas(lengths).sum() / 2), 1e-150), -checked.exponent))

    @cached_property
    def scales(self) -> FloatArray | None:
        """(n,) the target log scale at the vertices of the checked mesh, if relative sizes are given."""
        return None if self.sizes is None else target_scales(self.source, self.checked, self.sizes)

    def _of_flattening(self, boundary: str = "", all_sides: bool = False, note: str = "") -> IntegerGrid:
        """Return the grid of a flattening with a given boundary, or else the one of the options, by default free.

        Args:
            boundary: the boundary, or "".
            all_sides: require all straight sides on grid lines.
            note: a further note, or "".

        Raises:
            GridError: there is no grid, or required sides are not on grid lines.
        """
        own = "free" if self.boundary == "auto" else self.boundary
        given = {**self.options, "boundary": boundary or own}
        self.stages.done = 0.0
        with self.stages("flatten"):
            result = flatten_source(self.source, read_options({**flattening_defaults(given), **given}))
        return self.of_result(result, all_sides, note=note)

    def of_result(
        self, result: Flattening, all_sides: bool = False, is_aligned: bool = False, note: str = ""
    ) -> IntegerGrid:
        """Return the grid of a flattening.

        Args:
            result: the flattening.
            all_sides: require all straight sides on grid lines.
            is_aligned: its cones were chosen for its directions: sharp edges that are nearly along the axes are put on
                grid lines, if possible.
            note: a further note, or "".

        Raises:
            CoarseGridError: no quads can be extracted, if they are wanted; its grid has all notes.
        """
        is_straight = result.settings.get("boundary") == "straight"
        self.stages.done = 1.0
        with self.stages("grid"), limit_threads(result.settings.get("threads", THREADS)):
            layout = replace(aligned(result, self.size, self._angle), limit=self.limit)
            self.limit.check_cones(layout.node_quarters)
            sided, found, left = with_sides(layout) if is_straight else layout, None, ""
            if is_aligned or self.sharp_angle is not None:
                lines = edge_indices(sided.mesh, sharp_ends(sided.mesh, self._angle))
                split = split_between_nodes(sided, lines)
                found, left = grid_with_lines(split, self._angle, self.sharp_angle is not None, self.energy)
            # Rather than many more squares than requested, a grid with other cones is searched.
            most = 1 if is_aligned and self.sharp_angle is None else 4
            found = with_note(found or self._with_sides(layout, sided, all_sides, most), left)
        if result is not self.result:
            # Unmet guarantees of the map do not apply to the grid.
            notes = (note for note in result.notes if note not in unmet_guarantees(result))
            found = with_note(replace(found, notes=(*notes, *found.notes)), note)
        if is_aligned and self.scales is not None:
            found = with_note(found, note_on_sizes(found, self.scales))
        if not self.for_quads:
            return found
        with self.stages("extract"):
            return replace(found, quad_mesh=extract_quads(found))

    @property
    def _angle(self) -> float:
        """The dihedral angle above which edges are sharp."""
        return SHARP_ANGLE if self.sharp_angle is None else self.sharp_angle

    def _with_sides(self, layout: GridLayout, sided: GridLayout, all_sides: bool, most: int) -> IntegerGrid:
        """Return a grid with the sides of a layout on grid lines, or without some if these are not required.

        most: how often the number of squares is doubled.
        """
        try:
            return grid_about(find_rounding(split_between_nodes(sided)), self.energy, most)
        except GridError:
            if all_sides or len(sided.sides.points) == len(layout.sides.points):
                raise
        why = Unmet(
            "Straight sides of different loops are not parallel up to quarter turns, so not all on grid lines."
        )
        return with_note(grid_about(find_rounding(split_between_nodes(layout)), self.energy, most), why)
