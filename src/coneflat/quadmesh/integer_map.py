"""Integer-grid maps: the result class, the motions across edges, and the construction from corner coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..base import BoolArray, EntryPoint, FloatArray, IntArray, list_some, plural
from ..errors import GridError
from ..geometry import UNITS, double_areas, edge_lengths, quarters_around, sides_between, signed_double_areas
from ..mesh import NEXT, PREVIOUS
from ..mesh.connectivity import TriangleMesh
from .options import GRID_TOLERANCE

# Files are made of grids, so their module imports this one.
_WRITE = EntryPoint[Path]("quadmesh.files:write_grid")
_READ = EntryPoint["IntegerGrid"]("quadmesh.files:read_grid")


@dataclass(frozen=True, eq=False)
class IntegerGrid:
    """A map of a surface to the plane in which grid lines continue across seams: m triangles, n vertices.

    A half-edge h = 3 f + i is the side of triangle f opposite its corner i, from corner i + 1 to corner i + 2. A point
    x in the frame of the triangle across it is R x + shifts[h] in the frame of f, where R is a rotation by turns[h]
    quarter turns counterclockwise.

    Attributes:
        vertices: (n, 3) positions in model units; edges of the given mesh may be split, for example between cones.
        faces: (m, 3) vertex indices.
        corner_grid: (m, 3, 2) grid coordinates of every triangle corner, in units of the grid; no triangle is flipped.
        turns: (3m,) from 0 to 3; -1 on the boundary.
        shifts: (3m, 2) integers; 0 on the boundary.
        cones: (s,) vertices on grid points whose number of quads is not four.
        quarters: (s,) the number of quads at each cone: its angle in quarter turns.
        size: edge length of a square of the grid in model units: square root of the surface area over the grid's area.
        notes: one sentence each.
        corners: (k,) further vertices on grid points, where straight sides of the boundary, or sharp edges, meet at an
            angle; these sides and edges lie on grid lines.
        corner_quarters: (k,) their angles in quarter turns.
        features: (f, 2) vertices of sharp edges that lie on grid lines.
        seconds: wall time of each stage; not stored in files.

    Examples:
        >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]
        >>> grid = coneflat.integer_grid(*square, quads=4)
        >>> grid.corner_grid.shape, grid.turns.shape, grid.shifts.shape
        ((128, 3, 2), (384,), (384, 2))
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
    notes: tuple[str, ...] = ()
    corners: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    corner_quarters: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    features: IntArray = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    seconds: dict[str, float] = field(default_factory=dict)

    @property
    def squares(self) -> float:
        """The area of the grid in squares."""
        return float(signed_double_areas(self.corner_grid).sum()) / 2

    def save(self, path: str | PathLike[str]) -> Path:
        """Write the grid as .obj or .npz, atomically, and return the path; see `write_grid`.

        Raises:
            UnknownFormatError: the extension is not .obj or .npz.
            MeshFileError: the file cannot be written.
        """
        return _WRITE(path, self)

    @staticmethod
    def load(path: str | PathLike[str]) -> IntegerGrid:
        """Return the grid in an .npz file; see `read_grid`.

        Raises:
            UnknownFormatError: the extension is not .npz.
            MeshFileError: the file does not exist, cannot be read, or does not contain an integer grid of a manifold
                triangle mesh.
            GridError: triangles are flipped, or sides of seams do not match.
        """
        return _READ(path)


def find_motions(mesh: TriangleMesh, corner_grid: FloatArray) -> tuple[IntArray, IntArray, float]:
    """Return (3m,) quarter turns and (3m, 2) shifts of half-edges, and their largest error in units of the grid.

    They are the quarter turns and integer translations that map the triangle across a half-edge to its own as closely
    as possible, as in `IntegerGrid`; -1 and 0 on the boundary.

    Args:
        mesh: m triangles.
        corner_grid: (m, 3, 2) grid coordinates of every triangle corner.
    """
    z = np.ascontiguousarray(corner_grid).view(np.complex128)[..., 0]
    starts, ends = z[:, NEXT].ravel(), z[:, PREVIOUS].ravel()
    turns = np.full(len(starts), -1, dtype=np.int64)
    shifts = np.zeros((len(starts), 2), dtype=np.int64)
    pairs = mesh.edge_halfedges[~mesh.is_boundary_edge]
    off = 0.0
    for h, t in (pairs.T, pairs[:, ::-1].T):
        # The angle of the quotient of the sides, computed without dividing by a side of zero length.
        turn = (ends[h] - starts[h]) * np.conj(starts[t] - ends[t])
        turns[h] = np.rint(np.angle(turn) / (np.pi / 2)).astype(np.int64) % 4
        motion = UNITS[turns[h]]
        shift = starts[h] - motion * ends[t]
        rounded = np.rint(shift)
        shifts[h] = np.stack([rounded.real, rounded.imag], axis=1).astype(np.int64)
        missed = (starts[h] - motion * ends[t] - rounded, ends[h] - motion * starts[t] - rounded)
        off = max(off, *(float(np.abs(miss).max(initial=0.0)) for miss in missed))
    return turns, shifts, off


