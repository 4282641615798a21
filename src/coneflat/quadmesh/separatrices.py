"""Separatrices of an integer grid: the grid lines from irregular vertices, each to the next irregular vertex."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base import BoolArray, ComplexArray, IntArray, compiled
from ..geometry import UNITS
from ..mesh import NEXT
from ..mesh.connectivity import TriangleMesh
from .integer_map import IntegerGrid
from .transitions import Transitions


@dataclass(frozen=True, eq=False)
class Separatrices:
    """Grid lines between two irregular vertices, k of them, each in both directions.

    The frame of a line is that of the triangle at its start, rotated so that the line is along x.

    Attributes:
        starts, ends: (k,) the triangle corners 3 f + i at both ends.
        directions: (k,) the direction of the line in the triangle at its start, in quarter turns.
        lengths: (k,) squares.
        crossings: (c,) half-edges of seams that lines cross, those of each line in their order.
        line: (c,) the line of each.
    """

    starts: IntArray
    ends: IntArray
    directions: IntArray
    lengths: IntArray
    crossings: IntArray
    line: IntArray

    def offsets(self, transitions: Transitions, corners: IntArray) -> IntArray:
        """Return (j, v) rows whose products with the variables are the offsets across the lines of their two ends.

        In the given grid these are 0. Rows that are equal, up to the sign, are returned once.

        Args:
            transitions: the seams of the layout.
            corners: (m, 3) the point of the layout at each triangle corner.
        """
        chains, corner = transitions.chains, corners.ravel()
        shifts = (transitions.shifts[::2] + 1j * transitions.shifts[1::2]).tocsr()
        chain, side = np.full(len(corner), -1), np.zeros(len(corner), dtype=np.int64)
        chain[chains.halfedges] = chains.chain[:, None]
        side[chains.halfedges[:, 1]] = 1
        rows = -UNITS[-self.directions % 4][:, None] * shifts[corner[self.starts]].toarray()
        turns = -self.directions % 4
        for line, halfedge in zip(self.line.tolist(), self.crossings.tolist(), strict=True):
            crossed = int(chain[halfedge])
            quarter, columns = int(transitions.quarters[crossed]), [2 * crossed, 2 * crossed + 1]
            if side[halfedge] == 0:  # z_left = i^-q (z_right - t)
                turns[line] = (turns[line] - quarter) % 4
                rows[line, columns] -= UNITS[turns[line]] * np.array([1, 1j])
            else:  # z_right = i^q z_left + t
                rows[line, columns] += UNITS[turns[line]] * np.array([1, 1j])
                turns[line] = (turns[line] + quarter) % 4
        rows += UNITS[turns][:, None] * shifts[corner[self.ends]].toarray()
        across = np.rint(rows.imag).astype(np.int64)
        across = across[across.any(axis=1)]
        first = across[np.arange(len(across)), (across != 0).argmax(axis=1)]
        return np.unique(across * np.sign(first)[:, None], axis=0)


def find_separatrices(grid: IntegerGrid) -> Separatrices:
    """Return the separatrices of a grid that join two irregular vertices.

    Those that end at the boundary are left out. Corners of the boundary with more than two quads count as irregular.

    Notes:
        Coordinates of an `IntegerGrid` are multiples of a power of two for which sums are exact, so the side of a line
        on which a vertex lies is exact, too. A line through a vertex that is not irregular passes on its right.
    """
    mesh = TriangleMesh(grid.vertices, grid.faces)
    places = np.ascontiguousarray(grid.corner_grid).view(np.complex128)[..., 0]
    opposite = np.full(3 * len(grid.faces), -1)
    pairs = mesh.edge_halfedges[~mesh.is_boundary_edge]
    opposite[pairs], opposite[pairs[:, ::-1]] = pairs[:, ::-1], pairs
    is_irregular = np.zeros(len(grid.vertices), dtype=np.bool_)
    is_irregular[grid.cones] = True
    is_irregular[grid.corners[grid.corner_quarters > 2]] = True
    across = grid.shifts[:, 0] + 1j * grid.shifts[:, 1]
    is_seam = (opposite >= 0) & ((grid.turns > 0) | (across != 0))
    starts, directions = _starts(places, grid.faces, is_irregular)
    longest = 4 * int(np.ceil(grid.squares)) + 4
    ends, lengths, crossings, line = _trace(
        starts, directions, places, grid.faces, opposite, grid.turns, across, is_seam, is_irregular, longest
    )
    joined = np.flatnonzero(ends >= 0)
    number = np.full(len(ends), -1)
    number[joined] = np.arange(len(joined))
    is_on_joined = number[line] >= 0
    return Separatrices(
        starts[joined], ends[joined], directions[joined], lengths[joined], crossings[is_on_joined],
        number[line[is_on_joined]],
    )  # fmt: skip


def _starts(places: ComplexArray, faces: IntArray, is_irregular: BoolArray) -> tuple[IntArray, IntArray]:
    """Return the triangle corners at irregular vertices, and the directions in quarter turns, of lines that start."""
    corners = np.flatnonzero(is_irregular[faces.ravel()])
    face, corner = corners // 3, corners % 3
    ahead = places[face, NEXT[corner]] - places[face, corner]
    behind = places[face, NEXT[NEXT[corner]]] - places[face, corner]
    starts, directions = [], []
    for direction in range(4):
        right, left = ahead * UNITS[-direction % 4], behind * UNITS[-direction % 4]
        inside = (right.imag < 0) & (left.imag >= 0) & ((np.conj(right) * left).imag > 0)
        starts.append(corners[inside])
        directions.append(np.full(int(inside.sum()), direction))
    return np.concatenate(starts), np.concatenate(directions)


@compiled
def _trace(
    starts: IntArray,
    directions: IntArray,
    places: ComplexArray,
    faces: IntArray,
    opposite: IntArray,
    turns: IntArray,
    shifts: ComplexArray,
    is_seam: BoolArray,
    is_irregular: BoolArray,
    longest: int,
) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Return the corner at the end of each line, -1 for none, its length, and the seams it crosses with its number."""
    units = np.array([1, 1j, -1, -1j])
    ends, lengths = np.full(len(starts), -1, np.int64), np.zeros(len(starts), np.int64)
    crossings, line = [np.int64(0) for _ in range(0)], [np.int64(0) for _ in range(0)]
    for k in range(len(starts)):
        face, corner = starts[k] // 3, starts[k] % 3
        # A point z of the current triangle is unit z + shift in the frame of the line, whose start is 0.
        turn = -directions[k] % 4
        shift = -units[turn] * places[face, corner]
        halfedge = starts[k]
        for side in (1, 2):
            at = (corner + side) % 3
            place = units[turn] * places[face, at] + shift
            if place.imag == 0 and place.real > 0 and is_irregular[faces[face, at]]:
                ends[k], lengths[k] = 3 * face + at, round(place.real)
        while ends[k] < 0 and opposite[halfedge] >= 0:
            if is_seam[halfedge]:
                crossings.append(np.int64(halfedge))
                line.append(np.int64(k))
                shift = units[turn] * shifts[halfedge] + shift
                turn = (turn + turns[halfedge]) % 4
            face, corner = opposite[halfedge] // 3, opposite[halfedge] % 3
            place = units[turn] * places[face, corner] + shift
            if place.imag == 0 and is_irregular[faces[face, corner]]:
                ends[k], lengths[k] = 3 * face + corner, round(place.real)
            if place.real > longest:
                break
            # The line enters between corners + 1, on its left, and + 2, and leaves on the other side of the apex.
            halfedge = 3 * face + (corner + (1 if place.imag >= 0 else 2)) % 3
    return ends, lengths, np.array(crossings, dtype=np.int64), np.array(line, dtype=np.int64)
