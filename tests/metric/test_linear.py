from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from coneflat.metric import scaled_lengths

FACE = np.array([[0, 1, 2]])


@pytest.mark.parametrize("difference", [0.0, 1e-12, 1e-5, 9e-4, 1.1e-3, 0.5, 4.0])
def test_edge_integral(difference):
    phi = np.array([0.3, 0.3 + difference, 0.3])
    lengths = scaled_lengths(np.array([[1.0, 2.0, 3.0]]), FACE, phi)
    mean, _ = quad(lambda t: np.exp(phi[0] + t * difference), 0, 1, epsabs=0, epsrel=1e-13)
    np.testing.assert_allclose(lengths[0, 2], 3 * mean, rtol=1e-13)
    np.testing.assert_allclose(lengths[0, 1], 2 * np.exp(0.3), rtol=1e-14)


def test_both_sides_of_an_edge_get_the_same_bits():
    phi = np.random.default_rng(0).normal(size=4)
    lengths = scaled_lengths(np.ones((2, 3)), np.array([[0, 1, 2], [2, 1, 3]]), phi)
    assert lengths[0, 0] == lengths[1, 2]


def test_mean_rule_is_conformal_equivalence():
    phi = np.array([0.1, 0.5, -0.7])
    lengths = scaled_lengths(np.ones((1, 3)), FACE, phi, "mean")
    np.testing.assert_allclose(lengths[0], np.exp([(0.5 - 0.7) / 2, (0.1 - 0.7) / 2, 0.3]))
