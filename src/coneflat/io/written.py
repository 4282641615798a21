"""What a file holds of a result: its numbers as they are stored, and measures of these."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..atlas.touch import snap_apart
from ..base.arrays import FloatArray, IntArray
from ..base.text import plural
from ..errors import MeshFileError
from ..measure.guarantees import DOUBLE, SINGLE, remeasured
from ..mesh.polygons import polygon_of
from .convex_pieces import find_pieces
from .gltf.write import scene_losses

if TYPE_CHECKING:
    from ..result import Flattening


# Binary digits of 32-bit numbers.
DIGITS = 24
# Sizes of models the squares of whose details are 32-bit numbers, too, as programs that read them compute.
SMALLEST, LARGEST = 1e-15, 1e18


def as_written(result: Flattening, ending: str) -> Flattening:
    """Return a result as a file of a format holds it, measured on that.

    A .glb has 32-bit numbers, v from the top down; what rounding made of touching triangles is parted. An .obj has
    polygons, which are measured as the fans of triangles that others read. A .ply and an .npz hold what there is.
    Notes name what a format does not keep of the input.

    Args:
        result: what is written.
        ending: ".glb" and so on.

    Raises:
        MeshFileError: the file cannot hold numbers so large.
    """
    stored, lost = result, left_out(result, ending)
    if ending == ".glb":
        stored = _in_single_precision(result)
        lost = (*lost, *scene_losses(stored))
    elif ending == ".obj" and result.source is not None and result.face_corners is not None:
        stored = _in_fans(result, result.source.offsets, result.face_corners)
    lost = tuple(note for note in lost if note not in stored.notes)
    return replace(stored, notes=(*stored.notes, *lost)) if lost else stored


def _in_single_precision(result: Flattening) -> Flattening:
    """Return the result with 32-bit positions and UVs."""
    keeps_scene = result.source is not None and result.source.scene is not None
    vertices = result.vertices if keeps_scene else _positions_in_glb(result.vertices)
    is_stored = np.array_equal(stored_in_glb(result.uv), result.uv)
    if is_stored and np.array_equal(vertices, result.vertices):
        return result
    uv, overlaps = snap_apart(result.uv, result.uv_faces, stored_in_glb)
    return remeasured(result, replace(result, vertices=vertices, uv=uv), SINGLE, overlaps=overlaps)


def _positions_in_glb(vertices: FloatArray) -> FloatArray:
    """Return (n, 3) positions as 32-bit numbers.

    Raises:
        MeshFileError: the largest is beyond them, or so small that they have hardly a digit for it.
    """
    with np.errstate(over="ignore"):
        stored = vertices.astype(np.float32).astype(np.float64)
    largest = float(np.abs(vertices).max())
    if not SMALLEST < largest < LARGEST:
        raise MeshFileError(
            f"positions of up to {largest:.3g} are beyond the 32-bit numbers of .glb, which are good for sizes from "
            f"{SMALLEST:.0e} to {LARGEST:.0e}: scale the mesh, or write .ply"
        )
    return stored


def stored_in_glb(uv: FloatArray) -> FloatArray:
    """Return (u, 2) the points that are read where these are written: 32-bit numbers, the second from the top down.

    Both v and 1 - v are such numbers then, lest a reader that turns v around in 32 bits rounds once more.
    """
    u = uv[:, 0].astype(np.float32).astype(np.float64)
    largest = np.maximum(np.maximum(np.abs(uv[:, 1]), np.abs(1 - uv[:, 1])), 1.0)
    step = 2.0 ** (np.ceil(np.log2(largest)) - DIGITS)
    return np.stack([u, np.round(uv[:, 1] / step) * step], axis=1)


def _in_fans(result: Flattening, offsets: IntArray, face_corners: IntArray) -> Flattening:
    """Return the result with polygons in fans, as most programs read them."""
    if np.all(np.diff(offsets) == 3):
        return result
    assert result.source is not None
    pieces = find_pieces(result.uv, result.uv_faces, offsets, face_corners)
    corners, uv_faces = pieces.fans()
    vertex = np.full(int(offsets[-1]), -1, dtype=np.int64)
    vertex[face_corners] = result.faces
    order = np.argsort(polygon_of(face_corners, offsets), kind="stable")
    face_origin = np.arange(len(order)) if result.face_origin is None else result.face_origin
    notes: tuple[str, ...] = ()
    if len(pieces.split):
        names = plural(len(pieces.split), "polygon is", "polygons are")
        notes = (
            f"{names} written in convex pieces, as others would read triangles upside down: they are not convex in "
            f"the plane (the first is {pieces.split[0]}).",
        )
    fans = replace(
        result,
        faces=vertex[corners],
        uv_faces=uv_faces,
        face_corners=corners,
        face_origin=face_origin[order],
        # What these were before relaxing is known of other triangles alone.
        solve=replace(result.solve, qc_mean_unrelaxed=float("nan"), qc_max_unrelaxed=float("nan")),
    )
    return remeasured(result, fans, DOUBLE, notes)


_MATERIAL = re.compile(rb"^[ \t]*usemtl\s", re.MULTILINE)


def left_out(result: Flattening, ending: str) -> tuple[str, ...]:
    """Return what a file does not keep of the one that the mesh was read from, since its format is another.

    One sentence each. An .npz holds the result, not the file.
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
    if source.has_colours and ending != ".ply" and (source.obj is None or ending != ".obj"):
        notes.append(f"Vertex colours of the file are not kept in {ending}: .ply keeps them.")
    return tuple(notes)
