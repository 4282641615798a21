"""Methods that map the cut mesh directly: their metric, and least squares conformal maps, which prescribe no cones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csr_matrix

from coneflat import TriangleMesh
from coneflat.base import FloatArray, plural
from coneflat.errors import MetricError
from coneflat.geometry import double_areas, rest_sides
from coneflat.layout import far_pins, pinned_least_squares
from coneflat.stages import ConeSolution, Cut, Embedding, FlatMetric


def least_squares_map(mesh: TriangleMesh, lengths: FloatArray, solution: ConeSolution) -> FlatMetric:
    """Return the LSCM of a mesh, cut open through its cones, which it does not prescribe.

    Args:
        mesh: a connected mesh.
        lengths: (m, 3) side lengths, model units.
        solution: the cones, which only determine the cut.
    """

    def embed(cut: Cut) -> Embedding:
        note = (
            "The mesh was cut open first, and LSCM mapped the disk: it prescribes no cones, and the sides of seams do "
            "not match."
        )
        return Embedding(least_squares_conformal(cut.mesh, lengths), notes=(note,) if len(cut.seams) else ())

    return embedding_metric(mesh, lengths, solution, embed, has_target_cones=False)


def least_squares_conformal(disk: TriangleMesh, lengths: FloatArray) -> FloatArray:
    """Return (n, 2) the least squares conformal map (LSCM) of a disk, with two distant vertices pinned.

    It minimises the energy of Eq. 4 and 5 of the paper (Levy et al. 2002). Triangles may be flipped. The pins affect
    not only position and size, but also the variation of scale.

    Args:
        disk: a topological disk.
        lengths: (m, 3) side lengths; every triangle has area.

    Raises:
        MetricError: the solution is not finite.
    """
    z = pinned_least_squares(conformal_equations(disk, lengths), far_pins(disk, lengths))
    if not np.isfinite(z).all():
        raise MetricError(f"the least squares conformal map of {len(disk.faces):,} triangles is not finite")
    return np.stack([z.real, z.imag], axis=1)


def conformal_equations(mesh: TriangleMesh, lengths: FloatArray) -> csr_matrix:
    """Return the complex (m, n) matrix C with C z = 0 for maps z to the plane that are similarities on all triangles.

    |C z|^2 is the least squares energy of Levy et al. 2002 (Eq. 4): the rows are the sides opposite the corners, as
    complex numbers in a frame of the triangle, divided by the square root of its area. It is scaled to equal z^H L_C z,
    twice the Dirichlet energy minus the area (Mullen et al. 2008, Section 2.2).

    Args:
        mesh: the mesh.
        lengths: (m, 3) side lengths; every triangle has area.

    Raises:
        MetricError: a triangle has no area.
    """
    areas = double_areas(lengths)
    if not (areas > 0).all():
        raise MetricError(
            f"{int((~(areas > 0)).sum())} of {plural(len(areas), 'triangle')} without area have no conformal energy"
        )
    sides = rest_sides(lengths) / np.sqrt(2 * areas)[:, None]
    rows = np.repeat(np.arange(len(sides)), 3)
    return csr_matrix((sides.ravel(), (rows, mesh.faces.ravel())), shape=(len(sides), len(mesh.vertices)))


def embedding_metric(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    embed: Callable[[Cut], Embedding],
    has_target_cones: bool = True,
) -> FlatMetric:
    """Return the metric object of a method that maps the cut mesh directly; its boundary is free.

    Args:
        mesh: a connected mesh.
        lengths: (m, 3) side lengths.
        solution: the cones and their curvatures.
        embed: maps the cut mesh.
        has_target_cones: whether the method prescribes the cones' curvatures.
    """
    return FlatMetric(
        mesh=mesh,
        lengths=lengths,
        cones=solution.cones,
        target=solution.target,
        log_scale=solution.log_scale,
        is_open=mesh.is_boundary_vertex,
        is_fixed=np.zeros(len(mesh.vertices), dtype=bool),
        embed=embed,
        has_target_cones=has_target_cones,
    )
