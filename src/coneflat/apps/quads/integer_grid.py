"""Computation of integer-grid maps: seamless maps for which unit squares of the plane become quads of the surface."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ... import Flattening, flatten
from ...base import THREADS, FloatArray, Stopwatch, limit_threads, plural
from ...errors import ConvergenceError, CurvatureError, GridError, MetricError, OptionError, SeamError
from ...flatten import flatten_source
from ...geometry import double_areas, edge_lengths
from ...io import as_input
from ...layout import StretchEnergy
from ...measure import unmet_guarantees
from ...mesh import CheckedMesh
from ...options import SEARCH_OPTIONS, Options, WordOrVertices, read_options
from ...source import Source
from .aligned_cones import COARSE, aligned_cones
from .cross_field import SHARP_ANGLE, sharp_ends
from .extract import extract_quads
from .features import edge_indices, split_around, split_chords, split_small_components
from .integer_map import IntegerGrid, joined_grids
from .layout import GRID_TOLERANCE, GridLayout, aligned, has_area
from .lines import grid_with_lines, with_sides
from .options import DISTORTION, QUADS, QuadOptions
from .quad_mesh import CoarseGridError
from .round_layout import grid_of, split_between_nodes, with_note
from .sizes import extended, note_on_sizes, wanted_scales

# Options of the flattening for a grid: three, five or six quads at a cone, and rotations by quarter turns.
OPTIONS = {
    "quantise": np.pi / 2,
    "correct_handles": True,
    "charts": "one",
    "distortion": DISTORTION,
    "min_cone_angle": QuadOptions.min_cone_angle,
    "max_cone_angle": QuadOptions.max_cone_angle,
}

# With fewer quads, cones cost more in proportion.
QUADS_PER_CONE = 2_000
# Options that only the search for the fewest cones takes into account.
SPARSE_OPTIONS = (*SEARCH_OPTIONS, "max_cones", "lengths")

# Errors for which another grid is searched.
NO_GRID = (ConvergenceError, CurvatureError, GridError, MetricError, SeamError)


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
        GridError: no grid of this size without flipped triangles was found.
        MeshError, CurvatureError, OptionError, SeamError, MetricError: as for `coneflat.flatten`.

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


def _defaults(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the default options of the flattening for a grid; given cones are not searched for.

    Raises:
        OptionError: curvatures of given cones are not multiples of pi/2.
    """
    given = options.get("cones", "auto")
    # With straight sides, bounds of cone angles apply to the double of the surface, two copies glued along the
    # boundary, where a corner of pi/2 is a cone of pi.
    if isinstance(given, str):
        return OPTIONS if options.get("boundary") != "straight" else {**OPTIONS, "min_cone_angle": np.pi / 2}
    parsed = WordOrVertices((), "cone").parse("cones", given)
    for vertex, curvature in parsed.items() if isinstance(parsed, dict) else ():
        quarters = np.nan if curvature is None else curvature / (np.pi / 2)
        if not abs(quarters - np.rint(quarters)) <= GRID_TOLERANCE:
            raise OptionError(
                f"cones of a grid must have curvatures that are multiples of pi/2; that of vertex {vertex} is "
                f"{'not given' if curvature is None else f'{curvature:g}'}"
            )
    return {"charts": "one", "quantise": np.pi / 2, "correct_handles": True}


