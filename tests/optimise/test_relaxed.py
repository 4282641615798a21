"""Flattenings that are relaxed: bent triangles by default, all of them on the way from angles to areas."""

from __future__ import annotations

from importlib import import_module

import numpy as np
import pytest
import shapes

from coneflat import errors, flatten
from coneflat.geometry import double_areas, edge_lengths, signed_double_areas

METHOD, STAGE = import_module("coneflat.flattening"), import_module("coneflat.optimise.relaxed_layouts")

SHAPES = {
    "sphere": shapes.sphere(2),
    "genus2": shapes.genus(2),
    "hill": shapes.hill(),
    "box": shapes.box(),
}


def border_lengths(result):
    """UV lengths and lengths on the model of the boundary's edges."""
    faces = result.faces
    pairs = np.stack([faces[:, [1, 2, 0]].ravel(), faces[:, [2, 0, 1]].ravel()], axis=1)
    key = np.sort(pairs, axis=1)
    _, first, count = np.unique(key, axis=0, return_index=True, return_counts=True)
    border = first[count == 1]
    uv = result.corner_uv
    flat = (uv[:, [2, 0, 1]] - uv[:, [1, 2, 0]]).reshape(-1, 2)[border]
    ends = result.vertices[pairs[border]]
    return np.linalg.norm(flat, axis=1), np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)


def test_components_keep_their_areas_relative_to_each_other():
    ball, plate = shapes.sphere(3, bumps=0.0), shapes.grid(8, 6)
    result = flatten(*shapes.join(ball, (plate[0] + [5, 0, 0], plate[1])), stretch=1, distortion=0.5)
    flat = np.abs(signed_double_areas(result.corner_uv))
    areas = double_areas(edge_lengths(result.vertices, result.faces))
    of_ball, of_plate = (
        flat[triangles].sum() / areas[triangles].sum()
        for triangles in np.split(np.arange(len(flat)), [len(ball[1])])
    )
    assert of_ball == pytest.approx(of_plate, rel=1e-6)


@pytest.mark.parametrize("name", SHAPES)
def test_relaxing_never_increases_distortion(name):
    before, after, fully_relaxed = (flatten(*SHAPES[name], relax=relax) for relax in ("off", "auto", "whole"))
    for result in (after, fully_relaxed):
        assert np.array_equal(result.cones, before.cones)
        assert np.allclose(result.curvatures, before.curvatures, atol=1e-9)
        d = result.distortion
        assert d.qc_mean <= before.distortion.qc_mean * (1 + 1e-9)
        assert d.qc_max <= before.distortion.qc_max * (1 + 1e-9)
        assert d.flipped == d.degenerate == d.overlapping_pairs == 0
        assert d.seam_mismatch_max < 1e-9
        assert d.curvature_error_max < 1e-9
        assert result.solve.qc_mean_unrelaxed == pytest.approx(before.distortion.qc_mean)
        assert result.solve.qc_max_unrelaxed == pytest.approx(before.distortion.qc_max)
    assert before.solve.relaxed_vertices == 0
    assert np.isnan(before.solve.qc_mean_unrelaxed)


def test_the_worst_triangle_is_less_distorted():
    before, after = (flatten(*SHAPES["genus2"], relax=relax).distortion for relax in ("off", "auto"))
    assert after.qc_mean < before.qc_mean - 0.001
    assert after.qc_max - 1 < 0.7 * (before.qc_max - 1)


@pytest.mark.parametrize("name", ["sphere", "genus2"])
def test_stretch_trades_angles_for_areas(name):
    results = [flatten(*SHAPES[name], stretch=stretch) for stretch in (0.0, 0.25, 0.5, 1.0)]
    angles = [result.distortion.qc_mean for result in results]
    areas = [result.distortion.area_std for result in results]
    spread = [result.distortion.density_spread for result in results]
    assert np.all(np.diff(angles) > 0)
    assert np.all(np.diff(areas) < 0)
    assert np.all(np.diff(spread) < 0)
    assert areas[-1] < 0.65 * areas[0]
    for result in results:
        d = result.distortion
        assert np.array_equal(result.cones, results[0].cones)
        assert d.flipped == d.degenerate == d.overlapping_pairs == 0
        assert d.seam_mismatch_max < 1e-9
        assert d.curvature_error_max < 1e-9


def test_prescribed_lengths_of_the_boundary_stay():
    result = flatten(*shapes.hill(), boundary="lengths", stretch=1.0)
    flat, model = border_lengths(result)
    assert np.allclose(flat / result.uv_scale, model, rtol=1e-9)


@pytest.mark.parametrize("boundary", ["disk", "straight"])
def test_a_prescribed_boundary_is_not_moved(boundary):
    plain, relaxed = (flatten(*shapes.hill(), boundary=boundary, charts="one", stretch=s) for s in (0, 1))
    assert relaxed.distortion.area_std < plain.distortion.area_std
    assert relaxed.distortion.curvature_error_max < 1e-9
    plain_lengths, relaxed_lengths = border_lengths(plain)[0], border_lengths(relaxed)[0]
    assert np.allclose(
        plain_lengths / plain_lengths.sum(), relaxed_lengths / relaxed_lengths.sum(), rtol=1e-9
    )


def test_marked_seams_keep_equal_sides():
    vertices, faces = shapes.box(6)
    result = flatten(vertices, faces, sharp_angle=0.7, stretch=0.7)
    assert result.distortion.seam_mismatch_max < 1e-9
    assert result.distortion.flipped == 0


