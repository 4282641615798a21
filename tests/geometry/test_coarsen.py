"""Simplified meshes."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from scipy.spatial import Delaunay, cKDTree

from coneflat import TriangleMesh, check_mesh
from coneflat.geometry import coarse_mesh


@pytest.fixture
def sphere() -> TriangleMesh:
    return check_mesh(*shapes.sphere(4)).mesh


def test_the_number_of_triangles_is_reached(sphere: TriangleMesh):
    coarse = coarse_mesh(sphere, 1_000)
    assert len(coarse.mesh.faces) == len(coarse.faces) == 1_000
    assert np.array_equal(coarse.mesh.vertices, sphere.vertices[coarse.vertices])


def test_the_order_and_type_of_faces_in_memory_change_nothing(sphere: TriangleMesh):
    faces = np.asfortranarray(sphere.faces.astype(np.int32))
    coarse, coarse_of_copy = (
        coarse_mesh(mesh, 500).mesh.faces for mesh in (sphere, TriangleMesh(sphere.vertices, faces))
    )
    assert len(coarse) == 500
    assert np.array_equal(coarse, coarse_of_copy)


def test_the_topology_stays():
    for vertices, faces in (shapes.torus(48, 24), shapes.grid(30, 30)):
        mesh = check_mesh(vertices, faces).mesh
        coarse = coarse_mesh(mesh, 300).mesh
        assert len(coarse.faces) <= 300
        assert coarse.genus() == mesh.genus()
        assert coarse.boundary_loops[0] == mesh.boundary_loops[0]
        assert coarse.components[0] == 1


def test_the_surface_stays(sphere: TriangleMesh):
    coarse = coarse_mesh(sphere, 1_000).mesh
    centres = coarse.vertices[coarse.faces].mean(axis=1)
    fine = sphere.vertices[sphere.faces].mean(axis=1)
    assert cKDTree(fine).query(centres)[0].max() < 0.06
    corners = [mesh.vertices[mesh.faces].transpose(1, 0, 2) for mesh in (coarse, sphere)]
    volumes = [np.linalg.det(np.stack(columns, axis=1)).sum() for columns in corners]
    assert volumes[0] == pytest.approx(volumes[1], rel=0.02)


def test_renumbering_changes_nothing(sphere: TriangleMesh):
    order = np.random.default_rng(1).permutation(len(sphere.vertices))
    place = np.argsort(order)
    shuffled = TriangleMesh(sphere.vertices[order], place[sphere.faces][::-1])
    vertices, vertices_shuffled = (coarse_mesh(mesh, 500).mesh.vertices for mesh in (sphere, shuffled))
    assert np.array_equal(
        vertices[np.lexsort(vertices.T)], vertices_shuffled[np.lexsort(vertices_shuffled.T)]
    )


@pytest.mark.parametrize(("height", "largest_count"), [(0.1, 800), (0.02, 3000)])
def test_thin_triangles_are_not_folded_over(height, largest_count):
    """A flat sheet stays flat, and its triangles keep their orientation."""
    points = np.random.default_rng(0).uniform(size=(2000, 2))
    sheet = TriangleMesh(
        np.column_stack([points * [1, height], 0 * points[:, 0]]), Delaunay(points).simplices
    )
    for mesh in (sheet, coarse_mesh(sheet, 800).mesh):
        sides = mesh.vertices[mesh.faces][:, 1:] - mesh.vertices[mesh.faces][:, :1]
        assert (np.cross(sides[:, 0], sides[:, 1])[:, 2] >= 0).all()
    assert len(mesh.faces) <= largest_count < len(sheet.faces)


def test_every_vertex_is_in_the_cluster_of_one_that_remains(sphere: TriangleMesh):
    coarse = coarse_mesh(sphere, 1_000)
    assert np.array_equal(coarse.clusters[coarse.vertices], np.arange(len(coarse.vertices)))
    away = np.linalg.norm(sphere.vertices - coarse.mesh.vertices[coarse.clusters], axis=1)
    assert np.median(away) < 0.08
    assert away.max() < 0.4


@pytest.mark.parametrize("count", [100, 1_000])
def test_anchors_remain(sphere: TriangleMesh, count):
    """Few triangles are reached with a queue of edges only, many also in rounds."""
    anchors = np.arange(7, len(sphere.vertices), 97)
    assert np.isin(anchors, coarse_mesh(sphere, count, anchors).vertices).all()


def test_meshes_of_anchors_stay():
    """Vertices whose edges cannot collapse are most of those of the cheapest ones."""
    mesh = TriangleMesh(*shapes.grid(40, 40))
    anchors = np.arange(0, len(mesh.vertices), 2)
    assert np.isin(anchors, coarse_mesh(mesh, 10, anchors).vertices).all()


@pytest.mark.parametrize("count", [300, 2_000])
def test_renumbering_and_similarity_change_nothing_on_symmetric_meshes(count):
    vertices, faces = shapes.subdivide(*shapes.subdivide(*shapes.hill(40, 30)))
    mesh = TriangleMesh(vertices, faces)
    coarse = coarse_mesh(mesh, count)
    rotated = TriangleMesh(3e-5 * vertices @ shapes.rotation().T, faces)
    assert np.array_equal(coarse_mesh(rotated, count).vertices, coarse.vertices)
    order = np.random.default_rng(1).permutation(len(vertices))
    renumbered = TriangleMesh(vertices[order], np.argsort(order)[faces][::-1])
    vertices = order[coarse_mesh(renumbered, count).vertices]
    assert np.array_equal(np.sort(vertices), coarse.vertices)