def grid_of_corners(
    vertices: FloatArray,
    faces: IntArray,
    corner_grid: FloatArray,
    cones: IntArray | None = None,
    corners: IntArray | None = None,
    **attributes: float | tuple[str, ...] | IntArray,
) -> IntegerGrid:
    """Return the integer grid of given corner coordinates, with the motions and cones that follow from them.

    Args:
        vertices, faces: (n, 3), (m, 3) a consistently oriented manifold mesh.
        corner_grid: (m, 3, 2) grid coordinates of every triangle corner.
        cones, corners: None: all inner vertices with another angle than four quarter turns; and all corners of the
            boundary.
        attributes: the size of squares, which else is computed, notes, features, and the angles of corners.

    Raises:
        GridError: triangles are flipped, or the sides of seams are not related by quarter turns and integer
            translations.
    """
    mesh = TriangleMesh(vertices, faces)
    flat = signed_double_areas(corner_grid)
    flipped = np.flatnonzero(~(flat > 0))
    if len(flipped):
        raise GridError(
            f"{plural(len(flipped), 'triangle')} of {len(faces):,} with UVs flipped or without area "
            f"({list_some(flipped)}): this is not an integer-grid map"
        )
    turns, shifts, off = find_motions(mesh, corner_grid)
    if not off <= GRID_TOLERANCE:
        raise GridError(
            f"the sides of a seam differ by {off:.2g} squares, up to quarter turns and integer translations: this is "
            "not an integer-grid map"
        )
    quarters = quarters_around(mesh, sides_between(corner_grid))
    is_used = np.bincount(faces.ravel(), minlength=len(vertices)) > 0
    if cones is None:
        cones = np.flatnonzero((quarters != 4) & ~mesh.is_boundary_vertex & is_used)
    if corners is None:
        # Both boundary edges at a corner are on grid lines.
        sides = mesh.edges[mesh.is_boundary_edge & on_lines(mesh, corner_grid)]
        is_between = np.bincount(sides.ravel(), minlength=len(vertices)) == 2
        corners = np.flatnonzero((quarters != 2) & is_between)
    area = float(double_areas(edge_lengths(vertices, faces)).sum())
    attributes = {
        "size": float(np.sqrt(area / flat.sum())),
        "corner_quarters": quarters[corners],
        **attributes,
    }
    arrays = (vertices, faces, corner_grid, turns, shifts, cones, quarters[cones])
    return IntegerGrid(*arrays, corners=corners, **attributes)  # type: ignore[arg-type]


def with_note(grid: IntegerGrid, note: str) -> IntegerGrid:
    """Return a grid with one more note, unless it has this one, or the note is empty."""
    return grid if note in ("", *grid.notes) else replace(grid, notes=(*grid.notes, note))


def joined_grids(grids: Sequence[IntegerGrid], notes: Sequence[str]) -> IntegerGrid:
    """Return one grid of several surfaces, with the mean size of squares, and the notes of all after given ones."""
    first = np.cumsum([0, *(len(grid.vertices) for grid in grids)])
    squares = [grid.squares for grid in grids]
    values: dict[str, Any] = {}
    for attribute in fields(IntegerGrid):
        values_of = [getattr(grid, attribute.name) for grid in grids]
        if attribute.name in ("faces", "cones", "corners", "features"):
            values[attribute.name] = np.concatenate(
                [array + start for array, start in zip(values_of, first, strict=False)]
            )
        elif str(attribute.type).endswith("Array"):
            values[attribute.name] = np.concatenate(values_of)
    values["size"] = float(np.average([grid.size for grid in grids], weights=squares))
    values["notes"] = tuple(dict.fromkeys([*notes, *(note for grid in grids for note in grid.notes)]))
    return IntegerGrid(**values)


def on_lines(mesh: TriangleMesh, corner_grid: FloatArray) -> BoolArray:
    """Return (e,) whether each edge is on a grid line."""
    halfedge = mesh.edge_halfedges[:, 0]
    starts, ends = (corner_grid[:, which].reshape(-1, 2)[halfedge] for which in (NEXT, PREVIOUS))
    return ((starts == ends) & (starts == np.rint(starts))).any(axis=1)
