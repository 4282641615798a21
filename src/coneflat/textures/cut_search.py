"""The search for the cuts of all components of a mesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from ..base import current_time, stage
from ..base.progress import component_at_work
from ..base.search_time import SearchTime
from ..errors import ConvergenceError
from ..flattening import Steps
from ..groups import lay_out_flat_components
from ..metric import find_metric
from ..options import Options
from ..source import Component, Prepared, Source, find_copies
from ..source.copies import Copy
from ..stages import ConeSolution, FlatMetric, Layout, MetricSpec, Surface
from .candidates import Candidate, CutModel
from .creases import along_sharp_edges
from .energy import EnergyBound
from .minor import cuts_together, is_searchable_together
from .mirror import half_of
from .options import ISOMETRIC, UnwrapOptions, options_of_stages
from .search import best_cut
from .sharing import SharedTexels
from .stacked import without_copies
from .work import CHECKING, SEARCHING, SearchWork, groups_of_minor, minor_components, threads_for

# Newton steps of the exact metric: most meshes take 10, bad ones 100 and more.
MAX_NEWTON_STEPS = 25

#: The components that are cut, by their index: those that are no copies of others.
Models: TypeAlias = Mapping[int, CutModel]


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


def search_cuts(source: Source, options: UnwrapOptions) -> Searched:
    """Return the cuts of a mesh by parsed options.

    The cut of each component is searched for (`search.py`): few cones and short seams for which the layout with free
    seams is within the bound of the energy.
    """
    with component_at_work("", CHECKING), stage("check"):
        prepared, shared = _without_shared(source, options_of_stages(options), options.stack)
    components = along_sharp_edges(prepared.components)
    with threads_for(components, options):
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
    work = SearchWork(int(sizes[searched].sum()), SEARCHING)
    is_minor = minor_components(components)
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
