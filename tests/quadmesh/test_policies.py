"""Stages return a grid or a reason, and policies choose what is tried next."""

from dataclasses import replace

import numpy as np
import pytest
import shapes

import coneflat
from coneflat.errors import ConvergenceError, GridError, OptionError
from coneflat.quadmesh import attempt, policies
from coneflat.quadmesh.extract import DegenerateQuads
from coneflat.quadmesh.no_grid import REASONS, NoGrid, or_reason
from coneflat.quadmesh.request import GridRequest


@pytest.mark.parametrize("error", REASONS)
def test_errors_of_stages_become_reasons_without_tracebacks(error):
    @or_reason
    def stage():
        raise error("none")

    outcome = stage()
    assert isinstance(outcome, NoGrid)
    assert (outcome.reason, outcome.coarse_grid, outcome.error.__traceback__) == ("none", None, None)


def test_other_errors_end_the_search():
    @or_reason
    def stage():
        raise OptionError("wrong")

    with pytest.raises(OptionError, match="wrong"):
        stage()


def test_the_error_of_the_last_attempt_is_raised(monkeypatch):
    monkeypatch.setattr(policies, "aligned_map", lambda *_: NoGrid(GridError("aligned")))
    monkeypatch.setattr(policies, "flattened_map", lambda *_, **__: NoGrid(ConvergenceError("fewest")))
    with pytest.raises(ConvergenceError, match="fewest"):
        coneflat.integer_grid(*shapes.sphere(2), quads=100)


def test_the_first_coarse_grid_is_the_reason(monkeypatch):
    """Of three sizes, all of which are too coarse, the requested one is used."""
    sizes = []

    def always_degenerate(grid):
        sizes.append(grid.size)
        return DegenerateQuads("too coarse")

    monkeypatch.setattr(attempt, "find_quads", always_degenerate)
    monkeypatch.setattr(policies, "PRICE_FACTORS", (1.0,))
    request = GridRequest.of(*shapes.sphere(2), {"quads": 60}, {"cones": "sparse"})
    quads_request = replace(request, for_quads=True)
    outcome = policies.find_grid(quads_request)
    assert isinstance(outcome, NoGrid)
    assert outcome.reason == "too coarse"
    assert len(sizes) == policies.MAX_SIZES
    assert (np.diff(sizes) < 0).all()
    assert outcome.coarse_grid is not None
    assert outcome.coarse_grid.size == sizes[0]
