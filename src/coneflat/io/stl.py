"""Reading STL, binary and text; every triangle has corners of its own."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NoReturn

import numpy as np

from ..errors import EmptyMeshError, MeshFileError
from .raw import RawMesh, triangle_offsets
from .text import parse_points

_HEADER_BYTES = 84
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def parse_stl(path: Path, content: bytes) -> RawMesh:
    """Return the triangles of an STL file, three vertices each.

    Raises:
        MeshFileError: the file is neither, or it is cut short.
        EmptyMeshError: it has no triangle.
    """
    promised = int.from_bytes(content[80:84], "little") if len(content) >= _HEADER_BYTES else -1
    needed = _HEADER_BYTES + promised * _TRIANGLE.itemsize
    is_text = content.lstrip()[:5].lower() == b"solid"
    # Binary files may begin with "solid" too, so an exact fit decides before the first word does.
    if promised >= 0 and (len(content) == needed or (len(content) > needed and not is_text)):
        triangles = np.frombuffer(content, _TRIANGLE, promised, _HEADER_BYTES)
        points = triangles["corners"].reshape(-1, 3).astype(np.float64)
    elif is_text:
        points = _text_points(path, content)
    elif promised >= 0:
        held = (len(content) - _HEADER_BYTES) // _TRIANGLE.itemsize
        raise MeshFileError(f"{path} ends after {held} of the {promised} triangles its header promises")
    else:
        raise MeshFileError(f"{path} is not an STL file: it is shorter than the header of one")
    if not len(points):
        raise EmptyMeshError(f"{path} has no faces")
    return RawMesh(points, np.arange(len(points), dtype=np.int64), triangle_offsets(len(points) // 3))


def _text_points(path: Path, content: bytes) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Return (3m, 3) the corners of m triangles."""
    lines = content.lower().splitlines()
    stripped = [line.lstrip() for line in lines]
    rows = [i for i, line in enumerate(stripped) if line.startswith(b"vertex")]
    facets = sum(line.startswith(b"facet") for line in stripped)
    if not re.search(rb"(?m)^\s*endsolid", content[-4096:].lower()):
        raise MeshFileError(f"{path} ends early: the last line of an STL text, 'endsolid', is missing")
    if len(rows) != 3 * facets:
        raise MeshFileError(f"{path} has {facets} facets but {len(rows)} vertices; three each are needed")

    def bad_vertex(i: int, reason: str) -> NoReturn:
        raise MeshFileError(f"{path}, line {rows[i] + 1}: {reason}")

    return parse_points([stripped[i][len(b"vertex") :] + b"\n" for i in rows], bad_vertex)
