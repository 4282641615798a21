"""The relative change of the lengths of edges."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

import coneflat
from coneflat import TriangleMesh, measure
from coneflat.measures import largest_of_sides, strain_of

VERTICES, FACES = shapes.grid(6, 4)
MESH = TriangleMesh(VERTICES, FACES)
FLAT = VERTICES[FACES][..., :2]


def strain(mesh, corner_uv):
    chosen, inner = np.ones(len(mesh.faces), dtype=bool), np.zeros(mesh.faces.size, dtype=bool)
    return strain_of(mesh.vertices, mesh.faces, corner_uv, chosen, inner)


def by_definition(result):
    """The largest and the mean change of length of the edges of the charts, at the best of many scales."""
    lengths = {}
    for corners, points in zip(result.faces.tolist(), result.uv_faces.tolist(), strict=True):
        for i in range(3):
            (v, w), (p, q) = (sorted((ends[i], ends[i - 1])) for ends in (corners, points))
            length = np.linalg.norm(result.vertices[v] - result.vertices[w])
            lengths[p, q] = length, np.linalg.norm(result.uv[p] - result.uv[q])
    on_model, in_plane = np.array(list(lengths.values())).T
    ratios = in_plane / on_model
    scales = 1 / np.linspace(ratios.min(), ratios.max(), 20001)
    best = scales[np.argmin([np.abs(scale * ratios - 1).max() for scale in scales])]
    strains = np.abs(best * ratios - 1)
    return strains.max(), np.average(strains, weights=on_model)


@pytest.mark.parametrize("shape", [shapes.torus, lambda: shapes.hill(10, 8)])
def test_it_is_that_of_the_definition(shape):
    result = coneflat.flatten(*shape(), distortion=0.2)
    largest, mean = by_definition(result)
    assert result.distortion.strain_max == pytest.approx(largest, abs=1e-3)
    assert result.distortion.strain_mean == pytest.approx(mean, abs=1e-3)
    assert result.report()["strain_max"] == result.distortion.strain_max


def test_a_stretched_grid():
    """Lengths 2 and 1 are best scaled to 4/3 and 2/3."""
    d = measure(MESH, FLAT * [2, 1])
    assert d.strain_max == pytest.approx(1 / 3)
    sides = strain(MESH, FLAT * [2, 1]).sides
    assert np.abs(largest_of_sides(sides)) == pytest.approx(np.full(len(FACES), 1 / 3))
    assert np.nanmin(sides) == pytest.approx(-1 / 3)


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


def test_sides_without_length_are_left_out():
    sides = np.array([[np.nan, 0.1, -0.2], [np.nan, np.nan, np.nan]])
    assert largest_of_sides(sides) == pytest.approx([-0.2, np.nan], nan_ok=True)
    collapsed = MESH.moved_to(0 * VERTICES)
    assert np.isnan(strain(collapsed, FLAT).largest)


def test_a_requirement_takes_it():
    requirement = coneflat.measures.parse_requirements(["strain_max<=.03"], coneflat.measures.REPORTED)
    cube = coneflat.flatten(*shapes.box(1)).report()
    assert not coneflat.measures.breaches(requirement, cube)
    torus = coneflat.flatten(*shapes.torus()).report()
    assert "strain_max is" in coneflat.measures.breaches(requirement, torus)[0]
