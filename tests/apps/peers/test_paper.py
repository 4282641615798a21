"""The paper's numbers, on the two of its models that are at hand, and the real models in linear mode."""

from __future__ import annotations

import pytest

from coneflat import PAPER, flatten


def test_fandisk_as_in_tables_1_and_2(shared):
    d = flatten(shared("fandisk.obj"), **PAPER).distortion
    assert d.curvature_error == pytest.approx(4.6e-6, rel=0.05)
    assert d.qc_mean == pytest.approx(1.012, abs=0.001)


def test_rocker_arm_as_in_tables_1_and_2(shared):
    d = flatten(shared("rocker-arm.obj"), **PAPER).distortion
    assert 1.2e-5 <= d.curvature_error <= 1.4e-5
    assert d.qc_mean == pytest.approx(1.028, abs=0.001)
