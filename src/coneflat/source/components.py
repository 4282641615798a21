"""The checked input, split into connected components with the specifications of their stages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import FloatArray, IntArray, mask_of
from ..geometry.opening import with_slack
from ..mesh.check import CheckedMesh
from ..mesh.connectivity import TriangleMesh
from ..stages import ConeSpec, FlatMetric, MetricSpec, SeamSpec
from .fill import Fill
from .input_mesh import InputMesh


@dataclass(frozen=True, eq=False)
class Component:
    """A connected part of the input with n vertices and m faces, and the specifications of its stages.

    Attributes:
        mesh: the mesh.
        vertices, faces: (n,), (m,) indices in the whole mesh; a vertex on a marked seam may occur several times.
        lengths: (m, 3) side lengths, with which every triangle has area.
        double_areas: (m,) twice the areas of the triangles before any were opened.
        cones, metric, seams: specifications.
        fill: the mesh with filled holes; None if there are none, or if they must be opened.
        keeps_holes: no seam has to reach the holes: the curvature along their borders is that of the filled mesh.
    """

    mesh: TriangleMesh
    vertices: IntArray
    faces: IntArray
    lengths: FloatArray
    double_areas: FloatArray
    cones: ConeSpec
    metric: MetricSpec
    seams: SeamSpec
    fill: Fill | None = None
    keeps_holes: bool = False

    @property
    def is_exact(self) -> bool:
        """Whether the metric is exact: its computation flips edges of an intrinsic triangulation."""
        return self.metric.method == "exact"

    @property
    def location(self) -> str:
        """The vertex and the number of triangles by which messages name the component."""
        return f"in the component of vertex {self.cones.names[0]} ({len(self.faces):,} triangles)"

    @property
    def kept_holes(self) -> list[IntArray]:
        """For each hole that no seam has to reach its half-edges in order."""
        return self.fill.holes if self.fill is not None and self.keeps_holes else []

    @property
    def filled(self) -> Component:
        """The component for which cones and metric are computed: with filled holes if they are kept."""
        if self.fill is None or not self.keeps_holes:
            return self
        cones, metric = self.fill.specifications(self.cones, self.metric)
        return replace(self, mesh=self.fill.mesh, lengths=self.fill.lengths, cones=cones, metric=metric)

    def without_fill(self, metric: FlatMetric) -> FlatMetric:
        """Return the metric of the component that is part of a metric of `filled`."""
        if self.fill is None or not self.keeps_holes:
            return metric
        return self.fill.removed_from(metric, self.mesh, self.lengths, self.metric.keeps_area)

    def with_kept_holes(self) -> Component:
        """Return the component with its holes kept, where they can be."""
        return self if self.fill is None else replace(self, keeps_holes=True)

    def with_opened_holes(self) -> Component:
        """Return the component with seams to all of its holes."""
        return replace(self, keeps_holes=False)

    def with_slack(self) -> Component:
        """Return the component with triangles that are all thicker, see `with_slack` of `geometry.opening`."""
        fill = None if self.fill is None else replace(self.fill, lengths=with_slack(self.fill.lengths))
        return replace(self, lengths=with_slack(self.lengths), fill=fill)

    def with_distortion(self, factor: float) -> Component:
        """Return the component with another bound of the area distortion, multiplied by a factor."""
        return replace(self, cones=replace(self.cones, distortion=factor * self.cones.distortion))


@dataclass(frozen=True, eq=False)
class Prepared:
    """The checked input, split into components.

    Attributes:
        input_mesh: the input.
        checked: the mesh, scaled to about unit size.
        notes: notes on opened triangles without area, on marked edges that cut nothing, and on a missing boundary.
        components: connected parts of the mesh, which marked seams also separate.
        seams: (k, 2) vertices of the edges marked as seams.
        user_lengths: (m, 3) the side lengths given by the user instead of distances between vertices, or None.
    """

    input_mesh: InputMesh
    checked: CheckedMesh
    notes: tuple[str, ...]
    components: tuple[Component, ...]
    seams: IntArray
    user_lengths: FloatArray | None

    def pieces_of(self, coarser: Prepared, chosen: Sequence[int]) -> dict[int, list[Component]]:
        """Return the components that lie in chosen components of the same input with fewer seams."""
        coarse_component = np.full(len(self.checked.mesh.faces), -1)
        for i in chosen:
            coarse_component[coarser.components[i].faces] = i
        pieces: dict[int, list[Component]] = {i: [] for i in chosen}
        for component in self.components:
            if (i := int(coarse_component[component.faces[0]])) >= 0:
                pieces[i].append(component)
        return pieces

    def with_pieces(self, finer: Prepared, pieces: Mapping[int, Sequence[Component]]) -> Prepared:
        """Return the input with some components replaced by their pieces, and with the seams between these.

        Args:
            finer: the same input with more seams.
            pieces: the pieces of components, from `pieces_of`.
        """
        is_cut = mask_of(
            len(self.checked.mesh.vertices), np.concatenate([self.components[i].vertices for i in pieces])
        )
        seams = np.concatenate([self.seams, finer.seams[is_cut[finer.seams].all(axis=1)]])
        components = [
            piece for i, component in enumerate(self.components) for piece in pieces.get(i, [component])
        ]
        return replace(self, components=tuple(components), seams=np.unique(seams, axis=0))
