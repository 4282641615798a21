"""A map of a surface to the integer grid, the motions across its edges, and the map of given corners."""

from __future__ import annotations

from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np

from ... import TriangleMesh
from ...base import BoolArray, FloatArray, IntArray, list_some, plural
from ...errors import GridError
from ...geometry import double_areas, edge_lengths, sides_between, signed_double_areas
from ...mesh import NEXT, PREVIOUS
from .layout import GRID_TOLERANCE, quarters_around
from .transitions import UNITS


@dataclass(frozen=True, eq=False)
class IntegerGrid:
    """A map of a surface to the plane in which grid lines go on across seams: m triangles, n vertices.

    A half-edge h = 3 f + i is the side of triangle f opposite its corner i, from corner i + 1 to corner i + 2. What is
    x in the frame of the triangle across it is R x + shifts[h] in its own, R being turns[h] quarter turns to the left.

    Attributes:
        vertices: (n, 3) positions in model units.
        faces: (m, 3) vertex indices.
        corner_grid: (m, 3, 2) the point of the grid of every triangle corner, in units of the grid; no triangle is
            flipped.
        turns: (3m,) from 0 to 3; -1 on the boundary.
        shifts: (3m, 2) integers; 0 on the boundary.
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

    Examples:
        >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]
        >>> grid = coneflat.integer_grid(*square, quads=4)
        >>> grid.corner_grid.shape, grid.turns.shape, grid.shifts.shape
        ((8, 3, 2), (24,), (24, 2))
        >>> len(grid.cones), len(coneflat.quads(grid).quads)
        (0, 4)
    """

    vertices: FloatArray
    faces: IntArray
    corner_grid: FloatArray
    turns: IntArray
    shifts: IntArray
    cones: IntArray
    quarters: IntArray
    size: float
    move_rms: float = np.nan
    move_max: float = np.nan
    energy_before: float = np.nan
    energy: float = np.nan
    qc_before: float = np.nan
    qc_mean: float = np.nan
    least_area: float = np.nan
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
        from .files import write_grid

        return write_grid(path, self)

    @staticmethod
    def load(path: str | PathLike[str]) -> IntegerGrid:
        """Return the grid that an .npz or .obj file holds; see `read_grid`.

        Raises:
            UnknownFormatError: the ending is another.
            MeshFileError: the file is not there, may not be read, or holds no manifold of triangles with UVs.
            GridError: the UVs are not an integer-grid map.
        """
        from .files import read_grid

        return read_grid(path)


def find_motions(mesh: TriangleMesh, corner_grid: FloatArray) -> tuple[IntArray, IntArray, float]:
    """Return (3m,) quarter turns and (3m, 2) shifts of half-edges, and by how much they miss, in units of the grid.

    They take the triangle across a half-edge to its own, as those of `IntegerGrid` do: what is nearest to that among
    quarter turns and whole translations. -1 and 0 on the boundary.

    Args:
        mesh: m triangles.
        corner_grid: (m, 3, 2) the place of every triangle corner.
    """
    z = np.ascontiguousarray(corner_grid).view(np.complex128)[..., 0]
    starts, ends = z[:, NEXT].ravel(), z[:, PREVIOUS].ravel()
    turns = np.full(len(starts), -1, dtype=np.int64)
    shifts = np.zeros((len(starts), 2), dtype=np.int64)
    pairs = mesh.edge_halfedges[~mesh.is_boundary_edge]
    off = 0.0
    for h, t in (pairs.T, pairs[:, ::-1].T):
        # The angle of own over other, without dividing by a side of no length.
        turn = (ends[h] - starts[h]) * np.conj(starts[t] - ends[t])
        turns[h] = np.rint(np.angle(turn) / (np.pi / 2)).astype(np.int64) % 4
        motion = UNITS[turns[h]]
        shift = starts[h] - motion * ends[t]
        whole = np.rint(shift)
        shifts[h] = np.stack([whole.real, whole.imag], axis=1).astype(np.int64)
        missed = (starts[h] - motion * ends[t] - whole, ends[h] - motion * starts[t] - whole)
        off = max(off, *(float(np.abs(each).max(initial=0.0)) for each in missed))
    return turns, shifts, off


def grid_of_corners(
    vertices: FloatArray,
    faces: IntArray,
    corner_grid: FloatArray,
    **known: float | tuple[str, ...] | IntArray,
) -> IntegerGrid:
    """Return the integer grid that corners of triangles are in, with all that follows from their places.

    Args:
        vertices, faces: (n, 3), (m, 3) a manifold mesh whose triangles run the same way round.
        corner_grid: (m, 3, 2) the place of every triangle corner, in units of the grid.
        known: measures of the grid, notes and features; measures left out are not a number, but for the size.

    Raises:
        GridError: triangles are flipped, or the sides of seams are not copies of each other by quarter turns and
            whole translations.
    """
    mesh = TriangleMesh(vertices, faces)
    flat = signed_double_areas(corner_grid)
    turned = np.flatnonzero(~(flat > 0))
    if len(turned):
        raise GridError(
            f"{plural(len(turned), 'triangle')} of {len(faces):,} with UVs flipped or without area "
            f"({list_some(turned)}): this is not an integer-grid map"
        )
    turns, shifts, off = find_motions(mesh, corner_grid)
    if not off <= GRID_TOLERANCE:
        raise GridError(
            f"the sides of a seam miss each other by {off:.2g} squares, up to quarter turns and whole translations: "
            "this is not an integer-grid map"
        )
    quarters = quarters_around(mesh, sides_between(corner_grid))
    is_used = np.bincount(faces.ravel(), minlength=len(vertices)) > 0
    cones = np.flatnonzero((quarters != 4) & ~mesh.is_boundary_vertex & is_used)
    corners = np.flatnonzero((quarters != 2) & _between_sides(mesh, corner_grid))
    area = float(double_areas(edge_lengths(vertices, faces)).sum())
    return IntegerGrid(
        vertices=vertices,
        faces=faces,
        corner_grid=corner_grid,
        turns=turns,
        shifts=shifts,
        cones=cones,
        quarters=quarters[cones],
        corners=corners,
        corner_quarters=quarters[corners],
        **{"size": float(np.sqrt(area / flat.sum())), **known},  # type: ignore[arg-type]
    )


def _between_sides(mesh: TriangleMesh, corner_grid: FloatArray) -> BoolArray:
    """Return (n,) whether the edges of the boundary at a vertex are all on grid lines; none are inside."""
    border = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
    starts, ends = (corner_grid[:, which].reshape(-1, 2)[border] for which in (NEXT, PREVIOUS))
    is_on = ((starts == ends) & (starts == np.rint(starts))).any(axis=1)
    lines = np.zeros(len(mesh.vertices), dtype=np.int64)
    np.add.at(lines, mesh.edges[mesh.is_boundary_edge].ravel(), np.repeat(is_on, 2))
    return lines == 2
