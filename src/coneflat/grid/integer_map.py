"""A map of a surface to the integer grid."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .._arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class IntegerGrid:
    """A map of a surface to the plane in which grid lines go on across seams: m triangles, n vertices.

    A half-edge h = 3 f + i is the side of triangle f opposite its corner i, from corner i + 1 to corner i + 2. What is
    x in the frame of the triangle across it is R x + shifts[h] in its own, R being turns[h] quarter turns to the left.

    Attributes:
        vertices: (n, 3) positions in model units.
        faces: (m, 3) vertex indices.
        corner_grid: (m, 3, 2) the point of the grid of every triangle corner, in units of the grid; no triangle is
            turned over.
        turns: (3m,) from 0 to 3; -1 on the boundary.
        shifts: (3m, 2) whole numbers; 0 on the boundary.
        cones: (s,) vertices that lie on grid points and have other than four quads.
        quarters: (s,) how many they have, the quarter turns of their angle.
        size: of a square of the grid, in model units: the root of the surface's area by the grid's.
        move_rms, move_max: by how much rounding has moved the cones, in units of the grid.
        energy_before, energy: the mean distortion that was minimised, in the smooth layout and in the grid.
        qc_before, qc_mean: quasi-conformal distortion, the mean by area, likewise.
        least_area: of any triangle, over what it should have.
        notes: what was done, one sentence each.
        corners: (k,) vertices on grid points where straight sides of the boundary meet; sides lie on grid lines.
        corner_quarters: (k,) the quarter turns of their angle: 1, 3 or more.
    """

    vertices: FloatArray
    faces: IntArray
    corner_grid: FloatArray
    turns: IntArray
    shifts: IntArray
    cones: IntArray
    quarters: IntArray
    size: float
    move_rms: float
    move_max: float
    energy_before: float
    energy: float
    qc_before: float
    qc_mean: float
    least_area: float
    notes: tuple[str, ...] = ()
    corners: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    corner_quarters: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
