"""How a metric and its layout were found, in numbers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields


@dataclass(frozen=True)
class SolveFigures:
    """How a metric and its layout were found.

    Attributes:
        newton_steps: factorizations of Newton's method.
        euclidean_flips: edges flipped to make the input Delaunay.
        ptolemy_flips: edges flipped during the solve.
        residual: largest curvature error of the metric where curvature was prescribed, radians.
        broken: triangles of the metric that break the triangle inequality.
        untangled_triangles: triangles that were inverted on their straight sides, and were turned over.
        untangled_vertices: vertices that were moved for this.
        untangled_move: their longest way, relative to the mean edge around them.
        refined_triangles: triangles that were added by the common subdivision.
    """

    newton_steps: int = 0
    euclidean_flips: int = 0
    ptolemy_flips: int = 0
    residual: float = 0.0
    broken: int = 0
    untangled_triangles: int = 0
    untangled_vertices: int = 0
    untangled_move: float = 0.0
    refined_triangles: int = 0

    @classmethod
    def of_all(cls, parts: Iterable[SolveFigures]) -> SolveFigures:
        """Return counts summed and magnitudes maximised over components."""
        parts = list(parts)
        values = {}
        for field in fields(cls):
            every = [getattr(part, field.name) for part in parts]
            values[field.name] = max(every) if field.name in _MAXIMA else sum(every)
        return cls(**values)


_MAXIMA = ("newton_steps", "residual", "untangled_move")
