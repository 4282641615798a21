"""The paper's numbers, on the two of its models that are at hand, and the real models in linear mode."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat import PAPER, flatten, read_mesh


def test_fandisk_as_in_tables_1_and_2(shared):
    d = flatten(shared("fandisk.obj"), **PAPER).distortion
    assert d.curvature_error == pytest.approx(4.6e-6, rel=0.05)
    assert d.qc_mean == pytest.approx(1.012, abs=0.001)


def test_rocker_arm_as_in_tables_1_and_2(shared):
    d = flatten(shared("rocker-arm.obj"), **PAPER).distortion
    assert 1.2e-5 <= d.curvature_error <= 1.4e-5
    assert d.qc_mean == pytest.approx(1.028, abs=0.001)


@pytest.mark.parametrize("name", ["fandisk.obj", "rocker-arm.obj", "spot.obj"])
def test_scale_motion_and_numbering(shared, name):
    model = read_mesh(shared(name))
    vertices, faces = model.vertices, model.corners.reshape(-1, 3)
    base = flatten(vertices, faces, **PAPER)
    new_vertices, new_faces, new = shapes.renumber(vertices, faces)
    for other, cones in [
        (flatten(vertices * 1e-6, faces, **PAPER), base.cones),
        (flatten(vertices * 1e6, faces, **PAPER), base.cones),
        (flatten(vertices @ shapes.rotation().T, faces, **PAPER), base.cones),
        (flatten(new_vertices, new_faces, **PAPER), new[base.cones]),
    ]:
        np.testing.assert_array_equal(other.cones, cones)
        for measure in ("curvature_error", "qc_mean", "qc_p95", "qc_max", "area_std", "seam_length"):
            expected = getattr(base.distortion, measure)
            assert getattr(other.distortion, measure) == pytest.approx(expected, rel=1e-6), measure


CLEAN = ["fandisk.obj", "rocker-arm.obj", "hand.obj", "bunny.obj", "elephant.obj", "spot.obj", "3holes.off"]
OTHERS = ["camelhead.off", "horse.ply", "stanford-bunny.obj", "kitten.obj", "face.obj", "human.obj",
          "knight.off", "plane-holes.obj"]  # fmt: skip


@pytest.mark.parametrize("name", CLEAN + OTHERS)
def test_real_models_come_through(shared, name):
    result = flatten(shared(name), **PAPER)
    assert np.isfinite(result.uv).all()
    assert result.distortion.charts == (3 if name == "human.obj" else 1)
    if name in CLEAN:
        assert result.distortion.flipped == 0
