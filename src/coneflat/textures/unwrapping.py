"""Unwrapping of meshes for textures: `search_cuts` and `pack_searched` are the method, top to bottom."""

from __future__ import annotations

import pickle
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ..base import (
    FloatArray,
    current_time,
    is_time_up,
    limit_threads,
    search_time,
    stage,
    timing,
    warns,
    within_time,
)
from ..base.progress import component_at_work
from ..base.search_time import SearchTime
from ..errors import ConvergenceError
from ..evaluate import evaluate, packed_scale
from ..flattening import Steps
from ..geometry import double_areas
from ..groups import lay_out_flat_components, with_copies
from ..io import as_input
from ..metric import find_metric
from ..options import Options, declarations, read_options, takes
from ..result import Flattening
from ..source import Component, LatestCache, Prepared, Source, find_copies
from ..source.copies import Copy
from ..stages import ConeSolution, FlatMetric, Layout, MetricSpec, Surface
from .candidates import Candidate, CutModel
from .creases import along_sharp_edges
from .density import expected_resolution, least_resolution
from .energy import EnergyBound
from .fitting import cut_to_fit
from .free_seams import measured, seam_edges
from .minor import cuts_together, is_searchable_together
from .mirror import half_of
from .notes import FREE, with_notes
from .options import ISOMETRIC, UnwrapOptions, options_of_stages
from .pack_cuts import cut_for_packing, cut_into
from .search import best_cut
from .sharing import SharedTexels, with_shared_texels
from .shortening import cut_further
from .small_charts import join_small_charts
from .stacked import without_copies
from .straightening import straightened
from .work import SearchWork, groups_of_minor

# Components with less than this share of the area are cut together: 3,000 take 21 s instead of 140. With 0.05
# instead, 26 models in one file take 40% less time, and their seams are 10% longer.
MINOR_SHARE = 0.03
# Fractions of the work: checking, cuts for packing, and measuring the result. The rest searches for the cuts.
CHECKING, PACKING_CUTS, FINISHING = 0.05, 0.15, 0.1
# Triangles of a component from which several threads are faster than one.
PARALLEL = 20_000
# Newton steps of the exact metric: most meshes take 10, bad ones 100 and more.
MAX_NEWTON_STEPS = 25

#: The components that are cut, by their index: those that are no copies of others.
Models: TypeAlias = Mapping[int, CutModel]


@takes(UnwrapOptions)
@warns()
def unwrap(mesh: Any, faces: ArrayLike | None = None, **options: Any) -> Flattening:
    """Return UVs for a texture: the shortest seams for which the layout is nearly isometric.

    Unlike in `flatten`, the two sides of a seam may differ, which lowers the distortion. Cones are only the ends of
    seams. Branches of charts are cut off where the texture gains more than the seams cost, by the strength
    `packing_cuts`; not if `charts` is "one" or a number, `seams` is "none", or `up` is given.

    Args:
        mesh, faces: as for `coneflat.flatten`.
        options: see below.

    Returns:
        The layout in the unit square with its seams and measures. Its energy is `distortion.energy`.

    Raises:
        OptionError: the bound is not above 4, or an option is unknown or invalid.
        MeshError, MeshFileError, CurvatureError, SeamError, MetricError, TooLargeError: as for `coneflat.flatten`.

    Warns:
        GuaranteeWarning: a guarantee, or a request, is not met; notes of the result say which.

    References:
        M. Li, D. Kaufman, V. Kim, J. Solomon, A. Sheffer, "OptCuts: joint optimization of surface cuts and
        parameterization", 2018, for the problem. J. Smith, S. Schaefer, "Bijective parameterization with free
        boundaries", 2015, for the energy.

    Examples:
        >>> result = coneflat.unwrap(coneflat.sample_path())
        >>> result.distortion.energy < 4.1, result.distortion.flipped, result.distortion.overlapping_pairs
        (True, 0, 0)
    """
    return Unwrapper(mesh, faces).unwrap(**options)


class Unwrapper:
    """Unwraps one mesh repeatedly; cuts are searched again only if options other than those of packing change.

    The results are those of `unwrap`. With other options of packing (`PACKING`), three models of 6,000 to 28,000
    triangles take 0.06 to 0.8 s instead of 1.4 to 4.9.
    """

    def __init__(self, mesh: Any, faces: ArrayLike | None = None) -> None:
        """Args:
        mesh, faces: as for `unwrap`.
        """
        self._source = Source(as_input(mesh, faces))
        self._searched: LatestCache[Searched] = LatestCache()

    @warns()
    def unwrap(self, **options: Any) -> Flattening:
        """Return the UVs; options and errors are those of `unwrap`."""
        parsed = read_options(options, UnwrapOptions)
        with timing(parsed.progress), search_time(parsed.search_time):
            searched = self._searched.of(_search_key(parsed), lambda: search_cuts(self._source, parsed))
            return pack_searched(searched, parsed)


