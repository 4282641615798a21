"""Sparse symmetric positive definite systems behind one small interface, and Newton's method for convex functions.

The ladder, best first: MKL PARDISO (pypardiso) for large systems, CHOLMOD without supernodes (cholespy), SuperLU
(SciPy), and conjugate gradients with multigrid (pyamg) for what fits no factorization.
"""

from .back_ends import HermitianFactor, available, factorize, solving, used_again
from .factors import Factor, NotPositiveDefinite, aligned
from .memory import fitting_solver

__all__ = [
    "Factor",
    "HermitianFactor",
    "NotPositiveDefinite",
    "aligned",
    "available",
    "factorize",
    "fitting_solver",
    "solving",
    "used_again",
]
