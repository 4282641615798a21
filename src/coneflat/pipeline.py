"""Flattening: cones, target curvatures, scaling, cutting, layout (Section 4 of the paper)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
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
from .flat.held_cones import split_notes, unheld_notes, with_held_cones
from .flat.methods import find_metric, turning_meter
from .flat.more_cones import with_quality
from .flat.relaxed import relaxed, relaxes
from .geometry.operators import weighted_areas
from .input.arrays import as_input
from .input.components import Component, Prepared, Source, prepare
from .input.symmetry import SymmetryUse, are_mirrored, check_symmetry, find_symmetry, symmetry_notes
from .layout.disk import cutting
from .mesh import TriangleMesh
from .options import UNFOLDED, Options, read_options, takes
from .progress import Stages
from .result.assemble import assemble
from .result.flattening import Flattening
from .solver import solving
from .threads import one_blas_thread

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
    """
    return flatten_as(mesh, faces, read_options(options))


def flatten_as(mesh: Any, faces: ArrayLike | None, options: Options) -> Flattening:
    """Flatten a mesh by options that have been read; see `flatten`."""
    stages = Stages(options.progress)
    with stages("check"):
        prepared = prepare(mesh, faces, options)
        check_symmetry(prepared.components, options)
    return _flatten(prepared, Surface.of, options, stages)


class Flattener:
    """Flattens one mesh again and again: what depends on it alone is found once, and kept.

    That is the checked mesh, its intrinsic Delaunay triangulation, its Laplacian, factorized, and the Green's functions
    of the cones used last. Results are those of `coneflat.flatten`, to the last bit.

        flattener = Flattener(vertices, faces)
        for curvature in (1.0, 1.5, 2.0):
            flattener.flatten(cones={7: curvature, 12: None, 80: None})

    Args:
        mesh, faces: as of `coneflat.flatten`; arrays must not change afterwards.

    Raises:
        MeshError: it is no mesh, or its file cannot be read.
    """

    def __init__(self, mesh: Any, faces: ArrayLike | None = None) -> None:
        self._source = Source(as_input(mesh, faces))
        self._surfaces: dict[tuple[int, bool], Surface] = {}

    def flatten(self, **options: Any) -> Flattening:
        """Return the flattening by the options, and with the errors, of `coneflat.flatten`."""
        return self.flatten_as(read_options(options))

    def flatten_as(self, options: Options) -> Flattening:
        """Return the flattening by options that have been read."""
        stages = Stages(options.progress)
        with stages("check"):
            prepared = self._source.prepared(options)
            check_symmetry(prepared.components, options)
        meshes = {id(part.mesh) for part in prepared.components}
        self._surfaces = {key: surface for key, surface in self._surfaces.items() if key[0] in meshes}
        try:
            return _flatten(prepared, self._surface, options, stages)
        finally:
            for surface in self._surfaces.values():
                surface.search = None  # It remembers what it was asked before.

    def _surface(self, mesh: TriangleMesh, lengths: FloatArray, flips: bool) -> Surface:
        key = id(mesh), flips
        if key not in self._surfaces:
            self._surfaces[key] = Surface.of(mesh, lengths, flips)
            self._surfaces[key].is_kept = True
        return self._surfaces[key]


def _flatten(prepared: Prepared, surface_of: SurfaceOf, options: Options, stages: Stages) -> Flattening:
    """Flatten a checked mesh; `surface_of` returns what the choice of cones needs of a component."""
    with one_blas_thread(), solving(options.solver) as solvers:
        flat = list(_flat_components(prepared, surface_of, options, stages))
    return replace(assemble(prepared, flat, options, stages), solvers=tuple(solvers.used))


def flatten_component(part: Component, surface_of: SurfaceOf, options: Options, stages: Stages) -> LaidOut:
    """Flatten a connected mesh: find cones, scale the metric, cut, lay out, and part what overlaps."""
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
        with stages("layout", 0.95):
            areas = weighted_areas(surface.areas, part.constraints.weights)
            laid_out = metric.lay_out(disk.mesh, disk.seams).with_area_distortion(cones.log_scale, areas)
            use = None if symmetry is None else SymmetryUse(symmetry, is_mirrored, disk.is_symmetric)
            return replace(laid_out, symmetry=use)

    def flatten_by(options: Options) -> LaidOut:
        once = partial(flatten_once, options=options)
        may_lack_room = pursues(mesh, options) and options.method in UNFOLDED
        layout = with_held_cones(once, part) if may_lack_room else once(part)
        if not relaxes(options):
            return layout
        with stages("relax", 0.96):
            return relaxed(layout, part, options, stages.tell)

    layout = with_quality(flatten_by, part, options)
    if options.charts == "atlas":
        with stages("atlas", 1.0):
            part_charts = overlaid if options.mirrored == "overlap" else without_overlaps
            layout = part_charts(layout, part, options)
    reached = layout.statistics.area_distortion_linear
    notes = cone_notes(mesh, len(layout.cones), reached, options) + symmetry_notes(layout.symmetry)
    if options.method in UNFOLDED:
        notes += unheld_notes(layout, part.constraints.names) + split_notes(layout, part.constraints.names)
    return replace(layout, notes=layout.notes + notes)


def _flat_components(
    prepared: Prepared, surface_of: SurfaceOf, options: Options, stages: Stages
) -> Iterator[LaidOut]:
    """Yield the flattened components; errors say which one cannot be flattened, if there are several."""
    for part in prepared.components:
        stages.share = len(part.faces) / len(prepared.checked.mesh.faces)
        try:
            yield flatten_component(part, surface_of, options, stages)
        except (CurvatureError, MetricError, SeamError) as error:
            if len(prepared.components) == 1:
                raise
            first = part.constraints.names[0]
            where = f"in the component of vertex {first} ({len(part.faces):,} triangles)"
            raise type(error)(f"{where}: {error}") from error
        stages.end_part()
