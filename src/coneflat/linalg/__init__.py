"""Sparse symmetric positive definite systems behind one small interface."""

from .factors import Factor, SuperLUFactor, aligned
from .memory import check_memory, require_memory
from .shortest_paths import MultiGraph
from .solvers import HermitianFactor, factorize

__all__ = [
    "Factor", "HermitianFactor", "MultiGraph", "SuperLUFactor", "aligned", "check_memory", "factorize",
    "require_memory",
]  # fmt: skip
