"""Holes that are filled while cones and metric are computed, so that no seam is needed to reach them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..geometry import angle_defect, corner_angles, double_areas, signed_angles
from ..geometry.filling import filled
from ..geometry.operators import vertex_areas
from ..mesh.connectivity import TriangleMesh
from ..mesh.holes import find_holes
from ..stages import ConeSpec, FlatMetric, MetricSpec

# Largest curvature of a filled hole, radians: half of that of the end of a tube, which is opened.
MAX_MISSING = np.pi


@dataclass(frozen=True, eq=False)
class Fill:
    """A connected mesh with n vertices and m faces whose holes are filled.

    In a flat metric without cones in the fill, the border of a hole is that of a flat disk: it turns by a full turn
    and closes up. So does the layout of the mesh around the hole, without a seam.

    Attributes:
        mesh: the filled mesh; its first n vertices and m faces are those of the mesh.
        lengths: (m + f, 3) its side lengths, with which every triangle has area.
        holes: for each hole its half-edges in the mesh in order.
        material: (n + k,) fraction of the area around each vertex of the filled mesh that is not filled.
    """

    mesh: TriangleMesh
    lengths: FloatArray
    holes: list[IntArray]
    material: FloatArray

    @classmethod
    def of(cls, mesh: TriangleMesh, lengths: FloatArray, is_open: BoolArray | None = None) -> Fill | None:
        """Return the filled mesh, or None without holes to fill.

        Holes whose missing surface must have too much curvature are not filled.

        Args:
            mesh, lengths: a connected mesh and its (m, 3) side lengths.
            is_open: (n,) vertices, such as those of marked seams, whose holes are not filled; None for none.
        """
        # A mesh with a positive Euler characteristic has at most one boundary loop.
        holes = find_holes(mesh, lengths) if mesh.euler_characteristic <= 0 else []
        if is_open is not None:
            holes = [hole for hole in holes if not is_open[mesh.tails[hole]].any()]
        if holes:
            curvature = angle_defect(mesh.faces, corner_angles(lengths), mesh.is_boundary_vertex)
            missing = [curvature[mesh.tails[hole]].sum() + 2 * np.pi for hole in holes]
            holes = [hole for hole, total in zip(holes, missing, strict=True) if abs(total) <= MAX_MISSING]
        if not holes:
            return None
        filled_mesh, filled_lengths = filled(mesh, lengths, [mesh.tails[hole] for hole in holes])
        count, faces = len(filled_mesh.vertices), filled_mesh.faces
        areas, with_fill = (
            vertex_areas(faces[:number], filled_lengths[:number], count)
            for number in (len(mesh.faces), len(faces))
        )
        return cls(filled_mesh, filled_lengths, holes, areas / with_fill)

    def specifications(self, cones: ConeSpec, metric: MetricSpec) -> tuple[ConeSpec, MetricSpec]:
        """Return the specifications for the filled mesh: no cone is in a hole, and only the mesh itself has weight."""
        n, added = len(cones.names), len(self.material) - len(cones.names)
        on_border, is_allowed = self.mesh.is_boundary_vertex, cones.is_allowed.copy()
        for hole in self.holes:
            is_allowed[self.mesh.tails[hole]] = False
        weights = np.ones(n) if cones.weights is None else cones.weights
        names = np.pad(cones.names, (0, added), mode="edge")
        return (
            replace(
                cones,
                is_allowed=np.pad(is_allowed, (0, added)),
                weights=np.pad(weights, (0, added)) * self.material,
                absorbs_curvature=np.pad(cones.absorbs_curvature, (0, added)) & on_border,
                names=names,
            ),
            replace(metric, keeps_length=np.pad(metric.keeps_length, (0, added)) & on_border, names=names),
        )

    def removed_from(
        self, metric: FlatMetric, mesh: TriangleMesh, lengths: FloatArray, keeps_area: bool
    ) -> FlatMetric:
        """Return the metric of the mesh that is part of a flat metric of the filled mesh.

        Args:
            metric: the metric.
            mesh, lengths: the mesh, and (m, 3) its side lengths.
            keeps_area: the result has the area of the mesh.
        """
        n = len(mesh.vertices)
        triangles = None if metric.triangles is None else metric.triangles.first(len(mesh.faces))
        flat_lengths = None if metric.flat_lengths is None else metric.flat_lengths[: len(mesh.faces)]
        if triangles is None:
            assert flat_lengths is not None
            angles, areas = corner_angles(flat_lengths), double_areas(flat_lengths)
        else:
            sides = triangles.sides.reshape(-1, 3)
            angles, areas = signed_angles(sides), np.abs((np.conj(sides[:, 0]) * sides[:, 1]).imag)
        area = metric.scale**2 * areas.sum()
        factor = float(np.sqrt(double_areas(lengths).sum() / area)) if keeps_area else 1.0
        curvature = angle_defect(mesh.faces, angles, mesh.is_boundary_vertex)
        on_hole = mesh.is_boundary_vertex & ~self.mesh.is_boundary_vertex[:n]
        return replace(
            metric,
            mesh=mesh,
            lengths=lengths,
            target=np.where(on_hole, curvature, metric.target[:n]),
            log_scale=metric.log_scale[:n],
            is_open=metric.is_open[:n] | on_hole,
            is_fixed=metric.is_fixed[:n],
            triangles=triangles,
            flat_lengths=flat_lengths,
        ).scaled(factor)
