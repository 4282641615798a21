"""Files of brain surfaces: GIFTI and FreeSurfer surfaces, values at vertices, and labels.

GIFTI, annotations and MGH are read by nibabel (the extra `brains`); FreeSurfer's surfaces need nothing.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..base.arrays import FloatArray, IntArray
from ..base.text import list_some
from ..errors import MeshFileError, OptionError
from .attributes import Attribute
from .files import PathName, as_path, imported, read_bytes, readable
from .mesh_file import MeshFile

#: Endings of files with one value for each vertex, in addition to names such as lh.sulc.
VALUES = (".gii", ".mgh", ".mgz", ".sulc", ".curv", ".thickness", ".area", ".volume")
# How FreeSurfer's surfaces of triangles begin, and those of quads, with positions in hundredths of a millimetre or as
# floating-point numbers.
_TRIANGLES = b"\xff\xff\xfe"
_QUADS = {b"\xff\xff\xff": (">i2", 100.0), b"\xff\xff\xfd": (">f4", 1.0)}
LOG = logging.getLogger("coneflat")


def nibabel() -> Any:
    """Return the package nibabel.

    Raises:
        OptionError: it is not installed.
    """
    return imported("nibabel", "files of brain surfaces need nibabel", '"coneflat[brains]"')


@contextmanager
def _with_logged_warnings(path: Path) -> Iterator[None]:
    """Log the warnings of nibabel on a file, a line each; commands do not print them if they are quiet."""
    log = logging.getLogger("nibabel.global")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        level = log.level
        log.setLevel(logging.CRITICAL)  # the same again, on stderr
        try:
            yield
        finally:
            log.setLevel(level)
    for text in dict.fromkeys(" ".join(str(warning.message).split()) for warning in caught):
        LOG.warning("%s: %s", path, text)


def is_freesurfer(content: bytes) -> bool:
    """Return True if a file begins as FreeSurfer's surfaces do."""
    return content[:3] in (_TRIANGLES, *_QUADS)


def is_gifti(content: bytes) -> bool:
    """Return True if a file begins as GIFTI files do."""
    head = content[:512].lstrip()
    return head.startswith(b"<") and b"GIFTI" in head


def parse_freesurfer(path: Path, content: bytes) -> MeshFile:
    """Return the mesh of a FreeSurfer surface: three bytes, one or two lines, two counts, positions and triangles.

    Old surfaces of quads are split into triangles as FreeSurfer splits them.

    Raises:
        MeshFileError: it is not one, or is truncated.
    """
    if content[:3] in _QUADS:
        return _parse_quads(path, content)
    # FreeSurfer skips a line and all white space after it; nibabel skips two lines, and the second may be a comment.
    text = content.partition(b"\n")[2].lstrip()
    for body in (text, text.partition(b"\n")[2]) if content.startswith(_TRIANGLES) else ():
        vertices, faces = (int(count) for count in np.frombuffer(body[:8].ljust(8, b"\xff"), ">i4"))
        if min(vertices, faces) >= 0 and len(body) >= 8 + 12 * (vertices + faces):
            points = np.frombuffer(body, ">f4", 3 * vertices, 8).reshape(-1, 3)
            # What follows says where the volume is that the surface was made from.
            has_more = len(body) > 8 + 12 * (vertices + faces)
            attributes = [Attribute("geometry of the volume")] if has_more else []
            return _triangles(
                path, points, np.frombuffer(body, ">i4", 3 * faces, 8 + 12 * vertices), attributes
            )
    raise _not_freesurfer(path, content)


def _parse_quads(path: Path, content: bytes) -> MeshFile:
    """Return the mesh of a FreeSurfer surface of quads: two counts, positions and corners, integers of three bytes."""
    kind, units_per_millimetre = _QUADS[content[:3]]
    if len(content) < 9:
        raise _not_freesurfer(path, content)
    vertices, quads = _integers_of_three_bytes(content[3:9]).tolist()
    end = 9 + 3 * np.dtype(kind).itemsize * vertices
    if len(content) < end + 12 * quads:
        raise _not_freesurfer(path, content)
    points = np.frombuffer(content, kind, 3 * vertices, 9).reshape(-1, 3) / units_per_millimetre
    corners = _integers_of_three_bytes(content[end : end + 12 * quads]).reshape(-1, 4)
    # The diagonal of a quad is at its second corner if the number of its first is even.
    a, b, c, d = np.where(corners[:, :1] % 2 == 0, corners[:, [1, 2, 3, 0]], corners).T
    return _triangles(path, points, np.stack([a, b, c, a, c, d], axis=1), [])


def _integers_of_three_bytes(content: bytes) -> IntArray:
    """Return the integers (k,) in big-endian order in 3 k bytes."""
    return np.frombuffer(content, np.uint8).reshape(-1, 3).astype(np.int64) @ np.array([65536, 256, 1])


def _not_freesurfer(path: Path, content: bytes) -> MeshFileError:
    return MeshFileError(f"{path} is not a FreeSurfer surface, or is truncated at {len(content):,} bytes")


