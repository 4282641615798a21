"""Removal of inverted triangles that cannot be flipped while both sides of the seams stay equal."""

from __future__ import annotations

import numpy as np

from ..base.arrays import mask_of
from ..base.notes import Unmet
from ..base.progress import stage
from ..base.text import list_some, plural
from ..geometry.planar import sides_between
from ..mesh.connectivity import TriangleMesh
from ..stages import ConeSpec, Layout
from .energies import StretchEnergy
from .free_seams import untangled_disk
from .relaxed_layouts import LayoutGroup
from .relaxing import relax
from .untangling import find_degenerate


@stage("relax")
def untangle_seams(layout: Layout, spec: ConeSpec, stretch: float, quantum: float | None) -> Layout:
    """Return a layout whose inverted triangles are positively oriented, while seams near them may become unequal.

    Points move in the plane, those on the two sides of a seam independently, and are relaxed there. The lengths of the
    sides and the angles around their vertices, including cones, may change. If triangles stay inverted, the chart is
    embedded again as a disk and relaxed. Vertices of a prescribed boundary do not move. Layouts whose seams rotate by
    multiples of a quantum are returned unchanged.

    Args:
        layout: a layout in one chart.
        spec: the weights and the names of the vertices.
        stretch: balance of the relaxation between angles, 0, and areas, 1.
        quantum: angle in radians of whose multiples the seam rotations are, in which case the layout is not changed;
            None for any rotation.

    Returns:
        The layout, with a note if triangles were flipped.

    See Also:
        untangled_disk: which moves the points.
    """
    sides = sides_between(layout.points[layout.corners])
    was_bad = find_degenerate(sides)
    if quantum is not None or not was_bad.any():
        return layout
    disk = TriangleMesh(np.zeros((len(layout.points), 3)), layout.corners)
    vertex = np.empty(len(layout.points), dtype=np.int64)
    vertex[layout.corners] = layout.mesh.faces
    points, is_free, is_embedded = untangled_disk(
        disk, layout.points, layout.lengths, layout.is_fixed[vertex]
    )
    caveat = "no seam or cone is exact" if is_embedded else "the sides of seams near them are unequal"
    if not is_free.any():
        return layout
    group = LayoutGroup([layout], [spec.weights])
    points = relax(
        disk,
        points,
        disk.faces,
        StretchEnergy(stretch),
        lengths=group.lengths_as_laid_out,
        weights=group.weights,
        free=is_free,
    ).points
    was_free = mask_of(len(layout.mesh.vertices), vertex[is_free])
    untangled = group.updated(points, was_free)[0]
    flipped = np.flatnonzero(was_bad & ~find_degenerate(sides_between(points[disk.faces])))
    if not len(flipped):
        return layout
    where = list_some(f"vertex {name}" for name in np.unique(spec.names[layout.mesh.faces[flipped, 0]]))
    note = (
        f"{plural(len(flipped), 'triangle')} could not be untangled with matching seams, next to "
        f"{where}: they are positively oriented, but {caveat}."
    )
    return untangled.with_notes(Unmet(note))
