"""The fewest cones that lie in mirrored pairs of equal curvature, or on the plane of symmetry.

On the subspace of mirror symmetric log scales the problem is the same with fewer unknowns: one for each pair, whose
Green's function is the mean of two, and one for each vertex on the plane. The unknown of a pair is what both carry
together, so that sums stay sums. A pair counts as two cones, so sets are told by how many of them are pairs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..._arrays import BoolArray, FloatArray, IntArray
from .best_sets import ConeSet
from .dense_model import DenseModel, first_least
from .exact_model import CAUTIONS, ROUNDS, WORTHWHILE
from .search import COARSE_DOUBT, ConeSearch, SparseCones

# Sets of a number of cones, with more or fewer pairs among them, that are carried on, and that are tried on the mesh.
CARRIED, TRIED = 4, 3
# So many vertices on the plane are candidates on the coarse model at most.
MOST_SINGLE = 300
# Vertices on the plane are sought so many times as far.
FARTHER = 4
# Radians: a cone of less is none.
NO_CURVATURE = 1e-9


@dataclass(eq=False)
class PairModel(DenseModel):
    """A dense model whose candidates are pairs and single cones; swaps keep what is what.

    Attributes:
        is_pair: (m,).
    """

    is_pair: BoolArray | None = None

    def mask(self, pairs: bool) -> BoolArray:
        """Return (m,) the usable candidates that are pairs, or that are not."""
        assert self.is_pair is not None
        return self.usable & (self.is_pair == pairs)

    def _kind(self) -> BoolArray:
        assert self.is_pair is not None
        return self.is_pair

    def count(self, members: IntArray) -> int:
        """Return how many cones there are in a set."""
        assert self.is_pair is not None
        return len(members) + int(self.is_pair[members].sum())


class MirroredSearch:
    """A search for mirrored cones, beside one for any.

    Args:
        search: for any; it has no required cones.
        partner: (n,) the mirror image of each vertex.
        on_plane: (n,) the vertices that count as on the plane.
        usable: (n,) where cones may be.
    """

    def __init__(self, search: ConeSearch, partner: IntArray, on_plane: BoolArray, usable: BoolArray) -> None:
        self.search = search
        vertices = search.operator.vertices
        image = search.unknowns_of(partner)[vertices]
        usable = usable & ~search.is_boundary
        may = usable[vertices]
        self._single = may & on_plane[vertices]
        # Images of each other, so that no vertex is in two pairs.
        self._pair = may & ~on_plane[vertices] & (image >= 0) & may[image] & (image != np.arange(len(image)))
        self._pair &= ~self._single[image] & (image[image] == np.arange(len(image)))
        self._image = np.where(self._single, np.arange(len(image)), image)
        # The pairs and single unknowns tried on the mesh so far.
        self._own: IntArray = np.empty((0, 2), dtype=np.int64)

    def fewest(self, goal: float, most: int, starts: Iterable[IntArray] = ()) -> SparseCones | None:
        """Return the fewest mirrored cones found with E^2 <= goal, or else the best of at most so many; None if none.

        starts: cones, unknowns, that are made symmetric and tried, too.
        """
        sets = self._survey(goal, most)
        for cones in starts:
            own = self._orbits(cones)
            sets.append((len(own) + int((own[:, 0] != own[:, 1]).sum()), 0.0, own))
        best: tuple[float, IntArray, FloatArray] | None = None
        for count in sorted({each[0] for each in sets if each[0] <= most}):
            some = sorted((each for each in sets if each[0] == count), key=lambda each: each[1])[:TRIED]
            for _, energy, own in some:
                if energy <= COARSE_DOUBT * goal and len(own):
                    found = self._polished(own)
                    if best is None or found[0] < best[0]:
                        best = found
            if best is not None and best[0] <= goal:
                break
        return None if best is None or not math.isfinite(best[0]) else self._cones(*best)

    def _survey(self, goal: float, most: int) -> list[tuple[int, float, IntArray]]:
        """Return sets found on the coarse model: how many cones, E^2, and the unknowns (s, 2)."""
        own = self._coarse_candidates()
        kernel, slope = self.search._coarse_model.at(own.T.ravel())
        model = self._model(own, kernel, slope, self.search._coarse_model.constant)
        best: dict[int, dict[int, ConeSet]] = {0: {0: ConeSet(math.inf, np.empty(0, dtype=np.int64))}}
        sets: list[tuple[int, float, IntArray]] = []
        enough = most
        for count in range(most + 1):
            level = sorted(best.get(count, {}).values(), key=lambda each: each.energy)[:CARRIED]
            sets += [(count, each.energy, own[each.members]) for each in level]
            if level and level[0].energy <= goal / COARSE_DOUBT:
                enough = min(enough, count + 2)
            if count >= enough:
                break
            for each in level:
                for pairs in (False, True):
                    members = model.grown(each.members, model.mask(pairs))
                    if members is not None and not np.isin(members[-1], each.members):
                        found = model.exchanged(members)
                        kinds = best.setdefault(model.count(found.members), {})
                        if found.energy < kinds.get(len(found), ConeSet(math.inf, members)).energy or (
                            len(found) not in kinds
                        ):
                            kinds[len(found)] = found
        return sets

    def _coarse_candidates(self) -> IntArray:
        """Return (m, 2) pairs and single unknowns among which cones are sought on the coarse model."""
        places = self.search.places
        pairs = self._orbits(places[self._pair[places]])
        single = np.flatnonzero(self._single)
        single = single[np.linspace(0, len(single) - 1, min(len(single), MOST_SINGLE)).astype(np.int64)]
        return np.concatenate([pairs, np.stack([single, single], axis=1)])

    def _orbits(self, unknowns: IntArray) -> IntArray:
        """Return (m, 2) unknowns, each once, with their images, without those that can be neither pair nor single."""
        unknowns = unknowns[self._pair[unknowns] | self._single[unknowns]]
        own = np.sort(np.stack([unknowns, self._image[unknowns]], axis=1), axis=1)
        return np.unique(own, axis=0)

    def _model(self, own: IntArray, gram: FloatArray, slope: FloatArray, constant: float) -> PairModel:
        search, is_pair = self.search, own[:, 0] != own[:, 1]
        m, factor = len(own), np.where(is_pair, 2.0, 1.0)
        blocks = gram.reshape(2, m, 2, m).sum(axis=(0, 2)) / 4
        return PairModel(
            np.ascontiguousarray((blocks + blocks.T) / 2),
            slope.reshape(2, m).mean(axis=0),
            constant,
            np.ones(m, dtype=bool),
            np.empty(0, dtype=np.int64),
            search.limits,
            factor * search._least[own].max(axis=1),
            most=factor * search.limits.most,
            is_pair=is_pair,
        )

    def _exact_model(self) -> PairModel:
        """Return the model on what is known, with exact entries."""
        exact, own = self.search.exact, self._own
        places = exact.insert(own.T.ravel())
        return self._model(own, exact.gram[np.ix_(places, places)], exact.slope[places], exact.constant)

    def _add(self, own: IntArray) -> IntArray:
        """Add pairs and single unknowns to those known, if they are not, and return the places of all."""
        size = np.int64(len(self._image))
        keys, new = self._own @ [size, 1], own @ [size, 1]
        fresh = own[~np.isin(new, keys)]
        if len(fresh):
            self._own = np.concatenate([self._own, np.unique(fresh, axis=0)])
            keys = self._own @ [size, 1]
        order = np.argsort(keys, kind="stable")
        return order[np.searchsorted(keys, new, sorter=order)]

    def _polished(self, own: IntArray) -> tuple[float, IntArray, FloatArray]:
        """Return E^2 of a set after its members moved over the mesh, the set (s, 2), and what its members carry."""
        members = self._add(own)
        model = self._exact_model()
        found = model.exchanged(members)
        for _ in range(ROUNDS):
            known, before = len(self._own), found.energy
            fitted = model.fit(found.members)
            self._add(self._targets(found.members, fitted.curvatures, before))
            if len(self._own) == known:
                break
            model = self._exact_model()
            found = model.exchanged(found.members)
            if not found.energy < before * (1 - WORTHWHILE):
                break
        return found.energy, self._own[found.members], model.fit(found.members).curvatures

    def _targets(self, members: IntArray, carried: FloatArray, energy: float) -> IntArray:
        """Return (t, 2) where pairs and single cones should move; see `ExactModel.targets`."""
        exact, own = self.search.exact, self._own[members]
        is_pair = own[:, 0] != own[:, 1]
        curvatures = carried / np.where(is_pair, 2.0, 1.0)
        both = np.concatenate([own[:, 0], own[is_pair, 1]])
        score = exact._score(exact.insert(both), np.concatenate([curvatures, curvatures[is_pair]]))
        size = max(40, 4 * len(score) // self.search._coarse_model.size)
        targets = []
        for (s, image), pairs, k in zip(own, is_pair, curvatures, strict=True):
            near = exact.near(int(s), size if pairs else FARTHER * size)
            near = near[(self._pair if pairs else self._single)[near] & ~np.isin(near, both)]
            if not len(near) or k == 0:
                continue
            linear = 2 * k * (score[near] - score[s])
            bending = k * k * exact.squared_distances(int(s), near)
            if pairs:
                linear += 2 * k * (score[self._image[near]] - score[image])
                bending = 2 * bending
            for caution in CAUTIONS:
                change = linear + caution * bending
                best = first_least(change)
                if change[best] < -WORTHWHILE * energy:
                    targets.append(near[best])
        return self._orbits(np.array(targets, dtype=np.int64))

    def _cones(self, energy: float, own: IntArray, carried: FloatArray) -> SparseCones:
        """Return the cones of a set, those of no curvature left out."""
        is_pair = own[:, 0] != own[:, 1]
        curvatures = carried / np.where(is_pair, 2.0, 1.0)
        unknowns = np.concatenate([own[:, 0], own[is_pair, 1]])
        kept = np.concatenate([curvatures, curvatures[is_pair]])
        keep = np.abs(kept) > NO_CURVATURE
        unknowns, kept = unknowns[keep], kept[keep]
        order = np.argsort(unknowns)
        unknowns, kept = unknowns[order], kept[order]
        if self.search.limits.has_sum and len(kept):
            kept = kept + (self.search.limits.total - kept.sum()) / len(kept)
        return SparseCones(self.search.solution_of(unknowns, kept), math.sqrt(energy))
