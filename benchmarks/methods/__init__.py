"""Methods of the paper's tables that are not in the package: circle patterns and angle based flattening, with cones.

Circle patterns are also an independent way to the exact metric, which they verify; they take about eight times as long.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coneflat import ConeflatError, Flattening
from coneflat.apps.peers.run import Comparison, Entry, compare_methods, entry_of
from coneflat.flattener import flatten_source
from coneflat.io import as_input
from coneflat.options import Choice, Options, option, read_options
from coneflat.source import Source
from coneflat.stages import ConeSolution, FlatMetric, MetricSpec, Surface

from .abf import angle_based, linear_angles, nearest_angles
from .patterns import circle_patterns

#: The methods; each takes a connected mesh, its (m, 3) side lengths, and cones with their curvatures. Those with a /
#: are the variants as used in 2008: circle patterns without edge flips, and angle based flattening that prescribes
#: nothing at cones.
METHODS: Mapping[str, Callable[..., FlatMetric]] = {
    "circle-patterns": circle_patterns,
    "circle-patterns/fixed": partial(circle_patterns, delaunay=False),
    "linear-abf": partial(angle_based, solve=linear_angles),
    "linear-abf/free": partial(angle_based, solve=linear_angles, is_free=True),
    "abf++": partial(angle_based, solve=nearest_angles),
}


@dataclass(frozen=True, kw_only=True)
class MethodOptions(Options):
    """Options of `coneflat.flatten`, by one of the methods.

    Attributes:
        method: Name of the method.
    """

    method: str = option("circle-patterns", Choice(tuple(METHODS)))


def flatten_with(name: str, mesh: Any, faces: ArrayLike | None = None, **options: Any) -> Flattening:
    """Flatten a mesh by one of `METHODS`; the default is one chart per component. Arguments are those of `flatten`.

    Raises:
        OptionError: the method is unknown, or an option is invalid.
        ConvergenceError: the method did not converge, or there is no such pattern.
        ConeflatError: another of the errors of `coneflat.flatten`.
    """
    read = read_options({"charts": "one", **options, "method": name}, MethodOptions)

    def find(surface: Surface, solution: ConeSolution, spec: MetricSpec) -> FlatMetric:
        return METHODS[name](surface.mesh, surface.lengths, solution)

    return flatten_source(Source(as_input(mesh, faces)), read, find_metric=find)


def compare_all(mesh: Any, *, methods: Sequence[str], **options: Any) -> Comparison:
    """Return the results of several methods, of the package and of the benchmarks, with the same cones and cut.

    Args:
        mesh: as for `coneflat.flatten`.
        methods: names of `coneflat.peers.METHODS`, among them the one that finds the cones, and of `METHODS`.
        options: as for `coneflat.peers.compare_methods`; none that concern the vertices of the input.
    """
    own = [name for name in methods if name not in METHODS]
    found = compare_methods(mesh, methods=own, peers=(), **options)
    base = found[options.get("method", "exact")].result
    assert base is not None
    cones = dict(zip(base.cones.tolist(), base.curvatures.tolist(), strict=True)) or "none"
    entries = {entry.method: entry for entry in found.entries}
    for name in methods:
        if name in METHODS:
            try:
                result = flatten_with(name, base.vertices, base.faces, cones=cones)
                entries[name] = entry_of(name, result, base)
            except ConeflatError as error:
                entries[name] = Entry(name, None, np.nan, " ".join(str(error).split()))
    return Comparison(tuple(entries[name] for name in methods))
