"""Policies: when and how a component is laid out again, each one function with its reason."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from .base.progress import stage
from .bounds import (
    TOLERATED_EXCESS,
    borders_and_distortion,
    distortion_cost,
    excess,
    is_too_distorted,
    rank,
    seam_length,
)
from .cones import MAX_POLYHEDRON_CORNERS, MAX_SEARCHED, ConeSurface, uses_sparse_search, with_corners
from .errors import ConvergenceError, CurvatureError, LengthError, MetricError, OptionError, SeamError
from .flattening import (
    Steps,
    finish_component,
    infeasible_cones,
    lay_out_component,
    relax_components,
)
from .geometry import dihedral_angles
from .geometry.opening import RISKY_AREA, thickness
from .groups import ComponentProgress, errors_of, groups_of_small
from .measures import mean_qc
from .mesh.connectivity import TriangleMesh
from .options import Options
from .seams import NO_EDGES, find_seams
from .source import Component, Prepared, Source, coarse_component, has_vertex_options, is_large
from .stages import Layout

# Largest number of cone searches for a layout.
MAX_SEARCHES = 4
# Weight of areas with which a component beyond the allowed area distortion is relaxed.
CORRECTING_STRETCH = 0.1
# How often such a component is flattened with a tighter bound of the search, and the largest factor of one tightening.
MAX_CORRECTIONS, MAX_TIGHTENING = 2, 2.0
# Dihedral angle, radians, above which edges are cut in a solid that is too distorted otherwise.
SHARP_ANGLE = np.radians(40)
# Edges with dihedral angles from SHARP_ANGLE / 2 to SHARP_ANGLE bend a solid by at most this share of what sharper
# edges do: 0 to 0.07 on plates, gears and rings, 0.15 and more on noise.
MAX_BETWEEN = 0.1
# Fraction of the work that computes the layouts; the rest relaxes and separates them.
LAYING_OUT = 0.8
#: Errors of a component that a retry may solve, and after which its earlier layout remains.
FAILURES = CurvatureError, MetricError, SeamError


def lay_out_components(components: Mapping[int, Component], steps: Steps) -> dict[int, Layout]:
    """Return the layout of each component in one chart."""
    progress = ComponentProgress(components, LAYING_OUT, steps.names_components)
    layouts = {}
    for i, component in components.items():
        with progress.at(component):
            layouts[i] = lay_out_with_kept_holes(component, steps)
    return layouts


def lay_out_with_kept_holes(component: Component, steps: Steps) -> Layout:
    """Return the layout of a component in one chart; holes that are to be kept are opened if no metric is found."""
    if not component.keeps_holes:
        return lay_out_with_thick_triangles(component, steps)
    try:
        return lay_out_with_thick_triangles(component, steps)
    except FAILURES:
        return lay_out_with_thick_triangles(component.with_opened_holes(), steps)


def lay_out_with_thick_triangles(component: Component, steps: Steps) -> Layout:
    """Return the layout of a component in one chart.

    If no metric is found because of thin triangles, such as those that rounded coordinates leave, all are opened more.
    """
    try:
        return lay_out_with_feasible_cones(component, steps)
    except ConvergenceError:
        if not (thickness(component.lengths) < RISKY_AREA).any():
            raise
    return lay_out_with_feasible_cones(component.with_slack(), steps)


def lay_out_with_feasible_cones(component: Component, steps: Steps) -> Layout:
    """Return the layout of a component in one chart.

    The triangles around a cone may be unable to form the cone angle, which is known only after the layout. Then other
    cones are searched for: each search forbids the cones that were infeasible before. A later search may have more
    infeasible cones, so the best layout of all searches is returned.
    """
    with stage("cones"):
        surface = steps.surface(component)
    may_repeat = component.is_exact and uses_sparse_search(component.mesh, component.cones)
    layouts = list[Layout]()
    for _ in range(MAX_SEARCHES):
        try:
            layouts.append(lay_out_component(surface, component, steps))
        except FAILURES:
            if not layouts:
                raise
            break
        infeasible = np.setdiff1d(infeasible_cones(layouts[-1]), component.cones.required)
        if not (may_repeat and len(infeasible)):
            break
        component = replace(component, cones=component.cones.without(infeasible))
    return min(layouts, key=lambda layout: (len(layout.notes), len(infeasible_cones(layout))))


def finish_components(
    components: Mapping[int, Component], layouts: Mapping[int, Layout], steps: Steps
) -> dict[int, Layout]:
    """Return relaxed layouts without inverted triangles, and without overlaps if these are separated."""
    progress = ComponentProgress(components, 1 - LAYING_OUT, steps.names_components)
    finished = dict[int, Layout]()
    for group in groups_of_small(components, steps.relax):
        relaxed = relax_group([components[i] for i in group], [layouts[i] for i in group], steps)
        for i, layout in zip(group, relaxed, strict=True):
            with progress.at(components[i]):
                finished[i] = finish_component(components[i], layout, steps)
    return finished


def relax_group(components: Sequence[Component], layouts: Sequence[Layout], steps: Steps) -> Sequence[Layout]:
    """Return relaxed layouts: of all components together, or after a failure of each alone, so that it is named."""
    if len(components) == 1:
        with errors_of(components[0], steps.names_components):
            return relax_components(components, layouts, steps)
    try:
        return relax_components(components, layouts, steps)
    except (*FAILURES, LengthError):
        pairs = zip(components, layouts, strict=True)
        return [relax_group([component], [layout], steps)[0] for component, layout in pairs]


def with_kept_holes(component: Component, steps: Steps) -> Component:
    """Return a component with its holes kept where they can be; a large one only if it is better so on a coarse mesh.

    Keeping holes saves the seams to them, but the borders of opened ones absorb curvature, as the ends of a tube do.
    """
    variant = component.with_kept_holes() if steps.keeps_holes else component
    if not variant.keeps_holes or not is_compared_on_coarse(component):
        return variant
    coarse = coarse_component(variant)[0]
    # A cache of surfaces would hold those of coarse meshes, which are made anew each time.
    flatten = partial(flatten_within_bound, steps=replace(steps, surface_of=ConeSurface.of))
    kept_layout = without_failures(flatten, {0: coarse}).get(0)
    if kept_layout is None:
        return component
    if is_best_with_holes(coarse, kept_layout):
        return variant
    opened = without_failures(flatten, {0: coarse.with_opened_holes()})
    return component if better_layouts(opened, {0: kept_layout}, {0: coarse}) else variant


def is_compared_on_coarse(component: Component) -> bool:
    """Return whether keeping the holes of a component is decided on a coarse mesh, which saves half of the time.

    A coarse mesh has no forbidden edges, which may prevent that holes are opened.
    """
    has_forbidden = bool(component.seams.is_forbidden.any())
    return is_large(component) and not has_forbidden and not has_vertex_options(component)


def finish_with_best_holes(
    components: Mapping[int, Component], layouts: Mapping[int, Layout], steps: Steps
) -> dict[int, Layout]:
    """Return finished layouts; those with kept holes are compared with others if it is not known which are better."""
    finished = finish_within_bound(components, layouts, steps)
    opened = {
        i: component.with_opened_holes()
        for i, component in components.items()
        if component.keeps_holes
        and (finished[i].notes or not is_compared_on_coarse(component))
        and not is_best_with_holes(component, finished[i])
    }
    candidates = without_failures(partial(flatten_within_bound, steps=steps), opened)
    return finished | better_layouts(candidates, finished, opened)


def is_best_with_holes(component: Component, layout: Layout) -> bool:
    """Return whether a layout with kept holes ranks before any with opened ones: these need seams to all holes.

    The seams that are found are at most twice as long as the shortest ones.
    """
    if layout.notes or excess([component], [layout]) > TOLERATED_EXCESS:
        return False
    lengths = component.lengths.ravel()[component.mesh.edge_halfedges[:, 0]]
    opening = find_seams(component.mesh, NO_EDGES, lengths)
    size = np.sqrt(layout.area)
    return seam_length(layout) / size + distortion_cost([layout]) < lengths[opening].sum() / 2 / size


def flatten_within_bound(components: Mapping[int, Component], steps: Steps) -> dict[int, Layout]:
    """Return the finished layouts of components, see `finish_within_bound`."""
    return finish_within_bound(components, lay_out_components(components, steps), steps)


def finish_within_bound(
    components: Mapping[int, Component], layouts: Mapping[int, Layout], steps: Steps
) -> dict[int, Layout]:
    """Return finished layouts whose area distortion is at most the one allowed, as far as possible.

    The cone search bounds the distortion of the linear model. On coarse meshes, that of the triangles in the plane may
    be larger.
    """
    finished = finish_components(components, layouts, steps)
    finished |= open_at_corners(components, finished, steps)
    beyond = {
        i: component
        for i, component in components.items()
        if excess([component], [finished[i]]) > TOLERATED_EXCESS
    }
    finished |= relax_areas(beyond, layouts, finished, steps)
    return finished | search_more_cones(beyond, finished, with_relaxed_areas(steps))


def open_at_corners(
    components: Mapping[int, Component], finished: Mapping[int, Layout], steps: Steps
) -> dict[int, Layout]:
    """Return the better layouts of polyhedra with all their corners as cones.

    The cones that a search finds need not be corners, and triangles around them are distorted; a polyhedron opened at
    all of its corners keeps its shape. One with few corners is tried, and any that is too distorted. An open surface
    that needs no cone gets none.
    """
    polyhedra = {}
    for i, component in components.items():
        is_distorted = is_too_distorted(component, finished[i])
        if not is_distorted and not len(finished[i].cones) and component.mesh.is_boundary_vertex.any():
            continue
        largest_count = MAX_SEARCHED if is_distorted else MAX_POLYHEDRON_CORNERS
        cones = with_corners(component.mesh, component.lengths, component.cones, largest_count)
        if cones is not None:
            polyhedra[i] = replace(component, cones=cones)
    return retried(polyhedra, components, finished, steps)


def relax_areas(
    beyond: Mapping[int, Component],
    layouts: Mapping[int, Layout],
    finished: Mapping[int, Layout],
    steps: Steps,
) -> dict[int, Layout]:
    """Return the better layouts of components beyond the bound, with all triangles relaxed with some weight on areas.

    Args:
        beyond: these components.
        layouts, finished: their layouts before relaxing, and the best so far.
        steps: the functions of the stages.
    """
    relaxed = with_relaxed_areas(steps)
    if not beyond or relaxed is steps:
        return {}

    def relax(members: Mapping[int, Component]) -> dict[int, Layout]:
        return finish_components(members, layouts, relaxed)

    return better_layouts(without_failures(relax, beyond), finished, beyond)


def with_relaxed_areas(steps: Steps) -> Steps:
    """Return steps that relax with some weight on areas, unless nothing is relaxed or areas have more weight."""
    if steps.relax.is_off or steps.relax.stretch >= CORRECTING_STRETCH:
        return steps
    return replace(steps, relax=replace(steps.relax, stretch=CORRECTING_STRETCH))


def search_more_cones(
    beyond: Mapping[int, Component], finished: Mapping[int, Layout], steps: Steps
) -> dict[int, Layout]:
    """Return the better layouts of components beyond the bound that a tighter bound of the cone search gives."""
    improved = dict[int, Layout]()
    attempts = dict(beyond)
    for _ in range(MAX_CORRECTIONS):
        latest = {**finished, **improved}
        tightened = dict[int, Component]()
        for i, attempt in attempts.items():
            factor = min(excess([beyond[i]], [latest[i]]), MAX_TIGHTENING)
            # About that many times as many cones are needed; a search without enough of them takes longest.
            if factor > TOLERATED_EXCESS and factor * len(latest[i].cones) <= MAX_SEARCHED:
                tightened[i] = attempt.with_distortion(TOLERATED_EXCESS / factor)
        improvements = retried(tightened, beyond, latest, steps)
        improved |= improvements
        attempts = {i: tightened[i] for i in improvements}
    return improved


def retried(
    attempts: Mapping[int, Component],
    components: Mapping[int, Component],
    finished: Mapping[int, Layout],
    steps: Steps,
) -> dict[int, Layout]:
    """Return the layouts of components with other cones that are better than the finished ones.

    Args:
        attempts: the components with other cones; those that fail are left out.
        components: the components with the cones that the options require.
        finished: their layouts.
        steps: the functions of the stages.
    """

    def flatten(members: Mapping[int, Component]) -> dict[int, Layout]:
        return finish_components(members, lay_out_components(members, steps), steps)

    candidates = dict[int, Layout]()
    for group in groups_of_small(attempts, steps.relax):
        candidates |= without_failures(flatten, {i: attempts[i] for i in group})
    return better_layouts(candidates, finished, components)


def without_failures(
    flatten: Callable[[Mapping[int, Component]], dict[int, Layout]], components: Mapping[int, Component]
) -> dict[int, Layout]:
    """Return the layouts of components by a function of several; after a failure, of each component that succeeds."""
    try:
        return flatten(components)
    except FAILURES:
        if len(components) == 1:
            return {}
    layouts = dict[int, Layout]()
    for i, component in components.items():
        layouts |= without_failures(flatten, {i: component})
    return layouts


def better_layouts(
    candidates: Mapping[int, Layout], finished: Mapping[int, Layout], components: Mapping[int, Component]
) -> dict[int, Layout]:
    """Return the candidates that rank before the finished layouts of the same components."""
    return {
        i: candidate
        for i, candidate in candidates.items()
        if rank([components[i]], [candidate]) < rank([components[i]], [finished[i]])
    }


def cut_along_sharp_edges(
    source: Source,
    prepared: Prepared,
    layouts: Sequence[Layout],
    options: Options,
    flatten_pieces: Callable[[Sequence[Component]], list[Layout]],
) -> tuple[Prepared, list[Layout]]:
    """Return the input with sharp edges as seams in solids that are too distorted otherwise, and the layouts.

    Args:
        source, prepared, options: the mesh, its components, and the options.
        layouts: the layouts of the components.
        flatten_pieces: returns the finished layouts of components.
    """
    uncut = prepared, list(layouts)
    if options.charts != "atlas" or options.sharp_angle is not None:
        return uncut
    distorted = [
        i
        for i, (component, layout) in enumerate(zip(prepared.components, layouts, strict=True))
        if is_too_distorted(component, layout) and is_machined(component.mesh)
    ]
    if not distorted:
        return uncut
    try:
        sharp = source.prepared(replace(options, sharp_angle=SHARP_ANGLE))
        pieces_of = sharp.pieces_of(prepared, distorted)
        layouts_of_pieces = iter(flatten_pieces([piece for i in distorted for piece in pieces_of[i]]))
    except (OptionError, *FAILURES):  # options may name vertices or edges that such seams exclude
        return uncut
    layouts_of = {i: [next(layouts_of_pieces) for _ in pieces_of[i]] for i in distorted}
    cut = {
        i: with_note_on_seams(layouts_of[i], prepared.components[i], layouts[i])
        for i in distorted
        if is_worth_its_seams(pieces_of[i], layouts_of[i], prepared.components[i], layouts[i])
    }
    if not cut:
        return uncut
    prepared = prepared.with_pieces(sharp, {i: pieces_of[i] for i in cut})
    return prepared, [piece for i, layout in enumerate(layouts) for piece in cut.get(i, [layout])]


def with_note_on_seams(cut: Sequence[Layout], component: Component, uncut: Layout) -> list[Layout]:
    """Return the layouts of the pieces of a component with a note on why its sharp edges are seams."""
    note = (
        f"Edges above {np.degrees(SHARP_ANGLE):g} degrees are seams {component.location}: without them its "
        f"mean QC distortion is {mean_qc(uncut):.3g}."
    )
    return [cut[0].with_notes(note), *cut[1:]]


def is_worth_its_seams(
    pieces: Sequence[Component], cut: Sequence[Layout], component: Component, uncut: Layout
) -> bool:
    """Return whether layouts of pieces of a component are better than its layout, and cost less with their seams."""
    is_better = rank(pieces, cut) < rank([component], [uncut])
    return is_better and borders_and_distortion(pieces, cut) < borders_and_distortion([component], [uncut])


def is_machined(mesh: TriangleMesh) -> bool:
    """Return whether a mesh is a solid whose edges are either sharp or nearly flat.

    On noise, which bends at all angles, sharp edges would cut a surface into hundreds of charts, and a sheet is rarely
    meant to fall apart.
    """
    if mesh.is_boundary_vertex.any():
        return False
    angles = np.abs(dihedral_angles(mesh))
    ends = mesh.vertices[mesh.edges]
    bending = angles * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    is_between = (angles > SHARP_ANGLE / 2) & (angles <= SHARP_ANGLE)
    return bool(bending[is_between].sum() < MAX_BETWEEN * bending[angles > SHARP_ANGLE].sum())
