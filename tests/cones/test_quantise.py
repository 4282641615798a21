from __future__ import annotations

import numpy as np
import pytest
import shapes
from test_sparse import SHAPES, search_on, surface

from coneflat.cones.integer.search import quantise_cones
from coneflat.errors import CurvatureError
from coneflat.geometry.operators import area_distortion


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("parts", [4, 6])
def test_curvatures_are_multiples_and_sum_to_gauss_bonnet(name, parts):
    _, _, areas, is_boundary, chi = surface(*SHAPES[name])
    quantised = quantise_cones(search_on(*SHAPES[name]), 2 * np.pi / parts, distortion=0.2)
    curvatures = quantised.solution.curvatures
    assert curvatures == pytest.approx(quantised.indices * 2 * np.pi / parts, abs=1e-9)
    assert (quantised.indices != 0).all()
    assert (curvatures <= 1.5 * np.pi + 1e-9).all()
    assert quantised.distortion <= 0.2
    assert quantised.distortion == pytest.approx(
        area_distortion(quantised.solution.log_scale, areas), rel=1e-6
    )
    if not is_boundary.any():
        assert quantised.indices.sum() == parts * chi


def test_no_exchange_of_quanta_is_better():
    """Brute force over transfers of a quantum between two cones."""
    search = search_on(*shapes.sphere(3))
    quantised = quantise_cones(search, np.pi / 2, distortion=0.1)
    places = search.fine.insert(search.operator.unknowns_of(quantised.solution.cones))
    model = search.fine
    gram, slope = model.gram[np.ix_(places, places)], model.slope[places]

    def energy(indices):
        k = quantised.quantum * indices
        return model.constant + (2 * slope + gram @ k) @ k

    assert energy(quantised.indices) == pytest.approx(quantised.distortion**2, rel=1e-6)
    for i in range(len(places)):
        for j in range(len(places)):
            indices = quantised.indices.copy()
            indices[i] += 1
            indices[j] -= 1
            if i != j and indices.all() and indices.max() <= 3:
                assert energy(indices) >= quantised.distortion**2 * (1 - 1e-6)


def test_renumbering_changes_nothing():
    vertices, faces = shapes.sphere(3)
    shuffled, turned, _ = shapes.renumber(vertices, faces)
    original = quantise_cones(search_on(vertices, faces), np.pi / 2)
    renumbered = quantise_cones(search_on(shuffled, turned), np.pi / 2)
    assert sorted(original.indices) == sorted(renumbered.indices)
    assert original.distortion == pytest.approx(renumbered.distortion, rel=1e-6)


def test_required_cones_are_kept():
    quantised = quantise_cones(search_on(*shapes.sphere(3), required=[17, 4]), np.pi / 2, distortion=0.3)
    assert quantised.solution.cones[:2].tolist() == [17, 4]
    assert quantised.indices[:2].all()


def test_a_torus_needs_no_cones_if_it_is_flat_enough():
    loose = quantise_cones(search_on(*shapes.torus()), np.pi / 2, distortion=10)
    assert len(loose.indices) == 0


def test_the_number_of_cones_is_an_upper_bound():
    quantised = quantise_cones(search_on(*shapes.sphere(3)), np.pi / 2, count=8)
    assert len(quantised.indices) <= 8


def test_infeasible_sums_are_errors():
    with pytest.raises(CurvatureError, match="not a multiple"):
        quantise_cones(search_on(*shapes.sphere(2)), 1.0)
    with pytest.raises(CurvatureError):
        quantise_cones(search_on(*shapes.sphere(2)), np.pi / 2, count=2)
