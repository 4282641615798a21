"""Methods side by side: the same mesh, cones and cut for all, and the paper's experiments."""

from .paper import Reproduction, reproduce
from .run import Comparison, Entry, compare_methods

__all__ = ["Comparison", "Entry", "Reproduction", "compare_methods", "reproduce"]
