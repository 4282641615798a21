"""Integer-grid maps and the quad meshes extracted from them."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

#: Where names are defined; they are imported when they are first used, since commands need the options alone.
_HOMES = {
    "Domains": "domains",
    "Half": "mirrored",
    "IntegerGrid": "integer_map",
    "MirrorPlane": "mirror_planes",
    "QUADS": "options",
    "QUAD_MEASURES": "quality",
    "QuadMeasures": "quality",
    "QuadMesh": "quad_mesh",
    "QuadOptions": "options",
    "Sizes": "options",
    "check_grid_output": "files",
    "check_quads_output": "files",
    "doubled": "mirrored",
    "extract_quads": "extract",
    "find_domains": "domains",
    "half_beside": "mirrored",
    "holds_quads": "files",
    "integer_grid": "quad_meshing",
    "measure_quads": "quality",
    "quads": "quad_meshing",
    "quads_left_out": "files",
    "read_grid": "files",
    "read_quads": "files",
    "symmetry_planes": "mirror_planes",
    "write_quads_stream": "files",
}

__all__ = [
    "QUADS",
    "QUAD_MEASURES",
    "Domains",
    "Half",
    "IntegerGrid",
    "MirrorPlane",
    "QuadMeasures",
    "QuadMesh",
    "QuadOptions",
    "Sizes",
    "check_grid_output",
    "check_quads_output",
    "doubled",
    "extract_quads",
    "find_domains",
    "half_beside",
    "holds_quads",
    "integer_grid",
    "measure_quads",
    "quads",
    "quads_left_out",
    "read_grid",
    "read_quads",
    "symmetry_planes",
    "write_quads_stream",
]

if TYPE_CHECKING:
    from .domains import Domains, find_domains
    from .extract import extract_quads
    from .files import (
        check_grid_output,
        check_quads_output,
        holds_quads,
        quads_left_out,
        read_grid,
        read_quads,
        write_quads_stream,
    )
    from .integer_map import IntegerGrid
    from .mirror_planes import MirrorPlane, symmetry_planes
    from .mirrored import Half, doubled, half_beside
    from .options import QUADS, QuadOptions, Sizes
    from .quad_mesh import QuadMesh
    from .quad_meshing import integer_grid, quads
    from .quality import QUAD_MEASURES, QuadMeasures, measure_quads


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module("." + _HOMES[name], __name__), name)
