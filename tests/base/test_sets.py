"""Incident edges and largest values, compared with NumPy."""

from __future__ import annotations

import numpy as np

from coneflat.base.sets import edges_at_nodes, largest_at


def test_edges_at_nodes_are_ascending_and_listed_at_both_ends():
    ends = np.random.default_rng(0).integers(
        0, 7, (30, 2)
    )  # with loops and parallel edges; node 7 has no edge
    starts, sides = edges_at_nodes(ends, 8)
    assert starts[0] == 0
    assert starts[8] == 60
    for node in range(8):
        np.testing.assert_array_equal(sides[starts[node] : starts[node + 1]], np.nonzero(ends == node)[0])


def test_largest_values_are_those_of_numpy():
    rng = np.random.default_rng(0)
    places, values = rng.integers(0, 9, 40), rng.uniform(0, 1, 40)
    expected = np.zeros(11)
    np.maximum.at(expected, places, values)
    np.testing.assert_array_equal(largest_at(places, values, 11), expected)
