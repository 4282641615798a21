"""Other flattening methods with the same cones and cut, and their comparison.

Examples:
    >>> vertices = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
    >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
    >>> coneflat.peers.flatten_by("bff", vertices, faces)
    <Flattening: 4 triangles, 4 cones, 1 chart, QC 1.0000>
    >>> "lscm" in coneflat.peers.METHODS
    True
"""

from .methods import METHODS, flatten_by
from .run import Comparison, Entry, compare_methods

__all__ = ["METHODS", "Comparison", "Entry", "compare_methods", "flatten_by"]
