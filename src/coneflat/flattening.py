"""The method: cones, flat metric, cut and layout of a connected surface (Section 4 of the paper), and what follows.

The paper is M. Ben-Chen, C. Gotsman, G. Bunin, "Conformal flattening by curvature prescription and metric scaling",
Computer Graphics Forum 27(2), 2008. `flattener.py` calls these functions for all components of a mesh, `retries.py`
calls them again where a layout can be improved.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from .atlas import separate_overlaps
from .base.arrays import FloatArray, IntArray
from .base.notes import Unmet
from .base.text import list_some, plural
from .cones import ConeSurface, find_cones
from .geometry.operators import weighted_areas
from .layout import lay_out
from .mesh.connectivity import TriangleMesh
from .metric import find_metric, loop_rotations
from .optimise import relax_layouts, untangle_seams
from .seams import cut_to_disk, seam_costs
from .source.components import Component
from .stages import ConeSolution, FlatMetric, Layout, MetricSpec, RelaxSpec, Surface

#: Returns a connected mesh with the operators of its (m, 3) lengths; the flag allows intrinsic edge flips, as the exact
#: metric does.
SurfaceOf: TypeAlias = Callable[[TriangleMesh, FloatArray, bool], ConeSurface]
#: Returns the flat metric of a connected mesh for its cones.
FindMetric: TypeAlias = Callable[[Surface, ConeSolution, MetricSpec], FlatMetric]

# Curvature error of an infeasible cone, radians. Triangles that wind around a vertex once too little miss a full turn,
# of which untangled neighbours may take a part; rounding errors are far below.
INFEASIBLE_ERROR = 1.0


@dataclass(frozen=True)
class Steps:
    """The functions and options that components share.

    Attributes:
        surface_of: returns a component with the operators of its metric; they may be cached.
        find_metric: returns the flat metric for the cones of a component.
        relax: which triangles are relaxed.
        separates: overlaps are separated into charts.
        quantum: rotations across seams are multiples of it, radians; None for any rotation.
        untangles: inverted triangles of a first layout are turned back.
        names_components: errors name the component.
        keeps_holes: holes are kept where this is better.
    """

    surface_of: SurfaceOf = ConeSurface.of
    find_metric: FindMetric = find_metric
    relax: RelaxSpec = field(default_factory=lambda: RelaxSpec("off", 0.0))
    separates: bool = False
    quantum: float | None = None
    untangles: bool = True
    names_components: bool = False
    keeps_holes: bool = True

    def surface(self, component: Component) -> ConeSurface:
        """Return a component with the operators of its metric."""
        filled = component.filled
        return self.surface_of(filled.mesh, filled.lengths, filled.is_exact)


def lay_out_component(surface: ConeSurface, component: Component, steps: Steps) -> Layout:
    """Return the layout of a component in one chart (Section 4 of the paper).

    Cones concentrate the curvature that a flat metric cannot have elsewhere. The lengths l_ij of the surface are scaled
    by the log conformal factor phi to l_ij exp((phi_i + phi_j) / 2), so that the curvature is that of the cones. The
    surface is cut along a tree through the cones, and its triangles are unfolded.

    Args:
        surface: the component with its operators, from `Steps.surface`.
        component: the component.
        steps: the functions of the stages.

    Raises:
        CurvatureError: no metric has the curvatures.
        MetricError: the computation found no finite metric or layout; `ConvergenceError` if Newton's method fails.
        SeamError: every set of seams needs forbidden edges.
    """
    # Rotations along handles can be measured only in the metric of a set of cones, so this is a function.
    filled = component.filled
    rotations = loop_rotations(surface, filled.metric) if filled.cones.quantum else None
    cones = find_cones(surface, replace(filled.cones, rotations=rotations))  # Sections 3.1 and 3.2
    metric = component.without_fill(steps.find_metric(surface, cones, filled.metric))  # 2.3
    costs = seam_costs(component.mesh, component.lengths, component.seams, cones.is_polyhedral)
    disk = cut_to_disk(component.mesh, cones.cones, costs, component.seams, component.kept_holes)  # 4.3
    layout = lay_out(metric, disk, steps.untangles)  # 4.3
    n = len(component.mesh.vertices)
    areas = weighted_areas(surface.areas, filled.cones.weights)[:n]
    return layout.with_area_distortion(cones.log_scale[:n], areas).with_notes(*cones.notes)


def relax_components(
    components: Sequence[Component], layouts: Sequence[Layout], steps: Steps
) -> Sequence[Layout]:
    """Return layouts, relaxed together by `Steps.relax`: no triangle, the most distorted ones near cones, or all."""
    weights = [component.cones.weights for component in components]
    return relax_layouts(layouts, weights, steps.relax)


def finish_component(component: Component, relaxed: Layout, steps: Steps) -> Layout:
    """Return a relaxed layout whose inverted triangles are turned back, and whose overlaps are separated into charts.

    Triangles are turned back if the metric is exact and seam rotations are not multiples of a quantum; overlaps are
    separated if `Steps.separates`. What remains is measured later, and noted.
    """
    layout = relaxed
    if component.is_exact:
        layout = untangle_seams(layout, component.cones, steps.relax.stretch, steps.quantum)
        layout = layout.with_notes(*_infeasible_notes(layout, component))
    if steps.separates:
        costs = seam_costs(component.mesh, component.lengths, component.seams)
        layout = separate_overlaps(layout, costs, component.seams)
    return layout


def infeasible_cones(layout: Layout) -> IntArray:
    """Return the infeasible cones: the triangles around them, with angles below pi, cannot form the cone angle."""
    error = (layout.target - layout.curvature)[layout.cones]
    return layout.cones[np.abs(error) > INFEASIBLE_ERROR]


def _infeasible_notes(layout: Layout, component: Component) -> Iterator[Unmet]:
    infeasible = sorted(infeasible_cones(layout), key=layout.target.item)
    if infeasible:
        angles = [
            f"vertex {component.cones.names[v]} ({2 - layout.target[v] / np.pi:.3g} pi)" for v in infeasible
        ]
        yield Unmet(
            f"{plural(len(infeasible), 'cone')} with an angle that the surrounding triangles cannot form: "
            f"{list_some(angles)}; choose others, or refine the mesh."
        )
