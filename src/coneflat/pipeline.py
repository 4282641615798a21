"""Flattening: cones, target curvatures, scaling, cutting, layout (Section 4 of the paper)."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
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
from .flat.relaxed import relaxed, relaxed_together, relaxes
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

# Triangles up to which components count as small, and of those that are relaxed as one mesh.
SMALL, TOGETHER = 500, 40_000
# The part of a small component's work that comes before.
HALF = 0.5


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
        runs = _Runs(prepared, surface_of, options, stages)
        if early is not None:
            first = runs.all_first()
            early(assemble(prepared, first, replace(options, charts="one"), Stages(), NOT_LOOKED_FOR))
        flat = runs.all_last()
    return replace(assemble(prepared, flat, options, stages), solvers=tuple(solvers.used))


class _Runs:
    """The components of a mesh on their way: one after the other, small ones in groups that are relaxed together."""

    def __init__(self, prepared: Prepared, surface_of: SurfaceOf, options: Options, stages: Stages) -> None:
        self._parts, self._options, self._stages = prepared.components, options, stages
        self._size = len(prepared.checked.mesh.faces)
        self._runs = [flatten_component(part, surface_of, options, stages) for part in self._parts]
        self._copies = find_copies(self._parts, options)
        self._begun: dict[int, LaidOut] = {}

    def all_first(self) -> list[LaidOut]:
        """Return the first layout of each component."""
        found: dict[int, LaidOut] = {}
        for i in range(len(self._parts)):
            with self._at(i):
                found[i] = self._copy(i, found) or self._first(i)
        return list(found.values())

    def all_last(self) -> list[LaidOut]:
        """Return the layout of each component that was asked for."""
        found: dict[int, LaidOut] = {}
        for group in self._groups():
            own = [i for i in group if self._copies[i] is None]
            relaxed = self._relaxed(own) if len(own) > 1 else {}
            for i in group:
                with self._at(i, HALF if i in relaxed else 1.0):
                    found[i] = self._copy(i, found) or self._last(i, relaxed.get(i))
                self._stages.end_part()
        return [found[i] for i in range(len(self._parts))]

    def _groups(self) -> list[list[int]]:
        """Return the numbers of the components, those together whose triangles are relaxed at the same time."""
        sizes = [len(part.faces) for part in self._parts]
        if not relaxes(self._options):
            return [[i] for i in range(len(sizes))]
        groups, room = [[i] for i, size in enumerate(sizes) if size > SMALL], 0
        for i, size in enumerate(sizes):
            if size > SMALL:
                continue
            if room < size:
                groups.append([])
                room = TOGETHER
            groups[-1].append(i)
            room -= size
        return groups

    def _relaxed(self, group: list[int]) -> dict[int, LaidOut | None]:
        """Return the first layouts of small components relaxed, None where each has to see for itself."""
        for i in group:
            with self._at(i, HALF):
                self._first(i)
            self._stages.end_part()
        layouts, parts = [self._begun[i] for i in group], [self._parts[i] for i in group]
        self._stages.share = 0.0
        with self._stages("relax"):
            found = relaxed_together(layouts, parts, self._options, self._stages.tell)
        return dict(zip(group, found, strict=True))

    def _first(self, i: int) -> LaidOut:
        if i not in self._begun:
            self._begun[i] = next(self._runs[i])
        return self._begun[i]

    def _last(self, i: int, relaxed: LaidOut | None) -> LaidOut:
        self._first(i)
        last = self._runs[i].send(relaxed)
        self._runs[i].close()  # and forgets what it has worked with
        return last

    def _copy(self, i: int, found: dict[int, LaidOut]) -> LaidOut | None:
        """Return the layout of a component by that of the one that it is a copy of; None if that does not serve."""
        copy = self._copies[i]
        return None if copy is None else copied(found[copy.first], self._parts[i], copy.scale, self._options)

    @contextmanager
    def _at(self, i: int, portion: float = 1.0) -> Iterator[None]:
        """Do a portion of the work on a component inside; errors say which one it is, if there are several."""
        part = self._parts[i]
        self._stages.share = portion * len(part.faces) / self._size
        try:
            yield
        except (CurvatureError, MetricError, SeamError) as error:
            if len(self._parts) == 1:
                raise
            first = part.constraints.names[0]
            where = f"in the component of vertex {first} ({len(part.faces):,} triangles)"
            raise type(error)(f"{where}: {error}") from error


def flatten_component(
    part: Component, surface_of: SurfaceOf, options: Options, stages: Stages
) -> Generator[LaidOut, LaidOut | None, None]:
    """Flatten a connected mesh: find cones, scale the metric, cut, lay out, and part what overlaps.

    The layout comes twice: as soon as there is one, and when it is what was asked for. In between, what is sent is the
    first one relaxed, or None where that is still to be done.
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
    if options.quality is None:
        surface.search = None  # It remembers what it was asked for, and takes much memory.
    relaxed_first = yield first

    def flatten_by(asked: Options) -> LaidOut:
        if asked is options and relaxed_first is not None:
            return relaxed_first
        layout = first if asked is options else flatten_held(asked)
        if not relaxes(asked):
            return layout
        with stages("relax", 0.96):
            return relaxed(layout, part, asked, stages.tell)

    layout = with_quality(flatten_by, part, options)
    surface.search = None
    if options.charts == "atlas":
        with stages("atlas", 1.0):
            part_charts = overlaid if options.mirrored == "overlap" else without_overlaps
            layout = part_charts(layout, part, options)
    reached = layout.statistics.area_distortion_linear
    notes = cone_notes(mesh, len(layout.cones), reached, options) + symmetry_notes(layout.symmetry)
    if options.method in UNFOLDED:
        notes += unheld_notes(layout, part.constraints.names) + split_notes(layout, part.constraints.names)
    yield replace(layout, notes=layout.notes + notes)
