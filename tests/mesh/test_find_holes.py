"""Holes of meshes, and fans that fill them."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat import check_mesh
from coneflat.mesh import find_holes, with_fans
from coneflat.mesh.connectivity import joined_meshes


def plate(holes):
    """Return a flat plate of 10 x 8 squares without the squares at given places."""
    vertices, faces = shapes.grid(10, 8)
    lower = np.floor(vertices[faces].mean(axis=1)[:, :2] * [10, 8]).astype(int)
    keep = [tuple(place) not in holes for place in lower.tolist()]
    return check_mesh(vertices, faces[keep], repair=True).mesh


HOLES = {(2, 2), (3, 2), (7, 5), (4, 5), (4, 6)}


def test_the_longest_border_is_no_hole():
    mesh = plate(HOLES)
    holes = find_holes(mesh)
    assert sorted(len(hole) for hole in holes) == [4, 6, 6]
    outer = np.setdiff1d(mesh.edge_halfedges[mesh.is_boundary_edge, 0], np.concatenate(holes))
    assert len(outer) == 36


def test_half_edges_of_a_hole_follow_each_other():
    mesh = plate(HOLES)
    for hole in find_holes(mesh):
        assert np.array_equal(mesh.heads[hole], np.roll(mesh.tails[hole], -1))


def test_each_component_has_an_outer_border():
    mesh = joined_meshes([plate(HOLES), plate(set()), plate({(1, 1)})])
    assert len(find_holes(mesh)) == 4


def test_lengths_decide_which_border_is_the_outer_one():
    mesh = check_mesh(*shapes.annulus(12, 3)).mesh
    inner = find_holes(mesh)[0]
    lengths = np.ones(mesh.faces.shape)
    lengths.ravel()[inner] = 2.0
    assert set(mesh.tails[find_holes(mesh, lengths)[0]]).isdisjoint(mesh.tails[inner])


def test_closed_meshes_and_disks_have_no_holes():
    for shape in (shapes.tetrahedron(), shapes.hill(4, 4)):
        assert find_holes(check_mesh(*shape).mesh) == []


@pytest.mark.parametrize("dimension", [2, 3])
def test_filled_meshes_are_manifold_and_have_no_holes(dimension):
    mesh = plate(HOLES)
    mesh = mesh.moved_to(np.ascontiguousarray(mesh.vertices[:, :dimension]))
    holes = find_holes(mesh)
    filled = with_fans(mesh, [mesh.tails[hole] for hole in holes])
    assert filled.euler_characteristic == 1
    assert filled.boundary_loops[0] == 1
    assert np.array_equal(filled.faces[: len(mesh.faces)], mesh.faces)
    assert np.array_equal(filled.vertices[: len(mesh.vertices)], mesh.vertices)
    assert np.bincount(filled.halfedge_edges).max() == 2
