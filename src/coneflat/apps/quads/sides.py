"""Straight sides of a boundary, which lie on grid lines, and their corners."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ... import TriangleMesh
from ...base import BoolArray, ComplexArray, FloatArray, IntArray
from ...geometry import signed_angles
from ...mesh import NEXT, PREVIOUS, label_components

# Radians by which straight sides, or those of seams, may be off each other, up to quarter turns.
QUARTER = 1e-6


def _none() -> IntArray:
    return np.empty(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Sides:
    """Straight sides of a boundary, each a piece that no seam and no corner parts.

    Attributes:
        corners: (k,) vertices where sides meet at an angle.
        points: (q,) points on sides, those of the ends included; one of two sides is there twice.
        side: (q,) the side of each.
        axis: (l,) what points of a side have in common: 0 for x, 1 for y.
    """

    corners: IntArray = field(default_factory=_none)
    points: IntArray = field(default_factory=_none)
    side: IntArray = field(default_factory=_none)
    axis: IntArray = field(default_factory=_none)

    @property
    def directions(self) -> FloatArray:
        """(l, 2) of the sides, along the axes."""
        return np.eye(2)[1 - self.axis]


def quarters_around(mesh: TriangleMesh, sides: ComplexArray) -> IntArray:
    """Return (n,) the angle around each vertex in quarter turns, rounded; sides: (m, 3) of triangles in the plane."""
    angles = signed_angles(sides)
    sums = np.bincount(mesh.faces.ravel(), angles.ravel(), len(mesh.vertices))
    return np.rint(sums / (np.pi / 2)).astype(np.int64)


def side_angles(
    mesh: TriangleMesh, corners: IntArray, points: ComplexArray, component: IntArray
) -> tuple[BoolArray, FloatArray]:
    """Return (c,) whether the boundary of each component is made of sides at right angles, and where these point.

    component: (u,) that of each point.
    """
    border = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
    one = corners[:, NEXT].ravel()[border]
    vector = points[corners[:, PREVIOUS].ravel()[border]] - points[one]
    count, label = int(component.max(initial=-1)) + 1, component[one]
    fourth = np.abs(vector) * (vector / np.abs(vector)) ** 4
    sums = np.bincount(label, fourth.real, count) + 1j * np.bincount(label, fourth.imag, count)
    angles: FloatArray = np.angle(sums) / 4
    off = np.zeros(count)
    beside = np.angle((vector * np.exp(-1j * angles[label])) ** 4) / 4
    np.maximum.at(off, label, np.abs(beside))
    is_straight = (np.bincount(label, minlength=count) > 0) & (off <= QUARTER)
    return is_straight, angles


def find_sides(mesh: TriangleMesh, corners: IntArray, points: ComplexArray, is_straight: BoolArray) -> Sides:
    """Return the sides of a layout whose straight ones, at (u,) points of components, lie along the axes."""
    border = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
    starts, ends = corners[:, NEXT].ravel()[border], corners[:, PREVIOUS].ravel()[border]
    kept = is_straight[starts]
    border, starts, ends = border[kept], starts[kept], ends[kept]
    if not len(border):
        return Sides()
    quarter = np.rint(np.angle(points[ends] - points[starts]) / (np.pi / 2)).astype(np.int64) % 4
    leaving = np.full(len(points), -1)
    leaving[starts] = np.arange(len(border))
    after = leaving[ends]
    goes_on = (after >= 0) & (quarter[after] == quarter)
    count, side = label_components(len(border), np.flatnonzero(goes_on), after[goes_on])
    axis = np.zeros(count, dtype=np.int64)
    axis[side] = 1 - quarter % 2
    both = np.unique(np.stack([np.concatenate([starts, ends]), np.tile(side, 2)], axis=1), axis=0)
    z = points[corners]
    quarters = quarters_around(mesh, z[:, PREVIOUS] - z[:, NEXT])
    at = np.unique(np.concatenate([mesh.tails[border], mesh.heads[border]]))
    return Sides(at[quarters[at] != 2], both[:, 0], both[:, 1], axis)
