"""Flat disks, laid out all at once."""

from __future__ import annotations

from importlib import import_module

import numpy as np
import pytest
import shapes

import coneflat
from coneflat.errors import CurvatureError
from coneflat.geometry import edge_lengths, signed_double_areas
from coneflat.layout import lay_out_flat_disks

retries = import_module("coneflat.retries")


def laid_out(*parts):
    meshes = [coneflat.check_mesh(*part).mesh for part in parts]
    lengths = [edge_lengths(mesh.vertices, mesh.faces) for mesh in meshes]
    return lay_out_flat_disks(meshes, lengths, [np.zeros(len(mesh.vertices), dtype=bool) for mesh in meshes])


def rolled(columns: int, rows: int, turns: float):
    """Return a sheet rolled up, which is flat."""
    vertices, faces = shapes.grid(columns, rows)
    angle = turns * 2 * np.pi * np.arange(columns + 1) / columns
    steps = np.stack([np.cos(angle), np.sin(angle)], axis=1) / columns
    path = np.cumsum(np.concatenate([[[0, 0]], steps[:-1]]), axis=0)
    at = np.rint(vertices[:, 0] * columns).astype(int)
    return np.column_stack([path[at], vertices[:, 1]]), faces


def spiral(turns: float, count: int = 60):
    """Return a strip in the plane around a centre, which overlaps itself after a turn."""
    angle = turns * 2 * np.pi * np.arange(count + 1) / count
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    vertices, faces = shapes.grid(count, 1)
    at = np.rint(vertices[:, 0] * count).astype(int)
    return np.column_stack([ring[at] * (1 + vertices[:, 1:2]), np.zeros(len(at))]), faces[:, ::-1]


def test_flat_disks_keep_all_lengths():
    sheet, roll, bent = shapes.grid(4, 3), rolled(8, 3, 0.7), shapes.grid(1, 1)
    bent[0][3, 2] = 0.3
    triangle = np.array([[0.0, 0, 0], [1, 0, 0.2], [0.3, 1, 4]]), np.array([[0, 1, 2]])
    for (vertices, faces), layout in zip(
        (sheet, roll, bent, triangle), laid_out(sheet, roll, bent, triangle), strict=True
    ):
        flat = np.pad(layout.points, ((0, 0), (0, 1)))
        np.testing.assert_allclose(
            edge_lengths(flat, layout.corners), edge_lengths(vertices, faces), rtol=1e-12
        )
        assert (signed_double_areas(layout.points[layout.corners]) > 0).all()
        assert np.array_equal(layout.corners, faces)


def test_curved_and_overlapping_components_are_not_laid_out():
    overlapping = spiral(1.4)
    unfit = shapes.hill(4, 4), shapes.annulus(12, 2), shapes.tetrahedron(), overlapping
    assert laid_out(*unfit, shapes.grid(2, 2))[:-1] == [None] * len(unfit)
    assert laid_out(spiral(0.8))[0] is not None


def test_flat_disks_keep_holes_around_which_they_close_up():
    vertices, faces = shapes.grid(9, 9)
    middles = vertices[faces].mean(axis=1)
    frame = vertices, faces[np.abs(middles[:, :2] - 0.5).max(axis=1) > 0.2]
    vertex_indices, corners = np.unique(frame[1], return_inverse=True)
    frame = vertices[vertex_indices] @ shapes.rotation(), corners.reshape(-1, 3)
    flat_frame, tube = laid_out(frame, shapes.cylinder(12, 3))
    assert tube is None
    np.testing.assert_allclose(
        edge_lengths(np.pad(flat_frame.points, ((0, 0), (0, 1))), flat_frame.corners),
        edge_lengths(*frame),
        rtol=1e-9,
    )
    result = coneflat.flatten(*frame, boundary="lengths")
    assert (result.distortion.seam_length, result.notes) == (0, ())


def test_a_flat_disk_that_would_overlap_itself_is_cut():
    result = coneflat.flatten(*spiral(1.4))
    assert (result.distortion.charts, result.distortion.overlapping_pairs) == (2, 0)


def cards(count: int, seed: int = 0):
    """Return leaf cards of two triangles, all different."""
    random = np.random.default_rng(seed)
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.1], [0, 1, 0]])
    places = 3.0 * np.stack([np.arange(count) % 10, np.arange(count) // 10, np.zeros(count)], axis=1)
    vertices = corners * random.uniform(0.2, 2, (count, 1, 3)) + places[:, None]
    faces = np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(count)[:, None, None]
    return vertices.reshape(-1, 3), faces.reshape(-1, 3)


@pytest.mark.parametrize("function", [coneflat.flatten, coneflat.unwrap])
def test_flat_disks_are_laid_out_in_one_call(monkeypatch, function):
    """Thousands of leaf cards take seconds: they are laid out together."""
    for name in ("lay_out_with_thick_triangles", "lay_out_component", "finish_component"):
        monkeypatch.setattr(retries, name, lambda *_: pytest.fail("a stage runs for a flat disk"))
    vertices, faces = cards(50)
    result = function(vertices, faces)
    d = result.distortion
    assert (d.charts, d.qc_max, d.flipped, d.overlapping_pairs) == (50, pytest.approx(1, abs=1e-9), 0, 0)
    flat = np.pad(result.uv, ((0, 0), (0, 1)))
    np.testing.assert_allclose(
        edge_lengths(flat, result.uv_faces) / result.uv_scale, edge_lengths(vertices, faces), rtol=1e-9
    )


def test_requested_cones_or_shapes_are_respected():
    """A flat disk is laid out like others where its boundary is prescribed."""
    vertices, faces = shapes.grid(5, 5)
    disk = coneflat.flatten(vertices, faces, boundary="disk")
    border = disk.uv[
        np.unique(disk.uv_faces[coneflat.check_mesh(vertices, faces).mesh.is_boundary_vertex[faces]])
    ]
    radii = np.linalg.norm(border - border.mean(axis=0), axis=1)
    assert np.ptp(radii) < 0.1 * radii.mean()
    assert coneflat.flatten(vertices, faces, cones=[14]).cones.tolist() == [14]


def test_errors_name_the_only_component_that_is_not_flat():
    """A sphere without cones beside leaf cards."""
    vertices, faces = shapes.join(cards(3), shapes.sphere(1))[:2]
    with pytest.raises(CurvatureError, match=r"^in the component of vertex 12 \(80 triangles\): "):
        coneflat.flatten(vertices, faces, cones="none")
