"""Integer grids: layouts whose grid lines close up on the surface, and the quads that they are."""

from .extract import extract_quads
from .integer_grid import integer_grid
from .integer_map import IntegerGrid
from .quad_mesh import QuadMesh
from .quality import QuadMeasures, measure_quads
from .smooth import smooth_quads

__all__ = [
    "IntegerGrid",
    "QuadMeasures",
    "QuadMesh",
    "extract_quads",
    "integer_grid",
    "measure_quads",
    "smooth_quads",
]
