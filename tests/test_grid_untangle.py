"""Quads turned over that smoothing has to leave, turned back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from grid_maps import flat
from shapes import grid as rectangle

from coneflat import flatten, integer_grid
from coneflat import quads as find_quads
from coneflat.geometry.nearest import Stars, slide_near
from coneflat.grid.extract import extract_quads
from coneflat.grid.integer_grid import OPTIONS
from coneflat.grid.jacobians import least_jacobians
from coneflat.grid.untangle import untangled


def folded(height):
    """A sheet with a ridge, bent by `height`, one of whose quad vertices on the ridge has gone past the next one."""
    points, faces = rectangle(24, 24)
    grid = flat(points[:, :2] * 6, faces)
    grid.vertices = np.column_stack([points[:, :2] * 6, -height * np.abs(points[:, 0] * 6 - 3)])
    mesh = extract_quads(grid)
    at = int(np.argmin(np.linalg.norm(mesh.vertices[:, :2] - [3, 3], axis=1)))
    surface = Stars.of(mesh.surface.vertices, mesh.surface.faces)
    on, weights = mesh.faces.copy(), mesh.barycentric.copy()
    slide_near(surface, np.array([[3.0, 4.4, 0.0]]), on[at : at + 1], weights[at : at + 1])
    return replace(mesh, vertices=surface.at(on, weights), faces=on, barycentric=weights)


def test_a_vertex_on_a_sharp_edge_is_moved_where_it_must():
    mesh = folded(1.0)
    assert least_jacobians(mesh.vertices, mesh.quads).min() < 0
    back = untangled(mesh)
    assert least_jacobians(back.vertices, back.quads).min() > 0
    moved = (back.vertices != mesh.vertices).any(axis=1)
    assert 0 < moved.sum() <= 9
    assert not (moved & mesh.is_boundary_vertex).any()
    corners = back.surface.vertices[back.surface.faces[back.faces]]
    np.testing.assert_allclose(np.einsum("qi,qix->qx", back.barycentric, corners), back.vertices, atol=1e-12)


def test_meshes_without_any_stay():
    points, faces = rectangle(12, 12)
    mesh = extract_quads(flat(points[:, :2] * 6, faces))
    assert untangled(mesh) is mesh


def test_no_quad_of_a_chess_piece_is_turned_over(shared):
    """A thousand triangles with 114 cones and sharp edges."""
    result = flatten(shared("knight.off"), **OPTIONS)
    for wanted, is_turned in ((700, True), (1000, False), (5000, False)):
        grid = integer_grid(result, quads=wanted)
        rough, fine = (find_quads(grid, smooth=rounds) for rounds in (0, 10))
        assert least_jacobians(rough.vertices, rough.quads).min() < 0 or not is_turned
        assert least_jacobians(fine.vertices, fine.quads).min() > 0