#: Options on which the search for cuts does not depend.
PACKING = (
    "packing_cuts", "padding", "resolution", "texel_density", "lightmap", "block_size", "tiles", "up", "progress",
)  # fmt: skip
#: Largest number of sets of charts per component whose finished layouts are cached.
MAX_FINISHED = 4


def _search_key(options: UnwrapOptions) -> bytes:
    """Return bytes that are equal for options for which the same cuts are found."""
    names = set(declarations(UnwrapOptions)) - set(PACKING)
    if options.hide_seams:  # Seams are hidden from above.
        names.add("up")
    return pickle.dumps([(name, getattr(options, name)) for name in sorted(names)])


@dataclass(frozen=True, eq=False)
class Searched:
    """What was found for a mesh, whatever the options of packing.

    Attributes:
        prepared, shared: the input without triangles that share the texels of others, and these.
        components: its components.
        flat: layouts of flat components.
        copies: for each component, of which it is a copy, if any.
        models: the models of components that are no copies.
        candidates: the best candidate of each component that is not a copy.
        finished: candidates that were cut further, by their component and by the chart of each triangle before.
        ended: the time of the search, if it was up before the search was complete.
    """

    prepared: Prepared
    shared: SharedTexels | None
    components: Sequence[Component]
    flat: Mapping[int, Layout]
    copies: Sequence[Copy | None]
    models: Models
    candidates: Mapping[int, Candidate]
    finished: dict[tuple[int, bytes], Candidate] = field(default_factory=dict)
    ended: SearchTime | None = None

    @property
    def ended_by_now(self) -> SearchTime | None:
        """The time that was up before the search for cuts was complete, or that for packing; None if neither was."""
        limit = current_time()
        return limit if limit and limit.is_ended else self.ended


def unwrap_source(source: Source, options: UnwrapOptions) -> Flattening:
    """Return the UVs of a mesh by parsed options; see `unwrap`."""
    with search_time(options.search_time):
        return pack_searched(search_cuts(source, options), options)


def search_cuts(source: Source, options: UnwrapOptions) -> Searched:
    """Return the cuts of a mesh by parsed options.

    The cut of each component is searched for (`search.py`): few cones and short seams for which the layout with free
    seams is within the bound of the energy.
    """
    with component_at_work("", CHECKING), stage("check"):
        prepared, shared = _without_shared(source, options_of_stages(options), options.stack)
    components = along_sharp_edges(prepared.components)
    with _threads_for(components, options):
        with stage("layout"):
            flat = lay_out_flat_components(components, max_triangles=np.inf)
        with stage("check"):
            # Copies cannot have different numbers of charts.
            is_counted = isinstance(options.charts, int)
            copies = [None] * len(components) if is_counted else find_copies(components, flat)
        models = _cut_models(components, copies, options)
        candidates = _search(models, flat, components)
    limit = current_time()
    # A copy: the time may be up later, while charts are packed.
    ended = replace(limit) if limit and limit.is_ended else None
    return Searched(prepared, shared, components, flat, copies, models, candidates, ended=ended)


def pack_searched(searched: Searched, options: UnwrapOptions) -> Flattening:
    """Return the UVs with charts that are cut further for packing (`pack_cuts.py`), and packed.

    The ends of seams are moved again to meet the bound.
    """
    options = options.with_lightmap()
    stage_options = _with_expected_resolution(
        options_of_stages(options), options, searched.components, searched.prepared.checked.exponent
    )
    return pack_candidates(searched, cut_to_pack(searched, options, stage_options), options, stage_options)


