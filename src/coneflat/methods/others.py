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
            from ..conformal.linear_abf import linear_angles
            from .angle_based import angle_based

            cones = "prescribed" if name == "linear-abf" else "free"
            return partial(angle_based, solve=linear_angles, cones=cones)
        case "abf++" | "abf++/free":
            from ..conformal.abf import nearest_angles
            from .angle_based import angle_based

            return partial(
                angle_based, solve=nearest_angles, cones="prescribed" if name == "abf++" else "free"
            )
        case "lscm":
            from .cut_first import map_cut_mesh
            from .lscm import least_squares_conformal

            return partial(map_cut_mesh, name="LSCM", place=least_squares_conformal)
        case "spectral":
            from .cut_first import map_cut_mesh
            from .spectral import spectral_conformal

            return partial(map_cut_mesh, name="the spectral method", place=spectral_conformal)
        case "bff":
            from .bff import boundary_first

            return boundary_first
    raise OptionError(f"unknown method {name!r}")
