"""The fewest cones for the distortion allowed: `ConeSearch`."""

from .search import ConeSearch, SparseCones

__all__ = ["ConeSearch", "SparseCones"]
