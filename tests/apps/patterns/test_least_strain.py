"""Layouts of pieces with little strain, and seams with equal sides."""

from __future__ import annotations

import numpy as np
import pytest
from flat_pieces import cut_sphere

from coneflat import TriangleMesh
from coneflat.apps.patterns.pieces.cut_surface import CutSurface
from coneflat.apps.patterns.pieces.equal_sides import with_equal_sides
from coneflat.apps.patterns.pieces.least_strain import least_strain
from coneflat.apps.patterns.pieces.power_sum import PowerSum
from coneflat.apps.patterns.pieces.relaxing import SMALLEST, relaxed
from coneflat.apps.patterns.pieces.strain import FlatEdges, Stretch
from coneflat.geometry import signed_double_areas


def sum_with_fixed_points(stretch, seed):
    """A cut sphere, which of its points are free, the sum of powers of its strain, and random numbers."""
    surface, rng = cut_sphere(), np.random.default_rng(seed)
    is_free = rng.random(len(surface.points)) < 0.8
    return surface, is_free, PowerSum(surface.edges, surface.corners, stretch, is_free), rng


def test_the_gradient_of_the_sum_of_powers_is_its_derivative():
    stretch = Stretch(0.05, 0.1)
    surface, is_free, total, rng = sum_with_fixed_points(stretch, seed=0)
    points = surface.points + 1e-3 * rng.standard_normal(surface.points.shape)
    bounds = stretch.bounds(surface.edges.vectors(points))
    gradient, hessian = total.derivatives(points, bounds, 4)
    direction = rng.standard_normal(points.shape) * is_free[:, None]
    step = 1e-6
    values = [total.value(points + sign * step * direction, bounds, 4) for sign in (1, -1)]
    slope = gradient @ direction[is_free].ravel()
    assert slope == pytest.approx((values[0] - values[1]) / (2 * step), rel=1e-5)
    assert abs(hessian - hessian.T).max() <= 1e-9 * abs(hessian).max()


def test_the_hessian_of_the_sum_of_squares_is_its_second_derivative():
    stretch = Stretch(0.05, 0.05)
    surface, is_free, total, rng = sum_with_fixed_points(stretch, seed=1)
    # Where the strain is small, hardly anything of the Hessian is negative.
    points = least_strain(surface.edges, surface.corners, surface.points, stretch)
    bounds = stretch.bounds(surface.edges.vectors(points))
    direction = rng.standard_normal(points.shape) * is_free[:, None]
    step, moved = 1e-6, direction[is_free].ravel()
    hessian = total.derivatives(points, bounds, 2)[1].copy()
    slopes = [total.derivatives(points + sign * step * direction, bounds, 2)[0] @ moved for sign in (1, -1)]
    curvature = (slopes[0] - slopes[1]) / (2 * step)
    assert 0.9 * curvature <= moved @ hessian @ moved <= 1.1 * curvature


def test_a_developable_surface_has_no_strain():
    angle, height = np.meshgrid(np.linspace(0, 2, 9), np.linspace(0, 1, 4))
    vertices = np.stack([np.cos(angle), np.sin(angle), height], axis=-1).reshape(-1, 3)
    i = (np.arange(3)[:, None] * 9 + np.arange(8)).ravel()
    faces = np.concatenate([np.stack([i, i + 1, i + 10], axis=1), np.stack([i, i + 10, i + 9], axis=1)])
    mesh = TriangleMesh(vertices, faces)
    flat = np.stack([angle.ravel(), 1.1 * height.ravel()], axis=1)
    edges = FlatEdges.of(mesh, faces)
    points = least_strain(edges, mesh.faces, flat, Stretch(0.05, 0.05))
    assert np.abs(edges.strains(points)).max() < 1e-6


def test_relaxing_flips_nothing_and_lowers_the_largest_strain():
    surface = cut_sphere()
    points = least_strain(surface.edges, surface.corners, surface.points, Stretch(0.05, 0.05))
    assert (signed_double_areas(points[surface.corners]) > 0).all()
    before, after = (np.abs(surface.edges.strains(p)).max() for p in (surface.points, points))
    assert after < 0.7 * before


def test_points_that_are_not_free_stay():
    surface = cut_sphere()
    is_free = np.zeros(len(surface.points), dtype=bool)
    is_free[surface.corners[:40]] = True
    points = least_strain(surface.edges, surface.corners, surface.points, Stretch(0.05, 0.05), (4,), is_free)
    assert np.array_equal(points[~is_free], surface.points[~is_free])
    assert not np.array_equal(points, surface.points)


def test_both_sides_of_seams_become_equally_long():
    surface = cut_sphere()
    points = with_equal_sides(surface.edges, surface.corners, surface.points)
    lengths = np.linalg.norm(surface.edges.vectors(points), axis=1)
    first, second = surface.edges.partners.T
    assert len(first)
    assert lengths[first] == pytest.approx(lengths[second], rel=1e-11)
    assert np.abs(points - surface.points).max() < 0.2


def test_sides_become_equally_long_by_free_points_alone():
    surface = cut_sphere()
    closed = surface.with_points(with_equal_sides(surface.edges, surface.corners, surface.points))
    is_free = np.zeros(len(surface.points), dtype=bool)
    is_free[surface.corners[:80]] = True
    noise = 1e-3 * np.random.default_rng(0).standard_normal(surface.points.shape)
    start = closed.points + noise * is_free[:, None]
    points = with_equal_sides(surface.edges, surface.corners, start, is_free)
    lengths = np.linalg.norm(surface.edges.vectors(points), axis=1)
    first, second = surface.edges.partners.T
    assert lengths[first] == pytest.approx(lengths[second], rel=1e-11)
    assert np.array_equal(points[~is_free], start[~is_free])


def test_exponents_are_left_out_once_the_strain_is_within():
    surface = cut_sphere()
    wide, narrow = Stretch(10.0, 10.0), Stretch(1e-3, 1e-3)
    for stretch, is_same in ((wide, True), (narrow, False)):
        points = relaxed(surface, stretch, SMALLEST, until_within=True).points
        assert np.array_equal(points, surface.points) == is_same


def test_moved_points_keep_what_does_not_depend_on_them():
    surface = cut_sphere()
    before = surface.edges, surface.pieces, surface.seams
    moved = surface.with_points(2 * surface.points)
    fresh = CutSurface(surface.mesh, surface.corners, 2 * surface.points)
    assert all(
        part is first for part, first in zip((moved.edges, moved.pieces, moved.seams), before, strict=True)
    )
    assert np.array_equal(moved.places, fresh.places)
    assert np.array_equal(moved.edges.ends, fresh.edges.ends)
    assert np.array_equal(moved.pieces, fresh.pieces)
