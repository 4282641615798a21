"""Reading meshes from files, and writing flattened meshes to them."""

from __future__ import annotations

from .atomic import atomic_write
from .npz import read_flattening
from .raw import PIPE
from .read import INPUT_FORMATS, read_mesh, read_mesh_from
from .write import OUTPUT_FORMATS, check_output, write_flattening, write_stream

__all__ = [
    "INPUT_FORMATS",
    "OUTPUT_FORMATS",
    "PIPE",
    "atomic_write",
    "check_output",
    "read_flattening",
    "read_mesh",
    "read_mesh_from",
    "write_flattening",
    "write_stream",
]
