"""Unwrapping one mesh repeatedly: what is found once gives the same results."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

import coneflat
from coneflat.textures import Unwrapper, cut_search


@pytest.fixture
def searches(monkeypatch):
    """The components whose cuts are searched for, in turn."""
    searched, best_cut = [], cut_search.best_cut

    def counted(model):
        searched.append(model)
        return best_cut(model)

    monkeypatch.setattr(cut_search, "best_cut", counted)
    return searched


def assert_equal(result, expected):
    np.testing.assert_array_equal(result.uv, expected.uv)
    np.testing.assert_array_equal(result.uv_faces, expected.uv_faces)
    assert result.notes == expected.notes
    assert result.settings == expected.settings


@pytest.mark.parametrize("charts", ["atlas", "one", 3])
def test_options_of_packing_need_no_search_and_give_the_same_result(searches, charts):
    mesh = shapes.genus(2)
    unwrapper = Unwrapper(*mesh)
    unwrapper.unwrap(charts=charts)
    assert len(searches) == 1
    changes = (
        {"padding": 20.0},
        {"packing_cuts": 1.0},
        {"resolution": 256},
        {"up": (0, 1, 0)},
        {"tiles": 2},
        {"texel_density": 90.0},
        {},
    )
    results = [unwrapper.unwrap(charts=charts, **change) for change in changes]
    assert len(searches) == 1
    for change, result in zip(changes, results, strict=True):
        assert_equal(result, coneflat.unwrap(*mesh, charts=charts, **change))


def test_other_options_are_searched_for_again(searches):
    mesh = shapes.sphere(2)
    unwrapper = Unwrapper(*mesh)
    edges = coneflat.TriangleMesh(*mesh).edges
    changes = (
        {"max_energy": 4.5}, {"charts": 2}, {"seams": edges[:1]}, {"seams": edges[1:2]}, {"no_seams": edges[:3]},
        {"hide_seams": 1.0, "up": (0, 0, 1)}, {"hide_seams": 1.0, "up": (1, 0, 0)},
    )  # fmt: skip
    for number, change in enumerate(changes, 1):
        assert_equal(unwrapper.unwrap(**change), coneflat.unwrap(*mesh, **change))
        assert len(searches) == 2 * number
