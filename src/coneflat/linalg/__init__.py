"""Sparse symmetric positive definite systems behind one small interface, and Newton's method for convex functions."""

from .factors import Factor, HermitianFactor, SuperLUFactor, aligned, factorize
from .memory import check_memory
from .newton import Limits, Point, minimise

__all__ = [
    "Factor",
    "HermitianFactor",
    "Limits",
    "Point",
    "SuperLUFactor",
    "aligned",
    "check_memory",
    "factorize",
    "minimise",
]
