"""Quads made squarer on the surface, and the worst of them better."""

from __future__ import annotations

import numpy as np
import pytest
from grid_maps import bumpy, flat, quad_areas
from shapes import grid as rectangle

from coneflat.errors import OptionError
from coneflat.geometry.nearest import Stars, slide_near
from coneflat.grid.extract import extract_quads
from coneflat.grid.jacobians import least_jacobians
from coneflat.grid.quality import measure_quads
from coneflat.grid.smooth import smooth_quads
from coneflat.grid.worst import lift_worst


def test_smoothing_makes_quads_squarer_and_stays_on_the_surface():
    grid = bumpy()
    mesh = extract_quads(grid)
    surface = mesh.surface
    smooth = smooth_quads(mesh, 10)
    before, after = measure_quads(mesh), measure_quads(smooth)
    assert after.angle_mean < 0.9 * before.angle_mean
    assert after.angle_p95 < before.angle_p95
    assert after.jacobian_min > 0
    np.testing.assert_array_equal(smooth.quads, mesh.quads)
    corners = surface.vertices[surface.faces[smooth.faces]]
    np.testing.assert_allclose(
        np.einsum("qi,qix->qx", smooth.barycentric, corners), smooth.vertices, atol=1e-15
    )
    assert (smooth.barycentric >= 0).all()
    # What lies on the sharp edges, the corners of the cubes among it, stays.
    assert (smooth.vertices == mesh.vertices).all(axis=1).sum() >= len(mesh.irregular)
    with pytest.raises(OptionError, match="not -1"):
        smooth_quads(mesh, -1)


def test_squares_stay():
    points, faces = rectangle(6, 6)
    grid = flat(points[:, :2] * 6, faces)
    mesh = extract_quads(grid)
    smooth = smooth_quads(mesh, 5)
    np.testing.assert_allclose(smooth.vertices, mesh.vertices, atol=1e-12)


def test_smoothing_inverts_nothing():
    """Of a strongly stretched sheet, whose quads are needles at places."""
    points, faces = rectangle(40, 40)
    places = points[:, :2] * 12
    grid = flat(places, faces)
    x, y = places.T
    grid.vertices = np.column_stack([x**3 / 30, y + 0.8 * np.sin(x), 2 * np.sin(y) * np.cos(x)])
    mesh = extract_quads(grid)
    before = least_jacobians(mesh.vertices, mesh.quads)
    after = least_jacobians(smooth_quads(mesh, 30).vertices, mesh.quads)
    assert (before <= 0).any()
    assert (after[before > 0] > 0).all()
    assert after.min() > before.min()


@pytest.mark.parametrize("turn", [2.0, 3.0])
def test_smoothing_turns_quads_back(turn):
    """A sheet turned around a point, the more the nearer: its quads are turned over there, its triangles are not."""
    points, faces = rectangle(90, 90)
    grid = flat(points[:, :2] * 12, faces)
    z = (points[:, :2] * 12 - [6.3, 5.8]) @ [1, 1j]
    z *= np.exp(1j * turn * np.exp(-(np.abs(z) ** 2)))
    grid.vertices = np.column_stack([z.real, z.imag, 0 * z.real])
    mesh = extract_quads(grid)
    assert least_jacobians(mesh.vertices, mesh.quads).min() < 0
    smooth = smooth_quads(mesh)
    assert least_jacobians(smooth.vertices, smooth.quads).min() > 0.9
    assert quad_areas(smooth).sum() == pytest.approx(144)


def test_worst_quads_are_lifted():
    """One corner of a sheet of squares is moved over to the other side of its neighbour."""
    points, faces = rectangle(24, 24)
    mesh = extract_quads(flat(points[:, :2] * 6, faces))
    at = int(np.flatnonzero((mesh.vertices == [3, 3, 0]).all(axis=1))[0])
    surface = Stars.of(mesh.surface.vertices, mesh.surface.faces)
    on, weights = mesh.faces.copy(), mesh.barycentric.copy()
    slide_near(surface, np.array([[4.6, 3.1, 0.0]]), on[at : at + 1], weights[at : at + 1])
    places = surface.at(on, weights)
    np.testing.assert_allclose(places[at], [4.6, 3.1, 0])
    assert least_jacobians(places, mesh.quads).min() < 0
    others = np.arange(len(places)) != at
    before = places.copy()
    lift_worst(places, mesh.quads, on, weights, ~others, surface)
    assert least_jacobians(places, mesh.quads).min() > 0.5
    np.testing.assert_array_equal(places[others], before[others])
    np.testing.assert_allclose(surface.at(on, weights), places, atol=1e-12)
    lift_worst(before, mesh.quads, on, weights, np.zeros(len(places), dtype=bool), surface)
    np.testing.assert_allclose(before[at], [4.6, 3.1, 0])


def test_sliding_stays_on_its_sheet():
    """Of two sheets close together, a point that is to go through to the other stays on its own."""
    points, faces = rectangle(10, 10)
    above = points + np.array([0, 0, 0.01])
    surface = Stars.of(np.concatenate([points, above]), np.concatenate([faces, faces + len(points)]))
    on, weights = np.array([0]), np.array([[1.0, 0, 0]])
    slide_near(surface, np.array([[0.63, 0.41, 0.009]]), on, weights)
    np.testing.assert_allclose(surface.at(on, weights), [[0.63, 0.41, 0.0]], atol=1e-12)
