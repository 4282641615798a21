from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat import TriangleMesh, check_mesh
from coneflat.mesh import corner_fans

CASES = [
    (shapes.tetrahedron(), 0, 0),
    (shapes.sphere(2), 0, 0),
    (shapes.torus(), 1, 0),
    (shapes.genus(1), 1, 0),
    (shapes.genus(3), 3, 0),
    (shapes.hill(), 0, 1),
    (shapes.annulus(), 0, 2),
]


@pytest.mark.parametrize(("shape", "genus", "loops"), CASES)
def test_topology(shape, genus, loops):
    mesh = TriangleMesh(*shape)
    assert mesh.boundary_loops[0] == loops
    assert mesh.genus() == genus
    assert mesh.euler_characteristic == 2 - 2 * genus - loops
    assert mesh.components[0] == 1


def test_halfedges_lie_opposite_their_corners():
    mesh = TriangleMesh(np.zeros((4, 3)), np.array([[0, 1, 2], [2, 1, 3]]))
    assert mesh.tails.tolist() == [1, 2, 0, 1, 3, 2]
    assert mesh.heads.tolist() == [2, 0, 1, 3, 2, 1]
    assert mesh.edges.tolist() == [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]
    assert mesh.edge_halfedges.tolist() == [[2, -1], [1, -1], [0, 5], [3, -1], [4, -1]]
    assert mesh.is_boundary_edge.tolist() == [True, True, False, True, True]


def test_components_keep_their_numbers():
    mesh = TriangleMesh(*shapes.join(shapes.hill(3, 2), shapes.tetrahedron()))
    parts = mesh.split_components()
    assert len(parts) == 2
    for part, vertices, faces in parts:
        np.testing.assert_array_equal(vertices[part.faces], mesh.faces[faces])
        np.testing.assert_array_equal(part.vertices, mesh.vertices[vertices])


def test_fans_are_the_vertices_of_the_glued_surface():
    mesh = TriangleMesh(*shapes.torus(8, 6))
    count, fan = corner_fans(mesh.faces, *mesh.edge_halfedges.T)
    assert count == len(mesh.vertices)
    assert len(np.unique(np.stack([fan.ravel(), mesh.faces.ravel()]), axis=1).T) == count
    alone, _ = corner_fans(mesh.faces, *mesh.edge_halfedges[:0].T)
    assert alone == mesh.faces.size


def test_orientation_of_shapes_is_consistent():
    for shape, _, _ in CASES:
        assert check_mesh(*shape).notes == ()
