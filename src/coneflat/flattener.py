"""Flattening of a mesh: all components, from the input to the result; once, or repeatedly with cached operators."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, TypeAlias

from numpy.typing import ArrayLike

from .base.arrays import FloatArray
from .base.notes import warns
from .base.progress import stage, timing
from .base.threads import limit_threads
from .bounds import bound_notes
from .cones import ConeSurface
from .evaluate import evaluate
from .flattening import FindMetric, Steps, SurfaceOf
from .geometry.overlap import UNKNOWN_OVERLAPS
from .groups import lay_out_flat_components, with_copies
from .io.packages import as_input
from .mesh.connectivity import TriangleMesh
from .metric import find_metric as conformal_metric
from .options import Options, read_options, takes
from .result import Flattening
from .retries import cut_along_sharp_edges, finish_with_best_holes, lay_out_components, with_kept_holes
from .source import Component, Prepared, Source
from .source.copies import find_copies
from .stages import Layout, RelaxSpec

#: Receives the first layout, before triangles are relaxed and overlaps are separated.
Preview: TypeAlias = Callable[[Flattening], object]


@takes(Options)
@warns()
def flatten(mesh: Any, faces: ArrayLike | None = None, **options: Any) -> Flattening:
    """Flatten a triangle mesh of any topology conformally, one disk or a few charts per connected component.

    Args:
        mesh: vertices (n, 3) if `faces` is given; else a path, a `MeshFile`, a pair (vertices, faces), or
            a mesh of trimesh, meshio or pyvista.
        faces: (m, 3) vertex indices from 0. Vertices in options are indices of the input's vertices.
        options: see below.

    Returns:
        The layout in the unit square with its cones, seams and measures.

    Raises:
        MeshError: the mesh cannot be flattened; see `coneflat.errors` for its kinds.
        MeshFileError: its file cannot be read.
        CurvatureError: no metric has the prescribed curvatures.
        OptionError: an option is unknown or invalid.
        SeamError: every set of seams needs forbidden edges.
        MetricError: the computation found no finite result.
        TooLargeError: the mesh does not fit into the free memory.

    Warns:
        GuaranteeWarning: a guarantee, or a request, is not met; notes of the result say which.

    Examples:
        >>> vertices = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
        >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
        >>> result = coneflat.flatten(vertices, faces)
        >>> result
        <Flattening: 4 triangles, 4 cones, 1 chart, QC 1.0000>
        >>> result.uv[result.uv_faces].shape  # a point of the plane for every triangle corner
        (4, 3, 2)
    """
    return flatten_source(Source(as_input(mesh, faces)), read_options(options))


def flatten_source(
    source: Source,
    options: Options,
    surface_of: SurfaceOf = ConeSurface.of,
    find_metric: FindMetric = conformal_metric,
    on_preview: Preview | None = None,
    keeps_holes: bool = True,
) -> Flattening:
    """Return the flattening of a mesh by parsed options; see `flatten`.

    Args:
        source: the mesh.
        options: the options.
        surface_of: returns a component with the operators of its metric; they may be cached.
        find_metric: returns the flat metric for the cones of a component.
        on_preview: called with the first layout: one chart per component, before triangles are relaxed and overlaps are
            separated; its overlaps are not measured.
        keeps_holes: holes are not opened by seams where this is better.

    Raises:
        ConeflatError: as for `flatten`.
    """
    with timing(options.progress):
        with stage("check"):
            prepared = source.prepared(options)
        steps = Steps(
            surface_of,
            find_metric,
            RelaxSpec(options.relax if options.method == "exact" else "off", options.stretch),
            separates=options.charts == "atlas",
            quantum=options.quantise,
            names_components=len(prepared.components) > 1,
            # Another map cannot be computed for the filled mesh.
            keeps_holes=keeps_holes and find_metric is conformal_metric,
        )
        show = None if on_preview is None else partial(_preview, prepared, options, on_preview)
        with limit_threads(options.threads):
            layouts = flatten_components(prepared.components, steps, show)
            prepared, layouts = cut_along_sharp_edges(
                source, prepared, layouts, options, partial(flatten_components, steps=steps)
            )
        notes = tuple(bound_notes(prepared.components, layouts, options))
        return evaluate(prepared, layouts, options, notes=notes)


def flatten_components(
    components: Sequence[Component], steps: Steps, on_layouts: Callable[[list[Layout]], None] | None = None
) -> list[Layout]:
    """Return the layouts of components; of those that are copies of each other, the layout of the first is copied.

    on_layouts: called with the first layouts of all components, see `on_preview` of `flatten_source`.
    """
    # A map of another kind need not be an isometry of flat components.
    with stage("layout"):
        flat = lay_out_flat_components(components) if steps.find_metric is conformal_metric else {}
    with stage("check"):
        copies = find_copies(components, flat)
    originals = {
        i: with_kept_holes(component, steps)
        for i, component in enumerate(components)
        if copies[i] is None and i not in flat
    }
    layouts = lay_out_components(originals, steps)
    if on_layouts is not None:
        on_layouts(with_copies(flat | layouts, components, copies))
    finished = flat | finish_with_best_holes(originals, layouts, steps)
    # Notes contain vertex indices, so copies of components with notes are computed, too.
    noted = {
        i: with_kept_holes(components[i], steps)
        for i, copy in enumerate(copies)
        if copy and finished[copy.first].notes
    }
    finished |= finish_with_best_holes(noted, lay_out_components(noted, steps), steps)
    return with_copies(finished, components, copies)


def _preview(prepared: Prepared, options: Options, on_preview: Preview, layouts: Sequence[Layout]) -> None:
    """Call a function with the result of layouts in one chart per component."""
    with timing():
        result = evaluate(prepared, layouts, replace(options, charts="one"), UNKNOWN_OVERLAPS)
    on_preview(result)


class Flattener:
    """Flattens one mesh repeatedly and caches everything that depends on the mesh alone.

    The cache holds the checked mesh, its intrinsic Delaunay triangulation, its factorized Laplacian, and the Green's
    functions of the cones used last. Results are bitwise equal to those of `coneflat.flatten`. Other marked seams,
    other lengths or a different repair change the mesh and clear the cache. An object is not thread-safe.

        flattener = Flattener(vertices, faces)
        for curvature in (1.0, 1.5, 2.0):
            flattener.flatten(cones={7: curvature, 12: None, 80: None})

    Args:
        mesh, faces: as for `coneflat.flatten`; arrays must not be modified afterwards.

    Raises:
        MeshError: the input is not a mesh.
        MeshFileError: its file cannot be read.

    Examples:
        >>> vertices = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
        >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
        >>> flattener = coneflat.Flattener(vertices, faces)
        >>> [len(flattener.flatten(cones=cones).cones) for cones in ([0, 1, 2], [0, 1, 2, 3])]
        [3, 4]
    """

    def __init__(self, mesh: Any, faces: ArrayLike | None = None) -> None:
        self._source = Source(as_input(mesh, faces))
        self._surfaces: dict[tuple[int, bool], ConeSurface] = {}
        self._threads: int | None = None

    @warns()
    def flatten(self, *, on_preview: Preview | None = None, **options: Any) -> Flattening:
        """Return the flattening for the given options.

        Args:
            on_preview: called with the first layout: one chart per part, before triangles are relaxed and overlaps
                are separated; its overlaps are not measured.
            options: those of `coneflat.flatten`.

        Raises:
            ConeflatError: as for `coneflat.flatten`.
        """
        return self.flatten_as(read_options(options), on_preview)

    @warns()
    def flatten_as(self, options: Options, on_preview: Preview | None = None) -> Flattening:
        """Return the flattening for parsed options; see `flatten`.

        Args:
            options: parsed options.
            on_preview: called with an early result, if given.
        """
        # The last digits of cached values depend on the number of threads.
        if options.threads != self._threads:
            self._surfaces, self._threads = {}, options.threads
        meshes = {id(part.mesh) for part in self._source.prepared(options).components}
        self._surfaces = {key: surface for key, surface in self._surfaces.items() if key[0] in meshes}
        try:
            return flatten_source(self._source, options, self._surface, on_preview=on_preview)
        finally:
            self._close_searches()

    def _surface(self, mesh: TriangleMesh, lengths: FloatArray, flips: bool) -> ConeSurface:
        self._close_searches()
        key = id(mesh), flips
        if key not in self._surfaces:
            self._surfaces[key] = ConeSurface.of(mesh, lengths, flips)
            self._surfaces[key].is_reused = True
        if self._surfaces[key].lengths is not lengths:  # a retry has opened thin triangles
            return ConeSurface.of(mesh, lengths, flips)
        return self._surfaces[key]

    def _close_searches(self) -> None:
        """Delete the searches for cones: the sets that they found must not affect later results."""
        for surface in self._surfaces.values():
            surface.close_search()
