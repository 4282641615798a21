"""Writing of a flattened mesh to a file, and the result as the file stores it, measured on the stored numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np

from ..atlas import round_safely
from ..base.arrays import FloatArray
from ..base.formats import Use, endings
from ..base.notes import Unmet
from ..base.text import plural, short_repr
from ..errors import OptionError
from ..measures.guarantees import DOUBLE, SINGLE, first_faces, remeasured
from ..mesh.polygons import polygon_of
from ..result import Flattening
from .attributes import ALPHA, VERTEX_COLOURS, Attribute, losses, old_textures
from .convex_pieces import find_pieces
from .files import PathName, atomic_write, checked_target
from .gltf.positions import local_positions
from .gltf.write import glb_changes, kept_in_glb, write_glb
from .mesh_file import MeshFile
from .npz import write_npz
from .obj import kept_in_obj, obj_has_textures, write_obj
from .ply.write import kept_in_ply, ply_has_textures, write_ply
from .split import source_uv
from .texture import Texture, find_texture

#: Endings of the files that `write_flattening` writes, each in `_FORMATS`.
OUTPUT_FORMATS = endings(Use.FLATTENING)


class OutputFormat(NamedTuple):
    """How files of a format are written.

    Attributes:
        write: writes a result to a stream; further arguments are the folder of the file, a texture or None, and the
            number of the UV set.
        kept_attributes: returns those of a source file that the format keeps.
        stored: returns a result with the numbers and the triangles of the file, measured again.
        is_rounded: the numbers of `stored` are rounded, and are those that `write` gets instead of the result's.
        takes_texture: a texture can be embedded.
        keeps_old_textures: returns whether textures of the old UVs of a source file are kept, scenes not counted.
        changes: returns notes on further changes of the data of the source, for a result, whether it has a texture, and
            the number of the UV set.
    """

    write: Callable[[Flattening, IO[bytes], Path, Texture | None, int], None]
    kept_attributes: Callable[[MeshFile], set[Attribute]]
    stored: Callable[[Flattening], Flattening] = lambda result: result
    is_rounded: bool = False
    takes_texture: bool = False
    keeps_old_textures: Callable[[MeshFile], bool] = lambda source: False
    changes: Callable[[Flattening, bool, int], tuple[str, ...]] = lambda result, has_texture, uv_set: ()


def check_output(path: PathName, texture: PathName | None = None, uv_set: int | None = None) -> Path:
    """Return the path if `write_flattening` can be expected to succeed with it, a texture and a UV set.

    This is useful before a long computation.

    Args:
        path: the file.
        texture, uv_set: as of `write_flattening`.

    Raises:
        UnknownFormatError: the ending is not one of `OUTPUT_FORMATS`.
        MeshFileError: the folder is missing, the path is a folder, or writing is not permitted; or the texture is not
            an image that can be read.
        OptionError: the format does not support textures or the UV set, or Pillow is not installed.
    """
    path = checked_target(path, OUTPUT_FORMATS, "results are written as")
    _check_texture(path, path.suffix.lower(), texture)
    check_uv_set(path, path.suffix.lower(), uv_set)
    if texture is not None:
        find_texture(texture)
    return path


def write_flattening(
    result: Flattening, path: PathName, texture: PathName | None = None, uv_set: int | None = None
) -> Path:
    """Write a flattened mesh, either completely or not at all, and return the path.

    The format is given by the path's ending, in upper or lower case. An .obj keeps the polygons, groups, materials and
    comments of the OBJ that the mesh was read from. A .glb keeps the scene of the glTF or GLB that the mesh was read
    from. Otherwise, a .ply and a .glb contain the triangles, with a vertex for every pair of vertex and UV point, the
    input's normals, and the input's vertex as an attribute. An .npz contains all arrays of the result and its report as
    JSON.

    Args:
        result: the result to write.
        path: the file.
        texture: for a .glb: "checker" for a checkerboard, or an image file to embed.
        uv_set: 1 for a .glb to have the UVs as a second set, TEXCOORD_1, beside those of the textures; 0 replaces
            these. By default 1 for a lightmap (see `coneflat.unwrap`) in a .glb, otherwise 0.

    Raises:
        UnknownFormatError: the ending is not one of `OUTPUT_FORMATS`.
        MeshFileError: the file cannot be written, or the texture cannot be read.
        OptionError: the format does not support textures or the UV set, or Pillow is not installed.
    """
    return write_stored(result, path, texture, uv_set)[0]


def write_measured(
    result: Flattening, path: PathName, texture: PathName | None = None, uv_set: int | None = None
) -> Flattening:
    """Write a flattened mesh as `write_flattening` does, and return it as the file stores it; see `as_written`."""
    written, stored = write_stored(result, path, texture, uv_set)
    return as_written(stored, written.suffix.lower(), has_texture=texture is not None, uv_set=uv_set)


def write_stored(
    result: Flattening, path: PathName, texture: PathName | None, uv_set: int | None
) -> tuple[Path, Flattening]:
    """Write a flattened mesh, and return the path and the arrays that were written."""
    path = check_output(path, texture, uv_set)
    with atomic_write(path) as stream:
        stored = write_stream(result, stream, path.suffix, texture, path.parent, uv_set)
    return path, stored


def write_stream(
    result: Flattening,
    stream: IO[bytes],
    ending: str,
    texture: PathName | None = None,
    folder: Path | None = None,
    uv_set: int | None = None,
) -> Flattening:
    """Write a flattened mesh to a binary stream, and return the arrays that were written; see `write_flattening`.

    Args:
        result: the result to write.
        stream: a binary stream; it need not be seekable.
        ending: one of `OUTPUT_FORMATS`.
        texture, uv_set: as of `write_flattening`.
        folder: folder of the file, for relative paths in it; by default the current one.

    Raises:
        MeshFileError, OptionError: as of `write_flattening`.
    """
    ending, folder = ending.lower(), Path() if folder is None else folder
    _check_texture(f"a {ending}", ending, texture)
    check_uv_set(f"a {ending}", ending, uv_set)
    image = None if texture is None else find_texture(texture, result)
    form = _FORMATS[ending]
    # Rounded triangles must also be positively oriented and disjoint.
    stored = as_stored(result, ending) if form.is_rounded else result
    form.write(stored, stream, folder, image, _chosen_uv_set(result, ending, uv_set))
    return stored


def _check_texture(name: object, ending: str, texture: PathName | None) -> None:
    if texture is not None and not _FORMATS[ending].takes_texture:
        raise OptionError(f"only .glb files contain a texture, and {name} is not one")


def check_uv_set(name: object, ending: str, uv_set: int | None) -> None:
    """Raise OptionError if files of a format do not have a UV set; name: the file, for the message."""
    is_integer = isinstance(uv_set, (int, np.integer)) and not isinstance(uv_set, bool)
    if uv_set is not None and not (is_integer and uv_set in (0, 1)):
        raise OptionError(f"uv_set must be 0 or 1, got {short_repr(uv_set)}")
    if uv_set and ending not in endings(Use.UV_SETS):
        formats = ", ".join(endings(Use.UV_SETS))
        raise OptionError(f"only {formats} files have a second UV set, and {name} is not one")


def _chosen_uv_set(result: Flattening, ending: str, uv_set: int | None) -> int:
    """Return the UV set that is written: by default the second one for lightmaps, where files have it."""
    if uv_set is not None:
        return int(uv_set)
    return int(result.settings.get("lightmap") is not None and ending in endings(Use.UV_SETS))


def as_written(
    result: Flattening, ending: str, *, has_texture: bool = False, uv_set: int | None = None
) -> Flattening:
    """Return a result as a file of a given format stores it, with measures of the stored numbers.

    A .glb has 32-bit numbers and v pointing down; touching triangles that overlap after rounding are separated. An
    .obj has polygons, which are measured as triangle fans, as other programs read them. A .ply and an .npz store the
    result unchanged. Notes list the data of the input that a format does not keep.

    Args:
        result: the result that is written.
        ending: the ending of the format, such as ".glb".
        has_texture: whether it is written with a texture.
        uv_set: as of `write_flattening`.

    Raises:
        MeshFileError: numbers are out of range for the format.
    """
    if not isinstance(ending, str):
        raise OptionError(f"ending must be text such as .glb, got {short_repr(ending)}")
    check_uv_set(f"a {ending}", ending, uv_set)
    stored = as_stored(result, ending)
    lost = tuple(note for note in left_out(stored, ending, has_texture, uv_set) if note not in stored.notes)
    return replace(stored, notes=(*stored.notes, *lost)) if lost else stored


def as_stored(result: Flattening, ending: str) -> Flattening:
    """Return a result as `as_written` does, without the notes on data of the input that the format does not keep."""
    form = _FORMATS.get(ending)
    return result if form is None else form.stored(result)


def _in_single_precision(result: Flattening) -> Flattening:
    """Return the result with the positions and UVs of a .glb.

    Raises:
        MeshFileError: the largest coordinate is too large or too small for 32-bit numbers.
    """
    vertices = result.vertices
    if result.source is None or result.source.scene is None:
        shown = np.unique(result.faces)
        vertices = vertices.copy()
        vertices[shown] = local_positions(vertices[shown]).vertices
    is_stored = np.array_equal(stored_in_glb(result.uv), result.uv)
    if is_stored and np.array_equal(vertices, result.vertices, equal_nan=True):
        return result
    uv, overlaps = round_safely(result.uv, result.uv_faces[first_faces(result)], stored_in_glb)
    stored = remeasured(result, replace(result, vertices=vertices, uv=uv), SINGLE, overlaps=overlaps)
    flattened = stored.distortion.degenerate_input - result.distortion.degenerate_input
    if flattened <= 0:
        return stored
    note = Unmet(
        f"{plural(flattened, 'triangle has', 'triangles have')} no area in the 32-bit numbers of .glb, as they are too "
        "small for the size of the model: .obj and .ply have all digits."
    )
    return replace(stored, notes=(*stored.notes, note))


def stored_in_glb(uv: FloatArray) -> FloatArray:
    """Return (u, 2) the UV points as they are read back from a .glb: rounded to 32-bit numbers.

    Both v and 1 - v are 32-bit numbers, so that a reader that computes 1 - v in 32 bits does not round again.
    """
    u = uv[:, 0].astype(np.float32).astype(np.float64)
    largest = np.maximum(np.maximum(np.abs(uv[:, 1]), np.abs(1 - uv[:, 1])), 1.0)
    step = 2.0 ** (np.ceil(np.log2(largest)) - 1 - np.finfo(np.float32).nmant)
    return np.stack([u, np.round(uv[:, 1] / step) * step], axis=1)


def _in_fans(result: Flattening) -> Flattening:
    """Return the result with the polygons of its file split into fans, as most programs read them."""
    source, face_corners = result.source, result.face_corners
    if source is None or face_corners is None or np.all(np.diff(source.offsets) == 3):
        return result
    offsets = source.offsets
    pieces = find_pieces(result, offsets, face_corners)
    corners, uv_faces = pieces.fans()
    vertex = np.full(int(offsets[-1]), -1, dtype=np.int64)
    vertex[face_corners] = result.faces
    order = np.argsort(polygon_of(face_corners, offsets), kind="stable")
    face_origin = np.arange(len(order)) if result.face_origin is None else result.face_origin
    notes: tuple[str, ...] = ()
    if len(pieces.split):
        names = plural(len(pieces.split), "polygon is", "polygons are")
        notes = (
            f"{names} written in convex pieces, because other programs would read flipped triangles, or triangles "
            f"that have area in the plane alone (the first is {pieces.split[0]}).",
        )
    fans = replace(
        result,
        faces=vertex[corners],
        uv_faces=uv_faces,
        face_corners=corners,
        face_origin=face_origin[order],
        # The values before relaxing are known only for the original triangles.
        solve=replace(result.solve, qc_mean_unrelaxed=float("nan"), qc_max_unrelaxed=float("nan")),
    )
    return remeasured(result, fans, DOUBLE, notes)


def left_out(
    result: Flattening, ending: str, has_texture: bool = False, uv_set: int | None = None
) -> tuple[str, ...]:
    """Return notes on data of the source file that a file of another format does not keep, one sentence each."""
    source, form = result.source, _FORMATS.get(ending)
    if form is None:
        return ()
    changes = form.changes(result, has_texture, _chosen_uv_set(result, ending, uv_set))
    if source is None or result.face_corners is None:
        return changes
    # A texture would be multiplied by colours of vertices.
    hidden = {VERTEX_COLOURS, ALPHA} if has_texture and source.scene is None else set()
    preserved = form.kept_attributes(source) - hidden
    lost = set(source.attributes) - preserved
    complete = (name for name, other_form in _FORMATS.items() if lost <= other_form.kept_attributes(source))
    return (
        *_lightmap_notes(result, ending),
        *losses(source, ending, preserved, next(complete, "")),
        *([old_textures("the file")] if form.keeps_old_textures(source) else []),
        *changes,
    )


def _lightmap_notes(result: Flattening, ending: str) -> tuple[str, ...]:
    """Return a note if the UVs of a lightmap replace those of textures, because the format has one set only."""
    formats = endings(Use.UV_SETS)
    if result.settings.get("lightmap") is None or ending in formats or source_uv(result) is None:
        return ()
    return (f"The UVs of the lightmap replace those of the textures; {', '.join(formats)} has both.",)


def kept_attributes(source: MeshFile, ending: str) -> set[Attribute]:
    """Return the attributes of a source file that a file of a format in `OUTPUT_FORMATS` keeps."""
    return _FORMATS[ending].kept_attributes(source)


_FORMATS = {
    ".obj": OutputFormat(
        write=lambda result, stream, folder, *_: write_obj(result, stream, folder),
        kept_attributes=kept_in_obj,
        stored=_in_fans,
        keeps_old_textures=obj_has_textures,
    ),
    ".ply": OutputFormat(
        write=lambda result, stream, folder, *_: write_ply(result, stream, folder),
        kept_attributes=kept_in_ply,
        keeps_old_textures=ply_has_textures,
    ),
    ".glb": OutputFormat(
        write=lambda result, stream, folder, texture, uv_set: write_glb(
            result, stream, texture, folder, uv_set
        ),
        kept_attributes=kept_in_glb,
        stored=_in_single_precision,
        is_rounded=True,
        takes_texture=True,
        changes=glb_changes,
    ),
    ".npz": OutputFormat(
        write=lambda result, stream, *_: write_npz(result, stream), kept_attributes=lambda source: set()
    ),
}
