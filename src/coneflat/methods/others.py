"""The methods that ours is compared with, by name; each is loaded when it is asked for."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeAlias

from .._arrays import FloatArray
from ..cones import ConeSolution
from ..mesh import TriangleMesh
from .base import FlatMetric

#: Takes a connected mesh, its (m, 3) side lengths, cones with their curvatures, and whether a result that did not
#: converge is wanted nevertheless.
Method: TypeAlias = Callable[[TriangleMesh, FloatArray, ConeSolution, bool], FlatMetric]


def other_method(name: str) -> Method:
    """Return the method of a name."""
    base, _, variant = name.partition("/")
    cones = "free" if variant == "free" else "prescribed"
    if base == "circle-patterns":
        from .circle_patterns import circle_patterns

        return partial(circle_patterns, delaunay=variant != "fixed")
    if base == "ricci":
        from .ricci import ricci_flow

        return ricci_flow
    if base == "linear-abf":
        from .angle_based import linear_abf

        return partial(linear_abf, cones=cones)
    if base == "abf++":
        from .angle_based import abf_plus_plus

        return partial(abf_plus_plus, cones=cones)
    if base == "lscm":
        from .lscm import lscm

        return lscm
    if base == "spectral":
        from .spectral import spectral

        return spectral
    from .bff import boundary_first

    return boundary_first
