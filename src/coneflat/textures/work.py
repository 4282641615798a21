"""The search for the cuts of all components: which are searched together, its progress, and the time of each."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from ..base import IntArray, portion_of_time, stage
from ..base.progress import component_at_work
from .shortening import MANY_TRIANGLES

# Fraction of the time of the search that is left for cuts for packing.
TIME_FOR_PACKING = 0.2


class SearchWork:
    """The search for the cuts of all components, with its progress and the time that each may take.

    Args:
        triangles: the number of triangles of all components.
        portion: fraction of the total work, for the progress.
    """

    def __init__(self, triangles: int, portion: float) -> None:
        self._portion = portion
        self._triangles = self._remaining = max(triangles, 1)
        self._reserved = TIME_FOR_PACKING / (1 - TIME_FOR_PACKING) * self._triangles

    @contextmanager
    def at(self, place: str, triangles: int) -> Iterator[None]:
        """Search for cuts of a number of triangles in the block, see `component_at_work`."""
        # Components that are not within the bound after they were searched together are searched again.
        self._remaining = max(self._remaining, triangles)
        time_share = triangles / (self._remaining + self._reserved)
        work_share = self._portion * triangles / self._triangles
        with component_at_work(place, work_share), portion_of_time(time_share), stage("search"):
            yield
        self._remaining -= triangles


def groups_of_minor(minor: IntArray, sizes: IntArray) -> Iterator[list[int]]:
    """Yield groups of at least two minor components, with not many triangles.

    Args:
        minor: (k,) indices of components.
        sizes: (c,) numbers of triangles of all components.
    """
    total = np.cumsum(sizes[minor]) // MANY_TRIANGLES
    for group in np.split(minor, np.flatnonzero(np.diff(total)) + 1):
        if len(group) > 1:
            yield group.tolist()
