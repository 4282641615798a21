"""Search for the fewest cones of an allowed distortion: `ConeSearch`."""

from .search import ConeSearch, SparseCones

__all__ = ["ConeSearch", "SparseCones"]
