"""Charts of a result, moved, pinned and packed around each other."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from .atlas import Charts, Frame, Moves, pack_around, turns_of_quantum
from .base.arrays import BoolArray, IntArray
from .base.notes import warns
from .base.text import short_repr
from .errors import OptionError
from .geometry import signed_double_areas
from .measures.guarantees import DOUBLE, remeasured
from .mesh import label_faces
from .mesh.connectivity import TriangleMesh
from .result import Flattening

#: A similarity of a chart: the point z = u + iv of the texture comes to factor * z + shift.
Move = tuple[complex, complex]
#: Relative difference of a scale from 1 from which on a note reports it.
NOTED_SCALE = 1e-9


@warns()
def repack(
    result: Flattening,
    pinned: Iterable[int] = (),
    *,
    moves: Mapping[int, Move] | None = None,
    pack: bool = True,
) -> Flattening:
    """Return a result whose charts are moved, and packed around those that are pinned.

    Pinned charts keep their place, rotation and scale. The others are rotated and moved to free places, with the
    padding of the result between all charts that are moved. They keep their scale where there is space for them;
    otherwise all of them become smaller, with a note. The result is measured again.

    Args:
        result: the result of `unwrap` or `flatten`, in one texture.
        pinned: a triangle of each chart that stays where it is.
        moves: for a triangle of a chart, two complex numbers a and b: the point z = u + iv of the chart comes to
            a z + b. (1, 0.25) moves it along u, and (1j, 0) rotates it by a quarter turn about the corner of the
            texture. These charts are pinned at their new places.
        pack: pack the other charts; otherwise they stay where they are.

    Returns:
        The changed result.

    Raises:
        OptionError: there is no such triangle, a chart is moved twice, a number is not finite, a factor is 0, the
            result has several tiles or shared texels, or there is no space for the other charts.

    Examples:
        >>> result = coneflat.unwrap(coneflat.sample_path(), charts=2)
        >>> packed = coneflat.repack(result, moves={0: (1j, 1)})  # turned about (1, 0), and so inside the texture
        >>> packed.distortion.overlapping_pairs
        0
    """
    settings = result.settings
    for name, default in (("tiles", 1), ("stack", "none")):
        if settings.get(name, default) != default:
            raise OptionError(f"charts cannot be moved with {name} {settings[name]}: leave out {name}")
    count, chart = label_faces(result.uv_faces, len(result.uv))
    charts_used, chart = np.unique(chart, return_inverse=True)
    count = len(charts_used)
    placed = _moves_of(moves or {}, chart, count)
    is_pinned = np.zeros(count, dtype=bool)
    is_pinned[[chart[_face(face, len(chart))] for face in (*pinned, *(moves or {}))]] = True
    moved = _moved(result, placed, chart)
    notes: tuple[str, ...] = ()
    if pack:
        packing = _packing(moved, chart, is_pinned)
        moved = _moved(moved, packing, chart)
        notes = _scale_notes(packing, is_pinned)
    return remeasured(result, _with_efficiency(moved), DOUBLE, notes)


def _packing(result: Flattening, chart: IntArray, is_pinned: BoolArray) -> Moves:
    """Return the moves that pack the charts of a result around pinned ones."""
    settings = result.settings
    frame = Frame.of(
        settings.get("resolution", 1024), settings.get("padding", 2.0), settings.get("block_size", 1)
    )
    quantum, turns = settings.get("quantise"), None
    if settings.get("up") is not None:
        turns = 1
    elif quantum is not None:
        turns = turns_of_quantum(quantum)
    corners = np.ascontiguousarray(result.corner_uv).view(np.complex128)[..., 0]
    mesh = TriangleMesh(result.vertices, result.faces)
    charts = Charts(corners, chart, len(is_pinned), mesh.edge_halfedges)
    return pack_around(charts, is_pinned, frame, turns)


def _moved(result: Flattening, moves: Moves, chart: IntArray) -> Flattening:
    """Return a result with the charts of its triangles (m,) moved; the measures are those of before."""
    of_point = np.zeros(len(result.uv), dtype=np.int64)
    of_point[result.uv_faces] = chart[:, None]
    points = np.ascontiguousarray(result.uv).view(np.complex128)[:, 0]
    points = moves.factor[of_point] * points + moves.shift[of_point]
    return replace(result, uv=points.view(np.float64).reshape(-1, 2))


def _with_efficiency(result: Flattening) -> Flattening:
    covered = float(np.abs(signed_double_areas(result.corner_uv)).sum()) / 2
    return replace(result, packing_efficiency=covered)


def _scale_notes(moves: Moves, is_pinned: BoolArray) -> tuple[str, ...]:
    """Return a note on charts that were scaled, or nothing."""
    scales = np.abs(moves.factor[~is_pinned])
    if not len(scales) or scales.min() > 1 - NOTED_SCALE:
        return ()
    return (
        f"The charts that are not pinned are scaled by {scales.min():.3f}: the pinned ones leave no more space.",
    )


def _moves_of(moves: Mapping[int, Move], chart: IntArray, count: int) -> Moves:
    """Return the moves of all k charts.

    Raises:
        OptionError: as of `repack`.
    """
    placed = Moves(np.ones(count, np.complex128), np.zeros(count, np.complex128))
    owners: dict[int, int] = {}
    for face, move in moves.items():
        number = int(chart[_face(face, len(chart))])
        if number in owners:
            raise OptionError(f"triangles {owners[number]} and {face} are in one chart, which is moved twice")
        owners[number] = face
        placed.factor[number], placed.shift[number] = _move(face, move)
    return placed


def _move(face: int, move: Any) -> Move:
    """Return a checked move."""
    try:
        factor, shift = (complex(number) for number in move)
    except (TypeError, ValueError) as error:
        raise OptionError(
            f"the move of triangle {face} must be two numbers, got {short_repr(move)}"
        ) from error
    if not (np.isfinite(factor) and np.isfinite(shift) and factor != 0):
        raise OptionError(
            f"the move of triangle {face} must be finite, and its factor not 0, got {short_repr(move)}"
        )
    return factor, shift


def _face(face: Any, count: int) -> int:
    """Return a checked triangle."""
    is_index = isinstance(face, (int, np.integer)) and not isinstance(face, bool)
    if not is_index or not 0 <= face < count:
        raise OptionError(
            f"there is no triangle {short_repr(face)}: they are numbered from 0 to {count - 1:,}"
        )
    return int(face)
