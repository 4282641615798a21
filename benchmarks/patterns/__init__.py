"""Circle patterns, an independent way to a flat metric.

They verify the exact metric, and are a method of the paper's tables. They take about eight times as long.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coneflat import ConeflatError, Flattening
from coneflat.apps.peers.run import Comparison, Entry, compare_methods, entry_of
from coneflat.flatten import flatten_source
from coneflat.io import as_input
from coneflat.options import Choice, Options, option, read_options
from coneflat.source import Source
from coneflat.stages import ConeSolution, FlatMetric, MetricSpec, Surface

from .metric import circle_patterns

#: Circle patterns with edge flips, and without as in 2008.
PATTERNS: dict[str, Callable[..., FlatMetric]] = {
    "circle-patterns": circle_patterns,
    "circle-patterns/fixed": partial(circle_patterns, delaunay=False),
}


@dataclass(frozen=True, kw_only=True)
class PatternOptions(Options):
    """Options of `coneflat.flatten`, by circle patterns.

    Attributes:
        method: Name of the method.
    """

    method: str = option("circle-patterns", Choice(tuple(PATTERNS)))


def flatten_by_patterns(
    mesh: Any, faces: ArrayLike | None = None, *, method: str = "circle-patterns", **options: Any
) -> Flattening:
    """Flatten a mesh by circle patterns; the default is one chart per component. Arguments are those of `flatten`.

    Raises:
        ConvergenceError: there is no such pattern, or it was not found.
        ConeflatError: another of the errors of `coneflat.flatten`.
    """
    read = read_options({"charts": "one", **options, "method": method}, PatternOptions)

    def find(surface: Surface, solution: ConeSolution, spec: MetricSpec) -> FlatMetric:
        return PATTERNS[method](surface.mesh, surface.lengths, solution)

    return flatten_source(Source(as_input(mesh, faces)), read, find_metric=find)


def compare_with_patterns(mesh: Any, *, methods: Sequence[str], **options: Any) -> Comparison:
    """Return the results of several methods, among them circle patterns, with the same cones and cut.

    Args:
        mesh: as for `coneflat.flatten`.
        methods: names of `coneflat.peers.METHODS`, among them the one that finds the cones, and of `PATTERNS`.
        options: as for `coneflat.peers.compare_methods`; none that concern the vertices of the input.
    """
    own = [name for name in methods if name not in PATTERNS]
    found = compare_methods(mesh, methods=own, peers=(), **options)
    base = found[options.get("method", "exact")].result
    assert base is not None
    cones = dict(zip(base.cones.tolist(), base.curvatures.tolist(), strict=True)) or "none"
    entries = {entry.method: entry for entry in found.entries}
    for name in PATTERNS:
        if name in methods:
            try:
                result = flatten_by_patterns(base.vertices, base.faces, method=name, cones=cones)
                entries[name] = entry_of(name, result, base)
            except ConeflatError as error:
                entries[name] = Entry(name, None, np.nan, " ".join(str(error).split()))
    return Comparison(found.name, found.triangles, tuple(entries[name] for name in methods))
