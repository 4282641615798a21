"""Reading of meshes from files, and writing of flattened meshes to files."""

from .attributes import ALPHA, GROUPS, MATERIALS, OBJECTS, VERTEX_COLOURS, Attribute, losses, texture_files
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
    readable,
    remove_unfinished,
)
from .gltf.positions import local_positions
from .gltf.references import keys_of
from .gltf.write import FOR_INDICES, FOR_VERTICES, MATERIAL, Glb, bounds
from .join import Joined
from .mapped import UVMesh, as_uv_mesh, has_uv, uv_mesh_of
from .materials import (
    CLAMP,
    MIRRORED,
    REPEAT,
    SLOTS,
    SPECULAR,
    TRANSFORM,
    ImageTexture,
    Materials,
    read_materials,
    slot_of,
)
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
    to_linear,
    to_srgb,
)
from .write import (
    KEPT,
    as_written,
    check_output,
    stored_in_glb,
    write_flattening,
    write_measured,
    write_stream,
)

__all__ = [
    "ALPHA", "as_input", "as_path", "as_uv_mesh", "as_written", "atomic_write", "Attribute", "bounds", "cell_side",
    "CELLS", "check_cells", "check_output", "check_target", "checked_target", "CheckedArrays", "DARK_CELL",
    "decode_image", "encode_png", "find_meshes", "FOR_INDICES", "FOR_VERTICES", "Glb", "GROUPS", "has_uv",
    "imported", "INPUT_FORMATS", "Joined", "KEPT", "known_ending", "LIGHT_CELL", "lines_of", "local_positions",
    "losses", "make_folder", "MATERIAL", "MATERIALS", "nibabel", "number", "OBJECTS", "PIPE", "read_archive",
    "read_bytes", "read_flattening", "read_joined", "read_label", "read_mesh", "read_mesh_from", "read_picture",
    "read_structure", "read_vertex_values", "relocated", "remove_unfinished", "shading_normals", "split_at_seams",
    "stored_in_glb", "Texture", "texture_files", "uv_mesh_of", "UVMesh", "VALUES", "VERTEX_COLOURS", "write_flattening",
    "write_measured", "write_parts", "write_stream",
    "CLAMP", "ImageTexture", "keys_of", "Materials", "MIRRORED", "read_materials", "readable", "REPEAT", "slot_of",
    "SLOTS", "SPECULAR", "to_linear", "to_srgb", "TRANSFORM",
]  # fmt: skip
