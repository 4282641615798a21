"""Positions as GLB stores them: 32-bit numbers, relative to a node if the model is far from the origin."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import FloatArray
from ...errors import MeshFileError

#: Range of model sizes for which squares of small lengths are also 32-bit numbers, as other programs compute them.
MIN_SIZE, MAX_SIZE = 1e-15, 1e18
#: Distance from the origin, in sizes of the model, from which positions are relative to a node: 32-bit numbers have 24
#: binary digits, of which at most two are lost below it.
MAX_DISTANCE = 4.0
#: Binary digits of 32-bit numbers.
DIGITS = 24


class LocalPositions(NamedTuple):
    """Positions relative to a node.

    Attributes:
        local: (n, 3) 32-bit numbers.
        translation: (3,) the node's translation, in doubles; zeros for a model near the origin.
    """

    local: NDArray[np.float32]
    translation: FloatArray

    @property
    def vertices(self) -> FloatArray:
        """(n, 3) the positions as readers compute them."""
        return self.local.astype(np.float64) + self.translation

    @property
    def node(self) -> dict[str, list[float]]:
        """The entry of the node in the JSON, empty without a translation."""
        return {"translation": self.translation.tolist()} if self.translation.any() else {}


def local_positions(vertices: FloatArray) -> LocalPositions:
    """Return positions (n, 3) as 32-bit numbers, relative to a translation if the model is far from the origin.

    The translation is a multiple of a power of two near the size of the model, and relative positions are multiples of
    a small one, so that positions that were read back are written without change.

    Raises:
        MeshFileError: the size is beyond the range of 32-bit numbers.
    """
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    largest, size = float(np.maximum(np.abs(low), np.abs(high)).max()), float((high - low).max())
    if not MIN_SIZE < largest < MAX_SIZE:
        raise MeshFileError(
            f"positions of up to {largest:.3g} are beyond the 32-bit numbers of .glb, which support sizes from "
            f"{MIN_SIZE:.0e} to {MAX_SIZE:.0e}: scale the mesh, or write .ply"
        )
    rounded = vertices.astype(np.float32)
    if largest <= MAX_DISTANCE * size or np.array_equal(rounded, vertices):
        return LocalPositions(rounded, np.zeros(3))
    exponent = np.frexp(np.maximum(high - low, MIN_SIZE))[1]
    translation = np.ldexp(np.rint(np.ldexp((low + high) / 2, -exponent)), exponent)
    steps = np.rint(np.ldexp(vertices - translation, DIGITS - exponent))
    return LocalPositions(np.ldexp(steps, exponent - DIGITS).astype(np.float32), translation)
