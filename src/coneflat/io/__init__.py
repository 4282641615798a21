"""Reading meshes from files, and writing flattened meshes to them."""

from __future__ import annotations

from .atomic import atomic_write
from .model import MeshFile
from .npz import read_flattening
from .polygons import is_polygon_side, triangulate
from .raw import COLOURS
from .read import INPUT_FORMATS, read_mesh, read_mesh_from
from .write import OUTPUT_FORMATS, check_output, write_flattening

__all__ = [
    "COLOURS",
    "INPUT_FORMATS",
    "OUTPUT_FORMATS",
    "MeshFile",
    "atomic_write",
    "check_output",
    "is_polygon_side",
    "read_flattening",
    "read_mesh",
    "read_mesh_from",
    "triangulate",
    "write_flattening",
]
