"""Flattening: cones, target curvatures, scaling, cutting, layout (Section 4 of the paper)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from .atlas import separate_overlaps
from .attempts import SHARP_ANGLE, is_machined, with_corners_as_cones
from .base.arrays import FloatArray, IntArray
from .base.notes import Unmet, warns
from .base.progress import Stopwatch
from .base.text import list_some, plural
from .base.threads import concurrently, limit_threads
from .bounds import TOLERATED_EXCESS, borders_and_distortion, bound_notes, excess, is_too_distorted, rank
from .cones import MAX_SEARCHED, ConeSurface, find_cones, leaves_flat_disks
from .errors import ConvergenceError, CurvatureError, MetricError, OptionError, SeamError
from .evaluate import evaluate
from .geometry.opening import RISKY_AREA, thickness, with_slack
from .geometry.operators import weighted_areas
from .geometry.overlap import UNKNOWN_OVERLAPS
from .io.packages import as_input
from .layout import lay_out, lay_out_flat_disks
from .mesh.connectivity import TriangleMesh
from .metric import find_metric as conformal_metric
from .metric import loop_rotations
from .optimise import mean_qc, relax_layouts, untangle_seams
from .options import Options, read_options, takes
from .result import Flattening
from .seams import cut_to_disk, seam_costs
from .source.copies import Copy, copied, find_copies
from .source.parts import Part, Prepared, Source
from .stages import ConeSolution, ConeSpec, FlatMetric, Layout, MetricSpec, RelaxSpec, Surface

#: Receives the first layout, before triangles are relaxed and overlaps are separated.
Preview: TypeAlias = Callable[[Flattening], object]
#: Returns a connected mesh with the operators of its (m, 3) lengths; the flag allows edge flips.
SurfaceOf: TypeAlias = Callable[[TriangleMesh, FloatArray, bool], ConeSurface]
#: Returns the flat metric of a connected mesh for its cones.
FindMetric: TypeAlias = Callable[[Surface, ConeSolution, MetricSpec], FlatMetric]

# Largest number of cone searches per part. A search is repeated if the triangles around a cone cannot hold its angle.
MAX_SEARCHES = 4
# A part beyond the allowed area distortion is relaxed with this stretch, then flattened with tighter bounds of the
# search: at most so often, and by at most this factor each time.
MAX_CORRECTIONS, MAX_TIGHTENING, CORRECTING_STRETCH = 2, 2.0, 0.1
# Curvature error of an infeasible cone, radians: ideally a full turn; rounding and untangled neighbours reduce it.
INFEASIBLE_ERROR = 1.0
# A log scale that varies by less is constant: the surface is a polyhedron with vertices as cones, cut along its edges.
CONSTANT_SCALE = 1e-9
# Parts with at most SMALL_TRIANGLES triangles are relaxed together, as one mesh of about GROUP_TRIANGLES: 13% of the
# time of 60 spheres of 320 triangles.
SMALL_TRIANGLES, GROUP_TRIANGLES = 500, 40_000
# Fraction of the work that computes the layouts; the rest relaxes and separates them.
LAYING_OUT = 0.8


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


@dataclass(frozen=True)
class Method:
    """How the parts of a mesh are flattened.

    Attributes:
        relax: which triangles are relaxed.
        separates: overlaps are separated into charts.
        quantum: rotations across seams are multiples of it, radians; None for any rotation.
        watch: the stopwatch.
        surface_of, find_metric: the two steps that a caller can replace.
        untangles: inverted triangles are flipped where both sides of the seams can stay equal.
        names_parts: errors say in which part they occur, as there are several.
    """

    relax: RelaxSpec
    separates: bool
    quantum: float | None
    watch: Stopwatch
    surface_of: SurfaceOf
    find_metric: FindMetric
    untangles: bool = True
    names_parts: bool = False


def flatten_source(
    source: Source,
    o: Options,
    surface_of: SurfaceOf = ConeSurface.of,
    find_metric: FindMetric = conformal_metric,
    on_preview: Preview | None = None,
) -> Flattening:
    """Return the flattening of a mesh by parsed options; see `flatten`.

    Args:
        source: the mesh.
        o: the options.
        surface_of: returns a part with the operators of its metric; they may be cached.
        find_metric: returns the flat metric for the cones of a part.
        on_preview: called with the first layout: one chart per part, before triangles are relaxed and overlaps are
            separated; its overlaps are not measured.

    Raises:
        ConeflatError: as for `flatten`.
    """
    watch = Stopwatch(o.progress)
    with watch("check"):
        prepared = source.prepared(o)
    relax = RelaxSpec(o.relax if o.method == "exact" else "off", o.stretch)
    names_parts = len(prepared.parts) > 1
    method = Method(
        relax, o.charts == "atlas", o.quantise, watch, surface_of, find_metric, names_parts=names_parts
    )
    with limit_threads(o.threads):
        show = None if on_preview is None else partial(_preview, prepared, o, on_preview)
        layouts = flatten_parts(prepared.parts, method, show)
        prepared, layouts = cut_along_sharp_edges(source, prepared, layouts, o, method)
    layouts[0] = layouts[0].with_notes(*bound_notes(prepared.parts, layouts, o))
    return evaluate(prepared, layouts, o, watch)


def _preview(prepared: Prepared, o: Options, on_preview: Preview, layouts: Sequence[Layout]) -> None:
    on_preview(evaluate(prepared, layouts, replace(o, charts="one"), Stopwatch(), UNKNOWN_OVERLAPS))


def flatten_parts(
    parts: Sequence[Part], method: Method, on_layouts: Callable[[list[Layout]], None] | None = None
) -> list[Layout]:
    """Return the layouts of parts; of parts that are copies of each other, the layout of the first is copied.

    on_layouts: called with the first layouts of all parts, as of `flatten_source`.
    """
    # A map of another kind need not be an isometry of flat parts.
    flat = lay_out_flat_parts(parts, method.watch) if method.find_metric is conformal_metric else {}
    with method.watch("check"):
        copies = find_copies(parts, flat)
    originals = {i: part for i, part in enumerate(parts) if copies[i] is None and i not in flat}
    layouts = flat | lay_out_parts(originals, method)
    if on_layouts is not None:
        on_layouts(with_copies(layouts, parts, copies))
    finished = flat | finish_within_bound(originals, layouts, method)
    # Notes contain vertex indices, so copies of parts with notes are computed, too.
    noted = {i: parts[i] for i, copy in enumerate(copies) if copy and finished[copy.first].notes}
    finished |= finish_within_bound(noted, lay_out_parts(noted, method), method)
    return with_copies(finished, parts, copies)


def cut_along_sharp_edges(
    source: Source, prepared: Prepared, layouts: list[Layout], o: Options, method: Method
) -> tuple[Prepared, list[Layout]]:
    """Return the input with sharp edges as seams where components are too distorted otherwise, and the layouts.

    Args:
        source, prepared, o: the mesh, its parts, and the options.
        layouts: the layouts of the parts.
        method: how parts are flattened.
    """
    if not method.separates or o.sharp_angle is not None:
        return prepared, layouts
    pairs = enumerate(zip(prepared.parts, layouts, strict=True))
    distorted = [
        i for i, (part, layout) in pairs if is_machined(part.mesh) and is_too_distorted(part, layout)
    ]
    if not distorted:
        return prepared, layouts
    try:
        sharp = source.prepared(replace(o, sharp_angle=SHARP_ANGLE))
    except (OptionError, SeamError):  # options name vertices or edges that such seams exclude
        return prepared, layouts
    pieces_of = sharp.pieces_of(prepared, distorted)
    pieces = [piece for i in distorted for piece in pieces_of[i]]
    try:
        flat = iter(flatten_parts(pieces, method))
    except (CurvatureError, MetricError, SeamError):
        return prepared, layouts
    replaced = {}
    for i in distorted:
        part, cut = prepared.parts[i], [next(flat) for _ in pieces_of[i]]
        is_better = rank(pieces_of[i], cut) < rank([part], [layouts[i]])
        is_cheaper = borders_and_distortion(pieces_of[i], cut) < borders_and_distortion([part], [layouts[i]])
        if is_better and is_cheaper:
            note = (
                f"Edges above {np.degrees(SHARP_ANGLE):g} degrees are seams {part.where}: without them its mean QC "
                f"distortion is {mean_qc(layouts[i]):.3g}."
            )
            replaced[i] = [cut[0].with_notes(note), *cut[1:]]
    if not replaced:
        return prepared, layouts
    together = [replaced.get(i, [layout]) for i, layout in enumerate(layouts)]
    return prepared.with_pieces(sharp, {i: pieces_of[i] for i in replaced}), [
        layout for several in together for layout in several
    ]


def lay_out_flat_parts(parts: Sequence[Part], watch: Stopwatch) -> dict[int, Layout]:
    """Return the finished layouts of the small parts that are flat disks and do not overlap themselves.

    An isometry is their only flat metric without cones, so nothing is searched, solved or relaxed.
    """
    chosen = [i for i, part in enumerate(parts) if len(part.faces) <= SMALL_TRIANGLES and _may_be_flat(part)]
    if not chosen:
        return {}
    with watch("layout"):
        layouts = lay_out_flat_disks(
            [parts[i].mesh for i in chosen],
            [parts[i].lengths for i in chosen],
            [parts[i].metric.keeps_length for i in chosen],
        )
    return {i: layout for i, layout in zip(chosen, layouts, strict=True) if layout is not None}


def _may_be_flat(part: Part) -> bool:
    """Return whether a part is laid out without cones and with a free shape if it is a flat disk."""
    return part.is_exact and part.metric.boundary in ("free", "lengths") and leaves_flat_disks(part.cones)


def lay_out_parts(parts: Mapping[int, Part], method: Method) -> dict[int, Layout]:
    """Return the layout of each part in one chart."""
    layouts, places = {}, _Places(parts, method, LAYING_OUT)
    for i, part in parts.items():
        with places.at(part):
            layouts[i] = lay_out_part(part, method)
    return layouts


def lay_out_part(part: Part, method: Method) -> Layout:
    """Return the layout of a part in one chart.

    If no metric is found because of thin triangles, such as those that rounded coordinates leave, all are opened more.
    """
    try:
        return lay_out_with_lengths(part, method)
    except ConvergenceError:
        if not (thickness(part.lengths) < RISKY_AREA).any():
            raise
    return lay_out_with_lengths(replace(part, lengths=with_slack(part.lengths)), method)


def lay_out_with_lengths(part: Part, method: Method) -> Layout:
    """Return the layout of a part in one chart.

    The triangles around a cone may be unable to hold its angle, which is known only after the layout. Then other cones
    are searched for: each search forbids the cones that were infeasible before. A later search may have more infeasible
    cones, so the best layout of all searches is returned.
    """
    with method.watch("cones", 0.1):
        surface = method.surface_of(part.mesh, part.lengths, part.is_exact)
    best, wanted = None, part.cones
    for _ in range(MAX_SEARCHES):
        tried, was_searched = lay_out_once(surface, part, wanted, method)
        best = tried if best is None or _failures(tried) < _failures(best) else best
        infeasible = infeasible_cones(tried)
        if not (was_searched and part.is_exact and len(infeasible)):
            break
        wanted = wanted.without(infeasible)
    assert best is not None
    return best


def lay_out_once(surface: ConeSurface, part: Part, wanted: ConeSpec, method: Method) -> tuple[Layout, bool]:
    """Return a layout of a part with the cones found for it, and whether the sparse search found them."""
    watch, mesh = method.watch, part.mesh
    with watch("cones", 0.5):
        if wanted.quantum is not None:
            wanted = replace(wanted, rotations=loop_rotations(surface, part.metric))
        # The second thread prepares what the metric needs from the surface alone.
        with concurrently(partial(surface.prepare, part.metric.method), len(mesh.faces)):
            cones = find_cones(surface, wanted)
        is_polyhedron = bool(np.ptp(cones.log_scale) < CONSTANT_SCALE)
        costs = seam_costs(mesh, part.lengths, part.seams, is_polyhedron)
    # The cut depends on the cones alone. Computing it next to the metric saves 9% of the time with 97,000 triangles on
    # two threads, 10% with 29,000.
    cutting = partial(cut_to_disk, mesh, cones.cones, costs, part.seams)
    with concurrently(cutting, len(mesh.faces)) as cut:
        with watch("metric", 0.8):
            metric = method.find_metric(surface, cones, part.metric)
        with watch("cut", 0.9):
            disk = cut.result()
    with watch("layout", 1.0):
        areas = weighted_areas(surface.areas, part.cones.weights)
        layout = lay_out(metric, disk, method.untangles).with_area_distortion(cones.log_scale, areas)
    return layout.with_notes(*cones.notes), cones.is_searched


def finish_parts(
    parts: Mapping[int, Part], layouts: Mapping[int, Layout], method: Method
) -> dict[int, Layout]:
    """Return relaxed layouts without inverted triangles, and without overlaps if the method separates them."""
    watch, finished = method.watch, dict[int, Layout]()
    places = _Places(parts, method, 1 - LAYING_OUT)
    for group in _groups(parts, method.relax):
        watch.share = 0.0
        with watch("relax"):
            weights = [parts[i].cones.weights for i in group]
            relaxed = relax_layouts([layouts[i] for i in group], weights, method.relax, watch.report)
        for i, layout in zip(group, relaxed, strict=True):
            with places.at(parts[i]):
                finished[i] = finish_part(parts[i], layout, method)
    return finished


def finish_part(part: Part, layout: Layout, method: Method) -> Layout:
    """Return a relaxed layout without inverted triangles, and without overlaps if the method separates them."""
    if part.is_exact:
        with method.watch("relax", 0.2):
            layout = untangle_seams(layout, part.cones, method.relax.stretch, method.quantum)
        layout = layout.with_notes(*_infeasible_notes(layout, part))
    if method.separates:
        with method.watch("atlas", 1.0):
            layout = separate_overlaps(layout, seam_costs(part.mesh, part.lengths, part.seams), part.seams)
    return layout


def finish_within_bound(
    parts: Mapping[int, Part], layouts: Mapping[int, Layout], method: Method
) -> dict[int, Layout]:
    """Return finished layouts whose area distortion is at most the one allowed, as far as possible.

    The cone search bounds the distortion of the linear model. On coarse meshes, that of the triangles in the plane may
    be larger. First all triangles of such a part are relaxed with some weight on areas, then more cones are searched.
    A polyhedron with few corners, or one that is too distorted, opens at all of them, where that is better.
    """
    finished = finish_parts(parts, layouts, method)
    distorted = {i for i, part in parts.items() if is_too_distorted(part, finished[i])}
    _try(with_corners_as_cones(parts, finished, distorted), finished, parts, method)
    beyond = {i: part for i, part in parts.items() if excess([part], [finished[i]]) > TOLERATED_EXCESS}
    if len(beyond) > 0 and not method.relax.is_off and method.relax.stretch < CORRECTING_STRETCH:
        method = replace(method, relax=replace(method.relax, stretch=CORRECTING_STRETCH))
        _keep_better(finished, finish_parts(beyond, layouts, method), parts)
    for _ in range(MAX_CORRECTIONS):
        factors = {i: min(excess([parts[i]], [finished[i]]), MAX_TIGHTENING) for i in beyond}
        # About that many times as many cones are needed; a search without enough of them takes longest.
        beyond = {
            i: beyond[i].with_distortion(TOLERATED_EXCESS / factors[i])
            for i in beyond
            if factors[i] > TOLERATED_EXCESS and factors[i] * len(finished[i].cones) <= MAX_SEARCHED
        }
        beyond = {i: beyond[i] for i in _try(beyond, finished, parts, method)}
    return finished


def _try(
    attempts: Mapping[int, Part], finished: dict[int, Layout], parts: Mapping[int, Part], method: Method
) -> list[int]:
    """Replace finished layouts by those of parts with other cones where these are better; return their indices.

    An attempt that fails leaves the finished layout as it is.
    """
    better = []
    for group in _groups(attempts, method.relax):
        chosen = {i: attempts[i] for i in group}
        with suppress(CurvatureError, MetricError, SeamError):
            better += _keep_better(
                finished, finish_parts(chosen, lay_out_parts(chosen, method), method), parts
            )
    return better


def _keep_better(
    finished: dict[int, Layout], others: Mapping[int, Layout], parts: Mapping[int, Part]
) -> list[int]:
    """Replace finished layouts of parts by better ones, and return the indices of these parts."""
    better = [i for i in others if rank([parts[i]], [others[i]]) < rank([parts[i]], [finished[i]])]
    finished.update((i, others[i]) for i in better)
    return better


def infeasible_cones(layout: Layout) -> IntArray:
    """Return the infeasible cones: the triangles around them, with angles below pi, cannot hold their angle."""
    error = (layout.target - layout.curvature)[layout.cones]
    return layout.cones[np.abs(error) > INFEASIBLE_ERROR]


def _failures(layout: Layout) -> tuple[int, int]:
    """Return the number of notes and the number of infeasible cones, by which layouts are compared."""
    return len(layout.notes), len(infeasible_cones(layout))


def _infeasible_notes(layout: Layout, part: Part) -> Iterator[Unmet]:
    infeasible = sorted(infeasible_cones(layout), key=layout.target.item)
    if infeasible:
        shown = [f"vertex {part.cones.names[v]} ({2 - layout.target[v] / np.pi:.3g} pi)" for v in infeasible]
        yield Unmet(
            f"{plural(len(infeasible), 'cone')} with an angle that the surrounding triangles cannot form: "
            f"{list_some(shown)}; choose others, or refine the mesh."
        )


def with_copies(
    known: Mapping[int, Layout], parts: Sequence[Part], copies: Sequence[Copy | None]
) -> list[Layout]:
    """Return the layouts of all parts; a missing layout is copied from the part of which it is a copy."""
    return [
        copied(known[copy.first], parts[i], copy.scale) if copy and i not in known else known[i]
        for i, copy in enumerate(copies)
    ]


def _groups(parts: Mapping[int, Part], relax: RelaxSpec) -> list[list[int]]:
    """Return groups of part indices; small parts share a group and are relaxed together."""
    groups, small, capacity = list[list[int]](), list[int](), 0
    for i, part in parts.items():
        size = len(part.faces)
        if relax.is_off or size > SMALL_TRIANGLES:
            groups.append([i])
            continue
        if capacity < size:
            groups.append(small := [])
            capacity = GROUP_TRIANGLES
        small.append(i)
        capacity -= size
    return groups


class _Places:
    """The places of parts in a portion of the work, for its progress and for errors.

    Args:
        parts: all parts.
        method: the stopwatch, and whether errors name parts.
        portion: fraction of the work.
    """

    def __init__(self, parts: Mapping[int, Part], method: Method, portion: float) -> None:
        self._watch, self._names_parts = method.watch, method.names_parts
        self._count, self._begun = len(parts), 0
        self._share = portion / max(sum(len(part.faces) for part in parts.values()), 1)

    @contextmanager
    def at(self, part: Part) -> Iterator[None]:
        """Run the work on the next part in the block."""
        self._begun += 1
        self._watch.share = self._share * len(part.faces)
        if self._count > 1:
            self._watch.component = f"component {self._begun:,} of {self._count:,}"
        try:
            yield
        except (CurvatureError, MetricError, SeamError) as error:
            if not self._names_parts:
                raise
            raise type(error)(f"{part.where}: {error}") from error
        self._watch.end_component()
