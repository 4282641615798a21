from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat import TriangleMesh, errors
from coneflat.geometry import (
    angle_defect,
    corner_angles,
    cotangent_laplacian,
    cotangents,
    double_areas,
    edge_lengths,
    is_broken,
    mollify,
)
from coneflat.geometry.opening import thickness


def test_right_triangle():
    lengths = np.array([[5.0, 4.0, 3.0]])
    np.testing.assert_allclose(corner_angles(lengths), [[np.pi / 2, np.arctan2(4, 3), np.arctan2(3, 4)]])
    np.testing.assert_allclose(cotangents(lengths), [[0, 3 / 4, 4 / 3]], atol=1e-15)
    np.testing.assert_allclose(double_areas(lengths), [12.0])


def test_broken_triangle_has_the_real_part_of_its_angles():
    lengths = np.array([[1.0, 3.0, 1.0]])
    assert is_broken(lengths).tolist() == [True]
    np.testing.assert_allclose(corner_angles(lengths), np.arccos(np.clip([[1.5, -3.5, 1.5]], -1, 1)))
    assert double_areas(lengths).tolist() == [0.0]


def test_needles_keep_their_digits():
    # A side of 1e-9 between two of 1: the small angle is 1e-9 to all digits.
    angles = corner_angles(np.array([[1e-9, 1.0, 1.0]]))
    np.testing.assert_allclose(angles[0, 0], 1e-9, rtol=1e-12)


def test_gauss_bonnet():
    for shape in (shapes.sphere(2), shapes.torus(), shapes.genus(2), shapes.hill(), shapes.annulus()):
        mesh = TriangleMesh(*shape)
        angles = corner_angles(edge_lengths(*shape))
        np.testing.assert_allclose(angles.sum(axis=1), np.pi)
        defect = angle_defect(mesh.faces, angles, mesh.is_boundary_vertex)
        np.testing.assert_allclose(defect.sum(), 2 * np.pi * mesh.euler_characteristic, atol=1e-9)


def test_laplacian_of_a_grid_is_the_five_point_stencil():
    vertices, faces = shapes.grid(4, 4)
    laplacian = cotangent_laplacian(faces, cotangents(edge_lengths(vertices, faces)), len(vertices))
    row = laplacian[12].toarray().ravel()  # the middle of 5 x 5
    expected = np.zeros(25)
    expected[[7, 11, 13, 17]] = -1
    expected[12] = 4
    np.testing.assert_allclose(row, expected, atol=1e-12)


def test_laplacian_energy_is_the_dirichlet_energy():
    vertices, faces = shapes.sphere(2)
    laplacian = cotangent_laplacian(faces, cotangents(edge_lengths(vertices, faces)), len(vertices))
    f = vertices @ [0.3, -1.0, 2.0]
    # The gradient of a linear function on a triangle is its gradient in space, projected.
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1) / 2
    normals /= 2 * areas[:, None]
    gradient = np.array([0.3, -1.0, 2.0]) - (normals @ [0.3, -1.0, 2.0])[:, None] * normals
    np.testing.assert_allclose(f @ (laplacian @ f), (areas * (gradient**2).sum(axis=1)).sum())


def test_only_the_shortest_side_of_a_triangle_without_area_gets_longer():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0.4, 0, 0], [0.5, 1, 0.0]])
    mesh = TriangleMesh(vertices, np.array([[0, 1, 2], [1, 0, 3]]))
    lengths = edge_lengths(mesh.vertices, mesh.faces)
    opened, note = mollify(lengths, mesh)
    changed = np.argwhere(opened != lengths).tolist()
    assert changed == [[0, 1]]  # from vertex 2 to 0
    assert 0 < opened[0, 1] - lengths[0, 1] < 1e-10
    assert "1 triangle" in note
    with pytest.raises(errors.DegenerateFaceError, match="1 triangle without area: 0"):
        mollify(lengths, mesh, strict=True)


def test_lengths_of_triangles_with_area_do_not_change():
    vertices, faces = shapes.sphere(2)
    lengths = edge_lengths(vertices, faces)
    opened, note = mollify(lengths, TriangleMesh(vertices, faces))
    np.testing.assert_array_equal(opened, lengths)
    assert note is None


def test_a_mesh_without_area_is_refused():
    mesh = TriangleMesh(np.array([[0, 0, 0], [1, 0, 0], [0.5, 0, 0]]), np.array([[0, 1, 2]]))
    with pytest.raises(errors.DegenerateFaceError, match="no area: 1 triangle on a line"):
        mollify(edge_lengths(mesh.vertices, mesh.faces), mesh)


