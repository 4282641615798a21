"""A mesh as its file has it: polygons, and what must survive from reading to writing."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from .._arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from .obj import ObjText


@dataclass(frozen=True, eq=False)
class MeshFile:
    """A mesh read from a file, with its polygons untouched.

    Attributes:
        path: where it came from.
        vertices: (n, 3) positions, model units.
        corners: (c,) vertex index of every polygon corner, polygon after polygon.
        offsets: (p + 1,) polygon i owns corners[offsets[i]:offsets[i + 1]].
        welded: how many vertices were merged because they lay at the same position.
        obj: the text of an OBJ file, from which the output keeps groups, materials and comments.
    """

    path: Path
    vertices: FloatArray
    corners: IntArray
    offsets: IntArray
    welded: int = 0
    obj: ObjText | None = None
