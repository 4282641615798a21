from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat import TriangleMesh, errors
from coneflat.geometry import edge_lengths
from coneflat.layout import least_squares_layout


def test_a_flat_mesh_is_reconstructed():
    vertices, faces = shapes.grid(9, 5)
    points = least_squares_layout(TriangleMesh(vertices, faces), edge_lengths(vertices, faces))
    assert shapes.similar(points, vertices[:, :2]) < 1e-11


def test_slivers_are_laid_out_accurately():
    vertices, faces = shapes.grid(30, 30)
    vertices[:, 1] *= 1e-3
    points = least_squares_layout(TriangleMesh(vertices, faces), edge_lengths(vertices, faces))
    assert shapes.similar(points, vertices[:, :2]) < 1e-8


def test_broken_triangle_is_laid_on_a_line():
    # Two triangles on a common side; the second cannot close.
    mesh = TriangleMesh(*shapes.grid(1, 1))
    lengths = edge_lengths(mesh.vertices, mesh.faces)
    lengths[1] = [0.5, 0.5, lengths[1, 2]]
    long = int(np.argmax(lengths[1]))
    points = least_squares_layout(mesh, lengths)
    side = points[mesh.faces[1]]
    middle = (side[(long + 1) % 3] + side[(long + 2) % 3]) / 2
    np.testing.assert_allclose(side[long], middle, atol=1e-9)


def test_layout_without_finite_solution_is_refused():
    mesh = TriangleMesh(*shapes.grid(2, 2))
    with pytest.raises(errors.MetricError):
        least_squares_layout(mesh, np.full((8, 3), np.nan))
