"""Exact flattenings: what is prescribed is there in the layout itself, to rounding."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from stored_meshes import at_hand

from coneflat import TriangleMesh, errors, flatten, read_mesh
from coneflat.geometry.triangles import edge_lengths
from coneflat.metric.boundary import BoundaryCurvature

SHAPES = {
    "sphere": shapes.sphere(2),
    "disk": shapes.hill(),
    "annulus": shapes.annulus(),
    "genus 2": shapes.genus(2),
}


def turned_angles(result):
    """Return the sum of the layout's angles at each vertex."""
    z = result.corner_uv @ [1, 1j]
    angles = np.stack([np.angle((z[:, k - 1] - z[:, k]) / (z[:, k - 2] - z[:, k])) for k in range(3)], axis=1)
    return np.bincount(result.faces.ravel(), angles.ravel(), minlength=len(result.vertices))


def boundary_loop(vertices, faces):
    """Return the vertices of a disk's boundary in order."""
    mesh = TriangleMesh(vertices, faces)
    start = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
    after = dict(zip(mesh.tails[start].tolist(), mesh.heads[start].tolist(), strict=True))
    loop = [min(after)]
    while (v := after[loop[-1]]) != loop[0]:
        loop.append(v)
    return np.array(loop)


@pytest.mark.parametrize("name", ["sphere", "annulus", "genus 2"])
@pytest.mark.parametrize("prescribed", ["scale", "curvature"])
def test_angle_sums_of_the_layout_are_flat_except_at_cones(name, prescribed):
    vertices, faces = SHAPES[name]
    greedy = {"cones": "greedy"}
    if prescribed == "curvature":
        linear = flatten(vertices, faces, method="linear", charts="one", **greedy)
        greedy = {
            "cones": dict(zip(linear.cones.tolist(), linear.curvatures.tolist(), strict=True)) or "none"
        }
    result = flatten(vertices, faces, charts="one", relax="off", **greedy)
    d = result.distortion
    assert d.flipped == d.degenerate == 0
    assert d.curvature_error_max < 1e-10
    assert d.seam_mismatch_max < 1e-9
    assert d.seam_motion_mismatch < 1e-7
    inside = ~TriangleMesh(vertices, faces).is_boundary_vertex
    expected = np.full(len(vertices), 2 * np.pi)
    expected[result.cones] -= result.curvatures
    np.testing.assert_allclose(turned_angles(result)[inside], expected[inside], atol=1e-8)
    if prescribed == "scale" and len(result.cones):
        np.testing.assert_allclose(np.ptp(result.log_scale[result.cones]), 0, atol=1e-12)


def test_rectangle_from_four_corners():
    vertices, faces = SHAPES["disk"]
    loop = boundary_loop(vertices, faces)
    corners = loop[np.isin(loop, [0, 20, 504, 524])]
    result = flatten(vertices, faces, cones="none", boundary=corners)
    angles = turned_angles(result)
    np.testing.assert_allclose(angles[corners], np.pi / 2, atol=1e-9)
    np.testing.assert_allclose(angles[np.setdiff1d(loop, corners)], np.pi, atol=1e-9)
    # So it fills its bounding box once it stands straight.
    at = np.empty((len(vertices), 2))
    at[result.faces] = result.corner_uv
    sides = np.linalg.norm(np.diff(at[[*corners, corners[0]]], axis=0), axis=1)
    np.testing.assert_allclose(sides[:2], sides[2:], rtol=1e-8)
    second_corner, third_corner = (result.corner_uv[:, k] - result.corner_uv[:, 0] for k in (1, 2))
    area = np.sum(second_corner[:, 0] * third_corner[:, 1] - second_corner[:, 1] * third_corner[:, 0]) / 2
    assert area == pytest.approx(sides[0] * sides[1], rel=1e-8)


def test_polygon_with_prescribed_angles():
    vertices, faces = SHAPES["disk"]
    corners = boundary_loop(vertices, faces)[[0, 30, 60]].tolist()
    curvatures = [np.pi / 2, 0.7 * np.pi, 0.8 * np.pi]
    result = flatten(vertices, faces, cones="none", boundary=dict(zip(corners, curvatures, strict=True)))
    np.testing.assert_allclose(turned_angles(result)[corners], np.pi - np.array(curvatures), atol=1e-9)


def test_disk_is_round():
    vertices, faces = SHAPES["disk"]
    result = flatten(vertices, faces, cones="none", boundary="disk")
    at = np.empty((len(vertices), 2))
    at[result.faces] = result.corner_uv
    rim = at[boundary_loop(vertices, faces)]
    middle, spread = rim.mean(axis=0), np.ptp(rim, axis=0).max()
    # Three points of the circle through them all: fit centre and radius.
    solution = np.linalg.lstsq(np.c_[2 * rim, np.ones(len(rim))], (rim**2).sum(axis=1), rcond=None)[0]
    radii = np.linalg.norm(rim - solution[:2], axis=1)
    assert np.ptp(radii) < 0.01 * spread
    assert np.linalg.norm(middle - solution[:2]) < spread


