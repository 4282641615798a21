"""Moves of cones on a dense model against all that there are, tried one by one."""

from itertools import product

import numpy as np
import pytest

from coneflat.cones.sparse.dense_model import DenseModel
from coneflat.cones.sparse.limits import Limits

COUNT = 14
TOTALS = (np.nan, 4 * np.pi, 0.0, -4 * np.pi)


def model_of(seed: int, total: float, bound: float = np.inf, fixed: int = 0) -> DenseModel:
    random = np.random.default_rng(seed)
    half = random.normal(size=(COUNT, 2 * COUNT))
    gram, slope = half @ half.T, random.normal(size=COUNT) * 10
    constant = float(slope @ np.linalg.solve(gram, slope)) + 50.0
    lower, usable = np.full(COUNT, -bound), np.arange(COUNT) >= fixed
    return DenseModel(gram, slope, constant, usable, np.arange(fixed), Limits(-bound, bound, total), lower)


def energy_of(model: DenseModel, members) -> float:
    return model.energy(np.array(members, dtype=np.int64))


def swapped(members, place, t):
    return [*members[:place], t, *members[place + 1 :]]


@pytest.mark.parametrize("total", TOTALS)
def test_best_addition_without_bounds_minimises_the_fitted_energy(total):
    for seed in range(5):
        model = model_of(seed, total)
        for members in ([3], [3, 8], [0, 5, 9, 11]):
            candidates = [t for t in range(COUNT) if t not in members]
            change = [energy_of(model, [*members, t]) - energy_of(model, members) for t in candidates]
            member_array = np.array(members, dtype=np.int64)
            np.testing.assert_allclose(
                model.additions(member_array)[candidates], change, rtol=1e-8, atol=1e-9
            )
            assert model.grown(member_array).tolist() == [*members, candidates[np.argmin(change)]]
        model.usable[:] = False
        assert model.grown(member_array) is None


def test_too_few_cones_grow_by_one_that_absorbs_the_missing_curvature():
    model = model_of(1, -5.0, bound=2.0)
    model.lower[[4, 6]] = -3.5
    members = np.array([2], dtype=np.int64)
    assert model.grown(members)[-1] in (4, 6)
    model.lower[:] = 0.0
    model.lower[9] = -0.5
    assert model.grown(members)[-1] == 9


@pytest.mark.parametrize("total", TOTALS)
def test_scores_of_swaps_are_the_fitted_changes_of_energy(total):
    for seed in range(5):
        model, members = model_of(seed, total, fixed=1), [0, 4, 7]
        fitted = model.fit(np.array(members))
        change, which = model.swaps(np.array(members), fitted)
        assert which[0] == -1
        assert np.isinf(change[0])
        for place in (1, 2):
            exact = {
                t: energy_of(model, swapped(members, place, t)) - fitted.energy
                for t in range(1, COUNT)
                if t not in members
            }
            assert which[place] == min(exact, key=exact.__getitem__)
            assert change[place] == pytest.approx(min(exact.values()), rel=1e-8)


@pytest.mark.parametrize("bound", [np.inf, 6.0])
@pytest.mark.parametrize("total", TOTALS)
def test_after_exchanges_no_single_replacement_is_better(total, bound):
    for seed in range(5):
        model, members = model_of(seed, total, bound, fixed=1), [0, 3, 6, 12]
        exchanged = model.exchanged(np.array(members))
        assert exchanged.members[0] == 0
        assert len(set(exchanged.members.tolist())) == 4
        assert exchanged.energy == pytest.approx(energy_of(model, exchanged.members))
        assert exchanged.energy <= energy_of(model, members)
        if np.isinf(bound):
            for place, t in product((1, 2, 3), range(1, COUNT)):
                if t not in exchanged.members:
                    replaced_energy = energy_of(model, swapped(exchanged.members.tolist(), place, t))
                    assert replaced_energy >= exchanged.energy * (1 - 2e-6)


@pytest.mark.parametrize("total", TOTALS)
def test_shrinking_removes_the_least_important_member(total):
    for seed in range(5):
        model, members = model_of(seed, total, fixed=1), [0, 5, 7, 10]
        remaining_energies = [
            energy_of(model, [m for m in members if m != members[place]]) for place in range(1, 4)
        ]
        places = 1 + np.argsort(remaining_energies)
        expected = [[m for m in members if m != members[place]] for place in places]
        for number in range(1, 5):
            assert [cones.tolist() for cones in model.shrunk(np.array(members), number)] == expected[:number]
    assert model.shrunk(np.array(members[:1])) == []


def test_no_member_is_removed_if_the_others_cannot_absorb_the_total():
    assert model_of(0, 4 * np.pi, bound=4.2).shrunk(np.arange(4))
    assert model_of(0, 4 * np.pi, bound=3.2).shrunk(np.arange(4)) == []
