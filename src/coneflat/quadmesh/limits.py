"""Limits of the number of quads: what was asked for, what triangles can carry, and what fits into memory."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..base import FloatArray, IntArray, plural
from ..errors import CoarseGridError, GridError
from ..geometry import signed_double_areas
from ..linalg import require_memory

#: Number of triangles of a coarse mesh, on which the cones, or the grid, of larger meshes are searched.
COARSE_TRIANGLES = 25_000
#: Largest number of squares of a grid, relative to the number requested; of few, so many squares are possible, as a
#: closed component needs six, and ones with handles or spikes up to ninety.
MAX_TIMES, FEWEST_SQUARES = 4, 100
#: Number of quads, relative to the number requested, above which there is a note.
NOTED_TIMES = 1.5
#: Largest number of squares requested of any mesh, of one of few triangles, and for each triangle of larger meshes.
#: Beyond, quads are those of single flat triangles, and smoothing takes over ten seconds.
MAX_SQUARES, FEW_SQUARES, SQUARES_PER_TRIANGLE = 20_000_000, 100_000, 1_000
#: Largest number of crossings of grid lines with edges, relative to these numbers. There are about as many as squares
#: and triangles, but many more where a map distorts a surface to long thin triangles.
MAX_CROSSINGS = 10
#: Peak memory of the extraction in bytes, for each square and for each crossing.
BYTES_PER_SQUARE, BYTES_PER_CROSSING = 850, 600


def most_squares(triangles: int) -> int:
    """Return the largest number of squares that may be requested of a mesh with a number of triangles."""
    return min(max(FEW_SQUARES, SQUARES_PER_TRIANGLE * triangles), MAX_SQUARES)


@dataclass(frozen=True)
class SquareLimit:
    """The largest number of squares of a grid, and of quads made of it.

    A grid may have more squares than requested, because cones and seams must be some squares apart.

    Attributes:
        requested: the number of squares that is requested, at least 1.
        triangles: number of triangles of the mesh.
    """

    requested: float = math.inf
    triangles: int = MAX_SQUARES

    @classmethod
    def of(cls, requested: float, triangles: int, extent: float) -> SquareLimit:
        """Return the limit for a number of squares, which must not be too large for the mesh or the memory.

        Args:
            requested: the number of squares.
            triangles: that of the mesh.
            extent: the root of the area of the mesh, in model units.

        Raises:
            GridError: there are too many squares.
            TooLargeError: they do not fit into the free memory.
        """
        largest = most_squares(triangles)
        if requested > largest:
            # The size is rounded up.
            size = float(f"{1.005 * extent / math.sqrt(largest):.3g}")
            raise GridError(
                f"{requested:,.10g} quads are too many for {plural(triangles, 'triangle')}: use at most {largest:,} "
                f"quads, of size {size:.3g}, or subdivide the mesh"
            )
        require_memory(requested * BYTES_PER_SQUARE, f"a grid of {requested:,.0f} squares needs")
        return cls(max(requested, 1.0), triangles)

    @property
    def squares(self) -> float:
        """The limit itself."""
        return min(max(MAX_TIMES * self.requested, FEWEST_SQUARES), 2 * most_squares(self.triangles))

    def violation(self, squares: float) -> str:
        """Return what is wrong with a number of squares above the limit; "" if nothing.

        The number is NaN or infinite where a map is not finite.
        """
        if squares <= self.squares:
            return ""
        if not math.isfinite(squares):
            return "the nearest grid is not finite"
        text = (
            f"the nearest grid has {squares:,.0f} squares, and at most {self.squares:,.0f} are possible for "
        )
        if squares > 2 * most_squares(self.triangles):
            advice = (
                "use fewer quads, or subdivide the mesh"
                if self.requested > self.triangles
                else "subdivide the mesh"
            )
            return f"{text}{plural(self.triangles, 'triangle')}: {advice}"
        return (
            f"{text}{plural(round(self.requested), 'quad')}: use at least {self.fewest(squares):,} quads "
            "(estimated from this grid)"
        )

    @staticmethod
    def fewest(squares: float) -> int:
        """Return the smallest number of quads for which a grid with a number of squares is within the limit."""
        return math.ceil(squares / MAX_TIMES)

    def error(self, squares: float) -> GridError | None:
        """Return the error for a number of squares above the limit; None if it is not."""
        text = self.violation(squares)
        if not text:
            return None
        is_coarse = math.isfinite(squares) and squares <= 2 * most_squares(self.triangles)
        return CoarseGridError(text, self.fewest(squares)) if is_coarse else GridError(text)

    def check_cones(self, quarters: IntArray) -> None:
        """Raise GridError if a grid with some cones and corners has more squares than the limit.

        Each of its squares has four corners, so it has a quarter of the sum of their angles at least.

        quarters: (k,) the angles in quarter turns.
        """
        squares = float(quarters.sum()) / 4
        if error := self.error(squares):
            text = f"{plural(len(quarters), 'cone')} of the surface: {error}"
            raise (
                CoarseGridError(text, error.quads) if isinstance(error, CoarseGridError) else GridError(text)
            )


#: The limit of a grid for which no number of squares is requested.
NO_LIMIT = SquareLimit()


def check_extraction(corner_grid: FloatArray) -> None:
    """Raise an error if a map has too many squares, or too many crossings of grid lines with edges, to extract quads.

    corner_grid: (m, 3, 2) grid coordinates of every triangle corner.

    Raises:
        GridError: there are too many.
        TooLargeError: they do not fit into the free memory.
    """
    area = float(signed_double_areas(corner_grid).sum()) / 2
    crossings = float(np.abs(corner_grid - np.roll(corner_grid, 1, axis=1)).sum()) / 2
    if not area <= MAX_SQUARES:
        raise GridError(
            f"a grid of {area:,.0f} squares is too fine: at most {MAX_SQUARES:,} quads can be extracted"
        )
    max_crossings = MAX_CROSSINGS * most_squares(len(corner_grid))
    if not crossings <= max_crossings:
        raise GridError(
            f"a grid of {area:,.0f} squares is too distorted: its lines cross edges {crossings:,.0f} times, of at most "
            f"{max_crossings:,} that are possible: use fewer quads, or subdivide the mesh"
        )
    needed = area * BYTES_PER_SQUARE + crossings * BYTES_PER_CROSSING
    require_memory(needed, f"a grid of {area:,.0f} squares needs")
