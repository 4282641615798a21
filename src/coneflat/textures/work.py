"""The work on the components: which are searched together, the progress, the time of each, and the threads."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager

import numpy as np

from ..base import BoolArray, FloatArray, IntArray, limit_threads, portion_of_time, stage
from ..base.progress import component_at_work
from ..geometry import double_areas
from ..source import Component
from .options import UnwrapOptions
from .shortening import MANY_TRIANGLES

# Fractions of the work: checking, the search for the cuts, cuts for packing, and measuring the result.
CHECKING, PACKING_CUTS, FINISHING = 0.05, 0.15, 0.1
SEARCHING = 1 - CHECKING - PACKING_CUTS - FINISHING
# Components with less than this share of the area are cut together: 3,000 take 21 s instead of 140. With 0.05
# instead, 26 models in one file take 40% less time, and their seams are 10% longer.
MINOR_SHARE = 0.03
# Triangles of a component from which several threads are faster than one.
PARALLEL = 20_000
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


def minor_components(components: Sequence[Component]) -> BoolArray:
    """Return (c,) which components have a small share of the area."""
    areas = double_component_areas(components)
    return areas < MINOR_SHARE * areas.sum()


def double_component_areas(components: Sequence[Component]) -> FloatArray:
    """Return (c,) twice the area of each component."""
    return np.array([double_areas(component.lengths).sum() for component in components])


def threads_for(components: Sequence[Component], options: UnwrapOptions) -> AbstractContextManager[None]:
    """Return a context with the threads that the largest component needs."""
    is_parallel = max(len(component.faces) for component in components) > PARALLEL
    return limit_threads(options.threads if is_parallel else 1)
