"""There is a bound of the number of quads on every path that makes them, and of the work; coordinates are finite."""

from __future__ import annotations

import math
from contextlib import suppress

import numpy as np
import pytest
import shapes

from coneflat import TriangleMesh, errors, integer_grid, quads
from coneflat.errors import ConeflatError, GridError, TooLargeError
from coneflat.quadmesh.aligned_cones import _Search, aligned_cones
from coneflat.quadmesh.extract import _along_longest_side, extract_quads
from coneflat.quadmesh.limits import (
    FEW_SQUARES,
    FEWEST_SQUARES,
    MAX_SQUARES,
    MAX_TIMES,
    SQUARES_PER_TRIANGLE,
    SquareLimit,
    check_extraction,
    most_squares,
)

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])


def needle(power, height, around=8, rings=4):
    """A body of revolution whose radius falls with a power of the height; its tip is a ring of coincident vertices."""
    angle = 2 * np.pi * np.arange(around) / around
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(around)], 1)
    up = np.linspace(0, 1, rings)
    vertices = np.concatenate([circle * (1 - u) ** power + [0, 0, height * u] for u in up])
    vertex = np.arange(around * (rings - 1))
    two = vertex - vertex % around + (vertex + 1) % around
    faces = [np.stack([vertex, two, two + around], 1), np.stack([vertex, two + around, vertex + around], 1)]
    return vertices, np.concatenate(faces)


@pytest.mark.parametrize(
    "options", [{"boundary": "free"}, {"cones": "sparse", "sharp_angle": 0.7, "stretch": 0}]
)
def test_a_needle_has_no_more_quads_than_the_limit_or_an_error_with_a_number(options):
    with pytest.raises(
        GridError, match=r"squares, and at most 100 are possible|are possible for 48 triangles"
    ) as caught:
        quads(*needle(4, 1.6e4), quads=10, smooth=0, **options)
    assert "\n" not in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 5, 40, 1000])
@pytest.mark.parametrize(("power", "height"), [(1, 1e3), (2, 10.0), (4, 1e4), (6, 100.0)])
def test_quads_of_needles_are_bounded_and_finite(power, height, count):
    with suppress(ConeflatError):
        mesh = quads(*needle(power, height), quads=count)
        assert len(mesh.quads) <= max(MAX_TIMES * count, FEWEST_SQUARES)
        assert np.isfinite(mesh.vertices).all()


def test_more_quads_than_triangles_carry_are_refused_with_the_number_and_the_size_that_are_possible():
    with pytest.raises(GridError, match="use at most 100,000 quads, of size 0.00318, or subdivide") as caught:
        quads(*SQUARE, quads=10**6)
    assert "1,000,000 quads are too many for 2 triangles" in str(caught.value)
    assert SquareLimit.of((1 / 0.00318) ** 2, 2, 1.0)
    for call in (quads, integer_grid):
        with pytest.raises(GridError, match="too many for 2 triangles"):
            call(*SQUARE, size=1e-9)


def test_the_number_of_quads_of_a_mesh_grows_with_its_triangles_up_to_a_bound():
    assert most_squares(2) == most_squares(FEW_SQUARES // SQUARES_PER_TRIANGLE) == FEW_SQUARES
    assert most_squares(5000) == 5000 * SQUARES_PER_TRIANGLE
    assert most_squares(10**8) == MAX_SQUARES


def test_more_quads_than_fit_into_memory_are_refused_before_any_work(monkeypatch):
    monkeypatch.setattr("coneflat.linalg.memory.free_memory", lambda: 2e9)
    with pytest.raises(
        TooLargeError, match="a grid of 5,000,000 squares needs about 4.25 GB of memory, but 2 GB"
    ):
        SquareLimit.of(5e6, 10**6, 1.0)
    assert SquareLimit.of(1e6, 10**6, 1.0).requested == 1e6


@pytest.mark.parametrize(
    ("requested", "triangles", "limit"), [(30, 50, 120), (10, 50, 100), (0.1, 50, 100), (1e5, 50, 2e5)]
)
def test_the_limit_is_that_of_the_number_requested_or_of_the_triangles(requested, triangles, limit):
    square_limit = SquareLimit.of(requested, triangles, 1.0)
    assert square_limit.squares == limit
    assert square_limit.violation(limit) == ""
    assert (
        square_limit.violation(math.nan)
        == square_limit.violation(math.inf)
        == "the nearest grid is not finite"
    )
    advice = "use fewer quads" if limit == 2e5 else f"use at least {math.ceil((limit + 1) / MAX_TIMES)} quads"
    assert advice in square_limit.violation(limit + 1)


def test_a_grid_with_cones_at_the_corners_of_a_surface_is_not_smaller_than_they_need():
    """Eight corners of three quads each are those of six quads."""
    limit = SquareLimit(1.0, 12)
    limit.check_cones(np.full(8, 3))
    with pytest.raises(
        GridError, match="200 cones of the surface: the nearest grid has 150 squares, and at most 100"
    ):
        limit.check_cones(np.full(200, 3))


def test_components_together_are_limited():
    """Each of many balls needs six quads."""
    ball = shapes.sphere(1)
    balls = shapes.join(*((ball[0] + [3.0 * i, 0, 0], ball[1]) for i in range(18)))
    with pytest.raises(GridError, match="at most 100 are possible for 2 quads: use at least"):
        quads(*balls, quads=2)
    assert len(quads(*balls, quads=50).quads) <= MAX_TIMES * 50


def test_a_map_whose_lines_cross_edges_too_often_is_refused_before_the_extraction():
    grid = integer_grid(*SQUARE, quads=16)
    corners = grid.corner_grid.copy()
    check_extraction(corners)
    corners[:, 1:, 0] += 1e7
    with pytest.raises(GridError, match=r"too distorted: its lines cross edges [\d,]+ times"):
        check_extraction(corners)


def test_the_search_for_cones_ends_after_some_work(monkeypatch):
    vertices, faces = shapes.sphere(3)
    mesh = TriangleMesh(vertices, faces)
    usual = aligned_cones(mesh, 0.1)
    calls, step = [], _Search._best_steps
    monkeypatch.setattr(
        _Search, "_best_steps", lambda self, *arguments: calls.append(1) or step(self, *arguments)
    )
    assert aligned_cones(mesh, 0.1) == usual
    call_count = len(calls)
    for name in ("MAX_PAIRS_OF_FEW", "PAIRS_PER_VERTEX"):
        monkeypatch.setattr(f"coneflat.quadmesh.aligned_cones.{name}", 1)
    calls.clear()
    with suppress(errors.CurvatureError):
        aligned_cones(mesh, 0.1)
    assert len(calls) < call_count


def test_points_in_triangles_without_area_have_weights():
    """The nearest points to the origin of a triangle of three points on a line, and of one in a single place."""
    line = np.array([[[-1.0, 0], [3, 0], [1, 0]], [[2.0, 2], [2, 2], [2, 2]]])
    weights = _along_longest_side(line)
    assert weights.sum(axis=1) == pytest.approx(1)
    assert weights.min() >= 0
    assert np.einsum("ki,kix->kx", weights, line)[0] == pytest.approx(0)


def test_quads_without_places_are_an_error(monkeypatch):
    grid = integer_grid(*SQUARE, quads=16)

    def lost(grid):
        extracted = extract_quads(grid)
        extracted.vertices[3] = np.nan
        return extracted

    monkeypatch.setattr("coneflat.quadmesh.quad_meshing.extract_quads", lost)
    with pytest.raises(GridError, match="1 vertex of quads without a place"):
        quads(grid, smooth=0)
