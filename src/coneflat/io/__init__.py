"""Reading of meshes from files, and writing of flattened meshes to files."""

from .attributes import ALPHA, GROUPS, MATERIALS, OBJECTS, VERTEX_COLOURS, Attribute, losses, texture_files
from .brains import VALUES, nibabel, read_label, read_structure, read_vertex_values
from .colours import as_bytes, linear_colours, to_linear, to_srgb
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
from .gltf.glb import FOR_INDICES, FOR_VERTICES, MATERIAL, Glb, bounds
from .gltf.positions import local_positions
from .gltf.references import keys_of
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
    image_numbers,
    read_materials,
    slot_of,
)
from .npz import CheckedArrays, number, read_archive, read_flattening
from .obj import lines_of, relocated
from .packages import as_input
from .ply.write import write_parts
from .read import INPUT_FORMATS, export_advice, find_meshes, read_joined, read_mesh, read_mesh_from
from .split import SplitMesh, shading_normals, split_at_seams
from .stl import write_stl
from .texture import (
    DARK_CELL,
    LIGHT_CELL,
    Texture,
    cell_side,
    check_cells,
    decode_image,
    encode_png,
    read_picture,
)
from .write import (
    OUTPUT_FORMATS,
    as_stored,
    as_written,
    check_output,
    check_uv_set,
    kept_attributes,
    stored_in_glb,
    write_flattening,
    write_measured,
    write_stream,
)

__all__ = [
    "ALPHA", "as_bytes", "as_input", "as_path", "as_stored", "as_uv_mesh", "as_written", "atomic_write", "Attribute",
    "bounds", "cell_side", "check_cells", "check_output", "check_target", "check_uv_set", "checked_target",
    "CheckedArrays", "CLAMP", "DARK_CELL", "decode_image", "encode_png", "export_advice", "find_meshes",
    "FOR_INDICES", "FOR_VERTICES", "Glb", "GROUPS", "has_uv", "image_numbers", "ImageTexture", "imported",
    "INPUT_FORMATS", "Joined", "kept_attributes", "keys_of", "known_ending", "LIGHT_CELL", "linear_colours",
    "lines_of", "local_positions", "losses", "make_folder", "MATERIAL", "MATERIALS", "Materials", "MIRRORED",
    "nibabel", "number", "OBJECTS", "OUTPUT_FORMATS", "PIPE", "read_archive", "read_bytes", "read_flattening",
    "read_joined", "read_label", "read_materials", "read_mesh", "read_mesh_from", "read_picture", "read_structure",
    "read_vertex_values", "readable", "relocated", "remove_unfinished", "REPEAT", "shading_normals", "slot_of",
    "SLOTS", "SPECULAR", "split_at_seams", "SplitMesh", "stored_in_glb", "Texture", "texture_files", "to_linear",
    "to_srgb", "TRANSFORM", "uv_mesh_of", "UVMesh", "VALUES", "VERTEX_COLOURS", "write_flattening", "write_measured",
    "write_parts", "write_stl", "write_stream",
]  # fmt: skip
