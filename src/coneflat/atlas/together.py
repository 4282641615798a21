"""Several flattened meshes in one texture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .._arrays import IntArray
from ..errors import EmptyMeshError
from ..mesh import TriangleMesh, label_components
from .arrange import whole_turns
from .pack import pack_charts
from .touch import part_touching

if TYPE_CHECKING:
    from ..result import Flattening


def pack_together(
    results: Sequence[Flattening],
    *,
    resolution: int = 1024,
    padding: float = 2.0,
    rotate: str = "any",
    tiles: int = 1,
) -> list[Flattening]:
    """Return results whose charts share one texture, or several (UDIM tiles), all at one scale of their models.

    Args:
        results: flattened meshes, in the same unit of length.
        resolution: texels along a side of the texture.
        padding: texels between charts, at least.
        rotate: "any" turns charts so that they fill the texture best, "quarter" lays them straight, "none" leaves them
            as they are, so what is upright stays so. Those of results with a quantum turn by multiples of it only.
        tiles: number of textures.

    Raises:
        EmptyMeshError: there are no results.
        OptionError: a number makes no sense, or so much padding leaves no room.
    """
    if not results:
        raise EmptyMeshError("there are no results to pack")
    from ..remeasure import measured_anew

    labels = [_charts(result) for result in results]
    first = np.cumsum([0, *(int(label.max()) + 1 for label in labels)])
    packed = pack_charts(
        np.concatenate([result.corner_uv / result.uv_scale for result in results]),
        np.concatenate([label + start for label, start in zip(labels, first[:-1], strict=True)]),
        resolution=resolution,
        padding=padding,
        rotate=_allowed_turns(results, rotate),
        tiles=tiles,
    )
    points = np.cumsum([0, *(len(result.uv) for result in results)])
    corners = [result.uv_faces + start for result, start in zip(results, points[:-1], strict=True)]
    uv = np.empty((points[-1], 2))
    uv[np.concatenate(corners)] = packed.corner_uv
    uv, _ = part_touching(uv, np.concatenate(corners))
    texture = {"resolution": resolution, "padding": padding, "tiles": tiles}
    moved = (
        replace(
            result,
            uv=own,
            uv_scale=packed.scale,
            packing_efficiency=packed.efficiency,
            settings={**result.settings, **texture},
        )
        for result, own in zip(results, np.split(uv, points[1:-1]), strict=True)
    )
    return [measured_anew(before, after) for before, after in zip(results, moved, strict=True)]


def _allowed_turns(results: Sequence[Flattening], rotate: str) -> str | int:
    """Return how charts may be turned so that the rotations between the sides of seams stay multiples of the quanta."""
    turns = [whole_turns(result.rotations.quantum) for result in results if result.rotations is not None]
    if not turns or rotate not in ("any", "quarter"):
        return rotate
    return math.gcd(*turns, 4) if rotate == "quarter" else math.gcd(*turns)


def _charts(result: Flattening) -> IntArray:
    """Return (m,) the chart of each triangle: what hangs together in the plane."""
    flat = TriangleMesh(result.uv, result.uv_faces)
    faces = flat.edge_faces[~flat.is_boundary_edge]
    return label_components(len(result.uv_faces), faces[:, 0], faces[:, 1])[1]
