"""A map of a surface to the integer grid."""

from __future__ import annotations

from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

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
        corners: (k,) further vertices on grid points, where straight sides of the boundary, or sharp edges, meet at an
            angle; sides and these lie on grid lines.
        corner_quarters: (k,) the quarter turns of their angle.
        features: (f, 2) vertices of sharp edges that lie on grid lines.
        seconds: wall time of each stage; files do not keep it.
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
    features: IntArray = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    seconds: dict[str, float] = field(default_factory=dict)

    def report(self) -> dict[str, float | None]:
        """Return the numbers among the attributes by name, as JSON takes them: None for what is not known."""
        numbers = {name: value for name, value in vars(self).items() if isinstance(value, float)}
        return {name: float(value) if np.isfinite(value) else None for name, value in numbers.items()}

    def save(self, path: str | PathLike[str]) -> Path:
        """Write the grid as .obj or .npz, in full or not at all, and return the path; see `write_grid`.

        Raises:
            UnknownFormatError: the ending is another.
            MeshFileError: the file cannot be written.
        """
        from ..files.grid import write_grid

        return write_grid(path, self)

    @staticmethod
    def load(path: str | PathLike[str]) -> IntegerGrid:
        """Return the grid that an .npz or .obj file holds; see `read_grid`.

        Raises:
            UnknownFormatError: the ending is another.
            MeshFileError: the file is not there, may not be read, or holds no manifold of triangles with UVs.
            GridError: the UVs are no integer-grid map.
        """
        from ..files.grid import read_grid

        return read_grid(path)
