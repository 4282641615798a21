"""Reading of meshes from files, and writing of flattened meshes to files."""

from .brains import VALUES, nibabel, read_label, read_structure, read_vertex_values
from .files import (
    PIPE,
    as_path,
    atomic_write,
    check_target,
    checked_target,
    imported,
    known_ending,
    make_folder,
    read_bytes,
    remove_unfinished,
)
from .gltf.write import FOR_INDICES, FOR_VERTICES, MATERIAL, Glb, bounds
from .join import Joined
from .mapped import UVMesh, as_uv_mesh, has_uv, uv_mesh_of
from .npz import CheckedArrays, number, read_archive, read_flattening
from .obj import lines_of, relocated
from .packages import as_input
from .ply import write_parts
from .read import INPUT_FORMATS, find_meshes, read_joined, read_mesh, read_mesh_from
from .split import shading_normals, split_at_seams
from .texture import (
    CELLS,
    DARK_CELL,
    LIGHT_CELL,
    Texture,
    cell_side,
    check_cells,
    decode_image,
    encode_png,
    read_picture,
)
from .write import as_written, check_output, stored_in_glb, write_flattening, write_measured, write_stream

__all__ = [
    "uv_mesh_of", "CELLS", "CheckedArrays", "DARK_CELL", "FOR_INDICES", "FOR_VERTICES", "Glb", "INPUT_FORMATS",
    "Joined", "LIGHT_CELL", "MATERIAL", "UVMesh", "VALUES", "PIPE", "Texture", "as_input",
    "as_uv_mesh", "as_path", "as_written", "atomic_write", "bounds", "cell_side", "check_cells", "check_output",
    "check_target", "checked_target", "decode_image", "encode_png", "find_meshes", "has_uv", "imported",
    "known_ending", "lines_of", "make_folder", "nibabel", "number", "read_archive", "read_bytes",
    "read_flattening", "read_joined", "read_label", "read_mesh", "read_mesh_from", "read_picture", "read_structure",
    "read_vertex_values", "relocated", "remove_unfinished", "shading_normals", "split_at_seams", "stored_in_glb",
    "write_flattening", "write_measured", "write_parts", "write_stream",
]  # fmt: skip
