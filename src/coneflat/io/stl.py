"""Reading STL, binary and text; every triangle has corners of its own."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ..base.arrays import FloatArray
from ..errors import EmptyMeshError, MeshFileError
from .mesh_file import MeshFile
from .text import Growing, text_blocks

_HEADER = np.dtype([("comment", "S80"), ("count", "<u4")])
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def is_stl(content: bytes) -> bool:
    """Return whether a file is one of STL, by its first word or by a length that is just that of its triangles."""
    return bool(re.match(rb"\s*solid\s", content, re.IGNORECASE)) or len(content) == _promised(content)[1]


def parse_stl(path: Path, content: bytes) -> MeshFile:
    """Return the triangles of an STL file, three vertices each.

    Raises:
        MeshFileError: the file is neither, or it is cut short.
        EmptyMeshError: it has no triangle.
    """
    promised, needed = _promised(content)
    is_text = re.match(rb"\s*solid", content, re.IGNORECASE) is not None
    # Binary files may begin with "solid" too, so an exact fit decides before the first word does.
    if len(content) == needed or (len(content) > needed > 0 and not is_text):
        triangles = np.frombuffer(content, _TRIANGLE, promised, _HEADER.itemsize)
        points = triangles["corners"].reshape(-1, 3).astype(np.float64)
    elif is_text:
        points = _text_points(path, content)
    elif needed:
        held = (len(content) - _HEADER.itemsize) // _TRIANGLE.itemsize
        raise MeshFileError(f"{path} ends after {held} of the {promised} triangles its header promises")
    else:
        raise MeshFileError(f"{path} is not an STL file: it is shorter than the header of one")
    if not len(points):
        raise EmptyMeshError(f"{path} has no faces")
    return MeshFile(path, points, np.arange(len(points)), np.arange(0, len(points) + 1, 3))


def _promised(content: bytes) -> tuple[int, int]:
    """Return how many triangles a binary file promises, and its bytes with these; 0, 0 if it has no header."""
    if len(content) < _HEADER.itemsize:
        return 0, 0
    promised = int(np.frombuffer(content, _HEADER, 1)["count"][0])
    return promised, _HEADER.itemsize + promised * _TRIANGLE.itemsize


def _text_points(path: Path, content: bytes) -> FloatArray:
    """Return (3m, 3) the corners of m triangles."""
    if not re.search(rb"(?m)^\s*endsolid", content[-4096:].lower()):
        raise MeshFileError(f"{path} ends early: the last line of an STL text, 'endsolid', is missing")
    facets, vertices = 0, Growing(np.float64, 3)
    for block in text_blocks(path, content):
        facets += len(block.beginning_with(b"facet"))
        vertices.add(block.words(block.beginning_with(b"vertex"), first=1).points()[:, :3])
    if len(vertices) != 3 * facets:
        raise MeshFileError(f"{path} has {facets} facets but {len(vertices)} vertices; three each are needed")
    return vertices.done()
