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
    least, usable = np.full(COUNT, -bound), np.arange(COUNT) >= fixed
    return DenseModel(gram, slope, constant, usable, np.arange(fixed), Limits(-bound, bound, total), least)


def energy_of(model: DenseModel, members) -> float:
    return model.energy(np.array(members, dtype=np.int64))


def swapped(members, place, t):
    return [*members[:place], t, *members[place + 1 :]]


@pytest.mark.parametrize("total", TOTALS)
def test_the_best_addition_without_bounds_is_the_one_that_fits_best(total):
    for seed in range(5):
        model = model_of(seed, total)
        for members in ([3], [3, 8], [0, 5, 9, 11]):
            others = [t for t in range(COUNT) if t not in members]
            change = [energy_of(model, [*members, t]) - energy_of(model, members) for t in others]
            given = np.array(members, dtype=np.int64)
            np.testing.assert_allclose(model.additions(given)[others], change, rtol=1e-8, atol=1e-9)
            assert model.grown(given).tolist() == [*members, others[np.argmin(change)]]
        model.usable[:] = False
        assert model.grown(given) is None


def test_too_few_cones_are_joined_by_one_that_can_carry_what_is_missing():
    model = model_of(1, -5.0, bound=2.0)
    model.least[[4, 6]] = -3.5
    members = np.array([2], dtype=np.int64)
    assert model.grown(members)[-1] in (4, 6)
    model.least[:] = 0.0
    model.least[9] = -0.5
    assert model.grown(members)[-1] == 9


@pytest.mark.parametrize("total", TOTALS)
def test_swaps_are_scored_as_they_fit(total):
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
def test_after_exchanges_no_other_member_is_better(total, bound):
    for seed in range(5):
        model, members = model_of(seed, total, bound, fixed=1), [0, 3, 6, 12]
        found = model.exchanged(np.array(members))
        assert found.members[0] == 0
        assert len(set(found.members.tolist())) == 4
        assert found.energy == pytest.approx(energy_of(model, found.members))
        assert found.energy <= energy_of(model, members)
        if np.isinf(bound):
            for place, t in product((1, 2, 3), range(1, COUNT)):
                if t not in found.members:
                    other = energy_of(model, swapped(found.members.tolist(), place, t))
                    assert other >= found.energy * (1 - 2e-6)


@pytest.mark.parametrize("total", TOTALS)
def test_the_member_missed_least_is_found(total):
    for seed in range(5):
        model, members = model_of(seed, total, fixed=1), [0, 5, 7, 10]
        rest = [energy_of(model, [m for m in members if m != members[place]]) for place in range(1, 4)]
        gone = members[1 + int(np.argmin(rest))]
        assert model.shrunk(np.array(members)).tolist() == [m for m in members if m != gone]
    assert model.shrunk(np.array(members[:1])) is None


def test_none_goes_where_the_others_cannot_carry_the_total():
    assert model_of(0, 4 * np.pi, bound=4.2).shrunk(np.arange(4)) is not None
    assert model_of(0, 4 * np.pi, bound=3.2).shrunk(np.arange(4)) is None