def pack_candidates(
    searched: Searched, candidates: Mapping[int, Candidate], options: UnwrapOptions, stage_options: Options
) -> Flattening:
    """Return the UVs of candidates, which are cut for packing, packed; the other arguments as of `cut_to_pack`."""
    prepared, components = searched.prepared, searched.components
    with _threads_for(components, options), stage("measure"):
        layouts = _measured_layouts(candidates, searched.flat, components, searched.copies)
    # With a density, the charts must be packed as tightly as they were when the resolution was found.
    has_density = options.texel_density is not None
    with search_time(0.0 if is_time_up() else None) if has_density else nullcontext():
        stage_options = _with_least_resolution(stage_options, options, prepared, layouts)
        with component_at_work("", FINISHING):
            result = evaluate(prepared, layouts, replace(stage_options, method=FREE))
    energies = [candidate.energy for candidate in candidates.values()]
    result = with_notes(
        result, options, energies, _count_forbidden(components, layouts), searched.ended_by_now
    )
    return result if searched.shared is None else with_shared_texels(result, searched.shared, prepared)


def _threads_for(components: Sequence[Component], options: UnwrapOptions) -> AbstractContextManager[None]:
    """Return a context with the threads that the largest component needs."""
    is_parallel = max(len(component.faces) for component in components) > PARALLEL
    return limit_threads(options.threads if is_parallel else 1)


def _without_shared(source: Source, options: Options, stack: str) -> tuple[Prepared, SharedTexels | None]:
    """Return the input without triangles that share the texels of others, and these; see the option `stack`."""
    prepared = source.prepared(options)
    if stack == "mirrored":
        shared, prepared = half_of(prepared, source, options)
    elif stack == "copies":
        shared, prepared = without_copies(prepared)
    else:
        return prepared, None
    return prepared, shared


def _with_expected_resolution(
    stage_options: Options, options: UnwrapOptions, components: Sequence[Component], exponent: int
) -> Options:
    """Return options with about the resolution that a texel density needs; exponent: see `CheckedMesh`."""
    if options.texel_density is None:
        return stage_options
    with np.errstate(over="ignore"):  # a model that is too large for any texture
        areas = np.ldexp(_double_areas_of(components) / 2, -2 * exponent)
    expected = expected_resolution(options.texel_density, areas, options.padding, options.tiles)
    return replace(stage_options, resolution=expected)


def _with_least_resolution(
    stage_options: Options, options: UnwrapOptions, prepared: Prepared, layouts: Sequence[Layout]
) -> Options:
    """Return options with the resolution that a texel density needs with given layouts."""
    if options.texel_density is None:
        return stage_options
    with stage("pack"):
        scale_at = packed_scale(prepared, layouts, stage_options)
        start = stage_options.resolution
        resolution = least_resolution(options.texel_density, options.padding, start, scale_at)
    return replace(stage_options, resolution=resolution)


def _double_areas_of(components: Sequence[Component]) -> FloatArray:
    """Return (c,) twice the area of each component."""
    return np.array([double_areas(component.lengths).sum() for component in components])


def _cut_models(
    components: Sequence[Component], copies: Sequence[Copy | None], options: UnwrapOptions
) -> Models:
    """Return the models of components that are no copies."""
    steps = Steps(find_metric=quick_metric, separates=options.charts != "one", untangles=False)
    bound = EnergyBound(options.bound, by_area=options.area is not None)
    return {i: CutModel(components[i], bound, steps) for i, copy in enumerate(copies) if copy is None}


def quick_metric(surface: Surface, solution: ConeSolution, spec: MetricSpec) -> FlatMetric:
    """Return the exact metric if few steps find it, else the linear one: a layout with free seams starts from it."""
    try:
        return find_metric(surface, solution, spec, MAX_NEWTON_STEPS)
    except ConvergenceError:
        return find_metric(surface, solution, replace(spec, method="linear"))


def _search(
    models: Models, flat: Mapping[int, Layout], components: Sequence[Component]
) -> dict[int, Candidate]:
    """Return the best candidate of each component.

    Flat components need no search. Minor ones are searched together, the others, and those of them without a candidate
    within the bound, one by one.
    """
    sizes = np.array([len(component.faces) for component in components])
    candidates = {
        i: Candidate(layout, ISOMETRIC, 0.0, 0.0, is_separated=True, keeps_points=True)
        for i, layout in flat.items()
    }
    searched = [i for i in models if i not in flat]
    work = SearchWork(int(sizes[searched].sum()), 1 - CHECKING - PACKING_CUTS - FINISHING)
    areas = _double_areas_of(components)
    is_minor = areas < MINOR_SHARE * areas.sum()
    minor = [i for i in searched if is_minor[i] and is_searchable_together(models[i])]
    for group in groups_of_minor(np.array(minor, dtype=np.int64), sizes):
        with work.at("", int(sizes[group].sum())):
            together = cuts_together([models[i] for i in group])
        candidates |= {
            i: replace(candidate, keeps_points=True)
            for i, candidate in zip(group, together, strict=True)
            if candidate is not None
        }
    alone = [i for i in models if i not in candidates]
    for number, i in enumerate(alone):
        place = f"component {number + 1:,} of {len(alone):,}" if len(alone) > 1 else ""
        with work.at(place, int(sizes[i])):
            candidates[i] = best_cut(models[i])
    return candidates


