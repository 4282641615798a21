"""What a file of another format than the input's does not keep of it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from .raw import COLOURS

if TYPE_CHECKING:
    from ..result import Flattening

_MATERIAL = re.compile(rb"^[ \t]*usemtl\s", re.MULTILINE)


def left_out(result: Flattening, ending: str) -> tuple[str, ...]:
    """Return what a file does not keep of the one that the mesh was read from, since its format is another.

    One sentence each. What a refinement drops is told of by itself, and an .npz holds the result, not the file.
    """
    source = result.source
    if source is None or result.face_corners is None or ending == ".npz":
        return ()
    notes = []
    if source.scene is not None and ending != ".glb":
        tree = source.scene.data.tree
        if tree.get("materials") or len(tree.get("nodes", [])) > 1:
            notes.append(
                f"Nodes, materials and textures of the file are not kept in {ending}: .glb keeps them."
            )
    if source.obj is not None and ending != ".obj" and any(map(_MATERIAL.search, source.obj.gaps.values())):
        notes.append(f"Groups and materials of the file are not kept in {ending}: .obj keeps them.")
    if all(colour in source.properties for colour in COLOURS) and (source.obj is None or ending != ".obj"):
        notes.append(f"Vertex colours of the file are not kept in {ending}.")
    return tuple(notes)
