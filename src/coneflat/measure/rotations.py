"""By how much the sides of seams are turned against each other, beside whole multiples of an angle."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..base.arrays import BoolArray, ComplexArray, FloatArray
from ..geometry.handles import handle_loops, off_multiple
from ..geometry.planar import sides_between
from ..mesh.connectivity import TriangleMesh


@dataclass(frozen=True)
class Rotations:
    """How far rotations are from multiples of a quantum, radians.

    Attributes:
        quantum: the angle.
        worst: the largest deviation of a seam edge's rotation.
        handles: the deviation of the rotation along each generator of the handles, two for each.
    """

    quantum: float
    worst: float
    handles: tuple[float, ...]

    @classmethod
    def of_all(cls, parts: Iterable[Rotations | None]) -> Rotations | None:
        """Return those of components together; None if there are none."""
        known = [part for part in parts if part is not None]
        if not known:
            return None
        handles = tuple(angle for part in known for angle in part.handles)
        return cls(known[0].quantum, max(part.worst for part in known), handles)

    def binds(self, off: FloatArray) -> BoolArray:
        """Return which edges with these deviations are held; seams that were marked, or join components, are not."""
        return np.asarray(off <= self.worst * (1 + 1e-6) + 1e-12)


def measure_rotations(mesh: TriangleMesh, corner_uv: FloatArray, quantum: float) -> Rotations:
    """Return the rotations of a layout of a connected mesh; `corner_uv` is (m, 3, 2)."""
    pairs = mesh.edge_halfedges[~mesh.is_boundary_edge]
    turns = _turns(mesh, corner_uv)
    across = np.zeros(mesh.faces.size)
    across[pairs[:, 0]], across[pairs[:, 1]] = turns, -turns
    off = np.abs(off_multiple(turns, quantum))
    handles = off_multiple(np.array([across[loop].sum() for loop in handle_loops(mesh)]), quantum)
    return Rotations(quantum, float(off.max(initial=0.0)), tuple(handles.tolist()))


def seam_rotations(mesh: TriangleMesh, corner_uv: FloatArray, quantum: float) -> FloatArray:
    """Return (k,) by how much the rotation across each inner edge misses a multiple of a quantum, radians."""
    return np.abs(off_multiple(_turns(mesh, corner_uv), quantum))


def ratios_across(mesh: TriangleMesh, corner_uv: FloatArray) -> ComplexArray:
    """Return (k,) the second side of each inner edge over the first, as complex numbers: how it is turned and scaled.

    Not finite where the first has no length.
    """
    sides = sides_between(corner_uv).ravel()
    pairs = mesh.edge_halfedges[~mesh.is_boundary_edge]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios: ComplexArray = -sides[pairs[:, 1]] / sides[pairs[:, 0]]
    return ratios


def _turns(mesh: TriangleMesh, corner_uv: FloatArray) -> FloatArray:
    """Return the rotation between the two sides of each inner edge, radians; 0 where a side has no length."""
    turns: FloatArray = np.angle(ratios_across(mesh, corner_uv))
    return np.where(np.isfinite(turns), turns, 0.0)