def test_weighted_vertices_are_less_distorted():
    vertices, faces = shapes.sphere(3)
    front = vertices[:, 2] > 0.3
    faces_there = front[faces].all(axis=1)

    def spread(weights):
        result = flatten(vertices, faces, cone_count=4, stretch=1.0, weights=weights)
        return result.distortion.log_area_scale[faces_there].std()

    assert spread(np.where(front, 100.0, 1.0)) < 0.8 * spread(None)


def test_results_are_reproducible_and_independent_of_scale():
    vertices, faces = SHAPES["genus2"]
    plain = flatten(vertices, faces, stretch=0.5)
    again = flatten(vertices, faces, stretch=0.5)
    assert np.array_equal(plain.corner_uv, again.corner_uv)
    for scale in (1e-6, 1e6):
        scaled = flatten(scale * vertices @ shapes.rotation(), faces, stretch=0.5)
        assert scaled.distortion.qc_mean == pytest.approx(plain.distortion.qc_mean, rel=1e-6)
        assert scaled.distortion.area_std == pytest.approx(plain.distortion.area_std, rel=1e-5)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"relax": "some"}, "relax"),
        ({"stretch": 1.5}, "from 0 to 1, got 1.5"),
        ({"stretch": float("nan")}, "stretch"),
        ({"stretch": 0.5, "method": "linear"}, "does not relax"),
        ({"relax": "whole", "method": "linear", "cones": "none"}, "does not relax"),
    ],
)
def test_invalid_options_are_refused(options, words):
    with pytest.raises(errors.OptionError, match=words):
        flatten(*shapes.hill(), **options)


def test_a_layout_with_unequal_seams_is_returned_unchanged(monkeypatch):
    def refuse(*arguments, **options):
        raise errors.SeamError("the sides of 3 of 4 seam edges are not copies of each other")

    monkeypatch.setattr(STAGE, "relax", refuse)
    result = flatten(*shapes.sphere(2), stretch=0.5)
    assert any("Not relaxed" in note for note in result.notes)


def of_many_sizes():
    """Small components with bent triangles, and one that is large; and them all in one file."""
    meshes = [
        (shapes.sphere(1, seed=1), 1.0),
        (shapes.torus(8, 5, 0.4), 1e-3),
        (shapes.grid(8, 5, lambda x, y: 0.6 * np.exp(-12 * ((x - 0.4) ** 2 + (y - 0.6) ** 2))), 200.0),
        (shapes.genus(2), 5.0),
        (shapes.sphere(1, seed=2), 0.02),
    ]
    pieces = [(size * np.asarray(vertices) * (1.0, 1.2, 0.9), faces) for (vertices, faces), size in meshes]
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in pieces)])
    faces = [piece_faces + start for (_, piece_faces), start in zip(pieces, starts, strict=False)]
    return pieces, np.concatenate([vertices for vertices, _ in pieces]), np.concatenate(faces)


def side_lengths(result):
    corners = result.corner_uv
    return np.linalg.norm(corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]], axis=2) / result.uv_scale


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"stretch": 0.5}])
def test_small_components_relaxed_together_equal_those_relaxed_separately(options, monkeypatch):
    pieces, vertices, faces = of_many_sizes()
    sizes, relax_layouts = [], METHOD.relax_layouts
    monkeypatch.setattr(
        METHOD,
        "relax_layouts",
        lambda *arguments: sizes.append(len(arguments[0])) or relax_layouts(*arguments),
    )
    result = flatten(vertices, faces, **options)
    assert sizes[:2] == [4, 1]  # further ones are those of other cones
    assert result.distortion.flipped == 0
    results_alone = [flatten(*piece, **options) for piece in pieces]
    # Newton's method ends where little is left to gain, which does not say where to the last digits.
    start, scales, sides = 0, [], side_lengths(result)
    for piece, separate in zip(pieces, results_alone, strict=True):
        piece_sides = sides[start : start + len(piece[1])]
        assert np.allclose(piece_sides, side_lengths(separate), rtol=1e-6)
        start += len(piece_sides)
        scales.append(separate.log_scale)
    assert np.allclose(result.log_scale, np.concatenate(scales), atol=1e-6)
    assert result.solve.relaxed_vertices == sum(separate.solve.relaxed_vertices for separate in results_alone)
    worst = [separate.solve.qc_max_unrelaxed for separate in results_alone]
    assert result.solve.qc_max_unrelaxed == pytest.approx(max(worst), rel=1e-9)


def test_if_components_cannot_be_relaxed_together_they_are_relaxed_separately(monkeypatch):
    _, vertices, faces = of_many_sizes()
    relax, components = STAGE.relax, []

    def refuse(mesh, *arguments, **options):
        components.append(mesh.components[0])
        if mesh.components[0] > 1:
            raise errors.SeamError("the sides of 3 of 4 seam edges are not copies of each other")
        return relax(mesh, *arguments, **options)

    undisturbed = flatten(vertices, faces)
    monkeypatch.setattr(STAGE, "relax", refuse)
    result = flatten(vertices, faces)
    assert sorted(components, reverse=True)[:2] == [4, 1]
    assert np.allclose(side_lengths(result), side_lengths(undisturbed), rtol=1e-6)
    assert result.distortion.qc_max == pytest.approx(undisturbed.distortion.qc_max, rel=1e-6)


def test_progress_of_grouped_components_never_decreases():
    _, vertices, faces = of_many_sizes()
    fractions = []
    flatten(vertices, faces, progress=lambda stage, done: fractions.append(done))
    assert fractions == sorted(fractions)
    assert 0.9 < fractions[-1] <= 1
