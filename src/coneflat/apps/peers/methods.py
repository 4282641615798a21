"""Flattening by the methods with which the package is compared, and by its own methods."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from ... import Flattening, TriangleMesh
from ...base import FloatArray, warns
from ...flattener import flatten_source
from ...io import as_input
from ...metric import find_metric
from ...options import Choice, Options, option, read_options
from ...source import Source
from ...stages import ConeSolution, FlatMetric, MetricSpec, Surface
from .bff import boundary_first
from .disk_maps import least_squares_map

#: The compared methods; each takes a connected mesh, its (m, 3) side lengths, and cones with their curvatures.
PEERS: Mapping[str, Callable[[TriangleMesh, FloatArray, ConeSolution], FlatMetric]] = {
    "lscm": least_squares_map,
    "bff": boundary_first,
}
#: All methods of `flatten_by`.
METHODS = ("exact", "linear", *PEERS)


def label_of(method: str) -> str:
    """Return the label of a method in tables, which says that a method of others is not the program of its authors."""
    return f"{method} (reimplemented here)" if method in PEERS else method


@dataclass(frozen=True, kw_only=True)
class PeerOptions(Options):
    """Options of `coneflat.flatten`, with all methods.

    Attributes:
        method: Name of the method.
    """

    method: str = option("exact", Choice(METHODS))


@warns()
def flatten_by(name: str, mesh: Any, faces: ArrayLike | None = None, **options: Any) -> Flattening:
    """Flatten a triangle mesh by a given method; the default is one chart per component, which all methods support.

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
    read = read_options({"charts": "one", **options, "method": name}, PeerOptions)

    def find(surface: Surface, solution: ConeSolution, spec: MetricSpec) -> FlatMetric:
        if name not in PEERS:
            return find_metric(surface, solution, spec)
        return PEERS[name](surface.mesh, surface.lengths, solution)

    return flatten_source(Source(as_input(mesh, faces)), read, find_metric=find)
