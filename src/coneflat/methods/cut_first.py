"""Maps of a disk that prescribe no cones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from .._arrays import FloatArray, IntArray
from ..cones import ConeSolution
from ..mesh import TriangleMesh
from .base import LaidOut
from .measured import laid_out_at

Place: TypeAlias = Callable[[TriangleMesh, FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class CutFirst:
    """A map of the mesh, cut open, that takes no notice of what was cut and of what cones should have.

    Attributes:
        name: the method's.
        place: returns (c, 2) points of a disk, at any scale, given its (m, 3) side lengths.
        mesh: the mesh.
        lengths: (m, 3) side lengths, model units.
        solution: the cones, through which the mesh is cut.
    """

    name: str
    place: Place
    mesh: TriangleMesh
    lengths: FloatArray
    solution: ConeSolution

    def lay_out(self, disk: TriangleMesh, seams: IntArray) -> LaidOut:
        """Map the disk, and say so if the mesh is none by itself."""
        notes: tuple[str, ...] = ()
        if len(seams):
            notes = (
                f"The mesh was cut open first, and {self.name} mapped the disk: it prescribes no cones, and the sides "
                "of seams come out as they may.",
            )
        points = self.place(disk, self.lengths)
        return laid_out_at(points, self.mesh, disk, seams, self.lengths, self.solution, notes=notes)


def map_cut_mesh(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    best_effort: bool,
    name: str,
    place: Place,
) -> CutFirst:
    """Return the map of a mesh, cut open through its cones, by a method that prescribes none.

    Args:
        mesh: connected.
        lengths: (m, 3) side lengths, model units.
        solution: the cones, which decide where the mesh is cut and no more.
        best_effort: of no meaning here: what is not found is nothing.
        name, place: of the method, see `CutFirst`.
    """
    return CutFirst(name, place, mesh, lengths, solution)
