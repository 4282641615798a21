"""Coarse meshes for the search of cuts."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from scipy.spatial import cKDTree

from coneflat.apps.unwrap.coarse import coarse_part
from coneflat.io import as_input
from coneflat.options import Options
from coneflat.source import Part, Source


def part_of(vertices: np.ndarray, faces: np.ndarray) -> Part:
    return Source(as_input(vertices, faces)).prepared(Options()).parts[0]


@pytest.fixture
def sphere() -> Part:
    return part_of(*shapes.sphere(4))


def test_the_number_of_triangles_is_reached(sphere: Part):
    coarse, kept = coarse_part(sphere, 1_000)
    assert len(coarse.mesh.faces) == 1_000
    assert np.array_equal(coarse.mesh.vertices, sphere.mesh.vertices[kept])


def test_the_topology_stays():
    for vertices, faces in (shapes.torus(48, 24), shapes.grid(30, 30)):
        part = part_of(vertices, faces)
        coarse, _ = coarse_part(part, 300)
        assert len(coarse.mesh.faces) <= 300
        assert coarse.mesh.genus() == part.mesh.genus()
        assert coarse.mesh.boundary_loops[0] == part.mesh.boundary_loops[0]
        assert coarse.mesh.components[0] == 1


def test_the_surface_stays(sphere: Part):
    coarse, _ = coarse_part(sphere, 1_000)
    centres = coarse.mesh.vertices[coarse.mesh.faces].mean(axis=1)
    fine = sphere.mesh.vertices[sphere.mesh.faces].mean(axis=1)
    assert cKDTree(fine).query(centres)[0].max() < 0.03
    corners = [each.vertices[each.faces].transpose(1, 0, 2) for each in (coarse.mesh, sphere.mesh)]
    volumes = [np.linalg.det(np.stack(each, axis=1)).sum() for each in corners]
    assert volumes[0] == pytest.approx(volumes[1], rel=0.02)


def test_renumbering_changes_nothing(sphere: Part):
    order = np.random.default_rng(1).permutation(len(sphere.mesh.vertices))
    place = np.argsort(order)
    shuffled = part_of(sphere.mesh.vertices[order], place[sphere.mesh.faces][::-1])
    one, two = (coarse_part(each, 500)[0].mesh.vertices for each in (sphere, shuffled))
    assert np.array_equal(one[np.lexsort(one.T)], two[np.lexsort(two.T)])
