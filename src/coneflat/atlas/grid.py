"""Shapes of charts on a grid, to be placed in square tiles of a varying width."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..errors import OptionError
from .charts import Outlines
from .masks import Masks, cover_charts, rotated_boxes
from .placement import Plan, place_all, reach_of

# Columns of the grid per square root of the number of charts, and the maximum number of cells of all tiles: at first,
# and where gaps between the charts need more.
COLUMNS_PER_CHART, MAX_CELLS, MAX_CELLS_WITH_GAPS = 24.0, 4_000_000, 16_000_000
# With more charts than GROUPED_CHARTS, those whose boxes differ by less than this factor are treated as equal: 20,000
# cards take 1.4 s instead of 52.
GROUPED_CHARTS, GROUP_RATIO = 1000, 1.02
# Number of widths in small steps that are too small, from which on the steps are larger: 200 charts with 24 texels of
# 1,024 between them take 0.7 s instead of 1.0.
MANY_FAILURES = 5
# Cells by which rounding enlarges a chart and the gap beside it.
ROUNDED_CELLS = 2.0
# Width of the grid relative to the width that charts without gaps would need, and to the longest chart. It is not a
# round number, so that simple charts do not end at cell borders, where rounding would decide which cell is the last.
GRID_MARGIN = 1.2347


#: No cells that other charts have, see `place_all`.
NO_OBSTACLES = np.empty((0, 3), np.int64)


@dataclass(frozen=True, eq=False)
class Packing:
    """Placement of k charts in square tiles.

    Attributes:
        side: side of a tile without its margins, in the unit of the outlines.
        angle: (k,) angle by which each chart is rotated, radians.
        shift: (k,) translation after the rotation, as complex numbers.
        tile: (k,) the tile of each chart.
    """

    side: float
    angle: FloatArray
    shift: NDArray[np.complex128]
    tile: IntArray


class Blocks(NamedTuple):
    """Cells that are aligned with the blocks of a texture, at whose corners charts begin.

    Attributes:
        across: cells across a tile without its margins; the last one may be a fraction of a cell.
        step: cells across a block; 1 if a cell is one block or several.
    """

    across: float
    step: int

    @classmethod
    def of(cls, count: int, columns: int) -> Blocks:
        """Return cells for tiles of `count` blocks across, about `columns` or more cells across."""
        if count < columns:
            step = -(-columns // count)
            return cls(float(count * step), step)
        return cls(count / (count // columns), 1)


class Placed(NamedTuple):
    """Charts placed by a plan; the other fields are what `place_all` returns."""

    plan: Plan
    height: int
    work: int
    chosen: IntArray
    place: IntArray


@dataclass(frozen=True, eq=False)
class Grid:
    """Shapes of k charts on a grid, to be placed in tiles of a varying width.

    With blocks, cells have a fixed size in the texture, and charts are rasterized for each width; otherwise cells have
    the size that they have at first.

    Attributes:
        masks: the shapes at the first width.
        masks_at: returns the shapes for a width with blocks.
        blocks: cells that are aligned with blocks; None for any cells.
        extent: (k, t) extents of the rotated charts, as complex numbers; infinite for angles that are not allowed.
        group: (k,) group of each chart, see `place_all`.
        gap: minimum distance between charts, relative to the width.
        tiles: number of tiles.
        columns: width to begin with.
        widest: largest width.
        narrowest: width that the longest chart needs.
        block_count: as of `grid_of`.
    """

    masks: Masks
    masks_at: Callable[[int], Masks]
    blocks: Blocks | None
    extent: NDArray[np.complex128]
    group: IntArray
    gap: float
    tiles: int
    columns: int
    widest: int
    narrowest: int
    block_count: int | None

    def place(self, plan: Plan, width: int, limit: int) -> Placed:
        """Return the charts placed by a plan in tiles of a width, with at most `limit` rows."""
        if self.blocks is None:
            reach = reach_of(self.gap * width)
            return Placed(
                plan,
                *place_all(plan, self.group, self.masks, reach, self.tiles, width, limit, 1, NO_OBSTACLES),
            )
        columns, reach = int(self.blocks.across), reach_of(self.gap * self.blocks.across)
        rows, work, chosen, place = place_all(
            plan,
            self.group,
            self.masks_at(width),
            reach,
            self.tiles,
            columns,
            columns * limit // width,
            self.blocks.step,
            NO_OBSTACLES,
        )
        return Placed(plan, -(-rows * width // columns), work, chosen, place)

    def first_placed(self, plan: Plan) -> tuple[Placed, int]:
        """Return the charts placed by a plan in the narrowest square tiles that it fits, and their width.

        Raises:
            OptionError: it fits none.
        """
        width, failures = self.columns, 0
        while (placed := self.place(plan, width, width)).height > width:
            failures += 1
            width += width // (12 if failures < MANY_FAILURES else 4) + 1
            if width > self.widest:
                raise _no_space(self.gap, len(plan.order), self.block_count)
        return placed, width

    def packing(self, placed: Placed, width: int) -> Packing:
        """Return placed charts as a packing; without blocks the tile is cropped to the charts, not to the cells."""
        masks, chosen = self.masks if self.blocks is None else self.masks_at(width), placed.chosen
        tile, column, row = placed.place.T
        shift = (column + 1j * row) * masks.cell - masks.low[chosen]
        if self.blocks is not None:
            return Packing(width * self.masks.cell, masks.angle[chosen], shift, tile)
        low, high = masks.low[chosen] + shift, masks.low[chosen] + self.extent.ravel()[chosen] + shift
        corner = complex(low.real.min(), low.imag.min())
        side = max(high.real.max() - corner.real, high.imag.max() - corner.imag)
        return Packing(min(side, width * masks.cell), masks.angle[chosen], shift - corner, tile)


def grid_of(
    outlines: Outlines,
    area: float,
    angles: FloatArray,
    allowed: BoolArray,
    gap: float,
    tiles: int,
    min_columns: int,
    block_count: int | None,
) -> Grid:
    """Return the shapes of charts on a grid; arguments as of `pack_outlines`, and the minimum number of columns.

    Raises:
        OptionError: the gap is too wide for this number of charts.
    """
    columns = int(max(min_columns, COLUMNS_PER_CHART * (len(outlines) / tiles) ** 0.5))
    columns = int(min(columns, (MAX_CELLS / tiles) ** 0.5))
    _, extent = rotated_boxes(outlines, angles)
    extent = np.where(allowed, extent, complex(np.inf, np.inf))
    longest = float(np.maximum(extent.real, extent.imag).min(axis=1).max())
    side = GRID_MARGIN * max((area / tiles) ** 0.5, longest) or 1.0
    widest = min(4 * columns, int((1.5 * MAX_CELLS_WITH_GAPS / tiles) ** 0.5))
    group = np.arange(len(outlines))
    if len(outlines) > GROUPED_CHARTS:
        # Charts in rows, with gaps that are a fraction of the width: so many cells of the width are left to each.
        in_row = (len(outlines) / tiles) ** 0.5
        cells = (MAX_CELLS_WITH_GAPS / tiles) ** 0.5 * (1 / in_row - gap) - ROUNDED_CELLS
        size = float(np.sqrt(extent.real * extent.imag).min(axis=1).mean())
        columns = int(min(columns, max(cells, 0.0) * side / size if size > 0 else columns))
    if columns < 1:
        raise _no_space(gap, len(outlines), block_count)
    if len(outlines) > GROUPED_CHARTS:
        boxes = (extent.real + extent.imag).min(axis=1)
        sizes = np.log(boxes + side / columns) // np.log(GROUP_RATIO)
        group = np.unique(sizes, return_inverse=True)[1].ravel()
    masks = cover_charts(outlines, angles, side / columns)
    blocks = None if block_count is None else Blocks.of(block_count, columns)

    # A search tries many plans for the same width.
    @lru_cache(maxsize=2)
    def masks_at(width: int) -> Masks:
        assert blocks is not None
        return cover_charts(outlines, angles, width * masks.cell / blocks.across)

    narrowest = int(longest / masks.cell) + 1
    return Grid(masks, masks_at, blocks, extent, group, gap, tiles, columns, widest, narrowest, block_count)


def _no_space(gap: float, count: int, block_count: int | None) -> OptionError:
    cause = f"a gap of {100 * gap:.3g} % of the texture's width between {count:,} charts"
    if block_count is None:
        return OptionError(
            f"{cause} leaves no space for them: use less padding, a higher resolution or more tiles"
        )
    return OptionError(
        f"{cause} that begin at corners of {block_count:,} by {block_count:,} blocks leaves no space for them: use "
        "a smaller block_size, less padding, a higher resolution or more tiles"
    )
