"""Each picture of a flattening: what stands at which place, in pixels and in polygons."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from figure_contents import BLACK, RED, SVG, axes_of, count_dots, enclosed, groups, polygons, shown_at

import coneflat

pytest.importorskip("matplotlib")

from coneflat.apps.view import draw_cones, draw_layout, quantity
from coneflat.apps.view.figures import uv_layout as layout
from coneflat.apps.view.figures.model import draw_cone_curve
from coneflat.apps.view.palettes import color_table


@pytest.fixture(scope="module")
def result():
    return coneflat.flatten(*shapes.sphere(3), charts="atlas")


class TestLayout:
    @pytest.mark.parametrize("pieces", [1, 2])
    def test_charts_are_polygons_of_the_right_area(self, tmp_path, pieces):
        vertices, faces = shapes.annulus()
        if pieces == 2:
            ball_vertices, ball_faces = shapes.sphere(2)
            vertices, faces = shapes.join((vertices, faces), (ball_vertices + 5, ball_faces))
        result = coneflat.flatten(vertices, faces, charts="atlas")
        path = coneflat.save_figure(coneflat.make_figure(result, "layout"), tmp_path / "layout.svg")
        groups_by_name = groups(path)
        charts = [groups_by_name[name] for name in groups_by_name if name and name.startswith("chart-")]
        assert len(charts) == result.distortion.charts >= pieces
        first_side, second_side = (result.corner_uv[:, k] - result.corner_uv[:, 0] for k in (1, 2))
        area = np.abs(first_side[:, 0] * second_side[:, 1] - first_side[:, 1] * second_side[:, 0]).sum() / 2
        drawn = sum(abs(sum(enclosed(curve) for curve in polygons(chart))) for chart in charts)
        # The frame around is the unit square, with 2 in 104 of the width on either side.
        side = (4.5 - 2 * 0.0) * 72 / 1.04
        assert drawn / side**2 == pytest.approx(area, rel=1e-4)
        mesh = coneflat.TriangleMesh(result.uv, result.uv_faces)
        lines = "".join(part.get("d") for part in groups_by_name["edges"].iter(f"{SVG}path"))
        assert lines.count("M") == np.count_nonzero(~mesh.is_boundary_edge)
        counts = [count_dots(groups_by_name.get(f"{sign}-cones")) for sign in ("positive", "negative")]
        assert sum(counts) == len(layout.layout_cones(result)[0])

    def test_cones_are_red_and_black_at_their_points(self):
        tube = shapes.tube()
        axes = axes_of()
        draw_layout(tube, axes)
        vertex, point = layout.layout_cones(tube)
        assert vertex.tolist() == [0, 0, 11, 11]
        np.testing.assert_array_equal(shown_at(axes, tube.uv[point]), [RED, RED, BLACK, BLACK])


class TestQuality:
    @pytest.mark.slow
    def test_the_layout_has_the_colours_of_its_triangles(self, result):
        axes = axes_of(size=8.0)
        shown = quantity.conformal_distortion(result)
        layout.fill_layout(axes, result, shown, dpi=100)
        share = np.clip((result.distortion.qc - 1) / (shown.scale.high - 1), 0, 1)
        expected = 255 * color_table("sequential")[np.minimum((256 * share).astype(int), 255)]
        shades = shown_at(axes, result.corner_uv.mean(axis=1))
        close = np.abs(shades - expected).max(axis=1) < 12
        # The rest is beside outlines and other triangles.
        assert close.mean() > 0.9
        assert np.ptp(expected, axis=0).max() > 100

    def test_scales_of_small_distortion_are_short(self):
        flat = coneflat.flatten([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
        assert quantity.conformal_distortion(flat).scale.high == pytest.approx(1.05)
        assert quantity.stretch(flat).scale.high == pytest.approx(1.05)


class TestConesAndCurvature:
    def test_cones_are_dots_and_those_behind_are_faint(self):
        tube = shapes.tube()
        tube.cones = np.array([4, 7])
        for eye, hidden in (((1, 0, 0.2), False), ((-1, 0, 0.05), True)):
            axes = axes_of()
            draw_cones(tube, axes, eye=eye, up="z", dpi=100)
            dots = {
                collection.get_gid(): collection
                for collection in axes.collections
                if "cones" in collection.get_gid()
            }
            assert list(dots) == [f"{'hidden-' * hidden}{sign}-cones" for sign in ("positive", "negative")]
            positive, negative = (shown_at(axes, marks.get_offsets())[0] for marks in dots.values())
            disc, square = (marks.get_paths()[0] for marks in dots.values())
            assert len(square.vertices) == 5  # Closed.
            assert len(disc.vertices) > 5
            assert np.abs(positive - RED).max() > 60 if hidden else positive.tolist() == list(RED)
            assert np.abs(negative - BLACK).max() > 100 if hidden else negative.tolist() == list(BLACK)
            lines = {
                collection.get_gid() for collection in axes.collections if "seams" in collection.get_gid()
            }
            assert lines == {"hidden-seams", "seams"}
            seams = {
                collection.get_gid(): len(collection.get_segments())
                for collection in axes.collections
                if "seams" in collection.get_gid()
            }
            assert (seams["seams"] < seams["hidden-seams"]) == hidden

    def test_curvature_before_and_after(self, result):
        before, after = (quantity.curvature(result, flat) for flat in (False, True))
        mesh = coneflat.TriangleMesh(result.vertices, result.faces)
        angles = coneflat.geometry.corner_angles(coneflat.geometry.edge_lengths(mesh.vertices, mesh.faces))
        defect = coneflat.geometry.angle_defect(mesh.faces, angles, mesh.is_boundary_vertex)
        np.testing.assert_allclose(before.values, np.abs(defect))
        assert before.percentile(100) == pytest.approx(np.abs(defect).max())
        assert after.percentile(100) < 1e-10
        np.testing.assert_allclose(after.values[result.cones], np.abs(result.curvatures), atol=1e-9)
        linear = quantity.curvature(coneflat.flatten(*shapes.sphere(3), **coneflat.PAPER), True)
        assert 1e-6 < linear.percentile(50) < before.percentile(50)

    def test_the_curve_is_that_of_the_numbers(self):
        curve = coneflat.cone_curve(*shapes.sphere(3), most=8)
        axes = axes_of()
        draw_cone_curve(curve, axes, distortion=0.15)
        np.testing.assert_array_equal(
            axes.lines[0].get_xydata(), np.column_stack([curve.counts, curve.distortions])
        )
        texts = [text.get_text() for text in axes.texts]
        assert texts == ["E = 0.15", f"knee: {curve.knee} cones"]
        assert coneflat.make_figure(curve, "curve").axes[0].get_xlabel() == "number of cones"