@dataclass(frozen=True, eq=False)
class GridSearch:
    """The search for a grid.

    Attributes:
        mesh: the mesh, or a flattening of it.
        quads, size: the number of squares; or their side in model units, which replaces it.
        sizes: relative sizes of squares, or None.
        energy: the energy of the grid.
        sharp_angle: the dihedral angle of edges required on grid lines, or None.
        boundary: the option of that name of `integer_grid`.
        options: the other options, those of the flattening.
        stages: the stopwatch.
        for_quads: search until quads can be extracted from the grid.
    """

    mesh: Source | Flattening
    quads: float
    size: float | None
    sizes: Any
    energy: StretchEnergy
    sharp_angle: float | None
    boundary: Any
    options: Mapping[str, Any]
    stages: Stopwatch
    for_quads: bool = False

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
        # Lengths beyond the range of coordinates, whose squares would overflow, fail as those at its ends.
        length, sizes = (min(max(o.size, 1e-75), 1e75), None) if isinstance(o.size, float) else (None, o.size)
        if o.quads is not None and length is not None:
            raise OptionError("quads and size must not be given together")
        boundary = options.get("boundary", "auto")
        is_auto = isinstance(boundary, str) and boundary == "auto"
        rest = {name: one for name, one in options.items() if name != "boundary"}
        shared = {"sharp_angle": o.sharp_angle, "boundary": "free" if is_auto else boundary}
        parsed = read_options({**_defaults(options), **rest, **shared}, Options)
        stages = Stopwatch(parsed.progress)
        if isinstance(mesh, Flattening):
            if any(one is not None for one in (faces, sizes, o.sharp_angle)) or options.keys() - {"progress"}:
                raise OptionError("a flattening already has faces and options: no others can be given")
        else:
            mesh = Source(as_input(mesh, faces))
        energy, boundary = StretchEnergy(o.stretch), "auto" if is_auto else parsed.boundary
        return cls(mesh, o.quads or QUADS, length, sizes, energy, o.sharp_angle, boundary, rest, stages)

    def grid(self) -> IntegerGrid:
        """Return the grid, with the time of each stage; errors are those of `integer_grid`."""
        self.stages.done = 0.0
        return replace(self.of_any_size(), seconds=dict(self.stages.seconds))

    def of_any_size(self, tries: int = 3) -> IntegerGrid:
        """Return a grid, with more squares if some quads of one of the wanted size have a vertex or an edge twice.

        This is so where the surface is as thin as a square.
        """
        try:
            return self._of_any_distortion()
        except CoarseGridError as error:
            if tries == 1:
                raise
            coarse = error
        try:
            found = replace(self, quads=1.6 * coarse.squares, size=None).of_any_size(tries - 1)
        except NO_GRID:
            raise coarse from None
        note = "More quads than wanted: with fewer, some have a vertex or an edge twice."
        return found if note in found.notes else with_note(found, note)

    def _of_any_distortion(self) -> IntegerGrid:
        """Return a grid, with the fewest cones for less distortion if there is none as given.

        Where few cones leave rotations around handles far from quarter turns, more cones help.
        """
        given = self.options
        is_searched = isinstance(given.get("cones", "auto"), str) and not given.get("cone_count")
        try:
            return self._as_given()
        except (ConvergenceError, GridError) as error:
            if isinstance(error, CoarseGridError) or isinstance(self.mesh, Flattening) or not is_searched:
                raise
        less = 0.7 * given.get("distortion", DISTORTION)
        other = replace(self, options={**given, "distortion": less})
        note = f"With a distortion above {less:.3g}, no grid was found."
        note += " Wanted sizes are not followed." if self.sizes is not None else ""
        return with_note(other._of_flattening(), note)

    def _as_given(self) -> IntegerGrid:
        """Return a grid for the options as given."""
        if isinstance(self.mesh, Flattening):
            return self.of_result(self.mesh)
        if not self._may_align():
            if self.sizes is not None:
                raise OptionError("sizes cannot be combined with options of cones, boundaries or weights")
            return self._with_fewest_cones()
        if self.checked.mesh.components[0] > 1:
            return self._of_components()
        what = "the boundary, sharp edges or curvature" + ", nor for wanted sizes" * (self.sizes is not None)
        # Where cones cost more, others are found, for which there may be a grid.
        for price_factor in (1.0, 4.0):
            try:
                return self._of_aligned_cones(price_factor)
            except NO_GRID as error:
                if isinstance(error, CoarseGridError) and self.sizes is not None:
                    raise
                why = error
            # Others hardly ever help then, and each metric takes long.
            if isinstance(why, ConvergenceError):
                break
        note = f"Cones are not chosen for {what}, because no grid with such cones was found: {why}."
        return with_note(self._of_flattening(), note)

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
        size = self.size or grow * float(np.sqrt(areas.sum() / 2 / self.quads))
        # Nothing of a component without area can be seen.
        for part, vertices, faces in (each for each in mesh.split_components() if areas[each[2]].any()):
            # The mean of the log scale on the component, relative to that on the whole mesh.
            mean = np.average(of_face[faces], weights=areas[faces]) - np.average(of_face, weights=areas)
            search = replace(
                self,
                mesh=Source(as_input(part.moved_to(grow * part.vertices))),
                size=size * float(np.exp(-mean)),
                sizes=None if self.sizes is None else np.exp(-scales[vertices]),
            )
            try:
                found.append(search.of_any_size())
            except CoarseGridError:  # its bad quads are left out
                found.append(replace(search, for_quads=False).of_any_size())
            except NO_GRID as error:
                why.append(f"No grid for a component of {plural(len(part.faces), 'triangle')}: {error}.")
        if not found:
            raise GridError(f"no grid was found for any of {mesh.components[0]} components: {why[0]}")
        return joined_grids(found, (*checked.notes, *why))

    def _may_align(self) -> bool:
        """Return whether the options leave open which cones a grid has."""
        cones = self.options.get("cones", "auto")
        if not (isinstance(cones, str) and cones == "auto") or any(n in self.options for n in SPARSE_OPTIONS):
            return False
        return self.boundary in ("auto", "straight") or not self.checked.mesh.is_boundary_edge.any()

    def _of_aligned_cones(self, price_factor: float) -> IntegerGrid:
        """Return a grid of a connected mesh whose cones are chosen for even sizes and its directions.

        price_factor: factor of the price of cones; if above 1, coarse meshes are split, for more places for cones.
        """
        checked, options = self.checked, read_options(self.options, QuadOptions)
        is_split = price_factor > 1 and 6 * len(checked.mesh.faces) < COARSE
        mesh = split_around(checked.mesh, checked.mesh.faces) if is_split else checked.mesh
        mesh, _ = split_chords(split_small_components(mesh))
        finer, count = split_chords(mesh, sharp_ends(mesh, self._angle))
        # On coarse meshes these are most edges, and their triangles would get thin.
        mesh = finer if 20 * count < len(mesh.edges) else mesh
        bounds = (
            int(np.ceil((2 * np.pi - (options.max_cone_angle or np.inf)) / (np.pi / 2) - GRID_TOLERANCE)),
            int(np.floor((2 * np.pi - options.min_cone_angle) / (np.pi / 2) + GRID_TOLERANCE)),
        )
        scales = None if self.scales is None else extended(self.scales, mesh)
        area = float(double_areas(edge_lengths(mesh.vertices, mesh.faces)).sum()) / 2
        quads = area / np.ldexp(self.size, checked.exponent) ** 2 if self.size else self.quads
        price = price_factor * max(1.0, QUADS_PER_CONE / quads)
        with self.stages("cones"), limit_threads(options.threads):
            found = aligned_cones(mesh, options.distortion, *bounds, price, self.sharp_angle, scales)
        cones = {vertex: quarters * np.pi / 2 for vertex, quarters in found.items()}
        given = {name: one for name, one in self.options.items() if name not in OPTIONS}
        given |= {**_defaults({"cones": cones}), "cones": cones}
        if mesh.is_boundary_edge.any():
            given["boundary"] = "straight"
        for splits in range(3):
            with self.stages("flatten"):
                result = flatten(np.ldexp(mesh.vertices, -checked.exponent), mesh.faces, **given)
            # Large cones that are adjacent flip triangles.
            if splits == 2 or (is_flat := has_area(result)).all():
                break
            mesh = split_around(mesh, mesh.faces[~is_flat])
        grid = self._with_notes(replace(result, notes=(*checked.notes, *result.notes)), True, True)
        return grid if self.scales is None else with_note(grid, note_on_sizes(grid, self.scales))

    def _with_fewest_cones(self) -> IntegerGrid:
        """Return a grid with the fewest cones."""
        may_be_straight = self.boundary == "auto" and isinstance(self.options.get("cones", "auto"), str)
        if not (may_be_straight and self.checked.mesh.is_boundary_edge.any()):
            return self._of_flattening()
        try:
            return self._of_flattening("straight", all_sides=True)
        except (CurvatureError, MetricError) as error:
            why = f"The boundary cuts squares, because no grid with the boundary on grid lines was found: {error}."
        return with_note(self._of_flattening("free"), why)

    @property
    def checked(self) -> CheckedMesh:
        """The checked mesh, at about unit size."""
        return self.source.checked(bool(self.options.get("repair", False)))

    @cached_property
    def scales(self) -> FloatArray | None:
        """(n,) the wanted log scale at the vertices of the checked mesh, if relative sizes are given."""
        return None if self.sizes is None else wanted_scales(self.source, self.checked, self.sizes)

    @property
    def source(self) -> Source:
        """The mesh, if no flattening is given."""
        assert isinstance(self.mesh, Source)
        return self.mesh

    def _of_flattening(self, boundary: str | None = None, all_sides: bool = False) -> IntegerGrid:
        """Return the grid of a flattening with a given boundary, or else the one of the options, by default free.

        all_sides: require all straight sides on grid lines.

        Raises:
            GridError: there is no grid, or required sides are not on grid lines.
        """
        own = "free" if self.boundary == "auto" else self.boundary
        options = {**self.options, "boundary": boundary or own}
        self.stages.done = 0.0
        with self.stages("flatten"):
            result = flatten_source(self.source, read_options({**_defaults(options), **options}))
        return self._with_notes(result, all_sides)

    def _with_notes(self, result: Flattening, all_sides: bool, sharp_lines: bool = False) -> IntegerGrid:
        found = self.of_result(result, all_sides, sharp_lines)
        # Unmet guarantees of the map do not apply to the grid.
        notes = (note for note in result.notes if note not in unmet_guarantees(result))
        return replace(found, notes=(*notes, *found.notes))

    def of_result(
        self, result: Flattening, all_sides: bool = False, sharp_lines: bool = False
    ) -> IntegerGrid:
        """Return the grid of a flattening.

        Args:
            result: the flattening.
            all_sides: require all straight sides on grid lines.
            sharp_lines: put sharp edges that are nearly along the axes on grid lines, if possible.
        """
        is_straight = result.settings.get("boundary") == "straight"
        self.stages.done = 1.0
        with self.stages("grid"), limit_threads(result.settings.get("threads", THREADS)):
            layout = aligned(result, self.quads, self.size, self._angle)
            sided, found, note = with_sides(layout) if is_straight else layout, None, ""
            if sharp_lines or self.sharp_angle is not None:
                lines = edge_indices(sided.mesh, sharp_ends(sided.mesh, self._angle))
                split = split_between_nodes(sided, lines)
                found, note = grid_with_lines(split, self._angle, self.sharp_angle is not None, self.energy)
            # Rather than many more squares than wanted, a grid with other cones is searched.
            most = 1 if sharp_lines and self.sharp_angle is None else 4
            found = with_note(found or self._with_sides(layout, sided, all_sides, most), note)
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
            return grid_of(sided, self.energy, most)
        except GridError:
            if all_sides or len(sided.sides.points) == len(layout.sides.points):
                raise
        why = "Straight sides of different loops are not parallel up to quarter turns, so not all on grid lines."
        return with_note(grid_of(layout, self.energy, most), why)
