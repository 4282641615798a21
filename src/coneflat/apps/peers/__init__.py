"""Other methods on the same cones and cut, methods side by side, and the paper's experiments.

>>> import coneflat
>>> result = coneflat.peers.flatten_by("abf++", vertices, faces)
"""

from .methods import METHODS, flatten_by
from .paper import Reproduction, reproduce
from .run import Comparison, Entry, compare_methods

__all__ = [
    "METHODS",
    "Comparison",
    "Entry",
    "Reproduction",
    "compare_methods",
    "flatten_by",
    "reproduce",
]
