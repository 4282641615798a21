"""Holes filled with triangles."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat import check_mesh
from coneflat.geometry import angle_defect, corner_angles, double_areas, edge_lengths
from coneflat.geometry.filling import filled
from coneflat.mesh import find_holes


def fill(mesh, lengths=None):
    lengths = edge_lengths(mesh.vertices, mesh.faces) if lengths is None else lengths
    return filled(mesh, lengths, [mesh.tails[hole] for hole in find_holes(mesh)])


def plate_with_letter():
    """Return a flat plate with a hole of the shape of an L."""
    vertices, faces = shapes.grid(12, 10)
    x, y = vertices[faces].mean(axis=1)[:, :2].T
    is_l = ((x > 0.3) & (x < 0.42) & (y > 0.2) & (y < 0.8)) | ((x > 0.3) & (x < 0.8) & (y > 0.2) & (y < 0.3))
    vertex_indices, corners = np.unique(faces[~is_l], return_inverse=True)
    return check_mesh(vertices[vertex_indices] @ shapes.rotation(), corners.reshape(-1, 3)).mesh


def test_a_flat_surface_stays_flat():
    mesh = plate_with_letter()
    filled_mesh, lengths = fill(mesh)
    curvature = angle_defect(filled_mesh.faces, corner_angles(lengths), filled_mesh.is_boundary_vertex)
    assert np.abs(curvature[~filled_mesh.is_boundary_vertex]).max() < 1e-9
    assert double_areas(lengths).sum() == pytest.approx(2, rel=1e-9)
    assert filled_mesh.euler_characteristic == 1
    assert np.array_equal(filled_mesh.faces[: len(mesh.faces)], mesh.faces)


def test_lengths_of_the_mesh_are_preserved():
    mesh = plate_with_letter()
    lengths = 1.1 * edge_lengths(mesh.vertices, mesh.faces)
    filled_mesh, filled_lengths = fill(mesh, lengths)
    np.testing.assert_allclose(filled_lengths[: len(lengths)], lengths, rtol=1e-12)
    of_edge = filled_lengths.ravel()[filled_mesh.edge_halfedges]
    inside = ~filled_mesh.is_boundary_edge
    assert np.array_equal(of_edge[inside, 0], of_edge[inside, 1])


def test_an_edge_of_the_mesh_is_not_used_again():
    """The shorter diagonal of a hole of four sides is an edge of the mesh: the hole is filled around a vertex."""
    rhomb = np.array([[0, -2, 0], [1, 0, 0], [0, 2, 0], [-1, 0, 0]], dtype=float)
    outer = 10 * rhomb[[0, 1, 3]] + [0, 0, 5]
    funnel = [(a, b, 4 + (i + 1) % 3) for i, (a, b) in enumerate([(0, 1), (1, 3), (3, 0)])]
    funnel += [(a, 4 + (i + 1) % 3, 4 + i) for i, a in enumerate([0, 1, 3])]
    mesh = check_mesh(np.concatenate([rhomb, outer]), [(1, 2, 3), *funnel]).mesh
    assert [len(hole) for hole in find_holes(mesh)] == [4]
    filled_mesh, _ = fill(mesh)
    assert len(filled_mesh.vertices) == len(mesh.vertices) + 1
    assert np.bincount(filled_mesh.halfedge_edges).max() == 2
    assert filled_mesh.boundary_loops[0] == 1


def test_a_hole_whose_border_crosses_itself_in_its_plane_is_filled_around_a_vertex():
    inner = np.array([[0, 0, 0], [3, 0, 0], [3, 3, 0], [1, -1, 0.5], [0, 3, 0]])
    count = len(inner)
    ring = [(i, (i + 1) % count, count + i) for i in range(count)]
    ring += [((i + 1) % count, count + (i + 1) % count, count + i) for i in range(count)]
    mesh = check_mesh(np.concatenate([inner, 1.3 * inner + [0, 0, 2]]), ring).mesh
    filled_mesh, lengths = fill(mesh)
    assert len(filled_mesh.vertices) == len(mesh.vertices) + 1
    assert filled_mesh.euler_characteristic == 1
    assert (double_areas(lengths) > 0).all()
