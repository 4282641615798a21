"""Integer grids: layouts whose grid lines close up on the surface."""

from .integer_grid import IntegerGrid, integer_grid

__all__ = ["IntegerGrid", "integer_grid"]
