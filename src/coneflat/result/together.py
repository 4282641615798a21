"""Several flattened meshes in one texture."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..atlas.arrange import whole_turns
from ..atlas.pack import pack_charts
from ..atlas.touch import part_touching
from ..errors import EmptyMeshError, OptionError

if TYPE_CHECKING:
    from .flattening import Flattening


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
            as they are, so what is upright stays so. Where a result has a quantum, both turn charts by multiples of it.
        tiles: number of textures.

    Raises:
        EmptyMeshError: there are no results.
        OptionError: something is no result, a number makes no sense, or so much padding leaves no room.
    """
    from .promises import DOUBLE, remeasured

    results = _checked(results)
    quanta = {result.rotations.quantum for result in results if result.rotations is not None}
    turns: str | int = rotate
    if quanta and rotate in ("any", "quarter"):
        turns = math.gcd(*(whole_turns(quantum) for quantum in quanta))
    labels = [result.seam_data.face_chart for result in results]
    first = np.cumsum([0, *(int(label.max()) + 1 for label in labels)])
    packed = pack_charts(
        np.concatenate([result.corner_uv / result.uv_scale for result in results]),
        np.concatenate([label + start for label, start in zip(labels, first[:-1], strict=True)]),
        resolution=resolution,
        padding=padding,
        rotate=turns,
        tiles=tiles,
    )
    points = np.cumsum([0, *(len(result.uv) for result in results)])
    corners = [result.uv_faces + start for result, start in zip(results, points[:-1], strict=True)]
    uv = np.empty((points[-1], 2))
    uv[np.concatenate(corners)] = packed.corner_uv
    uv, _ = part_touching(uv, np.concatenate(corners))
    texture = {"resolution": resolution, "padding": padding, "tiles": tiles}
    return [
        remeasured(
            result,
            replace(
                result,
                uv=own,
                uv_scale=packed.scale,
                packing_efficiency=packed.efficiency,
                settings={**result.settings, **texture},
            ),
            DOUBLE,
        )
        for result, own in zip(results, np.split(uv, points[1:-1]), strict=True)
    ]


def _checked(results: object) -> list[Flattening]:
    """Return results, if they are.

    Raises:
        EmptyMeshError, OptionError: there are none, or something else is among them.
    """
    from .flattening import Flattening

    listed: list[Flattening] = []
    for one in results if isinstance(results, Iterable) else [results]:
        if not isinstance(one, Flattening):
            raise OptionError(f"pack_together takes results of flatten, not {type(one).__name__}")
        listed.append(one)
    if not listed:
        raise EmptyMeshError("there are no results to pack")
    return listed
