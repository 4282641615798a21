from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat import TriangleMesh, check_mesh
from coneflat.base.arrays import unit_exponent
from coneflat.errors import SeamError
from coneflat.mesh import cut_open
from coneflat.mesh.charts import joined_edges, label_charts, point_seams, uv_seams
from coneflat.mesh.connectivity import corner_fans, sort_pairs

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


def test_components_have_the_connectivity_that_they_would_have_alone():
    joined = shapes.renumber(*shapes.join(shapes.hill(3, 2), shapes.torus(6, 5), shapes.annulus(7, 2)))
    for part, _, _ in TriangleMesh(*joined[:2]).split_components():
        alone = TriangleMesh(part.vertices, part.faces)
        for name in ("edges", "halfedge_edges", "edge_halfedges", "is_boundary_edge", "is_boundary_vertex"):
            np.testing.assert_array_equal(getattr(part, name), getattr(alone, name), err_msg=name)


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


def test_the_walks_around_several_boundaries_pass_every_side_once():
    mesh = TriangleMesh(*shapes.join(shapes.annulus(), shapes.hill(7, 5)))
    walks = mesh.boundary_walks()
    assert len(walks) == 3
    for walk in walks:
        np.testing.assert_array_equal(mesh.heads[walk], np.roll(mesh.tails[walk], -1))
    sides = np.sort(mesh.halfedge_edges[np.concatenate(walks)])
    np.testing.assert_array_equal(sides, np.flatnonzero(mesh.is_boundary_edge))


def test_the_walk_around_a_boundary_passes_every_side_once_and_goes_on_where_it_came():
    mesh = TriangleMesh(*shapes.hill(7, 5))
    (walk,) = mesh.boundary_walks()
    np.testing.assert_array_equal(mesh.heads[walk], np.roll(mesh.tails[walk], -1))
    np.testing.assert_array_equal(np.sort(mesh.halfedge_edges[walk]), np.flatnonzero(mesh.is_boundary_edge))
    # With the mesh to the left: the walk is that of its triangles.
    corners = mesh.vertices[mesh.tails[walk], :2] @ [1, 1j]
    assert (np.conj(corners) * np.roll(corners, -1)).imag.sum() > 0


def test_seams_are_where_sides_have_different_points_and_charts_what_is_left_between():
    mesh = TriangleMesh(*shapes.grid(4, 3))
    columns = np.minimum((3.999 * mesh.vertices[mesh.faces].mean(axis=1)[:, 0]).astype(int), 3)
    corners = mesh.faces + len(mesh.vertices) * (columns // 2)[:, None]
    seams = point_seams(mesh, corners)
    np.testing.assert_allclose(mesh.vertices[mesh.edges[seams]][..., 0], 0.5)
    assert len(seams) == 3
    uv = mesh.vertices[mesh.faces][..., :2] + 1e-9 + 2.0 * (columns // 2)[:, None, None]
    np.testing.assert_array_equal(uv_seams(mesh, uv), seams)
    count, chart = label_charts(mesh, joined_edges(mesh, uv))
    assert count == 2
    np.testing.assert_array_equal(chart, chart[0] ^ (columns // 2 != columns[0] // 2))


@pytest.mark.parametrize("value", [1.0, -1.0, 0.75, 3e-310, 1e300, 0.5 - 2.0**-54])
def test_unit_exponents_scale_values_to_between_a_half_and_one(value):
    scaled = np.ldexp(value, -unit_exponent(np.array([value, value / 3])))
    assert 0.5 <= abs(scaled) < 1


def test_pairs_are_sorted_stably_by_the_smaller_index_first():
    tails, heads = np.random.default_rng(0).integers(0, 9, (2, 200))
    order, first = sort_pairs(tails, heads, 9)
    low, high = np.minimum(tails, heads), np.maximum(tails, heads)
    assert order.tolist() == np.lexsort((high, low)).tolist()
    keys = (9 * low + high)[order]
    assert first.tolist() == [True, *(np.diff(keys) > 0).tolist()]


def test_ends_of_some_sides_are_those_of_all():
    mesh = TriangleMesh(*shapes.hill(7, 5))
    sides = np.array([5, 0, 17, 5])
    tails, heads = mesh.ends_of(sides)
    np.testing.assert_array_equal(tails, mesh.tails[sides])
    np.testing.assert_array_equal(heads, mesh.heads[sides])
    np.testing.assert_array_equal(mesh.tails.reshape(-1, 3)[:, 0], mesh.faces[:, 1])


def test_a_mesh_that_is_moved_has_the_same_edges():
    vertices, faces = shapes.hill(7, 5)
    mesh = TriangleMesh(vertices, faces)
    _ = mesh.is_boundary_vertex
    moved = mesh.moved_to(2 * vertices)
    assert moved.edges is mesh.edges
    np.testing.assert_array_equal(
        moved.is_boundary_vertex, TriangleMesh(2 * vertices, faces).is_boundary_vertex
    )
    np.testing.assert_array_equal(moved.vertices, 2 * vertices)


@pytest.mark.parametrize("edge", [-1, 10**7])
def test_only_edges_of_the_mesh_are_cut(edge):
    with pytest.raises(SeamError, match="edges from 0"):
        cut_open(TriangleMesh(*shapes.sphere(1)), np.array([edge]))


def test_vertices_without_triangles_have_no_copies_in_a_cut_mesh():
    vertices, faces = shapes.sphere(1)
    mesh = TriangleMesh(np.concatenate([[[9.0, 9.0, 9.0]], vertices]), faces + 1)
    # Two edges from one vertex.
    seams = np.flatnonzero((mesh.edges == 1).any(axis=1))[:2]
    cut = cut_open(mesh, seams)
    assert cut.origin.tolist() == [1, 1, *range(2, len(mesh.vertices))]
