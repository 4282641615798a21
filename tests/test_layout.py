from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat import TriangleMesh, edge_lengths, errors, least_squares_layout
from coneflat.layout import arrange
from coneflat.layout.pieces import triangulations


def similar(points, reference):
    """Return the points after the similarity that brings them closest to the reference."""
    z, w = points @ [1, 1j], reference @ [1, 1j]
    z, w = z - z.mean(), w - w.mean()
    return np.abs(z * (np.vdot(z, w) / np.vdot(z, z)) - w).max()


def test_flat_mesh_comes_back():
    vertices, faces = shapes.grid(9, 5)
    points = least_squares_layout(TriangleMesh(vertices, faces), edge_lengths(vertices, faces))
    assert similar(points, vertices[:, :2]) < 1e-11


def test_slivers_do_not_hurt():
    vertices, faces = shapes.grid(30, 30)
    vertices[:, 1] *= 1e-3
    points = least_squares_layout(TriangleMesh(vertices, faces), edge_lengths(vertices, faces))
    assert similar(points, vertices[:, :2]) < 1e-8


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


@pytest.mark.parametrize("count", [1, 2, 7, 40])
def test_charts_do_not_overlap_and_fill_the_unit_square(count):
    rng = np.random.default_rng(count)
    charts = [rng.random((5, 2)) * rng.random(2) * 3 for _ in range(count)]
    moved, scale = arrange(charts)
    boxes = np.array([[chart.min(axis=0), chart.max(axis=0)] for chart in moved])
    assert boxes.min() == 0
    assert boxes.max() == pytest.approx(1)
    for before, after in zip(charts, moved, strict=True):
        np.testing.assert_allclose(np.ptp(after, axis=0), np.ptp(before, axis=0) * scale)
    for i in range(count):
        for j in range(i):
            apart = (boxes[i, 0] > boxes[j, 1]) | (boxes[j, 0] > boxes[i, 1])
            assert apart.any()


def test_layout_without_finite_solution_is_refused():
    mesh = TriangleMesh(*shapes.grid(2, 2))
    with pytest.raises(errors.MetricError):
        least_squares_layout(mesh, np.full((8, 3), np.nan))


def test_polygons_have_catalan_many_triangulations():
    for corners, count in ((3, 1), (4, 2), (5, 5), (6, 14)):
        choices = triangulations(corners)
        assert choices.shape == (count, corners - 2, 3)
        assert len({tuple(sorted(map(tuple, choice.tolist()))) for choice in choices}) == count
