"""Layouts with free seams."""

from __future__ import annotations

import numpy as np
import pytest

from coneflat import TriangleMesh
from coneflat.geometry import edge_lengths, signed_double_areas
from coneflat.stages import SeamSpec
from coneflat.textures.free_seams import freed, laid_out, recut, seam_edges

NO_EDGES = np.empty(0, dtype=np.int64)


def fan(angles):
    """Return a regular polygon of triangles around a vertex, laid out with given angles at this vertex."""
    count = len(angles)
    ends = np.concatenate([[0.0], np.cumsum(angles)])
    ring = np.stack([np.cos(ends), np.sin(ends)], axis=1)
    places = np.stack([np.zeros((count, 2)), ring[:-1], ring[1:]], axis=1)
    regular = 2 * np.pi * np.arange(count) / count
    points = np.stack([np.cos(regular), np.sin(regular), 0 * regular], axis=1)
    around = 1 + np.arange(count)
    faces = np.stack([0 * around, around, np.roll(around, -1)], axis=1)
    mesh = TriangleMesh(np.vstack([np.zeros((1, 3)), points]), faces)
    return laid_out(mesh, edge_lengths(mesh.vertices, mesh.faces), places, NO_EDGES, NO_EDGES)


@pytest.mark.parametrize("forbidden", [None, False, True])
def test_vertices_around_which_triangles_wind_twice_are_cut_open(forbidden):
    """A triangle is flipped, too. Without such a cut, the layout starts from an embedding."""
    layout = fan([*np.full(11, 4.2 * np.pi / 11), -0.2 * np.pi])
    mesh, none = layout.mesh, np.zeros(len(layout.mesh.edges), dtype=bool)
    spec = None if forbidden is None else SeamSpec(0.0, 0.0, None, None, none, none | forbidden)
    relaxed, energy = freed(layout, tolerance=1e-9, spec=spec)
    seams = mesh.edges[seam_edges(relaxed)]
    assert len(seams) == (forbidden is False)
    assert (seams == 0).any(axis=1).all()
    assert energy == pytest.approx(4)
    assert (signed_double_areas(relaxed.points[relaxed.corners]) > 0).all()


def test_the_two_sides_of_closed_seams_meet_in_the_middle():
    disk = fan(np.full(6, np.pi / 3))
    spoke = np.flatnonzero((disk.mesh.edges == 0).any(axis=1))[:1]
    cut = recut(disk, spoke)
    assert len(cut.points) == len(disk.points) + 1
    ends = np.flatnonzero(np.linalg.norm(cut.points - disk.points[1], axis=1) < 1e-12)
    assert len(ends) == 2
    cut.points[ends] += [[0, 0.25], [0, -0.25]]
    np.testing.assert_allclose(recut(cut, NO_EDGES).points, disk.points, atol=1e-12)
