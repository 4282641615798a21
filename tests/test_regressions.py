"""Meshes that once broke a promise of the package, stored with the options of the call."""

from __future__ import annotations

import numpy as np
import pytest
from stored_meshes import REGRESSIONS, regression
from trials.outcome import Outcome
from trials.promises import check
from trials.textures import check_xatlas
from trials.written import check_file

import coneflat
from coneflat.geometry.triangulate import triangulate


def outcome_of(name, ending=None, folder=None):
    """Return the outcome of a stored case; its result may also be written to a file."""
    vertices, faces, options = regression(name)
    outcome = Outcome("mesh", 0)
    with outcome.guarded():
        result = coneflat.flatten(vertices, faces, **options)
    check(outcome, result, options, vertices, faces)
    if ending is not None:
        check_written(outcome, result, folder / f"out{ending}")
    return outcome


def check_written(outcome, result, path):
    with outcome.guarded("writing: "):
        result.save(path)
    check_file(outcome, result.as_written(path.suffix), path)


def test_charts_that_touch_themselves_do_not_overlap_in_single_precision():
    vertices, faces, _ = regression("self-touching-charts")
    outcome = Outcome("texture", 0)
    check_xatlas(outcome, vertices, faces, "stored")
    assert outcome.breaches == []


@pytest.mark.parametrize(
    ("name", "ending"),
    [("huge-triangles-tube", None), pytest.param("huge-triangles-crate", ".obj", marks=pytest.mark.slow)],
)
def test_components_keep_their_scale_where_triangles_were_huge(name, ending, tmp_path):
    assert outcome_of(name, ending, tmp_path).breaches == []


@pytest.mark.slow
def test_any_finite_distortion_may_be_allowed():
    assert outcome_of("any-distortion").breaches == []


def test_triangles_that_are_flat_by_rounding_stay_and_are_named(tmp_path):
    outcome = outcome_of("flat-by-rounding", ".npz", tmp_path)
    assert outcome.breaches == []
    assert outcome.noted


def test_components_of_opened_triangles_count_for_the_area_distortion(tmp_path):
    mesh = coneflat.read_mesh(REGRESSIONS / "opened-triangles.stl", weld=False)
    options = {"charts": "atlas", "repair": True, "max_cones": 12}
    outcome = Outcome("file", 0)
    with outcome.guarded():
        result = coneflat.flatten(mesh, **options)
    faces, *_ = triangulate(mesh.vertices, mesh.corners, mesh.offsets)
    check(outcome, result, options, mesh.vertices, np.asarray(faces))
    check_written(outcome, result, tmp_path / "out.ply")
    assert outcome.breaches == []
    assert result.distortion.area_std < 0.2


@pytest.mark.parametrize(
    ("name", "ending"),
    [("uneven-seams-spikes", ".obj"), pytest.param("uneven-seams-hemisphere", None, marks=pytest.mark.slow)],
)
def test_seams_that_a_note_names_are_noted(name, ending, tmp_path):
    outcome = outcome_of(name, ending, tmp_path)
    assert outcome.breaches == []
    assert any("sides of seams differ" in cause for cause in outcome.noted)


@pytest.mark.slow
def test_seams_that_differ_by_more_than_rounding_are_noted():
    """On some processors, by a bit more than the limit: by 1.7e-8."""
    assert outcome_of("uneven-seams-ring").breaches == []
