"""Cones that a user gives for a grid."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import OptionError
from ..options.kinds import WordOrVertices
from .transitions import QUARTER


def require_quarters(cones: Any) -> None:
    """Raise OptionError unless cones, as `flatten` takes them, all have curvatures that are multiples of pi/2."""
    parsed = WordOrVertices((), "cone").parse("cones", cones)
    for vertex, curvature in parsed.items() if isinstance(parsed, dict) else ():
        quarters = np.nan if curvature is None else curvature / (np.pi / 2)
        if not abs(quarters - np.rint(quarters)) <= QUARTER:
            raise OptionError(
                f"cones of a grid have curvatures that are multiples of pi/2; that of vertex {vertex} is "
                f"{'not given' if curvature is None else f'{curvature:g}'}"
            )
