"""Bounds on the distortion of layouts, and which of two layouts of a component is the better one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from .base.arrays import FloatArray, rows_of
from .base.notes import Unmet
from .cones import uses_sparse_search
from .geometry.operators import area_distortion
from .geometry.planar import mean_energy
from .measures import mean_qc
from .measures.guarantees import EXTREME_QC
from .options import Options
from .source.components import Component
from .stages import Layout

# A layout may exceed the allowed area distortion by this factor.
TOLERATED_EXCESS = 1.02
# Length of seams, relative to the square root of the area, that is worth as much as one unit of the mean symmetric
# Dirichlet energy. A cube opens at its eight corners (2.86) instead of five cones (1.93) with an energy that is 0.3
# higher; a sheet of 5 x 5 vertices stays closed where its nine (2.5) would lower the energy by 0.03.
SEAMS_PER_ENERGY = 20.0
# The mean symmetric Dirichlet energy of an isometry.
ISOMETRIC = 4.0


def rank(components: Sequence[Component], layouts: Sequence[Layout]) -> tuple[int, float, float]:
    """Return the rank of layouts of a component, uncut or cut into pieces; of two, the smaller is better.

    Fewer notes are better, then a smaller excess over the allowed area distortion, and within that bound a smaller sum
    of seams and distortion.
    """
    notes = sum(len(layout.notes) for layout in layouts)
    return (
        notes,
        max(excess(components, layouts), TOLERATED_EXCESS),
        borders_and_distortion(components, layouts),
    )


def is_too_distorted(component: Component, layout: Layout) -> bool:
    """Return whether a layout has too much area or angle distortion, where only a bound is requested."""
    if not is_bounded(component):
        return False
    return excess([component], [layout]) > TOLERATED_EXCESS or mean_qc(layout) > EXTREME_QC


def excess(components: Sequence[Component], layouts: Sequence[Layout]) -> float:
    """Return the area distortion of the triangles of all layouts, divided by the one allowed; 0 without a bound."""
    bounded = [
        (component, layout)
        for component, layout in zip(components, layouts, strict=True)
        if is_bounded(component)
    ]
    if not bounded:
        return 0.0
    areas = np.concatenate([component.double_areas for component, _ in bounded])
    flat = np.concatenate([layout.flat_double_areas for _, layout in bounded])
    chosen = (areas > 0) & (flat > 0)
    log_scale = np.log(flat[chosen] / areas[chosen]) / 2
    return area_distortion(log_scale, areas[chosen]) / components[0].cones.distortion


def is_bounded(component: Component) -> bool:
    """Return whether the area distortion of a component's layout is bounded by the options."""
    cones = component.cones
    is_free = cones.count is None and cones.weights is None and cones.quantum is None
    return component.is_exact and is_free and uses_sparse_search(component.mesh, cones)


def borders_and_distortion(components: Sequence[Component], layouts: Sequence[Layout]) -> float:
    """Return the length of all borders and seams, relative to the square root of the area, and a cost of distortion.

    A seam counts once, the two borders of components that it separates half each.
    """
    area = sum(layout.area for layout in layouts)
    length = sum(
        seam_length(layout) + border_length(component) / 2
        for component, layout in zip(components, layouts, strict=True)
    )
    return float(length / np.sqrt(area)) + distortion_cost(layouts)


def distortion_cost(layouts: Sequence[Layout]) -> float:
    """Return the length of seams, relative to the square root of the area, that the distortion of layouts is worth."""
    areas = [layout.area for layout in layouts]
    energies = [mean_energy(layout.lengths, rows_of(layout.points, layout.corners)) for layout in layouts]
    return float(SEAMS_PER_ENERGY * (np.average(energies, weights=areas) - ISOMETRIC))


def seam_length(layout: Layout) -> float:
    """Return the length of the seams of a layout on the surface, model units."""
    ends: FloatArray = layout.mesh.vertices[layout.seams]
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())


def border_length(component: Component) -> float:
    """Return the length of the border of a component on the surface, model units."""
    sides = component.mesh.edge_halfedges[component.mesh.is_boundary_edge, 0]
    return float(component.lengths.ravel()[sides].sum())


def bound_notes(
    components: Sequence[Component], layouts: Sequence[Layout], options: Options
) -> Iterator[Unmet]:
    """Yield a note if the area distortion of a component, or of all of them together, is above the one allowed."""
    pairs = zip(components, layouts, strict=True)
    curved = [(component, layout) for component, layout in pairs if layout.statistics.area_distortion > 0]
    alone = max((excess([component], [layout]) for component, layout in curved), default=0.0)
    together = excess(components, layouts)
    if (beyond := max(alone, together)) > TOLERATED_EXCESS:
        reached = beyond * options.distortion
        advice = f"allow {np.ceil(100 * reached) / 100:g}"
        if options.max_cones is not None:
            advice += ", or more cones"
        yield Unmet(
            f"The triangles of {'a component' if alone == beyond else 'all components'} have an area distortion of "
            f"{reached:.3g}, above the {options.distortion:g} allowed, and none with less was found: {advice}."
        )
