"""Files of brain surfaces: GIFTI and FreeSurfer surfaces, values at vertices, and labels.

GIFTI, annotations and MGH are read by nibabel (the extra `brains`); FreeSurfer's surfaces need nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..base.arrays import FloatArray, IntArray
from ..base.text import list_some
from ..errors import MeshFileError, OptionError
from .attributes import Attribute
from .files import PathName, as_path, imported, read_bytes, readable
from .mesh_file import MeshFile

#: Names of FreeSurfer's surfaces, which stand in the place of an ending: lh.pial.
FREESURFER = (".pial", ".white", ".inflated", ".sphere", ".orig", ".smoothwm")
#: Endings of files with one value for each vertex, in addition to names such as lh.sulc.
VALUES = (".gii", ".mgh", ".mgz", ".sulc", ".curv", ".thickness", ".area", ".volume")
_MAGIC = b"\xff\xff\xfe"


def nibabel() -> Any:
    """Return the package nibabel.

    Raises:
        OptionError: it is not installed.
    """
    return imported("nibabel", "files of brain surfaces need nibabel", '"coneflat[brains]"')


def is_freesurfer(content: bytes) -> bool:
    """Return True if a file begins as FreeSurfer's surfaces of triangles do."""
    return content.startswith(_MAGIC)


def is_gifti(content: bytes) -> bool:
    """Return True if a file begins as GIFTI files do."""
    head = content[:512].lstrip()
    return head.startswith(b"<") and b"GIFTI" in head


def parse_freesurfer(path: Path, content: bytes) -> MeshFile:
    """Return the mesh of a FreeSurfer surface: three bytes, one or two lines, two counts, positions and triangles.

    Raises:
        MeshFileError: it is not one, or is truncated.
    """
    # FreeSurfer skips a line and all white space after it; nibabel skips two lines, and the second may be a comment.
    rest = content.partition(b"\n")[2].lstrip()
    for body in (rest, rest.partition(b"\n")[2]) if is_freesurfer(content) else ():
        vertices, faces = (int(count) for count in np.frombuffer(body[:8].ljust(8, b"\xff"), ">i4"))
        if min(vertices, faces) >= 0 and len(body) >= 8 + 12 * (vertices + faces):
            points = np.frombuffer(body, ">f4", 3 * vertices, 8).reshape(-1, 3)
            # What follows says where the volume is that the surface was made from.
            has_more = len(body) > 8 + 12 * (vertices + faces)
            attributes = [Attribute("geometry of the volume")] if has_more else []
            return _triangles(
                path, points, np.frombuffer(body, ">i4", 3 * faces, 8 + 12 * vertices), attributes
            )
    raise MeshFileError(
        f"{path} is not a FreeSurfer surface of triangles, or is truncated at {len(content):,} bytes"
    )


def parse_gifti(path: Path, content: bytes) -> MeshFile:
    """Return the mesh of a GIFTI surface.

    Raises:
        MeshFileError: the file contains no surface.
        OptionError: nibabel is not installed.
    """
    if not is_gifti(content):
        raise MeshFileError(f"{path} is not a GIFTI file")
    image = nibabel().GiftiImage.from_bytes(content)
    points, faces = (image.agg_data(kind) for kind in ("pointset", "triangle"))
    for values, kind in ((points, "positions"), (faces, "triangles")):
        if np.ndim(values) != 2 or np.shape(values)[1] != 3:
            raise MeshFileError(f"{path} must be a surface, got a GIFTI file without {kind}")
    return _triangles(path, points, faces, _gifti_attributes(image))


def _gifti_attributes(image: Any) -> list[Attribute]:
    """Return the data of a GIFTI image in addition to its mesh: metadata with values, and further arrays."""
    found = list[Attribute]()
    for owner in (image, *image.darrays):
        filled = (str(name) for name, value in dict(owner.meta).items() if str(value).strip())
        found += [Attribute("metadata", name) for name in filled]
    if len(image.darrays) > 2:
        found.append(Attribute("values at vertices"))
    return list(dict.fromkeys(found))


def _triangles(path: Path, points: Any, corners: Any, attributes: Sequence[Attribute]) -> MeshFile:
    corners = np.asarray(corners, dtype=np.int64).reshape(-1)
    positions, offsets = np.asarray(points, dtype=np.float64), np.arange(0, len(corners) + 1, 3)
    return MeshFile(path, positions, corners, offsets, attributes=tuple(attributes))


def read_vertex_values(path: PathName) -> FloatArray:
    """Return (n,) the values of a file with one for each vertex, such as sulcal depth: GIFTI, FreeSurfer's, MGH.

    Raises:
        MeshFileError: the file cannot be read, or has more than one value for each vertex.
        OptionError: nibabel is not installed.
    """
    path = as_path(path)
    read_bytes(path)
    package, ending = nibabel(), path.suffix.lower()
    with readable(path, "file of values at vertices"):
        if ending == ".gii":
            values = package.load(path).agg_data()
        elif ending in (".mgh", ".mgz"):
            values = np.squeeze(np.asarray(package.load(path).dataobj))
        else:
            values = package.freesurfer.read_morph_data(path)
    if np.ndim(values) != 1:
        raise MeshFileError(f"{path} must have one value for each vertex, got shape {np.shape(values)}")
    return np.asarray(values, dtype=np.float64)


def read_label(text: str) -> IntArray:
    """Return (k,) the vertices of a label.

    Args:
        text: a FreeSurfer label (.label); or FILE:NAME for a label of an annotation (.annot) or of a GIFTI file; or a
            GIFTI file or one of values alone, for the vertices whose value is not 0.

    Raises:
        MeshFileError: the file cannot be read.
        OptionError: there is no such label, or nibabel is not installed.
    """
    file, _, name = (text, "", "") if Path(text).exists() else text.rpartition(":")
    path = as_path(file or text)
    read_bytes(path)
    package, ending = nibabel(), path.suffix.lower()
    with readable(path, "label"):
        if ending == ".label":
            return np.atleast_1d(np.asarray(package.freesurfer.read_label(path), dtype=np.int64))
        if ending == ".annot":
            values, _, names = package.freesurfer.read_annot(path)
            keys = {one.decode(): number for number, one in enumerate(names)}
            # FreeSurfer leaves vertices without a label; nibabel numbers them -1.
            if (values < 0).any():
                values = np.where(values < 0, keys.setdefault("unknown", -1), values)
        else:
            values = read_vertex_values(path)
            labels = package.load(path).labeltable.labels if ending == ".gii" else ()
            keys = {one.label: one.key for one in labels}
    if not name and ending != ".annot":
        return np.flatnonzero(values)
    if name not in keys:
        raise OptionError(
            f"{path} must have the label {name!r}, got {list_some(sorted(keys)) or 'no labels'}"
        )
    return np.flatnonzero(values == keys[name])
