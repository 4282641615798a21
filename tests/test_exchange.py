"""Moves of cones on a dense model against all that there are, tried one by one."""

from itertools import combinations, product

import numpy as np
import pytest

from coneflat.cones.sparse.dense_model import taken_out
from coneflat.cones.sparse.exchange import (
    Choice,
    Energies,
    additions,
    best_addition,
    best_swaps,
    exchange,
    fit_set,
    least_missed,
    shake,
)

COUNT = 14
TOTALS = (np.nan, 4 * np.pi, 0.0, -4 * np.pi)


def energies(seed: int, total: float, bound: float = np.inf) -> Energies:
    random = np.random.default_rng(seed)
    half = random.normal(size=(COUNT, 2 * COUNT))
    gram, slope = half @ half.T, random.normal(size=COUNT) * 10
    constant = float(slope @ np.linalg.solve(gram, slope)) + 50.0
    return Energies(gram, slope, constant, np.full(COUNT, -bound), np.full(COUNT, bound), total)


def choice(fixed: int = 0, kind=None) -> Choice:
    return Choice(fixed, np.arange(COUNT) >= fixed, np.zeros(COUNT, bool) if kind is None else kind, COUNT)


def energy_of(model: Energies, members) -> float:
    return fit_set(model, np.array(members, dtype=np.int64))[3]


def swapped(members, place, t):
    return [*members[:place], t, *members[place + 1 :]]


@pytest.mark.parametrize("total", TOTALS)
def test_the_best_addition_without_bounds_is_the_one_that_fits_best(total):
    for seed in range(5):
        model = energies(seed, total)
        for members in ([3], [3, 8], [0, 5, 9, 11]):
            others = [t for t in range(COUNT) if t not in members]
            change = [energy_of(model, [*members, t]) - energy_of(model, members) for t in others]
            given = np.array(members, dtype=np.int64)
            np.testing.assert_allclose(additions(model, given)[others], change, rtol=1e-8, atol=1e-9)
            assert best_addition(model, given, choice().usable) == others[np.argmin(change)]
        assert best_addition(model, given, np.zeros(COUNT, bool)) == -1


def test_too_few_cones_are_joined_by_one_that_can_carry_what_is_missing():
    model = energies(1, -5.0, bound=2.0)
    model.least[:] = -2.0
    model.least[[4, 6]] = -3.5
    members = np.array([2], dtype=np.int64)
    assert best_addition(model, members, choice().usable) in (4, 6)
    model.least[:] = 0.0
    model.least[9] = -0.5
    assert best_addition(model, members, choice().usable) == 9


@pytest.mark.parametrize("total", TOTALS)
def test_swaps_are_scored_as_they_fit(total):
    for seed in range(5):
        model, members = energies(seed, total), [1, 4, 7]
        curvatures, multiplier, _, energy = fit_set(model, np.array(members))
        change, which = best_swaps(model, np.array(members), curvatures, multiplier, choice(fixed=1))
        assert which[0] == -1
        assert np.isinf(change[0])
        for place in (1, 2):
            exact = {
                t: energy_of(model, swapped(members, place, t)) - energy
                for t in range(1, COUNT)
                if t not in members
            }
            assert which[place] == min(exact, key=exact.__getitem__)
            assert change[place] == pytest.approx(min(exact.values()), rel=1e-8)


@pytest.mark.parametrize("bound", [np.inf, 6.0])
@pytest.mark.parametrize("total", TOTALS)
def test_after_exchanges_no_other_member_is_better(total, bound):
    for seed in range(5):
        model, members = energies(seed, total, bound), np.array([0, 3, 6, 12])
        start = energy_of(model, members)
        reached = exchange(model, members, choice(fixed=1))
        assert members[0] == 0
        assert len(set(members.tolist())) == 4
        assert reached == pytest.approx(energy_of(model, members))
        assert reached <= start
        if np.isinf(bound):
            for place, t in product((1, 2, 3), range(1, COUNT)):
                if t not in members:
                    assert energy_of(model, swapped(list(members), place, t)) >= reached * (1 - 2e-6)


def test_exchanges_keep_to_the_kind():
    kind = np.arange(COUNT) % 3 == 0
    for seed in range(5):
        members = np.array([0, 3, 4, 5])
        exchange(energies(seed, np.nan), members, choice(kind=kind))
        np.testing.assert_array_equal(kind[members], [True, True, False, False])


@pytest.mark.parametrize("total", TOTALS)
def test_the_member_missed_least_is_found(total):
    for seed in range(5):
        model, members = energies(seed, total), [2, 5, 7, 10]
        rest = [energy_of(model, [m for m in members if m != members[place]]) for place in range(1, 4)]
        assert least_missed(model, np.array(members), choice(fixed=1)) == 1 + int(np.argmin(rest))
    assert least_missed(model, np.array(members[:1]), choice(fixed=1)) == -1


def test_none_goes_where_the_others_cannot_carry_the_total():
    assert least_missed(energies(0, 4 * np.pi, bound=4.2), np.arange(4), choice()) >= 0
    assert least_missed(energies(0, 4 * np.pi, bound=3.2), np.arange(4), choice()) == -1


@pytest.mark.parametrize("total", TOTALS)
def test_shaking_finds_the_best_of_all_small_sets(total):
    found = 0
    for seed in range(8):
        model, members = energies(seed, total), np.array([0, 1, 2, 3])
        start = exchange(model, members, choice(fixed=1))
        energy, fell = shake(model, members, start, choice(fixed=1), taken_out(3, 20, 0))
        assert members[0] == 0
        assert len(set(members.tolist())) == 4
        assert fell == (energy < start)
        assert energy == pytest.approx(energy_of(model, members))
        best = min(energy_of(model, [0, *others]) for others in combinations(range(1, COUNT), 3))
        assert energy >= best * (1 - 1e-9)
        found += energy <= best * (1 + 1e-5)
    assert found >= 7


def test_two_and_three_in_turn_are_taken_out():
    out = taken_out(6, 9, 3)
    assert ((out >= 0).sum(axis=1) == [2, 3, 2, 3, 2, 3, 2, 3, 2]).all()
    assert out.max() < 6
    assert all(len(set(row[row >= 0])) == (row >= 0).sum() for row in out)
    np.testing.assert_array_equal(taken_out(2, 4, 0), np.tile([-1, 0, 1], (4, 1)))
