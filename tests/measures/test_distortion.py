from __future__ import annotations

import re

import numpy as np
import pytest
import shapes
from measure_list import measure_list

from coneflat import TriangleMesh, errors, measure
from coneflat.geometry import edge_lengths
from coneflat.measures.report import MEASURES

VERTICES, FACES = shapes.grid(6, 4)
MESH = TriangleMesh(VERTICES, FACES)
FLAT = VERTICES[FACES][..., :2]


def test_identity():
    d = measure(MESH, FLAT)
    assert d.qc_mean == pytest.approx(1)
    assert d.qc_max == pytest.approx(1)
    assert (d.flipped, d.degenerate, d.charts, d.mirrored_charts, d.seam_length) == (0, 0, 1, 0, 0)
    assert d.area_std == pytest.approx(0, abs=1e-12)


def test_stretch_and_shear():
    assert measure(MESH, FLAT * [2, 1]).qc_mean == pytest.approx(2)
    golden = (1 + 5**0.5) / 2
    assert measure(MESH, FLAT @ [[1, 0], [1, 1]]).qc_mean == pytest.approx(golden**2)


def test_area_distortion_of_two_scales():
    left = FACES.size // 3 // 2
    uv = FLAT.copy()
    areas = np.full(len(FACES), 1.0)
    uv[:left] *= np.e
    d = measure(MESH, uv)
    spread = np.where(np.arange(len(FACES)) < left, 1.0, 0.0)
    assert d.area_std == pytest.approx(np.sqrt(np.average((spread - spread.mean()) ** 2, weights=areas)))


def test_flipped_degenerate_and_mirrored():
    uv = FLAT.copy()
    uv[3] = uv[3][[0, 2, 1]]
    uv[5] = uv[5, :1]
    d = measure(MESH, uv)
    assert d.degenerate == 1
    assert d.charts == 4  # the turned triangle and the collapsed one, and what the latter cut off
    assert d.mirrored_charts == 1
    uv = FLAT.copy()
    uv[FACES == FACES[10, 0]] += [0.4, 0.0]  # a vertex pulled over its neighbours
    assert measure(MESH, uv).flipped > 0


def test_seams_are_where_uvs_differ():
    uv = FLAT.copy()
    right = VERTICES[FACES].mean(axis=1)[:, 0] > 0.5
    uv[right] = uv[right] * 0.5 + [3, 0]
    d = measure(MESH, uv)
    assert d.charts == 2
    assert d.seam_length == pytest.approx(1)
    assert d.seam_mismatch == d.seam_mismatch_max == pytest.approx(0.5 / 0.75)


@pytest.mark.parametrize("points", [VERTICES, VERTICES @ [[2, 0, 1], [0, 0.5, 0], [0, 0, 1]]])
def test_a_metric_given_by_its_lengths(points):
    """It is measured as the surface that has these lengths, wherever the vertices are."""
    uv = FLAT.copy()
    right = VERTICES[FACES].mean(axis=1)[:, 0] > 0.5
    uv[right] = uv[right] * 0.5 + [3, 0]
    lengths = edge_lengths(points, FACES)
    measured, expected = measure(MESH, uv, lengths=lengths), measure(TriangleMesh(points, FACES), uv)
    for name in (
        "qc",
        "log_area_scale",
        "qc_mean",
        "area_std",
        "seam_length",
        "seam_mismatch",
        "flipped",
        "charts",
    ):
        assert getattr(measured, name) == pytest.approx(getattr(expected, name), rel=1e-12, abs=1e-12)
    with pytest.raises(errors.LengthError, match="not positive: 2"):
        measure(MESH, uv, lengths=np.where(np.arange(len(FACES))[:, None] == 2, -1, lengths))


def test_every_measure_is_documented():
    listed = re.findall(r"`(\w+)`[,:]", measure_list())
    assert sorted(listed) == sorted(MEASURES)
