"""Quads made squarer on the surface, the worst of them better; layouts whose edges are split."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapes
from grid_maps import bumpy, flat
from shapes import grid as rectangle

from coneflat import flatten
from coneflat.errors import OptionError
from coneflat.geometry.nearest import Stars, slide_near
from coneflat.geometry.planar import signed_double_areas
from coneflat.geometry.triangles import double_areas, edge_lengths
from coneflat.mesh.connectivity import TriangleMesh
from coneflat.optimise import find_chains
from coneflat.quadmesh.alignment import aligned
from coneflat.quadmesh.extract import extract_quads
from coneflat.quadmesh.quad_mesh import least_jacobians
from coneflat.quadmesh.quality import measure_quads
from coneflat.quadmesh.smooth import MovingQuads, smooth_quads
from coneflat.quadmesh.splitting import with_split_edges


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
    with pytest.raises(OptionError, match="rounds must be an integer, 0 or more, got -1"):
        smooth_quads(mesh, -1)


def moved_corner(place):
    """A sheet of squares, whose corner (3, 3, 0) is moved."""
    points, faces = rectangle(24, 24)
    mesh = extract_quads(flat(points[:, :2] * 6, faces))
    at = int(np.flatnonzero((mesh.vertices == [3, 3, 0]).all(axis=1))[0])
    surface = Stars.of(mesh.surface.vertices, mesh.surface.faces)
    on, weights = mesh.faces.copy(), mesh.barycentric.copy()
    slide_near(surface, np.array([place]), on[at : at + 1], weights[at : at + 1])
    return replace(mesh, vertices=surface.at(on, weights), faces=on, barycentric=weights)


def test_worst_quads_are_lifted():
    """A corner is on the other side of its neighbour."""
    mesh = moved_corner([4.6, 3.1, 0.0])
    surface, places = Stars.of(mesh.surface.vertices, mesh.surface.faces), mesh.vertices
    stays = (places != [4.6, 3.1, 0]).any(axis=1)
    assert (~stays).sum() == 1
    assert least_jacobians(places, mesh.quads).min() < 0
    moving = MovingQuads.of(mesh)
    moving.improve_worst(np.zeros(len(places), dtype=bool))
    np.testing.assert_array_equal(moving.mesh.vertices, places)
    moving.improve_worst(~stays)
    improved = moving.mesh
    assert least_jacobians(improved.vertices, mesh.quads).min() > 0.5
    np.testing.assert_array_equal(improved.vertices[stays], places[stays])
    np.testing.assert_allclose(
        surface.at(improved.faces, improved.barycentric), improved.vertices, atol=1e-12
    )


def test_sliding_stays_on_its_sheet():
    """Of two sheets close together, a point that is to go through to the other stays on its own."""
    points, faces = rectangle(10, 10)
    above = points + np.array([0, 0, 0.01])
    surface = Stars.of(np.concatenate([points, above]), np.concatenate([faces, faces + len(points)]))
    on, weights = np.array([0]), np.array([[1.0, 0, 0]])
    slide_near(surface, np.array([[0.63, 0.41, 0.009]]), on, weights)
    np.testing.assert_allclose(surface.at(on, weights), [[0.63, 0.41, 0.0]], atol=1e-12)


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
    moving = MovingQuads.of(mesh)
    moving.untangle()
    back = moving.mesh
    assert least_jacobians(back.vertices, back.quads).min() > 0
    moved = (back.vertices != mesh.vertices).any(axis=1)
    assert 0 < moved.sum() <= 9
    assert not (moved & mesh.is_boundary_vertex).any()
    corners = back.surface.vertices[back.surface.faces[back.faces]]
    np.testing.assert_allclose(np.einsum("qi,qix->qx", back.barycentric, corners), back.vertices, atol=1e-12)


def test_untangling_leaves_meshes_without_flipped_quads():
    """One has a bad quad, which `improve_worst` would lift."""
    mesh = moved_corner([3.46, 3.46, 0.0])
    assert 0 < least_jacobians(mesh.vertices, mesh.quads).min() < 0.2
    moving = MovingQuads.of(mesh)
    moving.untangle()
    np.testing.assert_array_equal(moving.mesh.vertices, mesh.vertices)


def test_settled_vertices_have_no_better_place():
    points, faces = rectangle(24, 24)
    mesh = extract_quads(flat(points[:, :2] * 6, faces))
    surface, on, weights = Stars.of(mesh.surface.vertices, mesh.surface.faces), mesh.faces, mesh.barycentric
    inside = ~mesh.is_boundary_vertex
    noise = np.random.default_rng(0).normal(0, 0.5, mesh.vertices.shape) * [[1, 1, 0]] * inside[:, None]
    slide_near(surface, mesh.vertices + noise, on, weights)
    moving = MovingQuads.of(replace(mesh, vertices=surface.at(on, weights)))
    moving.improve_worst(inside, 0.9)
    settled, places = np.flatnonzero(moving.settled), moving.mesh.vertices.copy()
    assert len(settled) >= 3
    for vertex in settled:
        moving._improve(np.array([vertex]))
    np.testing.assert_array_equal(moving.mesh.vertices, places)


OPTIONS = {"quantise": np.pi / 2, "charts": "one", "min_cone_angle": 1.5 * np.pi, "max_cone_angle": 3 * np.pi}


@pytest.mark.parametrize("share", [0.0, 0.3, 0.7, 1.0])
@pytest.mark.parametrize("boundary", ["free", "straight"])
def test_splitting_keeps_the_surface_and_its_seams(share, boundary):
    shape = shapes.hill() if boundary == "straight" else shapes.sphere(2)
    sharpest = {"min_cone_angle": np.pi / 2} if boundary == "straight" else {}
    layout = aligned(flatten(*shape, **{**OPTIONS, **sharpest}, boundary=boundary), 0.2)
    is_split = np.random.default_rng(3).random(len(layout.mesh.edges)) < share
    split = with_split_edges(layout, is_split)
    before, mesh = layout.mesh, split.mesh
    assert len(mesh.vertices) == len(before.vertices) + is_split.sum()
    inner = 2 - before.is_boundary_edge.astype(int)
    assert len(mesh.faces) == len(before.faces) + (inner * is_split).sum()
    assert mesh.euler_characteristic == before.euler_characteristic
    assert isinstance(mesh, TriangleMesh)
    # Lengths are those between positions, areas add up, in space and in the plane, and none is flipped.
    assert split.lengths == pytest.approx(edge_lengths(mesh.vertices, mesh.faces))
    assert double_areas(split.lengths).sum() == pytest.approx(double_areas(layout.lengths).sum())
    flat = [np.stack([z.points.real, z.points.imag], axis=1)[z.corners] for z in (split, layout)]
    assert signed_double_areas(flat[0]).min() > 0
    assert signed_double_areas(flat[0]).sum() == pytest.approx(signed_double_areas(flat[1]).sum())
    # Rigid seams, or this raises; a seam edge that is split is two.
    chains, old = (find_chains(z.mesh, z.corners, z.points, z.cones) for z in (split, layout))
    assert len(chains.edges) == len(old.edges) + is_split[old.edges].sum()
    # Sides of the boundary are what they were, with the points in between.
    assert len(split.sides.axis) == len(layout.sides.axis)
    assert sorted(split.sides.corners) == sorted(layout.sides.corners)
    border = (is_split & before.is_boundary_edge).sum() if boundary == "straight" else 0
    assert len(split.sides.points) == len(layout.sides.points) + border
