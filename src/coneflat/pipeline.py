"""Flattening: cones, target curvatures, scaling, cutting, layout (Section 4 of the paper)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any, TypeAlias

from numpy.typing import ArrayLike

from ._arrays import FloatArray
from .atlas.injective import without_overlaps
from .atlas.overlaid import overlaid
from .cones.choose import Surface, choose_cones, cone_notes, pursues
from .errors import CurvatureError, MetricError, SeamError
from .flat import LaidOut
from .flat.copies import copied, find_copies
from .flat.held_cones import split_notes, unheld_notes, with_held_cones
from .flat.methods import find_metric, turning_meter
from .flat.more_cones import with_quality
from .flat.relaxed import relaxed, relaxes
from .geometry.operators import weighted_areas
from .geometry.overlap import NOT_LOOKED_FOR
from .input.components import Component, Prepared, prepare
from .input.symmetry import SymmetryUse, are_mirrored, check_symmetry, find_symmetry, symmetry_notes
from .layout.disk import cutting
from .mesh import TriangleMesh
from .options import UNFOLDED, Options, read_options, takes
from .progress import Stages
from .result.assemble import assemble
from .result.flattening import Flattening
from .solver import fitting_solver, solving
from .threads import meanwhile, using_threads

#: Takes the first layout that there is.
Early: TypeAlias = Callable[[Flattening], object]
#: Returns a connected mesh with what follows from its (m, 3) lengths, on flips of edges if a metric may make them.
SurfaceOf: TypeAlias = Callable[[TriangleMesh, FloatArray, bool], Surface]


@takes(Options)
def flatten(mesh: Any, faces: ArrayLike | None = None, **options: Any) -> Flattening:
    """Flatten a triangle mesh of any topology conformally, one disk or a few charts per connected component.

    Args:
        mesh: vertices (n, 3) if `faces` is given; else a path, a `MeshFile`, a pair (vertices, faces), or
            a mesh of trimesh, meshio or pyvista.
        faces: (m, 3) vertex indices from 0. Options that name vertices name the input's.
        options: see below.

    Raises:
        MeshError: the mesh cannot be flattened; see `coneflat.errors` for its kinds.
        CurvatureError: no metric has the curvatures asked for.
        OptionError: an option makes no sense.
        SeamError: every set of seams needs forbidden edges.
        MetricError: the computation found no finite result.
        TooLargeError: it does not fit into the memory that is free.
    """
    return flatten_as(mesh, faces, read_options(options))


def flatten_as(mesh: Any, faces: ArrayLike | None, options: Options) -> Flattening:
    """Flatten a mesh by options that have been read; see `flatten`."""
    stages = Stages(options.progress)
    with stages("check"):
        prepared = prepare(mesh, faces, options)
        check_symmetry(prepared.components, options)
    solver = fitting_solver(len(prepared.checked.mesh.faces), options.solver)
    return flatten_prepared(prepared, solver, Surface.of, options, stages)


def flatten_prepared(
    prepared: Prepared,
    solver: str,
    surface_of: SurfaceOf,
    options: Options,
    stages: Stages,
    early: Early | None = None,
) -> Flattening:
    """Flatten a checked mesh.

    Args:
        prepared: the mesh.
        solver: the back end that fits into memory.
        surface_of: returns what the choice of cones needs of a component.
        options: that have been read.
        stages: the stopwatch.
        early: called with the first layout, one chart for each component, before triangles are relaxed and overlaps
            parted, which are not looked for.
    """
    with using_threads(options.threads), solving(solver) as solvers:
        runs = [flatten_component(part, surface_of, options, stages) for part in prepared.components]
        copies = find_copies(prepared.components, options)

        def laid_out(i: int, found: list[LaidOut], run: Callable[[Iterator[LaidOut]], LaidOut]) -> LaidOut:
            copy, same = copies[i], None
            with _at_component(prepared, i, stages):
                if copy is not None:
                    same = copied(found[copy.first], prepared.components[i], copy.scale, options)
                return run(runs[i]) if same is None else same

        if early is not None:
            first: list[LaidOut] = []
            for i in range(len(runs)):
                first.append(laid_out(i, first, next))
            early(assemble(prepared, first, replace(options, charts="one"), Stages(), NOT_LOOKED_FOR))
        flat: list[LaidOut] = []
        for i in range(len(runs)):
            flat.append(laid_out(i, flat, _last))
            stages.end_part()
    return replace(assemble(prepared, flat, options, stages), solvers=tuple(solvers.used))


def flatten_component(
    part: Component, surface_of: SurfaceOf, options: Options, stages: Stages
) -> Iterator[LaidOut]:
    """Flatten a connected mesh: find cones, scale the metric, cut, lay out, and part what overlaps.

    The layout comes twice: as soon as there is one, and when it is what was asked for.
    """
    mesh = part.mesh
    with stages("cones", 0.1):
        surface = surface_of(mesh, part.lengths, options.method in UNFOLDED and not options.refine)
        symmetry = find_symmetry(part, options)

    def flatten_once(part: Component, options: Options) -> LaidOut:
        with stages("cones", 0.4):
            turned = turning_meter(surface, part.constraints, options)
            cones = choose_cones(surface, part.constraints, options, stages, turned, symmetry)
            is_mirrored = symmetry is not None and are_mirrored(symmetry, cones.cones, cones.curvatures)
        with cutting(part, cones, options, symmetry if is_mirrored else None) as being_cut:
            with stages("metric", 0.75):
                metric = find_metric(surface, cones, part.constraints, options)
            with stages("cut", 0.85):
                disk = being_cut.result()
        with stages("layout", 0.95), meanwhile(partial(disk.get_ready, options), len(mesh.faces)):
            areas = weighted_areas(surface.areas, part.constraints.weights)
            laid_out = metric.lay_out(disk.mesh, disk.seams).with_area_distortion(cones.log_scale, areas)
            use = None if symmetry is None else SymmetryUse(symmetry, is_mirrored, disk.is_symmetric)
            opened = disk.mesh if laid_out.corners is disk.mesh.faces else None
            return replace(laid_out, symmetry=use, disk=opened)

    def flatten_held(options: Options) -> LaidOut:
        once = partial(flatten_once, options=options)
        may_lack_room = pursues(mesh, options) and options.method in UNFOLDED
        return with_held_cones(once, part) if may_lack_room else once(part)

    first = flatten_held(options)
    yield first

    def flatten_by(asked: Options) -> LaidOut:
        layout = first if asked is options else flatten_held(asked)
        if not relaxes(asked):
            return layout
        with stages("relax", 0.96):
            return relaxed(layout, part, asked, stages.tell)

    layout = with_quality(flatten_by, part, options)
    surface.search = None  # It remembers what it was asked for, and takes much memory.
    if options.charts == "atlas":
        with stages("atlas", 1.0):
            part_charts = overlaid if options.mirrored == "overlap" else without_overlaps
            layout = part_charts(layout, part, options)
    reached = layout.statistics.area_distortion_linear
    notes = cone_notes(mesh, len(layout.cones), reached, options) + symmetry_notes(layout.symmetry)
    if options.method in UNFOLDED:
        notes += unheld_notes(layout, part.constraints.names) + split_notes(layout, part.constraints.names)
    yield replace(layout, notes=layout.notes + notes)


def _last(layouts: Iterator[LaidOut]) -> LaidOut:
    """Return the last of a component's layouts."""
    *_, last = layouts
    return last


@contextmanager
def _at_component(prepared: Prepared, number: int, stages: Stages) -> Iterator[None]:
    """Work on a component inside; errors say which one cannot be flattened, if there are several."""
    part = prepared.components[number]
    stages.share = len(part.faces) / len(prepared.checked.mesh.faces)
    try:
        yield
    except (CurvatureError, MetricError, SeamError) as error:
        if len(prepared.components) == 1:
            raise
        first = part.constraints.names[0]
        where = f"in the component of vertex {first} ({len(part.faces):,} triangles)"
        raise type(error)(f"{where}: {error}") from error
