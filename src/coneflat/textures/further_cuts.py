"""Charts that are cut further for packing, within the bound of the energy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from ..base import FloatArray, stage, within_time
from ..base.progress import component_at_work
from ..options import Options
from ..stages import Layout
from .candidates import Candidate, CutModel
from .cut_search import Searched
from .fitting import cut_to_fit
from .options import UnwrapOptions
from .pack_cuts import cut_for_packing, cut_into
from .shortening import cut_further
from .small_charts import join_small_charts
from .straightening import straightened
from .work import PACKING_CUTS, minor_components, threads_for

#: Largest number of sets of charts per component whose finished layouts are cached.
MAX_FINISHED = 4


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

    with threads_for(searched.components, options), component_at_work("", PACKING_CUTS), stage("pack"):
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
    is_minor = minor_components(searched.components)
    finished, cache = dict[int, Candidate](), searched.finished
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
