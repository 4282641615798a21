"""Meshes whose numbering scatters neighbours are numbered anew while they are worked on, which nobody notices."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

import coneflat
from coneflat.input import nearby
from coneflat.mesh import TriangleMesh


@pytest.fixture
def always(monkeypatch):
    """However small a mesh is, it counts as large."""
    monkeypatch.setattr(nearby, "LARGE", 0)


def test_the_same_triangles_come_nearer(always):
    vertices, faces, _ = shapes.renumber(*shapes.sphere(4))
    mesh = TriangleMesh(vertices, faces)
    together, vertex_order, face_order = nearby.brought_together(mesh)
    assert np.array_equal(together.vertices, vertices[vertex_order])
    assert np.array_equal(vertex_order[together.faces], faces[face_order])
    assert np.array_equal(np.sort(vertex_order), np.arange(len(vertices)))
    assert np.array_equal(np.sort(face_order), np.arange(len(faces)))
    # A third of the vertices apart on average, as random numbers are; a band of the surface then.
    assert nearby.mean_span(faces) > 0.3 * len(vertices)
    assert nearby.mean_span(together.faces) < 0.04 * len(vertices)
    assert nearby.brought_together(TriangleMesh(*shapes.grid(100, 10))) is None


def test_small_meshes_stay():
    assert nearby.brought_together(TriangleMesh(*shapes.renumber(*shapes.sphere(4))[:2])) is None


def test_results_are_in_the_numbering_of_the_input(monkeypatch):
    vertices, faces, _ = shapes.renumber(*shapes.join(shapes.sphere(3), shapes.hill(20, 16)))
    required = [5, 17]
    plain = coneflat.flatten(vertices, faces, required_cones=required)
    monkeypatch.setattr(nearby, "LARGE", 0)
    ours = coneflat.flatten(vertices, faces, required_cones=required)
    assert set(required) <= set(ours.cones.tolist())
    assert np.array_equal(np.sort(ours.cones), np.sort(plain.cones))
    assert np.array_equal(ours.faces, plain.faces)
    assert np.array_equal(ours.vertices, plain.vertices)
    assert np.array_equal(ours.face_origin, plain.face_origin)
    assert {tuple(sorted(edge)) for edge in ours.seams.tolist()} == {
        tuple(sorted(edge)) for edge in plain.seams.tolist()
    }
    np.testing.assert_allclose(ours.distortion.qc, plain.distortion.qc, rtol=1e-6)
    np.testing.assert_allclose(ours.log_scale, plain.log_scale, atol=1e-9)
    assert ours.distortion.flipped == 0
