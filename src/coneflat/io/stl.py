"""STL files, in which triangles share no vertices: reading, binary and text, and writing, binary."""

from __future__ import annotations

import re
from pathlib import Path
from typing import IO

import numpy as np

from ..base.arrays import FloatArray, IntArray
from ..base.text import plural
from ..errors import EmptyMeshError, MeshFileError
from .attributes import Attribute
from .mesh_file import MeshFile
from .text import Growing, text_blocks

#: The solids of a text file, which may have names.
SOLIDS = Attribute("solids")
_SOLID = re.compile(rb"(?im)^[ \t]*solid[ \t]*([^\r\n]*?)[ \t]*$")
_HEADER = np.dtype([("comment", "S80"), ("count", "<u4")])
#: The first bytes of written files; text files begin with "solid".
_COMMENT = b"triangles by coneflat"
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def is_stl(content: bytes) -> bool:
    """Return True if a file is STL, by its first word or because its length matches its number of triangles."""
    return bool(re.match(rb"\s*solid\s", content, re.IGNORECASE)) or len(content) == _declared(content)[1]


def parse_stl(path: Path, content: bytes) -> MeshFile:
    """Return the triangles of an STL file, three vertices each.

    Raises:
        MeshFileError: the file is neither binary nor text STL, or it is truncated.
        EmptyMeshError: it has no triangle.
    """
    declared, needed = _declared(content)
    is_text = re.match(rb"\s*solid", content, re.IGNORECASE) is not None
    # Binary files may also begin with "solid", so an exact match of the length takes precedence over the first word.
    if len(content) == needed or (len(content) > needed > 0 and not is_text):
        triangles = np.frombuffer(content, _TRIANGLE, declared, _HEADER.itemsize)
        points = triangles["corners"].reshape(-1, 3).astype(np.float64)
        attributes = (Attribute("attributes of facets"),) if triangles["attribute"].any() else ()
    elif is_text:
        points = _text_points(path, content)
        attributes = (SOLIDS,) if _has_names(content) else ()
    elif needed:
        complete = (len(content) - _HEADER.itemsize) // _TRIANGLE.itemsize
        raise MeshFileError(f"{path} ends after {complete} of the {declared} triangles in its header")
    else:
        raise MeshFileError(f"{path} is not an STL file: it is shorter than an STL header")
    if not len(points):
        raise EmptyMeshError(f"{path} has no faces")
    count = len(points)
    return MeshFile(path, points, np.arange(count), np.arange(0, count + 1, 3), attributes=attributes)


def write_stl(stream: IO[bytes], vertices: FloatArray, triangles: IntArray) -> None:
    """Write triangles (m, 3) of vertices (n, 3) as binary STL, with 32-bit coordinates.

    Raises:
        MeshFileError: 32-bit numbers cannot represent the coordinates, or corners of a triangle coincide in them.
    """
    largest = float(np.abs(vertices).max(initial=0.0))
    if largest > float(np.finfo(np.float32).max):
        raise MeshFileError(
            f"positions of up to {largest:.3g} are beyond the 32-bit numbers of .stl: scale the mesh, or write .ply"
        )
    corners = vertices.astype(np.float32)[triangles]
    is_same = (corners == np.roll(corners, -1, axis=1)).all(axis=2)
    if collapsed := int(np.count_nonzero(is_same.any(axis=1))):
        raise MeshFileError(
            f"corners of {plural(collapsed, 'triangle')} coincide in the 32-bit numbers of .stl, at positions of up to "
            f"{largest:.3g}: move the mesh to the origin, or write .ply"
        )
    places = vertices[triangles]
    normals = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
    rows = np.zeros(len(triangles), _TRIANGLE)
    rows["normal"], rows["corners"] = normals, corners
    stream.write(np.array([(_COMMENT, len(rows))], _HEADER).data)
    stream.write(rows.data)


def _has_names(content: bytes) -> bool:
    """Return whether a text has solids with names, or several solids."""
    names = _SOLID.findall(content)
    return len(names) > 1 or any(names)


def _declared(content: bytes) -> tuple[int, int]:
    """Return the number of triangles in the header of a binary file, and its expected bytes; 0, 0 without a header."""
    if len(content) < _HEADER.itemsize:
        return 0, 0
    declared = int(np.frombuffer(content, _HEADER, 1)["count"][0])
    return declared, _HEADER.itemsize + declared * _TRIANGLE.itemsize


def _text_points(path: Path, content: bytes) -> FloatArray:
    """Return (3m, 3) the corners of m triangles."""
    if not re.search(rb"(?m)^\s*endsolid", content[-4096:].lower()):
        raise MeshFileError(f"{path} is truncated: the last line of an STL text, 'endsolid', is missing")
    facets, vertices = 0, Growing(np.float64, 3)
    for block in text_blocks(path, content):
        facets += len(block.beginning_with(b"facet"))
        vertices.add(block.words(block.beginning_with(b"vertex"), first=1).points()[:, :3])
    if len(vertices) != 3 * facets:
        raise MeshFileError(f"{path} has {facets} facets but {len(vertices)} vertices, expected three each")
    return vertices.done()
