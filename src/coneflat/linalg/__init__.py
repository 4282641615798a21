"""Sparse symmetric positive definite systems behind one small interface."""

from .factors import Factor, HermitianFactor, SuperLUFactor, aligned, factorize
from .memory import check_memory

__all__ = [
    "Factor",
    "HermitianFactor",
    "SuperLUFactor",
    "aligned",
    "check_memory",
    "factorize",
]
