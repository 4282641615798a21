"""Layouts with free seams."""

from __future__ import annotations

import numpy as np
import pytest

from coneflat import TriangleMesh
from coneflat.apps.unwrap.free import freed, laid_out, recut, seam_edges, unwound
from coneflat.geometry import edge_lengths, signed_double_areas

NO_EDGES = np.empty(0, dtype=np.int64)


def fan(count, turns):
    """Return a regular polygon of triangles around a vertex, laid out winding around it a number of times."""

    def corners(turns):
        angle = 2 * np.pi * turns * np.arange(count + 1) / count
        ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        return np.stack([np.zeros((count, 2)), ring[:-1], ring[1:]], axis=1)

    flat = corners(1)
    vertices = np.vstack([np.zeros((1, 3)), np.pad(flat[:, 1], ((0, 0), (0, 1)))])
    ring = 1 + np.arange(count)
    mesh = TriangleMesh(
        vertices, np.stack([np.zeros(count, dtype=np.int64), ring, np.roll(ring, -1)], axis=1)
    )
    lengths = edge_lengths(mesh.vertices, mesh.faces)
    return laid_out(mesh, lengths, corners(turns), NO_EDGES, NO_EDGES)


def test_vertices_around_which_triangles_wind_twice_are_cut_open():
    layout = fan(12, 2)
    opened = unwound(layout)
    assert len(seam_edges(opened)) == 1
    assert 0 in layout.mesh.edges[seam_edges(opened)]
    relaxed, energy = freed(opened, tolerance=1e-9)
    assert energy == pytest.approx(4)
    assert (signed_double_areas(relaxed.points[relaxed.corners]) > 0).all()
    assert unwound(fan(12, 1)).seams.size == 0


def test_the_two_sides_of_closed_seams_meet_in_the_middle():
    whole = fan(6, 1)
    spoke = np.flatnonzero((whole.mesh.edges == 0).any(axis=1))[:1]
    cut = recut(whole, spoke)
    assert len(cut.points) == len(whole.points) + 1
    ends = np.flatnonzero(np.linalg.norm(cut.points - whole.points[1], axis=1) < 1e-12)
    assert len(ends) == 2
    cut.points[ends] += [[0, 0.25], [0, -0.25]]
    np.testing.assert_allclose(recut(cut, NO_EDGES).points, whole.points, atol=1e-12)
