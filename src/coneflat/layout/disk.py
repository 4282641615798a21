"""A connected mesh cut open to a disk."""

from __future__ import annotations

from concurrent.futures import Future
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from .._arrays import IntArray
from ..cones import ConeSolution
from ..input.components import Component, seam_costs
from ..mesh import TriangleMesh
from ..options import Options
from ..seams import cut_open, find_seams
from ..threads import meanwhile

# A log scale that varies by less is constant.
FLAT = 1e-9


@dataclass(frozen=True, eq=False)
class Disk:
    """A disk.

    Attributes:
        mesh: the mesh, cut open.
        seams: (k,) the edges along which it was cut.
    """

    mesh: TriangleMesh
    seams: IntArray


def cutting(
    part: Component, solution: ConeSolution, options: Options
) -> AbstractContextManager[Future[Disk]]:
    """Return a context in which a component is being cut on another thread: the cut depends on the cones alone."""
    return meanwhile(partial(cut_to_disk, part, solution, options), len(part.faces))


def cut_to_disk(part: Component, solution: ConeSolution, options: Options) -> Disk:
    """Return a component cut open to a disk with the cones on its border (Section 4.2 of the paper)."""
    # What unfolds without distortion is a polyhedron, and opens along its edges.
    is_polyhedron = np.ptp(solution.log_scale) < FLAT
    options = replace(options, creases=1.0) if is_polyhedron and not options.creases else options
    costs, avoided, forbidden = seam_costs(part, options)
    seams = find_seams(part.mesh, solution.cones, costs, avoided, forbidden=np.flatnonzero(forbidden))
    return Disk(cut_open(part.mesh, seams).mesh, seams)
