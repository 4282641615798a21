"""A connected mesh cut open to a disk."""

from __future__ import annotations

from concurrent.futures import Future
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from ..cones import ConeSolution
from ..errors import MetricError, SeamError
from ..geometry.graph import edges_beside
from ..input.components import Component, seam_costs
from ..input.symmetry import Symmetry
from ..mesh import TriangleMesh
from ..options import Options
from ..seams import cut_open, detail_factors, find_seams, mirrored_seams
from ..threads import HUGE, meanwhile

# A log scale that varies by less is constant.
FLAT = 1e-9
# How much longer than others symmetric seams may be, unless they were asked for.
LONGER = 1.15


@dataclass(frozen=True, eq=False)
class Disk:
    """A disk.

    Attributes:
        mesh: the mesh, cut open.
        seams: (k,) the edges along which it was cut.
        is_symmetric: whether they are mirror symmetric.
    """

    mesh: TriangleMesh
    seams: IntArray
    is_symmetric: bool = False

    def get_ready(self, options: Options) -> None:
        """Find what charts will need of it, unless it is huge: while it is laid out, which takes the faces alone."""
        if options.method == "exact" and options.charts == "atlas" and len(self.mesh.faces) <= HUGE:
            _ = self.mesh.is_boundary_vertex
            edges_beside(self.mesh)


def cutting(
    part: Component, solution: ConeSolution, options: Options, symmetry: Symmetry | None = None
) -> AbstractContextManager[Future[Disk]]:
    """Return a context in which a component is being cut on another thread: the cut depends on the cones alone."""
    return meanwhile(partial(cut_to_disk, part, solution, options, symmetry), len(part.faces))


def cut_to_disk(
    part: Component, solution: ConeSolution, options: Options, symmetry: Symmetry | None = None
) -> Disk:
    """Return a component cut open to a disk with the cones on its border (Section 4.2 of the paper).

    With a symmetry of mesh and cones, the cut is symmetric, too, unless one that is not is much shorter.
    """
    # What unfolds without distortion is a polyhedron, and opens along its edges.
    is_polyhedron = np.ptp(solution.log_scale) < FLAT
    options = replace(options, creases=1.0) if is_polyhedron and not options.creases else options
    costs, avoided, forbidden = seam_costs(part, options)
    given = part.mesh, solution.cones, costs, avoided, np.flatnonzero(forbidden)
    mirrored = (
        None if symmetry is None else _mirrored(symmetry, part, solution.cones, costs, avoided, forbidden)
    )
    if mirrored is not None and symmetry is not None and symmetry.is_named:
        return mirrored
    seams = find_seams(*given[:-1], forbidden=given[-1])
    if mirrored is not None and costs[mirrored.seams].sum() <= LONGER * costs[seams].sum():
        return mirrored
    # What needs no seams has none that are not symmetric.
    return Disk(cut_open(part.mesh, seams).mesh, seams, symmetry is not None and not len(seams))


def _mirrored(
    symmetry: Symmetry,
    part: Component,
    cones: IntArray,
    costs: FloatArray,
    avoided: BoolArray,
    forbidden: BoolArray,
) -> Disk | None:
    """Return a mesh cut open symmetrically, None if it cannot be."""
    if symmetry.is_left is None:
        return None
    mesh, barred = part.mesh, np.flatnonzero(forbidden)
    on_plane = symmetry.on_plane[mesh.edges].all(axis=1)
    costs = np.where(on_plane, costs * detail_factors(mesh, part.lengths), costs)
    try:
        seams = mirrored_seams(mesh, symmetry.mirror, symmetry.is_left, cones, costs, avoided, barred)
        if seams is None:
            return None
        opened = cut_open(mesh, seams)
    except (SeamError, MetricError):
        return None
    return Disk(opened.mesh, seams, True) if opened.pieces == 1 else None
