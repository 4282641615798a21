"""Sets of cones that the search on the mesh starts from; here those on a coarse basis."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeAlias

import numpy as np

from ...base.arrays import IntArray
from ...errors import CurvatureError
from .coarse_model import CoarseModel, candidates
from .dense_model import BestSets, ConeSet, DenseModel
from .fine_model import FineModel


class Starts(Protocol):
    """Sets of cones on a smaller model than that of the mesh.

    Attributes:
        error: ratio of E^2 of a set on both models, at most; sets within this factor of a goal may meet it.
        largest: the largest number of cones.
        best: the best sets found.
    """

    error: float

    @property
    def largest(self) -> int: ...

    @property
    def best(self) -> BestSets[ConeSet]: ...

    def unknowns(self, size: int) -> IntArray:
        """Return the unknowns (s,) of the mesh for the best set of a size, required cones first."""

    def find_fewest(self, goal: float, max_count: int) -> ConeSet:
        """Return the fewest cones with E^2 <= goal, or those of small E^2 if there are none, and find similar sets."""

    def find_best(self, count: int) -> None:
        """Find sets of at most about `count` cones."""

    def find_all(self, max_count: int) -> None:
        """Find sets of sizes up to `max_count`."""


#: Returns the sets that the search on a model of the mesh starts from.
StartsOf: TypeAlias = Callable[[FineModel], Starts]


class DenseStarts:
    """Sets of cones at one vertex for each function of a coarse basis.

    Attributes:
        model: the energies of the sets.
        places: (c,) unknown of each candidate, required cones first.
    """

    error = 1.35

    def __init__(self, coarse: CoarseModel, fine: FineModel) -> None:
        """Choose the candidates.

        Args:
            coarse: the kernel of E on the coarse basis.
            fine: the model of the mesh with the required cones and the usable unknowns.
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
    def largest(self) -> int:
        """The number of candidates."""
        return len(self.places)

    @property
    def best(self) -> BestSets[ConeSet]:
        """The best sets found."""
        return self.model.best

    def unknowns(self, size: int) -> IntArray:
        """Return the unknowns (s,) of the mesh for the best set of a size, required cones first."""
        return self.places[self.best[size].members]

    def find_fewest(self, goal: float, max_count: int) -> ConeSet:
        """Return the fewest cones with E^2 <= goal, or those of smallest E^2; find sets of similar sizes."""
        self._climb(goal / self.error, max_count, max_count)
        count = len(self.best.fewest(goal, max_count))
        self.model.descend(count - 3, count + 1)
        return self.best.fewest(goal, max_count)

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
            raise CurvatureError(
                f"no set of {count} cones was found that absorbs a total curvature of "
                f"{self.model.limits.total / np.pi:.4g} pi within their bounds: allow more cones or other angles, or "
                "choose the greedy search (--cones greedy), which has no bounds"
            )