def cut_to_pack(
    searched: Searched, options: UnwrapOptions, stage_options: Options, chart_side: float | None = None
) -> dict[int, Candidate]:
    """Return candidates with charts cut further, into a number of them, for a tighter packing, or to fit in a square.

    The bound is met again afterwards: tips of seams move, and small charts are joined to others. Sides of charts become
    straight; not those of minor components, which would each need a relaxation of their own.

    Args:
        searched: what was found for the mesh.
        options, stage_options: the options, and those of the flattening.
        chart_side: side of a square in which each chart should fit, in units of the model; None for any size.
    """
    models, order = searched.models, list(searched.models)

    def costs(k: int) -> FloatArray:
        return models[order[k]].costs

    with _threads_for(searched.components, options), component_at_work("", PACKING_CUTS), stage("pack"):
        candidates: Mapping[int, Candidate] = searched.candidates
        if isinstance(options.charts, int):
            candidates = {i: _without_slivers(models[i], candidates[i]) for i in order}
        layouts = [candidates[i].layout for i in order]
        if isinstance(options.charts, int):
            layouts = cut_into(layouts, costs, options.charts)
        elif options.charts == "atlas" and options.up is None and np.isfinite(options.bound):
            gap = options.padding / stage_options.resolution
            layouts = cut_for_packing(layouts, costs, gap, options.packing_cuts)
        if chart_side is not None:
            exponent = searched.prepared.checked.exponent
            layouts = cut_to_fit(layouts, costs, float(np.ldexp(chart_side, exponent)))
        return _finished_candidates(searched, candidates, dict(zip(order, layouts, strict=True)), options)


def _finished_candidates(
    searched: Searched,
    candidates: Mapping[int, Candidate],
    layouts: Mapping[int, Layout],
    options: UnwrapOptions,
) -> dict[int, Candidate]:
    """Return candidates with the given layouts, which were cut further, within the bound of the energy."""
    areas, finished, cache = _double_areas_of(searched.components), dict[int, Candidate](), searched.finished
    is_minor = areas < MINOR_SHARE * areas.sum()
    for i, layout in layouts.items():
        key = i, layout.chart.tobytes()
        candidate = cache.get(key)
        if candidate is None:
            candidate = _finished(searched.models[i], candidates[i], layout, options)
            if not is_minor[i]:
                candidate = within_time(partial(straightened, searched.models[i], candidate)) or candidate
        finished[i] = candidate
        if len(cache) >= MAX_FINISHED * len(layouts):
            cache.clear()
        # What was ended early is not taken again.
        if searched.ended_by_now is None:
            cache[key] = candidate
    return finished


def _finished(model: CutModel, candidate: Candidate, layout: Layout, options: UnwrapOptions) -> Candidate:
    """Return a candidate whose charts were cut further, within the bound of the energy."""
    if candidate.keeps_points:
        # Flat disks are isometric; small components would each need a relaxation of their own.
        candidate = replace(candidate, layout=layout)
    else:
        candidate = cut_further(model, candidate, layout)
    return candidate if options.charts == "one" else _without_slivers(model, candidate)


def _without_slivers(model: CutModel, candidate: Candidate) -> Candidate:
    """Return a candidate whose small charts are joined to others where they fit."""
    return join_small_charts(model, candidate) if candidate.layout.chart.any() else candidate


def _measured_layouts(
    candidates: Mapping[int, Candidate],
    flat: Mapping[int, Layout],
    components: Sequence[Component],
    copies: Sequence[Copy | None],
) -> list[Layout]:
    """Return the layouts of all components with the scales and curvatures that they have."""
    layouts = {
        i: candidate.layout if candidate.layout is flat.get(i) else measured(candidate.layout)
        for i, candidate in candidates.items()
    }
    return with_copies(layouts, components, copies)


def _count_forbidden(components: Sequence[Component], layouts: Sequence[Layout]) -> int:
    """Return the number of forbidden edges that are cut."""
    return sum(
        int(component.seams.is_forbidden[seam_edges(layout)].sum())
        for component, layout in zip(components, layouts, strict=True)
        if len(layout.seams)
    )