def parse_gifti(path: Path, content: bytes) -> MeshFile:
    """Return the mesh of a GIFTI surface.

    Raises:
        MeshFileError: the file contains no surface.
        OptionError: nibabel is not installed.
    """
    if not is_gifti(content):
        raise MeshFileError(f"{path} is not a GIFTI file")
    package = nibabel()
    with _with_logged_warnings(path):
        image = package.GiftiImage.from_bytes(content)
        points, faces = (image.agg_data(kind) for kind in ("pointset", "triangle"))
    for values, kind in ((points, "positions"), (faces, "triangles")):
        if np.ndim(values) != 2 or np.shape(values)[1] != 3:
            raise MeshFileError(f"{path} must be a surface, got a GIFTI file without {kind}")
    return _triangles(path, points, faces, _gifti_attributes(image))


def _gifti_attributes(image: Any) -> list[Attribute]:
    """Return the data of a GIFTI image in addition to its mesh: metadata with values, and further arrays."""
    attributes = list[Attribute]()
    for owner in (image, *image.darrays):
        filled = (str(name) for name, value in dict(owner.meta).items() if str(value).strip())
        attributes += [Attribute("metadata", name) for name in filled]
    if len(image.darrays) > 2:
        attributes.append(Attribute("values at vertices"))
    return list(dict.fromkeys(attributes))


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
    with readable(path, "file of values at vertices"), _with_logged_warnings(path):
        if ending == ".gii":
            values = package.load(path).agg_data()
        elif ending in (".mgh", ".mgz"):
            values = np.squeeze(np.asarray(package.load(path).dataobj))
        else:
            values = package.freesurfer.read_morph_data(path)
    if np.ndim(values) != 1:
        raise MeshFileError(f"{path} must have one value for each vertex, got shape {np.shape(values)}")
    return np.asarray(values, dtype=np.float64)


def read_structure(path: PathName) -> str:
    """Return the anatomical structure that a GIFTI file names, such as CortexLeft; "" for other files.

    Raises:
        MeshFileError: the file cannot be read.
        OptionError: nibabel is not installed.
    """
    path = as_path(path)
    content = read_bytes(path)
    if not is_gifti(content):
        return ""
    package = nibabel()
    with readable(path, "GIFTI file"), _with_logged_warnings(path):
        image = package.GiftiImage.from_bytes(content)
    metadata = [image.meta, *(array.meta for array in image.darrays)]
    structures = (entries.get("AnatomicalStructurePrimary", "") for entries in metadata if entries)
    return next((str(structure) for structure in structures if structure), "")


def read_label(text: str, count: int | None = None) -> IntArray:
    """Return (k,) the vertices of a label.

    Args:
        text: a FreeSurfer label (.label); or FILE:NAME for a label of an annotation (.annot) or of a GIFTI file; or a
            GIFTI file or one of values alone, for the vertices whose value is not 0.
        count: number of vertices of the surface; None if it is not known.

    Raises:
        MeshFileError: the file cannot be read.
        OptionError: there is no such label, the file is of a surface with another number of vertices, or nibabel is not
            installed.
    """
    file, _, name = (text, "", "") if Path(text).exists() else text.rpartition(":")
    path = as_path(file or text)
    content = read_bytes(path)
    package, ending = nibabel(), path.suffix.lower()
    if ending == ".label":
        return _listed_vertices(path, content, count)
    with readable(path, "label"), _with_logged_warnings(path):
        if ending == ".annot":
            values, _, names = package.freesurfer.read_annot(path)
            keys = {text.decode(): number for number, text in enumerate(names)}
            # FreeSurfer leaves vertices without a label; nibabel numbers them -1.
            if (values < 0).any():
                values = np.where(values < 0, keys.setdefault("unknown", -1), values)
        else:
            values = read_vertex_values(path)
            labels = package.load(path).labeltable.labels if ending == ".gii" else ()
            keys = {label.label: label.key for label in labels}
    if count is not None and len(values) != count:
        raise OptionError(
            f"{path} must be of the surface, which has {count:,} vertices, got a file of {len(values):,} vertices"
        )
    if not name and ending != ".annot":
        return np.flatnonzero(values)
    if name not in keys:
        raise OptionError(
            f"{path} must have the label {name!r}, got {list_some(sorted(keys)) or 'no labels'}"
        )
    return np.flatnonzero(values == keys[name])


def _listed_vertices(path: Path, content: bytes, count: int | None) -> IntArray:
    """Return (k,) the vertices of a FreeSurfer label: a comment, their number, and a line for each."""
    with readable(path, "label"):
        _, number, *lines = content.decode("utf-8", errors="replace").splitlines()
        vertices = np.array([int(line.split()[0]) for line in lines if line.strip()], dtype=np.int64)
        if len(vertices) != int(number):
            raise MeshFileError(
                f"{path} must have {int(number):,} vertices, as it says, got {len(vertices):,}"
            )
    wrong = vertices[(vertices < 0) | (vertices >= (np.inf if count is None else count))]
    if len(wrong):
        raise OptionError(
            f"{path} must be of the surface, which has {count:,} vertices, got vertex {wrong[0]}"
            if count is not None
            else f"{path} must have vertices from 0, got vertex {wrong[0]}"
        )
    return vertices
