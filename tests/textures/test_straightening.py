"""Straight sides of charts: along the axes on hard surfaces, rectangles of strips, and no change of free forms."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from scipy.spatial import ConvexHull
from stored_meshes import find_model

import coneflat
from coneflat import unwrap
from coneflat.geometry import edge_lengths
from coneflat.textures import further_cuts

# Directions and distances of exactly straight sides, relative.
EXACT = 1e-9


def chamfered_box(sides=(3.0, 2.0, 1.0), chamfer=0.15, subdivisions=3):
    """Return a box whose edges and corners are cut off."""
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).T.reshape(-1, 3)
    inner = np.array(sides) / 2 - chamfer
    vertices = np.concatenate([signs * (inner + chamfer * np.eye(3)[axis]) for axis in range(3)])
    faces = _hull(vertices)
    for _ in range(subdivisions):
        vertices, faces = shapes.subdivide(vertices, faces)
    return vertices, faces


def _hull(vertices):
    faces = ConvexHull(vertices).simplices.astype(np.int64)
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (normals * corners.mean(axis=1)).sum(axis=1) < 0
    faces[inward] = faces[inward, ::-1]
    return faces


def strip(rise=0.06, width=0.5, columns=60, rows=6):
    """Return a bent strip of a cone, whose layout is a part of an annulus."""
    at = np.stack(np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, width, rows + 1)), axis=-1)
    angle, along = 1.2 * np.pi * at[..., 0].T.ravel(), at[..., 1].T.ravel()
    radius = 2 + rise * along
    vertices = np.stack([radius * np.cos(angle), radius * np.sin(angle), along], axis=1)
    return vertices, shapes.grid(columns, rows)[1]


def border_sides(result):
    """Return (b, 2) the vectors of the border edges of charts."""
    ends = np.sort(result.uv_faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, count = np.unique(ends, axis=0, return_counts=True)
    return np.diff(result.uv[edges[count == 1]], axis=1)[:, 0]


def share_along_axes(result, tolerance=EXACT):
    """Return the fraction of the length of the borders that is along the axes."""
    vectors = border_sides(result)
    lengths = np.linalg.norm(vectors, axis=1)
    return lengths[np.abs(vectors).min(axis=1) <= tolerance * lengths].sum() / lengths.sum()


def corner_points(result):
    """Return the four corners of the bounding box of the UVs."""
    low, high = result.uv.min(axis=0), result.uv.max(axis=0)
    return np.array([[x, y] for x in (low[0], high[0]) for y in (low[1], high[1])])


def assert_sound(result, bound=4.1):
    d = result.distortion
    assert (d.flipped, d.degenerate, d.overlapping_pairs) == (0, 0, 0)
    assert d.energy <= bound


@pytest.mark.parametrize("seed", [None, 0, 1])
def test_sides_of_a_chamfered_box_are_along_the_axes(seed):
    vertices, faces = chamfered_box()
    result = unwrap(vertices if seed is None else vertices @ shapes.rotation(seed).T, faces)
    assert share_along_axes(result) > 0.6
    assert_sound(result)


@pytest.mark.parametrize("seed", [None, 0, 1])
def test_a_bent_strip_becomes_a_rectangle(seed):
    vertices, faces = strip()
    result = unwrap(vertices if seed is None else vertices @ shapes.rotation(seed).T, faces)
    assert share_along_axes(result) == pytest.approx(1, abs=1e-12)
    for corner in corner_points(result):
        assert np.abs(result.uv - corner).max(axis=1).min() < EXACT
    assert_sound(result, 4.01)


def test_rectangles_do_not_depend_on_the_numbering():
    vertices, faces = strip()
    result, renumbered = unwrap(vertices, faces), unwrap(*shapes.renumber(vertices, faces)[:2])
    assert share_along_axes(renumbered) == pytest.approx(1, abs=1e-12)
    assert renumbered.distortion.energy == pytest.approx(result.distortion.energy, rel=1e-9)
    np.testing.assert_allclose(np.ptp(renumbered.uv, axis=0), np.ptp(result.uv, axis=0), rtol=1e-6)


def test_a_strip_that_bends_too_much_for_a_rectangle_keeps_its_shape():
    result = unwrap(*strip(rise=1.0, width=2.0))
    assert share_along_axes(result) < 0.5
    assert result.distortion.energy < 4 + 1e-6
    assert_sound(result)


def test_straight_sides_do_not_depend_on_the_scale():
    vertices, faces = strip()
    result, larger = unwrap(vertices, faces), unwrap(2.0**40 * vertices, faces)
    np.testing.assert_allclose(larger.uv, result.uv, atol=1e-9)


def test_a_tighter_bound_is_kept():
    result = unwrap(*chamfered_box(), max_energy=4.05)
    assert_sound(result, 4.05)


@pytest.mark.parametrize("arch", [0.01, 0.03, 0.3])
def test_curved_sides_of_a_flat_sheet_stay_curved(arch):
    vertices, faces = shapes.grid(40, 8)
    x, y = (values - values.min() for values in vertices.T[:2])
    arched = np.stack([x, y + arch * 4 * x * (x.max() - x) / x.max() ** 2, np.zeros_like(x)], axis=1)
    flat = unwrap(arched, faces)
    assert share_along_axes(flat, 1e-6) < 0.6
    assert flat.distortion.energy == pytest.approx(4, abs=1e-9)


@pytest.mark.parametrize("taper", [0.02, 0.05, 0.1])
def test_flat_faces_that_taper_are_not_stretched_into_rectangles(taper):
    """A draft angle of a part is not lost in its texture."""
    vertices, faces = shapes.box(6, (1.0, 1.0, 2.0))
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    middle, height = (low + high) / 2, (vertices[:, 2:] - low[2]) / (high - low)[2]
    tapered = np.array(vertices, dtype=float)
    tapered[:, :2] = middle[:2] + (tapered[:, :2] - middle[:2]) * (1 - taper * height)
    result = unwrap(tapered, faces)
    lengths = edge_lengths(tapered, result.faces)
    flat_lengths = edge_lengths(np.pad(result.uv, ((0, 0), (0, 1))), result.uv_faces) / result.uv_scale
    np.testing.assert_allclose(flat_lengths, lengths, rtol=0.025)


def test_free_forms_keep_their_layouts(monkeypatch):
    meshes = [shapes.sphere(3), shapes.torus(), shapes.hill()]
    results = [unwrap(*mesh) for mesh in meshes]
    monkeypatch.setattr(further_cuts, "straightened", lambda model, candidate: candidate)
    for mesh, result in zip(meshes, results, strict=True):
        np.testing.assert_array_equal(result.uv, unwrap(*mesh).uv)


@pytest.mark.parametrize("name", ["fandisk.obj", "rocker-arm.obj"])
def test_a_machined_part_stays_within_its_bound(name, tmp_path):
    assert_sound(unwrap(find_model(name, tmp_path)))


def test_charts_that_may_overlap_have_straight_sides_too():
    result = unwrap(*chamfered_box(), charts="one")
    assert result.distortion.flipped == 0
    assert result.distortion.energy <= 4.1


def test_written_sides_are_straight(tmp_path):
    result = unwrap(*strip())
    result.save(tmp_path / "strip.obj")
    stored = coneflat.measure_uv(tmp_path / "strip.obj")
    assert stored.distortion.flipped == 0
    assert share_along_axes(result.as_written(".obj"), 1e-3) == pytest.approx(1, abs=1e-9)
