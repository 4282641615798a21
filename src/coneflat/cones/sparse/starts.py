"""Sets of cones on a smaller model, from which the search on the mesh starts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ...base.arrays import IntArray
from ...errors import CurvatureError
from .coarse_model import CoarseModel, candidates
from .dense_model import BestSets, ConeSet, DenseModel
from .fine_model import FineModel

if TYPE_CHECKING:
    from .search import ConeSearch

# Error of the coarse model as a factor of E^2; sets within this factor of the goal are evaluated on the mesh.
COARSE_MODEL_ERROR = 1.35


class Starts(Protocol):
    """The sets of cones that were found on a smaller model.

    Attributes:
        max_size: the number of candidates for cones.
        best: the best sets found, of different sizes.
    """

    @property
    def max_size(self) -> int: ...

    @property
    def best(self) -> BestSets[ConeSet]: ...

    def unknowns(self, size: int) -> IntArray:
        """Return the unknowns (s,) of the mesh for the best set of a size, required cones first."""

    def find_fewest(self, goal: float, max_count: int) -> None:
        """Find sets of all sizes up to slightly more than E^2 <= goal needs."""

    def find_best(self, count: int) -> None:
        """Find sets of about `count` cones."""

    def find_all(self, max_count: int) -> None:
        """Find sets of all sizes up to `max_count`."""


class DenseStarts:
    """Sets of cones at one vertex for each function of the coarse basis.

    Attributes:
        model: the energies of the sets.
        places: (c,) unknown of each candidate, required cones first.
    """

    def __init__(self, coarse: CoarseModel, fine: FineModel) -> None:
        """Choose the candidates.

        Args:
            coarse: the kernel on the coarse basis.
            fine: the model of the mesh, with the required cones and the usable unknowns.
        """
        required = fine.unknowns[fine.fixed]
        self.places = np.concatenate([required, candidates(coarse, fine.fitness)])
        kernel, slope = coarse.at(self.places)
        self.model = DenseModel(
            np.ascontiguousarray(kernel),
            slope,
            coarse.constant,
            np.arange(len(self.places)) >= len(required),
            fine.fixed,
            fine.limits,
            fine.lower_bounds[self.places],
        )

    @property
    def max_size(self) -> int:
        """The number of candidates."""
        return len(self.places)

    @property
    def best(self) -> BestSets[ConeSet]:
        """The best sets found."""
        return self.model.best

    def unknowns(self, size: int) -> IntArray:
        """Return the unknowns (s,) of the mesh for the best set of a size."""
        return self.places[self.best[size].members]

    def find_fewest(self, goal: float, max_count: int) -> None:
        """Find sets of all sizes up to slightly more than E^2 <= goal needs."""
        self._climb(goal / COARSE_MODEL_ERROR, max_count, max_count)
        count = len(self.best.fewest(goal, max_count))
        self.model.descend(count - 3, count + 1)

    def find_best(self, count: int) -> None:
        """Find sets of about `count` cones."""
        self._climb(0.0, count + 1, count)
        self.model.descend(count - 2, count + 1)

    def find_all(self, max_count: int) -> None:
        """Find sets of all sizes up to `max_count`."""
        self.model.climb(0.0, max_count)
        self.model.descend(1, max_count)

    def _climb(self, bound: float, max_count: int, count: int) -> None:
        """Find sets of up to `max_count` cones; raise CurvatureError if all exceed `count`."""
        known_sizes = [size for size in self.best.sizes if size <= max_count]
        if all(self.best.energy(size) > bound for size in known_sizes):
            self.model.climb(bound, max_count, max(known_sizes, default=None))
        if min(self.best.sizes, default=count + 1) > count:
            limits = self.model.limits
            raise CurvatureError(
                f"no set of {count} cones was found that absorbs a total curvature of "
                f"{limits.total / np.pi:.4g} pi within their bounds: allow more cones or other angles, or choose "
                "the greedy search (--cones greedy), which has no bounds"
            )


@dataclass(frozen=True, eq=False)
class CoarseMeshStarts:
    """Sets of cones on a coarse mesh.

    Attributes:
        search: the search on the coarse mesh.
        places: (f,) unknown of the mesh for each unknown of the search.
    """

    search: ConeSearch
    places: IntArray

    @property
    def max_size(self) -> int:
        """The largest number of cones."""
        return self.search.max_cones

    @property
    def best(self) -> BestSets[ConeSet]:
        """The best sets found."""
        return self.search.fine.best

    def unknowns(self, size: int) -> IntArray:
        """Return the unknowns (s,) of the mesh for the best set of a size."""
        fine = self.search.fine
        return self.places[fine.unknowns[self.best[size].members]]

    def find_fewest(self, goal: float, max_count: int) -> None:
        """Find sets of all sizes up to slightly more than E^2 <= goal needs."""
        self.search.fewest(math.sqrt(goal), max_count)

    def find_best(self, count: int) -> None:
        """Find sets of about `count` cones."""
        self.search.best_of(count)

    def find_all(self, max_count: int) -> None:
        """Find sets of all sizes up to `max_count`."""
        self.search.curve(max_count)
