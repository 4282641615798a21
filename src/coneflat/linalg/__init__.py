"""Sparse symmetric positive definite systems behind one small interface."""

from .factors import Factor, HermitianFactor, SuperLUFactor, aligned, factorize
from .memory import check_memory
from .shortest_paths import MultiGraph

__all__ = [
    "Factor", "HermitianFactor", "MultiGraph", "SuperLUFactor", "aligned", "check_memory", "factorize",
]  # fmt: skip
