"""The methods that ours is compared with, by name; each is loaded when it is asked for."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeAlias

from .._arrays import FloatArray
from ..cones import ConeSolution
from ..errors import OptionError
from ..mesh import TriangleMesh
from .base import FlatMetric

#: Takes a connected mesh, its (m, 3) side lengths, cones with their curvatures, and whether a result that did not
#: converge is wanted nevertheless.
Method: TypeAlias = Callable[[TriangleMesh, FloatArray, ConeSolution, bool], FlatMetric]


def other_method(name: str) -> Method:
    """Return the method of a name.

    Raises:
        OptionError: there is none of that name.
    """
    match name:
        case "circle-patterns" | "circle-patterns/fixed":
            from .circle_patterns import circle_patterns

            return partial(circle_patterns, delaunay=name == "circle-patterns")
        case "ricci":
            from .ricci import ricci_flow

            return ricci_flow
        case "linear-abf" | "linear-abf/free":
            from .angle_based import linear_abf

            return partial(linear_abf, cones="prescribed" if name == "linear-abf" else "free")
        case "abf++" | "abf++/free":
            from .angle_based import abf_plus_plus

            return partial(abf_plus_plus, cones="prescribed" if name == "abf++" else "free")
        case "lscm":
            from .lscm import lscm

            return lscm
        case "spectral":
            from .spectral import spectral

            return spectral
        case "bff":
            from .bff import boundary_first

            return boundary_first
    raise OptionError(f"unknown method {name!r}")
