"""The trial of grids itself: cases that run, and breaches that it finds."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapes

from coneflat import integer_grid
from coneflat import quads as find_quads

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))
from trials.cases import run_case
from trials.grids import check_grid, check_quads
from trials.outcome import Outcome


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("seed", range(1, 8))
def test_no_case_is_a_breach(seed):
    outcome = run_case("grid", seed)
    assert not outcome.breaches


@pytest.fixture(scope="module")
def ball():
    grid = integer_grid(*shapes.sphere(3), quads=60)
    return grid, find_quads(grid)


def causes(check, *arguments):
    outcome = Outcome("grid", 0)
    check(outcome, *arguments)
    return " ".join(cause for cause, _ in outcome.breaches)


def test_grids_that_break_promises_are_found(ball):
    grid, _ = ball
    assert causes(check_grid, grid, {}) == ""
    moved = grid.corner_grid.copy()
    moved[5, 1] += 1e-9
    assert "do not fit exactly" in causes(check_grid, replace(grid, corner_grid=moved), {})
    assert "cones beyond bounds" in causes(check_grid, grid, {"min_cone_angle": 2 * np.pi})
    turned = grid.corner_grid[:, ::-1]
    assert "turned over" in causes(check_grid, replace(grid, corner_grid=turned), {})
    assert "angles" in causes(check_grid, replace(grid, quarters=grid.quarters + 1), {})


def test_quads_that_break_promises_are_found(ball):
    grid, mesh = ball
    assert causes(check_quads, mesh, grid) == ""
    without = causes(check_quads, replace(mesh, quads=mesh.quads[1:]), grid)
    assert "Euler" in without
    assert "squares" in without
    turned = mesh.quads.copy()
    turned[3] = turned[3, ::-1]
    assert "same side" in causes(check_quads, replace(mesh, quads=turned), grid)
    off = mesh.vertices.copy()
    off[0] *= 1.001
    assert "off the surface" in causes(check_quads, replace(mesh, vertices=off), grid)
    folded = mesh.quads.copy()
    folded[2, 1] = folded[2, 0]
    assert "twice" in causes(check_quads, replace(mesh, quads=folded), grid)
