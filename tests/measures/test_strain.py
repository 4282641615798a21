"""The relative change of the lengths of edges."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

import coneflat
from coneflat import TriangleMesh, measure

VERTICES, FACES = shapes.grid(6, 4)
MESH = TriangleMesh(VERTICES, FACES)
FLAT = VERTICES[FACES][..., :2]


def by_definition(result):
    """The largest change of length of the edges of the charts, at the best of many scales, and the mean."""
    lengths = {}
    for corners, points in zip(result.faces.tolist(), result.uv_faces.tolist(), strict=True):
        for i in range(3):
            (v, w), (p, q) = (sorted((ends[i], ends[i - 1])) for ends in (corners, points))
            length = np.linalg.norm(result.vertices[v] - result.vertices[w])
            lengths[p, q] = length, np.linalg.norm(result.uv[p] - result.uv[q])
    on_model, in_plane = np.array(list(lengths.values())).T
    ratios = in_plane / on_model
    scales = 1 / np.linspace(ratios.min(), ratios.max(), 20001)
    largest = min(np.abs(scale * ratios - 1).max() for scale in scales)
    mean_scale = on_model.sum() / in_plane.sum()
    return largest, np.average(np.abs(mean_scale * ratios - 1), weights=on_model)


@pytest.mark.parametrize("shape", [shapes.torus, lambda: shapes.hill(10, 8)])
def test_it_is_that_of_the_definition(shape):
    result = coneflat.flatten(*shape(), distortion=0.2)
    largest, mean = by_definition(result)
    assert result.distortion.strain_max == pytest.approx(largest, abs=1e-3)
    assert result.distortion.strain_mean == pytest.approx(mean, rel=1e-9)
    assert result.report()["strain_max"] == result.distortion.strain_max


def test_a_stretched_grid():
    """Lengths 2 and 1 are best scaled to 4/3 and 2/3."""
    d = measure(MESH, FLAT * [2, 1])
    assert d.strain_max == pytest.approx(1 / 3)
    assert np.ptp(d.strain) == pytest.approx(0, abs=1e-12)
    assert np.abs(d.strain[0]) > d.strain_max


def test_it_does_not_depend_on_scale_motion_or_numbering():
    rng = np.random.default_rng(3)
    uv = FLAT + 0.05 * VERTICES[FACES][..., :2] ** 2
    turn = np.linalg.qr(rng.normal(size=(2, 2)))[0]
    order = rng.permutation(len(FACES))
    expected = measure(MESH, uv)
    moved = measure(TriangleMesh(7 * VERTICES, FACES[order]), 0.3 * uv[order] @ turn + 2)
    assert 0.01 < expected.strain_max < 1
    for name in ("strain_max", "strain_mean"):
        assert getattr(moved, name) == pytest.approx(getattr(expected, name), rel=1e-9)


def test_of_each_triangle_the_side_that_changes_most_counts():
    uv = FLAT * [2, 1]
    uv[0] = FLAT[0]
    uv[1] = 3 * FLAT[1]
    d = measure(MESH, uv)  # lengths from 1 to 3, scaled to 1/2 and 3/2 for the largest
    assert d.strain_max == pytest.approx(0.5)
    assert (d.strain[1] + 1) / (d.strain[0] + 1) == pytest.approx(3)


def test_triangles_without_area_are_left_out():
    points = VERTICES.copy()
    points[FACES[0]] = points[FACES[0, 0]]
    d = measure(TriangleMesh(points, FACES), FLAT)
    assert np.isnan(d.strain[0])
    assert np.isfinite(d.strain_max)
    collapsed = measure(MESH.moved_to(0 * VERTICES), FLAT)
    assert np.isnan([collapsed.strain_max, collapsed.strain_mean, *collapsed.strain]).all()


def test_it_is_stored_in_archives(tmp_path):
    result = coneflat.flatten(*shapes.torus())
    stored = coneflat.read_flattening(result.save(tmp_path / "torus.npz")).distortion
    assert np.array_equal(stored.strain, result.distortion.strain)
    assert stored.strain_max == result.distortion.strain_max


def test_a_requirement_takes_it():
    requirement = coneflat.measures.parse_requirements(["strain_max<=.03"], coneflat.measures.REPORTED)
    cube = coneflat.flatten(*shapes.box(1)).report()
    assert not coneflat.measures.breaches(requirement, cube)
    torus = coneflat.flatten(*shapes.torus()).report()
    assert "strain_max is" in coneflat.measures.breaches(requirement, torus)[0]
