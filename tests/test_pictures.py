"""Each picture of a flattening: what stands at which place, in pixels and in polygons."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import shapes
from drawing import (
    BLACK,
    RED,
    SVG,
    axes_of,
    count_dots,
    darkest_at,
    enclosed,
    groups,
    pixels,
    polygons,
    shown_at,
)

import coneflat

pytest.importorskip("matplotlib")

from coneflat.view import quantity
from coneflat.view.figures import cone_marks as marks
from coneflat.view.figures import uv_layout as layout


@pytest.fixture(scope="module")
def result():
    return coneflat.flatten(*shapes.sphere(3), charts="atlas")


class TestLayout:
    @pytest.mark.parametrize("pieces", [1, 2])
    def test_charts_are_polygons_of_the_right_area(self, tmp_path, pieces):
        vertices, faces = shapes.annulus()
        if pieces == 2:
            other, more = shapes.sphere(2)
            vertices, faces = shapes.join((vertices, faces), (other + 5, more))
        result = coneflat.flatten(vertices, faces, charts="atlas")
        path = coneflat.save_figure(coneflat.make_figure(result, "layout"), tmp_path / "layout.svg")
        found = groups(path)
        charts = [found[name] for name in found if name and name.startswith("chart-")]
        assert len(charts) == result.distortion.charts >= pieces
        one, two = (result.corner_uv[:, k] - result.corner_uv[:, 0] for k in (1, 2))
        area = np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]).sum() / 2
        drawn = sum(abs(sum(enclosed(curve) for curve in polygons(chart))) for chart in charts)
        # The frame around is the unit square, with 2 in 104 of the width on either side.
        side = (4.5 - 2 * 0.0) * 72 / 1.04
        assert drawn / side**2 == pytest.approx(area, rel=1e-4)
        mesh = coneflat.TriangleMesh(result.uv, result.uv_faces)
        lines = "".join(part.get("d") for part in found["edges"].iter(f"{SVG}path"))
        assert lines.count("M") == np.count_nonzero(~mesh.is_boundary_edge)
        assert count_dots(found.get("cones")) == len(layout.layout_cones(result)[0])

    def test_a_chart_with_a_hole_has_a_hole(self):
        vertices, faces = shapes.annulus()
        flat = vertices * [1, 1, 0]
        result = shapes.tube()
        result.uv = (flat[:, :2] - flat[:, :2].min(axis=0)) / np.ptp(flat[:, :2], axis=0).max()
        result.vertices, result.faces, result.uv_faces = flat, faces, faces
        result.cones, result.curvatures = np.empty(0, dtype=int), np.empty(0)
        axes = axes_of()
        coneflat.draw_layout(result, axes, edges=False)
        ring = result.uv[faces].mean(axis=1)
        np.testing.assert_array_equal(shown_at(axes, [ring.mean(axis=0)]), [[255, 255, 255]])
        colors = shown_at(axes, ring[40:120])
        assert (np.abs(colors - [227, 233, 241]).max(axis=1) <= 1).mean() > 0.9
        paths = layout.chart_paths(result.uv, faces)
        assert len(paths) == 1
        assert len(layout.outline_loops(result.uv, faces)) == 2

    def test_curves_that_touch_in_a_point_are_closed_each(self):
        uv = np.array([[0, 0], [1, 0], [0, 1], [-1, 0], [0, -1]], dtype=float)
        loops = layout.outline_loops(uv, np.array([[0, 1, 2], [0, 3, 4]]))
        sides = sorted(side for loop in loops for side in zip(loop, [*loop[1:], loop[0]], strict=True))
        assert sides == [(0, 1), (0, 3), (1, 2), (2, 0), (3, 4), (4, 0)]

    def test_colours_of_charts_differ(self):
        vertices, faces = shapes.join(shapes.hill(), (shapes.hill()[0] + 3, shapes.hill()[1]))
        result = coneflat.flatten(vertices, faces, cones="none")
        middle = result.corner_uv.mean(axis=1)
        half = len(faces) // 2
        for colored in (False, True):
            axes = axes_of()
            coneflat.draw_layout(result, axes, color_charts=colored, edges=False)
            one, other = shown_at(axes, [middle[200], middle[half + 200]])
            assert (np.abs(one - other).max() > 10) == colored

    def test_edges_are_left_out_where_they_would_turn_it_grey(self, result, monkeypatch):
        monkeypatch.setattr(layout, "MOST_EDGES_DRAWN", len(result.faces) - 1)
        axes = axes_of()
        coneflat.draw_layout(result, axes)
        assert "edges" not in [artist.get_gid() for artist in axes.collections]
        monkeypatch.setattr(layout, "MOST_EDGES_DRAWN", len(result.faces))
        coneflat.draw_layout(result, axes)
        assert "edges" in [artist.get_gid() for artist in axes.collections]

    def test_seams_are_darker_than_the_boundary(self):
        tube = shapes.tube()
        axes = axes_of()
        coneflat.draw_layout(tube, axes, edges=False, cones=False)
        height = tube.uv[:, 1].max()
        seam, boundary = (darkest_at(axes, place) for place in ([0, height * 0.51], [0.51, height]))
        assert seam.max() < 60 < 90 < boundary.mean() < 200
        (lines,) = (each for each in axes.collections if each.get_gid() == "boundary")
        assert sum(len(path.vertices) for path in lines.get_paths()) == 2 * 2 * 48

    def test_cones_are_red_and_black_at_their_points(self):
        tube = shapes.tube()
        axes = axes_of()
        coneflat.draw_layout(tube, axes)
        vertex, point = layout.layout_cones(tube)
        assert vertex.tolist() == [0, 0, 11, 11]
        np.testing.assert_array_equal(shown_at(axes, tube.uv[point]), [RED, RED, BLACK, BLACK])

    def test_textures_stand_side_by_side(self):
        tube = shapes.tube()
        tube.uv = np.add(tube.uv, [1, 0])
        tube.corner_uv = tube.uv[tube.uv_faces]
        axes = axes_of()
        coneflat.draw_layout(tube, axes)
        assert not axes.texts
        assert axes.get_xlim() == pytest.approx((0.98, 2.02))
        half = len(tube.faces) // 2
        tube.uv_faces[half:] += len(tube.uv)
        tube.uv = np.concatenate([tube.uv, np.add(tube.uv, [0, 1])])
        tube.corner_uv = tube.uv[tube.uv_faces]
        coneflat.draw_layout(tube, axes)
        assert axes.get_ylim() == pytest.approx((-0.04, 2.04))
        assert [text.get_text() for text in axes.texts] == ["1002", "1012"]
        assert layout.layout_aspect(tube, crop=False) == 0.5

    def test_crop_shows_the_charts_alone(self):
        tube = shapes.tube()
        axes = axes_of()
        coneflat.draw_layout(tube, axes, crop=True)
        assert axes.get_ylim()[1] < 0.2
        coneflat.draw_layout(tube, axes)
        assert axes.get_ylim()[1] > 1.0


class TestChecker:
    def test_squares_have_equal_sides(self):
        vertices, faces = shapes.grid(6, 6)
        uv = 0.9 * vertices[:, :2]
        result = SimpleNamespace(vertices=vertices, faces=faces, uv=uv, uv_faces=faces, corner_uv=uv[faces])
        axes = axes_of(dpi=100)
        coneflat.draw_checker(result, axes, eye="front", cells=8, seams=False, dpi=100)
        image = pixels(axes.figure)
        inside = image[50:-50, 50:-50].sum(axis=2)
        light = inside > (inside.min() + inside.max()) / 2
        for lines in (light, light.T):
            changes = [np.flatnonzero(np.diff(line)) for line in lines[::17]]
            widths = np.concatenate([np.diff(change) for change in changes])
            assert len(widths) > 50
            side = 0.98 * 400 / 8
            np.testing.assert_allclose(widths, side, atol=1)
            # Straight, too: lines change at the same places all over.
            assert all(np.ptp(place) <= 2 for place in zip(*changes, strict=True))

    def test_cells_are_counted_by_the_area(self, result):
        from coneflat.quality.checker import cell_side

        one, two = (result.corner_uv[:, k] - result.corner_uv[:, 0] for k in (1, 2))
        area = np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]).sum() / 2
        assert cell_side(result.uv, result.uv_faces, 30.0) == pytest.approx(np.sqrt(area) / 30)


class TestQuality:
    def test_the_layout_has_the_colours_of_its_triangles(self, result):
        from matplotlib import colormaps

        axes = axes_of(size=8.0)
        shown = coneflat.draw_quality(result, axes, on="layout", measure="qc", dpi=100)
        share = np.clip((result.distortion.qc - 1) / (shown.scale.high - 1), 0, 1)
        expected = 255 * np.asarray(colormaps["viridis_r"](share))[:, :3]
        found = shown_at(axes, result.corner_uv.mean(axis=1))
        close = np.abs(found - expected).max(axis=1) < 12
        # The rest is beside outlines and other triangles.
        assert close.mean() > 0.9
        assert np.ptp(expected, axis=0).max() > 100

    def test_the_model_has_the_colours_of_its_triangles(self):
        tube = shapes.tube()
        tube.distortion.qc[:] = np.where(np.arange(len(tube.faces)) % 2, 1.0, 1.2)
        axes = axes_of()
        coneflat.draw_quality(tube, axes, eye=(1, 0.3, 0.5), up="z", dpi=100)
        image = pixels(axes.figure)
        yellow = (image[..., 0] > 150) & (image[..., 1] > 150) & (image[..., 2] < 80)
        violet = (image[..., 0] < 100) & (image[..., 1] < 40) & (image[..., 2] > 40)
        assert yellow.mean() > 0.05
        assert violet.mean() > 0.05

    def test_the_colour_scale_ends_at_a_round_number(self):
        ones = np.ones(9)
        assert quantity.qc_top(ones, ones) == pytest.approx(1.05)
        assert quantity.qc_top(1.12 * ones, ones) == pytest.approx(1.15)
        assert quantity.qc_top(2.3 * ones, ones) == pytest.approx(2.5)
        assert quantity.qc_top(np.array([np.nan, np.nan]), ones[:2]) == pytest.approx(1.05)

    def test_percentiles_weigh_by_area(self, result):
        shown = quantity.conformal_distortion(result)
        assert shown.percentile(95) == pytest.approx(result.distortion.qc_p95)
        assert shown.percentile(100) == result.distortion.qc_max
        values, weights = shown.counted()
        assert weights[values <= shown.percentile(50)].sum() / weights.sum() == pytest.approx(0.5, abs=0.01)

    def test_stretch_is_relative_to_the_mean(self):
        vertices, faces = shapes.grid(6, 6)
        result = coneflat.flatten(7 * vertices, faces, cones="none")
        shown = quantity.stretch(result)
        np.testing.assert_allclose(shown.values, 1.0)
        assert shown.scale.position(np.array([1.0])) == pytest.approx(0.5)
        assert shown.scale.low * shown.scale.high == pytest.approx(1.0)

    def test_scales_have_their_ends_and_grey_for_nothing(self):
        from matplotlib import colormaps

        scale = quantity.ColorScale(1.0, 100.0, "viridis", "log", ())
        np.testing.assert_allclose(scale.position(np.array([0.1, 1, 10, 100, 1e9])), [0, 0, 0.5, 1, 1])
        found = scale.rgb(np.array([1.0, 1e3, np.nan]))
        expected = [colormaps["viridis"](0.0)[:3], colormaps["viridis"](1.0)[:3], quantity.UNDEFINED_COLOR]
        np.testing.assert_allclose(found, expected)
        assert scale.mappable().norm(10.0) == pytest.approx(0.5)

    @pytest.mark.parametrize("name", ["viridis_r", "YlGnBu"])
    def test_colours_differ_in_lightness_alone_already(self, name):
        from matplotlib import colormaps

        light = np.asarray(colormaps[name](np.linspace(0, 1, 50)))[:, :3] @ [0.2126, 0.7152, 0.0722]
        assert (np.diff(light) < 0.002).all()
        assert light[0] - light[-1] > 0.6


class TestConesAndCurvature:
    def test_cones_are_dots_and_those_behind_are_faint(self):
        tube = shapes.tube()
        tube.cones = np.array([4, 7])
        for eye, hidden in (((1, 0, 0.2), False), ((-1, 0, 0.05), True)):
            axes = axes_of()
            coneflat.draw_cones(tube, axes, eye=eye, up="z", dpi=100)
            dots = {each.get_gid(): each for each in axes.collections if "cones" in each.get_gid()}
            assert list(dots) == ["hidden-cones" if hidden else "cones"]
            (found,) = dots.values()
            positive, negative = shown_at(axes, found.get_offsets())
            assert np.abs(positive - RED).max() > 60 if hidden else positive.tolist() == list(RED)
            assert np.abs(negative - BLACK).max() > 100 if hidden else negative.tolist() == list(BLACK)
            lines = {each.get_gid() for each in axes.collections if "seams" in each.get_gid()}
            assert lines == {"hidden-seams", "seams"}
            seams = {
                each.get_gid(): len(each.get_segments())
                for each in axes.collections
                if "seams" in each.get_gid()
            }
            assert (seams["seams"] < seams["hidden-seams"]) == hidden

    def test_dots_grow_with_curvature(self):
        area = marks.cone_area(np.array([0.5, -1.0, 1.0, 2.0]) * np.pi)
        assert area[1] == area[2]
        assert area[0] < area[1] < area[3]

    def test_curvature_before_and_after(self, result):
        before, after = (quantity.curvature(result, flat) for flat in (False, True))
        mesh = coneflat.TriangleMesh(result.vertices, result.faces)
        angles = coneflat.corner_angles(coneflat.edge_lengths(mesh.vertices, mesh.faces))
        defect = coneflat.angle_defect(mesh.faces, angles, mesh.is_boundary_vertex)
        np.testing.assert_allclose(before.values, np.abs(defect))
        assert before.percentile(100) == pytest.approx(np.abs(defect).max())
        assert after.percentile(100) < 1e-10
        np.testing.assert_allclose(after.values[result.cones], np.abs(result.curvatures), atol=1e-9)
        linear = quantity.curvature(coneflat.flatten(*shapes.sphere(3), **coneflat.PAPER), True)
        assert 1e-6 < linear.percentile(50) < before.percentile(50)

    def test_boundaries_have_no_curvature_to_show(self):
        result = coneflat.flatten(*shapes.hill())
        shown = quantity.curvature(result, True)
        mesh = coneflat.TriangleMesh(result.vertices, result.faces)
        np.testing.assert_array_equal(np.isnan(shown.values), mesh.is_boundary_vertex)

    def test_the_curve_is_that_of_the_numbers(self):
        curve = coneflat.cone_curve(*shapes.sphere(3), most=8)
        axes = axes_of()
        coneflat.draw_cone_curve(curve, axes, distortion=0.15)
        np.testing.assert_array_equal(
            axes.lines[0].get_xydata(), np.column_stack([curve.counts, curve.distortions])
        )
        texts = [text.get_text() for text in axes.texts]
        assert texts == ["E = 0.15", f"knee: {curve.knee} cones"]
        assert coneflat.make_figure(curve, "curve").axes[0].get_xlabel() == "number of cones"
