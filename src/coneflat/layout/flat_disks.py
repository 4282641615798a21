"""Layouts of many small flat disks, with holes or without, all at once: they are unfolded, and nothing is distorted.

For leaf cards and single triangles, the stages called for one component after the other take far longer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..geometry.intrinsic import intrinsic_triangulation
from ..geometry.operators import angle_defect
from ..geometry.overlap import has_overlaps
from ..geometry.planar import layout_curvature, sides_between
from ..geometry.straight import FlatTriangles, straight_triangles
from ..geometry.triangles import corner_angles
from ..geometry.unfolding import unfold_from
from ..mesh.connectivity import TriangleMesh, joined_meshes
from ..optimise.untangling import find_degenerate
from ..stages import Layout, SolveStatistics


@dataclass(frozen=True)
class Flatness:
    """What counts as flat.

    Attributes:
        curvature: largest curvature inside, radians.
        gap: largest difference of the sides of an unfolded triangle from its lengths, relative to the longest.
    """

    curvature: float
    gap: float


#: Flat up to the accuracy to which the exact metric is computed. The gap is more than rounding, and less than what
#: remains open around a hole.
EXACTLY_FLAT = Flatness(1e-10, 1e-9)
#: Flat up to the rounding of a file with six digits.
NEARLY_FLAT = Flatness(1e-5, 1e-4)
_NONE, _NO_PAIRS = np.empty(0, dtype=np.int64), np.empty((0, 2), dtype=np.int64)


def lay_out_flat_disks(
    meshes: Sequence[TriangleMesh],
    lengths: Sequence[FloatArray],
    fixed: Sequence[BoolArray],
    flatness: Flatness = EXACTLY_FLAT,
) -> list[Layout | None]:
    """Return the isometric layout of each mesh; None for those that are not flat disks, or would overlap themselves.

    Disks may have holes around which the layout closes up.

    Args:
        meshes: connected meshes.
        lengths: for each mesh (m, 3) its side lengths.
        fixed: for each mesh (n,) boundary vertices that must not move.
        flatness: what counts as flat.
    """
    if not meshes:
        return []
    first, starts = (np.cumsum([0, *map(len, arrays)]) for arrays in (fixed, lengths))
    mesh, sides = joined_meshes(meshes), np.concatenate(lengths)
    flat = straight_triangles(intrinsic_triangulation(mesh, sides), _NONE)
    is_flat = _are_flat_disks(mesh, sides, flat, first, starts, flatness)
    points = unfold_from(flat, mesh.faces, starts[:-1])
    gaps = np.abs(np.abs(sides_between(points[mesh.faces])) - sides).max(axis=1)
    gaps = gaps > flatness.gap * sides.max(axis=1)
    is_flat &= np.bincount(np.arange(len(meshes)).repeat(np.diff(starts)), gaps, len(meshes)) == 0
    is_flat &= ~has_overlaps(points[mesh.faces], starts)
    curvature = layout_curvature(mesh, points[mesh.faces])
    target = np.where(mesh.is_boundary_vertex, curvature, 0.0)
    zeros, chart = np.zeros(first[-1]), np.zeros(starts[-1], dtype=np.int64)
    statistics = SolveStatistics(qc_mean_unrelaxed=1.0, qc_max_unrelaxed=1.0)
    layouts = list[Layout | None]()
    ranges = zip(first.tolist(), first[1:].tolist(), strict=False)
    for i, (begin, end) in enumerate(ranges):
        if not is_flat[i]:
            layouts.append(None)
            continue
        at, component = slice(begin, end), meshes[i]
        layouts.append(
            Layout(
                mesh=component,
                lengths=lengths[i],
                points=points[at],
                corners=component.faces,
                chart=chart[: len(component.faces)],
                cones=_NONE,
                seams=_NO_PAIRS,
                log_scale=zeros[at],
                target=target[at],
                curvature=curvature[at],
                is_open=mesh.is_boundary_vertex[at],
                is_fixed=fixed[i],
                statistics=statistics,
                disk=component,
            )
        )
    return layouts


def is_flat_inside(mesh: TriangleMesh, lengths: FloatArray, flatness: Flatness = EXACTLY_FLAT) -> bool:
    """Return whether a mesh with (m, 3) side lengths has a boundary and no curvature inside."""
    return bool(mesh.is_boundary_vertex.any()) and not _are_curved(mesh, lengths, flatness).any()


def _are_curved(mesh: TriangleMesh, lengths: FloatArray, flatness: Flatness) -> BoolArray:
    """Return (n,) whether a vertex inside a mesh with (m, 3) side lengths has curvature."""
    defect = angle_defect(mesh.faces, corner_angles(lengths), mesh.is_boundary_vertex)
    return ~mesh.is_boundary_vertex & ~(np.abs(defect) <= flatness.curvature)


def _are_flat_disks(
    mesh: TriangleMesh,
    lengths: FloatArray,
    flat: FlatTriangles,
    first: IntArray,
    starts: IntArray,
    flatness: Flatness,
) -> BoolArray:
    """Return (k,) whether each component is a disk without curvature inside and without degenerate triangles.

    It may have holes.

    Args:
        mesh: the union of k components.
        lengths, flat: the side lengths of its triangles, and the triangles in the plane.
        first, starts: (k + 1,) the first vertex and the first triangle of each component.
        flatness: what counts as flat.
    """
    count = len(first) - 1
    of_vertex, of_face = np.arange(count).repeat(np.diff(first)), np.arange(count).repeat(np.diff(starts))
    of_edge = of_vertex[mesh.edges[:, 0]]
    loops, loop = mesh.boundary_loops
    of_loop = np.zeros(loops, dtype=np.int64)
    of_loop[loop[mesh.is_boundary_vertex]] = of_vertex[mesh.is_boundary_vertex]
    euler = np.diff(first) - np.bincount(of_edge, minlength=count) + np.diff(starts)
    loops_of = np.bincount(of_loop, minlength=count)
    is_disk = (euler == 2 - loops_of) & (loops_of > 0)
    is_curved = _are_curved(mesh, lengths, flatness)
    is_bad = find_degenerate(flat.sides.reshape(-1, 3))
    unfit = np.bincount(of_vertex[is_curved], minlength=count) + np.bincount(of_face[is_bad], minlength=count)
    return is_disk & (unfit == 0)
