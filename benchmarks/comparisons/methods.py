"""Flattening by the methods of the package, and by baselines on the same cones."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from numpy.typing import ArrayLike

from coneflat import Flattening, TriangleMesh
from coneflat.base import FloatArray
from coneflat.base.progress import stage
from coneflat.flattener import flatten_source
from coneflat.io import as_input
from coneflat.metric import find_metric
from coneflat.options import Choice, Options, option, read_options
from coneflat.source import Source
from coneflat.stages import ConeSolution, FlatMetric, MetricSpec, Surface

from .abf import angle_based, linear_angles, nearest_angles
from .bff import boundary_first
from .disk_maps import least_squares_map
from .patterns import circle_patterns

#: Baselines that need cones, or only a cut through them; each takes a connected mesh, its (m, 3) side lengths, and
#: cones with their curvatures. Those with a / are the variants of 2008: circle patterns without edge flips, and angle
#: based flattening that prescribes nothing at cones.
CONE_BASELINES: Mapping[str, Callable[[TriangleMesh, FloatArray, ConeSolution], FlatMetric]] = {
    "lscm": least_squares_map,
    "bff": boundary_first,
    "circle-patterns": circle_patterns,
    "circle-patterns/fixed": partial(circle_patterns, delaunay=False),
    "linear-abf": partial(angle_based, solve=linear_angles),
    "linear-abf/free": partial(angle_based, solve=linear_angles, is_free=True),
    "abf++": partial(angle_based, solve=nearest_angles),
}
#: All methods of `flatten_by`: those of the package and the baselines.
METHODS = ("exact", "linear", *CONE_BASELINES)
#: The methods that are compared by default; the others take several times as long.
COMPARED_METHODS = ("exact", "linear", "lscm", "bff")


def label_of(method: str) -> str:
    """Return the label of a method in tables, which says that a baseline is not the program of its authors."""
    return f"{method} (reimplemented here)" if method in CONE_BASELINES else method


@dataclass(frozen=True, kw_only=True)
class ComparedOptions(Options):
    """Options of `coneflat.flatten`, with all methods.

    Attributes:
        method: Name of the method.
    """

    method: str = option("exact", Choice(METHODS))


def flatten_by(name: str, mesh: Any, faces: ArrayLike | None = None, **options: Any) -> Flattening:
    """Flatten a triangle mesh by one of `METHODS`; the default is one chart per component, which all methods support.

    Args:
        name: one of `METHODS`.
        mesh, faces: as for `coneflat.flatten`.
        options: those of `coneflat.flatten`, except the method. Options of the exact method alone raise an error for
            other methods.

    Returns:
        The result, as from `coneflat.flatten`.

    Raises:
        OptionError: the method is unknown, or an option is invalid.
        ConvergenceError: the method did not converge.
        ConeflatError: another of the errors of `coneflat.flatten`.
    """
    settings = read_options({"charts": "one", **options, "method": name}, ComparedOptions)

    @stage("metric")
    def find(surface: Surface, solution: ConeSolution, spec: MetricSpec) -> FlatMetric:
        if name not in CONE_BASELINES:
            return find_metric(surface, solution, spec)
        return CONE_BASELINES[name](surface.mesh, surface.lengths, solution)

    return flatten_source(Source(as_input(mesh, faces)), settings, find_metric=find)
