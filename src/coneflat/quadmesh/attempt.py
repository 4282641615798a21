"""One attempt at a grid: cones, a seamless map, its rounding, and the extraction of quads.

`aligned_map` or `flattened_map` gives the seamless map. `grid_of_map` rounds it, which may leave out lines, or double
the number of squares (`round_layout.py`), and extracts the quads. Each returns a result, or the reason why there is
none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

from ..base import THREADS, limit_threads
from ..errors import GridError
from ..flattener import flatten_source
from ..measures import unmet_guarantees
from ..options import Options, read_options
from ..result import Flattening
from .alignment import aligned
from .extract import DegenerateQuads, find_quads
from .integer_map import IntegerGrid, with_note
from .no_grid import NoGrid, or_reason
from .options import flattening_defaults
from .quad_mesh import QuadMesh
from .relaxing import GridGoal
from .request import GridRequest
from .round_layout import DOUBLINGS_BEFORE_OTHER_CONES, MAX_DOUBLINGS, RoundingRules, rounded_grid
from .sizes import note_on_sizes, with_target_lengths

# With fewer quads, a cone costs more than 1, in proportion. Of a half, each stands for two.
QUADS_AT_UNIT_PRICE = 2_000


@dataclass(frozen=True, eq=False)
class GridWithQuads:
    """An integer grid, and its quads if they are asked for and the mesh is connected."""

    grid: IntegerGrid
    quad_mesh: QuadMesh | None = None

    def with_note(self, note: str) -> GridWithQuads:
        """Return the grid with one more note."""
        return replace(self, grid=with_note(self.grid, note))


@dataclass(frozen=True, eq=False)
class SeamlessMap:
    """A flattening with cones quantised to quarter turns, to be made into a grid.

    Attributes:
        flattening: the flattening.
        requires_sides: all straight sides must be on grid lines.
        is_aligned: its cones are chosen for its directions: sharp edges that are nearly along the axes are put on grid
            lines, if possible.
        note: a note on the choice of cones or of the boundary, or "".
    """

    flattening: Flattening
    requires_sides: bool = False
    is_aligned: bool = False
    note: str = ""


Outcome: TypeAlias = GridWithQuads | NoGrid
#: Returns a flattening with aligned cones for a price of cones, and whether the mesh is split for them.
AlignedFlattenings: TypeAlias = Callable[[float, bool], Flattening]


@or_reason
def aligned_map(request: GridRequest, price_factor: float, flattening_of: AlignedFlattenings) -> SeamlessMap:
    """Return the map of a connected mesh whose cones are chosen for even sizes and its directions.

    price_factor: factor of the price of cones.
    """
    least_price = 1.0 if request.mirror is None else 2.0
    price = price_factor * max(least_price, QUADS_AT_UNIT_PRICE * (request.size / request.extent) ** 2)
    # With costlier cones the mesh is split, for more places for them.
    return SeamlessMap(flattening_of(price, price_factor > 1), requires_sides=True, is_aligned=True)


@or_reason
def flattened_map(
    request: GridRequest, boundary: str = "", requires_sides: bool = False, note: str = ""
) -> SeamlessMap:
    """Return the map with the fewest cones, or given ones.

    Args:
        request: the grid that is asked for.
        boundary: the boundary; "" for that of the options, by default free.
        requires_sides: all straight sides must be on grid lines.
        note: a further note, or "".
    """
    requested = "free" if request.boundary == "auto" else request.boundary
    options = {**request.options, "boundary": boundary or requested}
    request.stages.done = 0.0
    with request.stages("flatten"):
        parsed: Options = read_options({**flattening_defaults(options), **options})
        # With kept holes, an aeroplane with 27 borders gets 156 irregular vertices instead of 97.
        flattening = flatten_source(request.source, parsed, keeps_holes=False)
    return SeamlessMap(flattening, requires_sides, note=note)


def grid_of_map(request: GridRequest, seamless: SeamlessMap | NoGrid) -> Outcome:
    """Return the grid of a seamless map, with its quads if they are asked for."""
    grid = seamless if isinstance(seamless, NoGrid) else rounded_map(request, seamless)
    if isinstance(grid, NoGrid):
        return grid
    return extracted(request, grid) if request.for_quads else GridWithQuads(grid)


@or_reason
def rounded_map(request: GridRequest, seamless: SeamlessMap) -> IntegerGrid | NoGrid:
    """Return the grid of a seamless map, with all notes."""
    flattening = seamless.flattening
    request.stages.done = 1.0
    with request.stages("grid"), limit_threads(flattening.settings.get("threads", THREADS)):
        layout = aligned(flattening, request.size, request.angle)
        if seamless.is_aligned and request.scales is not None:
            layout = with_target_lengths(layout, request.scales)
        request.limit.check_cones(layout.node_quarters)
        follows_lines = seamless.is_aligned or request.sharp_angle is not None
        # Rather than many more squares than requested, a grid with other cones is searched.
        may_change_cones = seamless.is_aligned and request.sharp_angle is None
        rules = RoundingRules(
            goal=GridGoal(request.energy, request.limit, request.loops, 1 if request.mirror is None else 2),
            has_sides=flattening.settings.get("boundary") == "straight",
            requires_sides=seamless.requires_sides,
            sharp_angle=request.angle if follows_lines else None,
            requires_lines=request.sharp_angle is not None,
            doublings=DOUBLINGS_BEFORE_OTHER_CONES if may_change_cones else MAX_DOUBLINGS,
        )
        grid = rounded_grid(layout, rules)
    if isinstance(grid, NoGrid):
        return grid
    if flattening is not request.flattening:
        # Unmet guarantees of the map do not apply to the grid.
        unmet = unmet_guarantees(flattening)
        notes = (note for note in flattening.notes if note not in unmet)
        grid = with_note(replace(grid, notes=(*notes, *grid.notes)), seamless.note)
    if seamless.is_aligned and request.scales is not None:
        grid = with_note(grid, note_on_sizes(grid, request.scales))
    return grid


@or_reason
def extracted(request: GridRequest, grid: IntegerGrid) -> Outcome:
    """Return a grid with its quads; if these are degenerate, it is the coarse grid of the reason."""
    with request.stages("extract"):
        quads = find_quads(grid)
    if isinstance(quads, DegenerateQuads):
        return NoGrid(GridError(quads.reason), coarse_grid=grid)
    return GridWithQuads(grid, quads)
