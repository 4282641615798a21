"""Angle based flattening, linear and to the end, with cones."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from comparisons import compare_methods, flatten_by
from comparisons.abf import angle_conditions, linear_angles, nearest_angles, target_angles

from coneflat import PAPER, errors, flatten
from coneflat.geometry import angle_defect, corner_angles, edge_lengths
from coneflat.mesh.check import check_mesh

ABF_METHODS = ("linear-abf", "abf++")
CLOSED = {
    "sphere": shapes.sphere(2),
    "torus": shapes.torus(20, 10),
    "genus 2": shapes.blocks(["#####", "#.#.#", "#####"], 2),
}
SMALL = [
    shapes.sphere(1),
    shapes.torus(8, 6),
    shapes.blocks(["###", "#.#", "###"], 1),
    shapes.hill(6, 5),
    shapes.annulus(8, 3),
]
OPEN = {"hill": shapes.hill(), "annulus": shapes.annulus(), "cylinder": shapes.cylinder()}


def metric_of(shape):
    """Return a mesh with its angles and its curvature."""
    mesh = check_mesh(*shape).mesh
    angles = corner_angles(edge_lengths(mesh.vertices, mesh.faces))
    return mesh, angles, angle_defect(mesh.faces, angles, mesh.is_boundary_vertex)


def problem(shape, curvature=None):
    """Return conditions and wanted angles on a mesh."""
    mesh, angles, _ = metric_of(shape)
    curvature = np.zeros(len(mesh.vertices)) if curvature is None else curvature
    return angle_conditions(mesh, curvature), target_angles(mesh, angles, curvature)


@pytest.mark.parametrize("shape", SMALL)
def test_angles_of_a_metric_fulfil_the_conditions(shape):
    """The angles of any mesh are those of a flat metric with a cone at every vertex."""
    mesh, angles, curvature = metric_of(shape)
    conditions = angle_conditions(mesh, curvature)
    assert conditions.residual(angles.ravel()) < 1e-12
    # All that is left free are the metrics with this curvature: an edge is a length, of which one is the unit.
    inside = (~mesh.is_boundary_vertex).sum() - (not mesh.is_boundary_vertex.any())
    triangles = np.repeat(np.eye(len(mesh.faces)), 3, axis=1)
    rows = np.vstack([triangles, conditions.slopes(angles.ravel()).toarray()])
    assert np.linalg.matrix_rank(rows) == len(rows) == mesh.faces.size - (len(mesh.edges) - 1 - inside)


def test_linear_angles_are_the_least_norm_solution():
    """As the paper of linear ABF has it, literally: a wheel after the other, and a dense pseudo-inverse."""
    mesh = check_mesh(*shapes.hill(5, 4)).mesh
    conditions, targets = problem(shapes.hill(5, 4))
    rows, right = [], []
    for face in range(len(mesh.faces)):
        rows.append(np.isin(np.arange(mesh.faces.size), 3 * face + np.arange(3)) * 1.0)
        right.append(np.pi - targets[3 * face : 3 * face + 3].sum())
    for vertex in np.flatnonzero(~mesh.is_boundary_vertex):
        around = np.flatnonzero(mesh.faces.ravel() == vertex)
        after, before = (around - around % 3 + (around + step) % 3 for step in (1, 2))
        rows.append(np.isin(np.arange(mesh.faces.size), around) * 1.0)
        right.append(2 * np.pi - targets[around].sum())
        wheel = np.zeros(mesh.faces.size)
        wheel[after] += 1 / np.tan(targets[after])
        wheel[before] -= 1 / np.tan(targets[before])
        rows.append(wheel)
        right.append(np.log(np.sin(targets[before])).sum() - np.log(np.sin(targets[after])).sum())
    relative = np.linalg.pinv(np.array(rows) * targets) @ np.array(right)
    angles, *_ = linear_angles(conditions, targets)
    np.testing.assert_allclose(angles, targets * (1 + relative), atol=1e-10)


def test_nearest_angles_are_a_minimum():
    """The gradient is a sum of the conditions' (Lagrange), and the conditions hold."""
    for shape in (shapes.hill(8, 6), shapes.annulus(12, 4)):
        conditions, targets = problem(shape)
        angles, _, converged = nearest_angles(conditions, targets)
        assert converged
        assert conditions.residual(angles) < 1e-9
        gradient = (angles - targets) / targets**2
        triangles = np.repeat(np.eye(len(targets) // 3), 3, axis=1)
        normals = np.vstack([triangles, conditions.slopes(angles).toarray()]).T
        left = gradient - normals @ np.linalg.lstsq(normals, gradient, rcond=None)[0]
        assert np.abs(left).max() < 1e-4 * np.abs(gradient).max()
        linear, *_ = linear_angles(conditions, targets)
        assert np.abs(linear - angles).max() < 0.2 * np.abs(angles - targets).max()


@pytest.mark.parametrize("method", ABF_METHODS)
@pytest.mark.parametrize("shape", [shapes.grid(9, 5), shapes.box(), shapes.cylinder(), shapes.grid(5, 1)])
def test_developable_meshes_come_back_as_they_are(method, shape):
    d = flatten_by(method, *shape).distortion
    assert d.qc_max < 1 + 1e-9
    assert d.area_std < 1e-9
    assert d.seam_mismatch_max < 1e-9


@pytest.mark.parametrize("shape", (CLOSED | OPEN).values(), ids=CLOSED | OPEN)
def test_abf_has_the_cones_and_seams_that_close(shape):
    """Around handles and holes, too: nothing is cut but what is unfolded."""
    result = flatten_by("abf++", *shape)
    d = result.distortion
    assert d.flipped == 0
    assert d.curvature_error_max < 1e-8
    assert d.seam_mismatch_max < 1e-8
    assert d.seam_motion_mismatch < 1e-7
    assert result.notes == ()
    assert d.qc_mean < flatten(*shape).distortion.qc_mean + 0.01


def test_a_cone_without_room_is_refused():
    cones = {0: -3.5 * np.pi, 5: 1.9 * np.pi, 7: 1.9 * np.pi, 100: 1.9 * np.pi, 200: 1.8 * np.pi}
    for method in ABF_METHODS:
        with pytest.raises(
            errors.CurvatureError,
            match=r"1 cone with angles too large .* 5 of them cannot have an angle of 5.5 pi",
        ):
            flatten_by(method, *shapes.sphere(3), cones=cones)


def test_a_failure_to_converge_is_an_error(monkeypatch):
    monkeypatch.setattr("comparisons.abf.STEPS", 1)
    with pytest.raises(errors.ConvergenceError, match=r"off by .* after 1 step; method 'exact'"):
        flatten_by("abf++", *shapes.sphere(2))


def test_free_cones_are_another_method():
    mesh = shapes.sphere(3)
    free = flatten_by("linear-abf/free", *mesh)
    held = flatten_by("linear-abf", *mesh)
    assert free.distortion.qc_mean < held.distortion.qc_mean - 0.01
    with pytest.raises(errors.OptionError, match="unknown method 'abf/free'"):
        flatten_by("abf/free", *mesh)
    with pytest.raises(errors.OptionError, match=r"unknown method 'abf\+\+'"):
        flatten(*mesh, method="abf++")


def test_they_agree_with_the_exact_metric_on_the_same_cones_and_cut():
    names = ("exact", "linear-abf", "abf++")
    comparison = compare_methods(*shapes.sphere(3), methods=names, atlases=())
    for entry in comparison.entries:
        assert np.array_equal(entry.result.cones, comparison["exact"].result.cones)
        assert "other edges" not in entry.note
    assert np.ptp([comparison[name].result.distortion.qc_mean for name in names]) < 1e-3


def test_scale_motion_and_numbering():
    vertices, faces = shapes.sphere(3)
    renumbered_vertices, renumbered_faces, numbers = shapes.renumber(vertices, faces)
    base = flatten_by("abf++", vertices, faces, cones="greedy")
    for mesh in (
        (vertices * 1e-6, faces),
        (vertices * 1e6, faces),
        (vertices @ shapes.rotation().T, faces),
        (renumbered_vertices, renumbered_faces),
    ):
        result = flatten_by("abf++", *mesh, cones="greedy")
        assert result.distortion.qc_mean == pytest.approx(base.distortion.qc_mean, rel=1e-7)
        assert result.distortion.qc_max == pytest.approx(base.distortion.qc_max, rel=1e-6)
    np.testing.assert_array_equal(result.cones, numbers[base.cones])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "free", "held"), [("fandisk.obj", 1.0070, 1.0116), ("rocker-arm.obj", 1.0259, 1.0279)]
)
def test_the_figures_of_table_2(shared, name, free, held):
    """The paper has 1.007 and 1.027 for linear ABF, which left cones free."""
    comparison = compare_methods(
        shared(name), methods=("linear", "linear-abf/free", "linear-abf"), atlases=(), **PAPER
    )
    assert comparison["linear-abf/free"].result.distortion.qc_mean == pytest.approx(free, abs=0.0002)
    assert comparison["linear-abf"].result.distortion.qc_mean == pytest.approx(held, abs=0.0002)
