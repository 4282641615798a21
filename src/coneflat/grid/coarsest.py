"""The coarsest integer grid of a layout: its quads are the patches of a quad layout of the surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import sqrt

from ..errors import GridError
from ..layout.relax import StretchEnergy
from ..text import plural
from .aligned import Layout
from .attempt import area_of, attempt, scaled
from .extract import extract_quads
from .integer_map import IntegerGrid
from .quad_mesh import used_euler

# Grids that are tried at most, and squares of one that does over those of one that does not at which the search ends.
TRIES, CLOSE = 14, 1.15
# What is tried beside that, times its squares: rounding makes more of fewer at times, and fewer of more.
ASIDE = (0.6, 0.8, 1.25, 1.6)
# Part of the grid that squares cut by a boundary may be, where its sides lie on no grid lines.
CUT = 0.25


def coarsest_grid(layout: Layout, energy: StretchEnergy, tell: Callable[[float, int], None]) -> IntegerGrid:
    """Return the coarsest grid found, with a note of the search.

    Squares are doubled from the fewest that there may be until a grid does; between that and the one before, the
    search goes on by halves of their ratio, and ends with some beside. A grid does if quads can be extracted from it
    that are a manifold mesh of the surface's topology. Of all that do the one with the fewest quads is returned: their
    number need not grow with the squares asked for.

    Args:
        layout: smooth, of any size.
        energy: of the map.
        tell: called before each attempt with the squares asked for and the number of attempts before.

    Raises:
        GridError: none was found.
    """
    search = _Search(layout, energy, tell)
    least = fewest_squares(layout)
    squares, failing = float(least), 0.0
    while not search.tried(squares):
        if search.tries >= TRIES:
            raise GridError(
                f"no grid of {least:,} to {squares:,.0f} quads was found in {plural(TRIES, 'try', 'tries')}: "
                f"{search.why}"
            )
        failing, squares = squares, 2 * squares
    while failing and squares / failing > CLOSE and search.tries < TRIES:
        middle = sqrt(failing * squares)
        if search.tried(middle):
            squares = middle
        else:
            failing = middle
    for factor in ASIDE:
        search.tried(factor * squares)
    assert search.best is not None
    note = (
        f"The coarsest grid found, in {plural(search.tries, 'try', 'tries')}, has {plural(search.quads, 'quad')}; with "
        f"{plural(len(layout.cones), 'irregular vertex', 'irregular vertices')} no fewer than {least:,} are possible."
    )
    is_open = bool(layout.mesh.is_boundary_edge.any()) and not len(layout.sides.axis)
    advice = (
        "Squares that the boundary cuts are left out: boundary='straight' has quads up to it.",
    ) * is_open
    return replace(search.best, notes=(*search.best.notes, note, *advice))


def fewest_squares(layout: Layout) -> int:
    """Return the least number of quads that a mesh with a vertex at each cone may have, by Euler's formula."""
    return max(1, len(layout.cones) - used_euler(layout.mesh))


class _Search:
    """Grids tried.

    Attributes:
        best: the grid with the fewest quads so far.
        quads: how many.
        tries: attempts so far.
        why: what was wrong with the last that did not do.
    """

    def __init__(self, layout: Layout, energy: StretchEnergy, tell: Callable[[float, int], None]) -> None:
        self._layout, self._energy, self._tell = layout, energy, tell
        self._area = area_of(layout)
        self.best: IntegerGrid | None = None
        self.quads, self.tries, self.why = 0, 0, ""

    def tried(self, squares: float) -> bool:
        """Return whether there is a grid of about so many squares, and remember the best."""
        self._tell(squares, self.tries)
        self.tries += 1
        grid, self.why = attempt(scaled(self._layout, squares / self._area), self._energy)
        if grid is None:
            return False
        try:
            found = extract_quads(grid)
        except GridError as error:
            self.why = str(error)
            return False
        cut = found.area_left_out / (found.area_left_out + len(found.quads))
        if found.euler_characteristic != found.surface_euler or cut > CUT:
            self.why = f"its boundary cuts {100 * cut:.0f} % of it away"
            return False
        if self.best is None or len(found.quads) < self.quads:
            self.best, self.quads = grid, len(found.quads)
        return True
