"""The search for cones on a dense model: for each number of cones, the best positions found."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .._arrays import IntArray
from .dense_model import MANY, DenseModel

# Large sets are improved every so many cones, as they grow.
EVERY = 8
# So many cones more that bring E^2 down by less than this factor are no use: bounds are in the way.
STALL, STALLED = 10, 0.99
# Local optima with E^2 up to this factor above the best are remembered, so many of them.
NEAR, KEPT = 1.2, 4


@dataclass(eq=False)
class DenseSearch(DenseModel):
    """A dense model with the best sets found so far.

    Attributes:
        best: number of cones -> E^2 and members, the required first.
        runners: number of cones -> other sets where exchanges came to rest nearby, best first.
    """

    best: dict[int, tuple[float, IntArray]] = field(default_factory=dict)
    runners: dict[int, list[tuple[float, IntArray]]] = field(default_factory=dict)

    def offer(self, energy: float, members: IntArray) -> bool:
        """Keep a set if it is the best of its size."""
        known = self.best.get(len(members))
        if known is None or energy < known[0] * (1 - 1e-6):
            self.best[len(members)] = energy, members.copy()
            return True
        return False

    def climb(self, bound: float, most: int, start: int | None = None) -> None:
        """Add cones, to the best set of the size `start` if it is given, until E^2 <= bound, or there are `most`."""
        members = self.best[start][1] if start in self.best else self.fixed
        energy = self.energy(members)
        if np.isfinite(energy):
            self.offer(energy, members)
        while len(members) < most and not energy <= bound:
            grown = self.grown(members)
            if grown is None:
                return
            if len(grown) > MANY and len(grown) % EVERY and len(grown) < most:
                energy, members = self.energy(grown), grown
            else:
                energy, members = self.exchanged(grown)
            if np.isfinite(energy):
                self.offer(energy, members)
            known = self.best.get(len(members))
            members = known[1] if known is not None else members
            before = self.best.get(len(members) - STALL)
            if before is not None and not energy < STALLED * before[0]:
                return

    def descend(self, count: int, least: int) -> bool:
        """Take cones away one at a time, from the best set of a size; tell if a set got better."""
        found = False
        members = self.best[count][1]
        while len(members) > max(least, len(self.fixed)):
            shrunk = self.shrunk(members)
            if shrunk is None:
                break
            energy, members = self.exchanged(shrunk)
            if not np.isfinite(energy):
                break
            found |= self.offer(energy, members)
            members = self.best[len(members)][1]
        return found

    def ascend(self, count: int, most: int) -> bool:
        """Add cones one at a time to the best set of a size; tell if a set got better."""
        found = False
        members = self.best[count][1]
        while len(members) < most:
            grown = self.grown(members)
            if grown is None:
                break
            energy, members = self.exchanged(grown)
            if not np.isfinite(energy):
                break
            found |= self.offer(energy, members)
            members = self.best[len(members)][1]
        return found

    def shaken(self, count: int, tries: int, seed: int = 0) -> bool:
        """Take two or three members away and refill, over and over; tell if the set of this size got better."""
        rng = np.random.default_rng(seed)
        fixed = len(self.fixed)
        found = False
        for i in range(tries):
            free = count - fixed
            if free < 2:
                break
            out = fixed + rng.choice(free, min(2 + i % 2, free), replace=False)
            energy, members = self.refilled(self.best[count][1], out)
            if not np.isfinite(energy):
                continue
            previous = self.best[count]
            if self.offer(energy, members):
                found = True
                energy, members = previous
            self._remember(energy, members)
        return found

    def _remember(self, energy: float, members: IntArray) -> None:
        """Keep a set that is not the best of its size, if it is near and no other has its energy."""
        best = self.best[len(members)][0]
        runners = self.runners.setdefault(len(members), [])
        if energy < best * NEAR and all(
            abs(e - energy) > 1e-6 * energy for e in [best, *(r[0] for r in runners)]
        ):
            runners.append((energy, members.copy()))
            runners.sort(key=lambda runner: runner[0])
            del runners[KEPT:]
