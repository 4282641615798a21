"""Triangle meshes: connectivity, checks and repair, cutting open, charts and seams of UVs."""

from .charts import (
    CutMesh,
    cut_open,
    joined_edges,
    label_charts,
    open_along,
    point_seams,
    point_vertices,
    uv_seams,
)
from .check import REPAIR_ADVICE, CheckedMesh, left_out, weld
from .connectivity import (
    NEXT,
    PREVIOUS,
    are_among,
    corner_fans,
    end_corners,
    label_components,
    label_faces,
    nearby,
    sort_pairs,
    split_vertices,
)
from .doubled import EdgeGroups, glue_layers
from .holes import find_holes, with_fans
from .polygons import polygon_of
from .ties import tie_key

__all__ = [
    "CheckedMesh", "CutMesh", "EdgeGroups", "NEXT", "PREVIOUS", "REPAIR_ADVICE", "are_among", "corner_fans", "cut_open",
    "end_corners", "find_holes", "glue_layers", "joined_edges", "label_charts", "label_components", "label_faces",
    "left_out", "nearby", "open_along", "point_seams", "point_vertices", "polygon_of", "sort_pairs",
    "split_vertices", "tie_key", "uv_seams", "weld", "with_fans",
]  # fmt: skip