@pytest.mark.parametrize("seed", range(5))
def test_opened_lengths_are_those_of_triangles_and_hardly_change(seed):
    """Also where coincident vertices, caps and needles are neighbours; both sides of an edge stay equal."""
    rng = np.random.default_rng(seed)
    vertices, faces = shapes.grid(12, 12)
    for v in rng.permutation(len(vertices))[:20]:
        neighbours = np.unique(faces[(faces == v).any(axis=1)])
        a, b = rng.choice(neighbours[neighbours != v], 2, replace=False)
        vertices[v] = vertices[a] + rng.choice([0, 0.3, 10.0 ** rng.uniform(-14, -2)]) * (
            vertices[b] - vertices[a]
        )
    mesh = TriangleMesh(vertices, faces)
    lengths = edge_lengths(vertices, faces)
    opened, _ = mollify(lengths, mesh)
    assert (thickness(opened) > 1e-6).all()
    assert (opened >= lengths).all()
    assert (opened - lengths).max() < 1e-3 * lengths.mean()
    pairs = mesh.edge_halfedges[mesh.edge_halfedges[:, 1] >= 0]
    np.testing.assert_array_equal(opened.ravel()[pairs[:, 0]], opened.ravel()[pairs[:, 1]])


@pytest.mark.parametrize("shape", [shapes.tetrahedron(), shapes.hill(6, 5)])
def test_the_laplacian_sums_over_triangles(shape):
    vertices, faces = shape
    cots = cotangents(edge_lengths(vertices, faces))
    expected = np.zeros((len(vertices), len(vertices)))
    for face, weights in zip(faces, cots / 2, strict=True):
        for corner, weight in enumerate(weights):
            i, j = face[(corner + 1) % 3], face[(corner + 2) % 3]
            expected[[i, j], [i, j]] += weight
            expected[[i, j], [j, i]] -= weight
    laplacian = cotangent_laplacian(faces, cots, len(vertices))
    np.testing.assert_allclose(laplacian.toarray(), expected, atol=1e-12)
    assert (laplacian.data != 0).all()
    assert all((np.diff(rows) > 0).all() for rows in np.split(laplacian.indices, laplacian.indptr[1:-1]))


def test_the_laplacian_of_edges_glued_to_each_other():
    # A cone of one triangle, two of whose sides are one: vertices 0, 1 and 1, and a side from 1 to itself.
    cots = np.array([[0.5, 2.0, 3.0]])
    laplacian = cotangent_laplacian(np.array([[0, 1, 1]]), cots, 2)
    np.testing.assert_allclose(laplacian.toarray(), 2.5 * np.array([[1, -1], [-1, 1]]))


@pytest.mark.parametrize(
    ("faces", "cots", "count", "kind"),
    [
        ([[0, 1, 2], [1, 2, 3]], np.ones((2, 3)), 3, errors.FaceIndexError),
        ([[0, 1, 2], [1, 2, -3]], np.ones((2, 3)), 4, errors.FaceIndexError),
        ([[0, 1, 2], [1, 2, 3]], np.ones((1, 3)), 4, errors.ArrayShapeError),
        ([[0, 1, 2], [1, 2, 3]], np.ones((2, 2)), 4, errors.ArrayShapeError),
        ([[0, 1, 2], [1, 2, 3]], np.ones(6), 4, errors.ArrayShapeError),
        ([[0, 1, 2], [1, 2, 3]], [["a"] * 3] * 2, 4, errors.ArrayShapeError),
        (np.empty((0, 3)), np.empty((0, 3)), 4, errors.EmptyMeshError),
    ],
)
def test_a_laplacian_of_arrays_that_do_not_fit_is_refused(faces, cots, count, kind):
    with pytest.raises(kind):
        cotangent_laplacian(faces, cots, count)


@pytest.mark.parametrize("function", [corner_angles, cotangents, double_areas, thickness])
@pytest.mark.parametrize("lengths", [np.ones(3), np.ones((2, 2)), np.ones((2, 3, 3)), [["a"] * 3], 1.0])
def test_lengths_that_are_no_sides_of_triangles_are_refused(function, lengths):
    with pytest.raises(errors.ArrayShapeError):
        function(lengths)


@pytest.mark.parametrize("vertices", [np.ones(12), np.ones((4, 3, 3)), [["a"] * 3] * 4])
def test_vertices_that_are_no_points_have_no_edge_lengths(vertices):
    with pytest.raises(errors.ArrayShapeError):
        edge_lengths(vertices, np.array([[0, 1, 2]]))


@pytest.mark.parametrize("faces", [[0, 1, 2], [[0, 1]], [[[0, 1, 2]]]])
def test_faces_that_are_no_triangles_have_no_edge_lengths(faces):
    with pytest.raises(errors.ArrayShapeError):
        edge_lengths(np.ones((4, 3)), faces)
