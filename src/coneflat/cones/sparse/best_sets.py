"""Sets of cones, and the best that were found of each size."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from ..._arrays import IntArray

# A set must lower E^2 by this share to replace one of its size: rounding must not decide.
GAIN = 1e-6


class Sized(Protocol):
    """What has E^2 and a number of cones."""

    @property
    def energy(self) -> float:
        """E^2."""

    def __len__(self) -> int: ...


@dataclass(frozen=True, eq=False)
class ConeSet:
    """Cones on a dense model.

    Attributes:
        energy: E^2, infinite where bounds leave no curvatures.
        members: (s,) candidates, the required ones first.
    """

    energy: float
    members: IntArray

    def __len__(self) -> int:
        return len(self.members)


SetT = TypeVar("SetT", bound=Sized)


class BestSets(Generic[SetT]):
    """The best set found of each size."""

    def __init__(self) -> None:
        self._sets: dict[int, SetT] = {}

    def __iter__(self) -> Iterator[SetT]:
        return iter(self._sets.values())

    def __contains__(self, size: int) -> bool:
        return size in self._sets

    def __getitem__(self, size: int) -> SetT:
        return self._sets[size]

    @property
    def sizes(self) -> list[int]:
        """The sizes of which there is one, upwards."""
        return sorted(self._sets)

    def energy(self, size: int) -> float:
        """Return E^2 of the best of a size, infinite if there is none."""
        return self._sets[size].energy if size in self._sets else math.inf

    def offer(self, found: SetT) -> bool:
        """Keep a set if it is the best of its size, and tell so."""
        is_better = found.energy < self.energy(len(found)) * (1 - GAIN)
        if is_better:
            self._sets[len(found)] = found
        return is_better

    def fewest(self, goal: float, most: float = math.inf) -> SetT:
        """Return the smallest set, up to a size, with E^2 <= goal; if there is none, that of least E^2."""
        known = [found for found in self if len(found) <= most]
        good = [found for found in known if found.energy <= goal]
        return min(good, key=len) if good else min(known, key=lambda found: (found.energy, len(found)))