def test_annulus_with_prescribed_boundary_has_round_loops():
    vertices, faces = SHAPES["annulus"]
    result = flatten(vertices, faces, cones="none", boundary="disk")
    mesh = TriangleMesh(vertices, faces)
    loop = mesh.boundary_loops[1]
    turning = np.where(mesh.is_boundary_vertex, np.pi - turned_angles(result), 0)
    totals = sorted(turning[loop == k].sum() / np.pi for k in (0, 1))
    np.testing.assert_allclose(totals, [-2, 2], atol=1e-9)


def test_the_curvature_of_round_loops_does_not_depend_on_the_scale():
    """Steps of a solver that diverges scale by factors that are no numbers."""
    vertices, faces = SHAPES["annulus"]
    mesh, log_scale = TriangleMesh(vertices, faces), 0.1 * vertices[:, 0]
    boundary = BoundaryCurvature(mesh, np.zeros(len(vertices)), np.array([2 * np.pi, -2 * np.pi]))
    lengths = edge_lengths(vertices, faces)
    expected = boundary.target(lengths, log_scale)
    np.testing.assert_allclose(boundary.target(lengths, log_scale + 2000), expected, rtol=1e-9)
    assert len(np.unique(np.round(expected, 9))) > 3


@pytest.mark.parametrize(
    ("options", "kind", "message"),
    [
        ({"boundary": "square"}, errors.OptionError, "unknown boundary 'square'"),
        ({"boundary": []}, errors.OptionError, "at least one corner"),
        ({"boundary": [0, 1, 40]}, errors.OptionError, "corner 40 does not lie on the boundary"),
        ({"boundary": [0, 1]}, errors.CurvatureError, "corner 0 would have a curvature of 1 pi"),
        ({"boundary": {0: 3.0, 1: 3.0}}, errors.CurvatureError, r"must sum to 2 pi, but sum to 1\.90986 pi"),
        ({"boundary": "disk", "method": "linear"}, errors.OptionError, "has a free boundary"),
    ],
)
def test_invalid_options_are_errors(options, kind, message):
    vertices, faces = SHAPES["disk"]
    with pytest.raises(kind, match=message):
        flatten(vertices, faces, **{"cones": "none", **options})


def test_unconverged_metric_is_refused(monkeypatch):
    from coneflat.metric import solve as method

    exact = method.exact_metric
    monkeypatch.setattr(
        method,
        "exact_metric",
        lambda *args, **options: exact(*args, **{**options, "tolerance": 1e-30, "max_steps": 1}),
    )
    with pytest.raises(errors.ConvergenceError, match="did not converge: after .* vertex .* is off by"):
        flatten(*SHAPES["sphere"])


@pytest.mark.parametrize("name", ["rocker-arm.obj", "spot.obj", *at_hand("3holes.off", "knight.off")])
def test_real_models_flatten_exactly(shared, name):
    result = flatten(read_mesh(shared(name)))
    d = result.distortion
    assert d.curvature_error_max * np.pi <= 1e-9
    assert d.seam_mismatch_max <= 1e-9
    assert d.flipped == 0
    assert d.degenerate == 0
    untouched = turned_angles(result)
    # Untangling moves vertices, and the angles around them, but never the sum of the angles at one.
    face_vertices = np.unique(result.faces)
    inside = face_vertices[~TriangleMesh(result.vertices, result.faces).is_boundary_vertex[face_vertices]]
    expected = np.full(len(result.vertices), 2 * np.pi)
    expected[result.cones] -= result.curvatures
    np.testing.assert_allclose(untouched[inside], expected[inside], atol=1e-6)


def test_components_without_a_corner_have_a_free_boundary():
    vertices, faces = shapes.hill()
    two_hills = np.concatenate([vertices, vertices + 9]), np.concatenate([faces, faces + len(vertices)])
    on_boundary = np.flatnonzero(TriangleMesh(vertices, faces).is_boundary_vertex)
    corners = on_boundary[:: len(on_boundary) // 4][:4]
    result = flatten(*two_hills, boundary=corners, charts="one")
    free = flatten(vertices, faces, charts="one")
    in_second = result.vertex_origin >= len(vertices)
    np.testing.assert_allclose(
        result.curvatures[np.isin(result.cones, np.flatnonzero(in_second))], free.curvatures
    )
    np.testing.assert_allclose(
        result.distortion.qc[result.faces[:, 0] >= len(vertices)], free.distortion.qc, rtol=1e-6
    )
    assert np.isnan(
        result.prescribed[in_second & np.isin(result.vertex_origin - len(vertices), on_boundary)]
    ).all()
