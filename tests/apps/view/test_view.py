"""Laws of the rasteriser, the camera and the pictures of meshes."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from shapes import tube

from coneflat.apps.view.figures.camera import eye_direction, fit_camera
from coneflat.apps.view.figures.render import rasterise, render_mesh
from coneflat.errors import OptionError
from coneflat.io.texture import DARK_CELL, LIGHT_CELL

SQUARE = np.array([[0, 1, 2], [0, 2, 3]])


def test_the_nearer_triangle_hides_the_farther_one_in_either_order():
    front, behind = [[2, 2, 1], [18, 2, 1], [2, 18, 1]], [[0, 0, 5], [30, 0, 5], [0, 30, 5]]
    for order in ([front, behind], [behind, front]):
        coverage = rasterise(np.concatenate(order), [[0, 1, 2], [3, 4, 5]], 32, 32)
        assert coverage.face[5, 5] == order.index(front)
        assert coverage.depth[5, 5] == pytest.approx(1.0)
        assert coverage.face[1, 20] == order.index(behind)
        assert coverage.face[31, 31] == -1
        assert np.isinf(coverage.depth[31, 31])


def test_a_triangulated_region_has_neither_gaps_nor_overlaps():
    random = np.random.default_rng(7)
    angle = np.sort(random.uniform(0, 2 * np.pi, 40))
    rim = 50 + 45 * np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.column_stack([np.vstack([random.uniform(45, 55, 2), rim]), np.zeros(41)])
    fan = np.column_stack([np.zeros(40, dtype=int), np.arange(1, 41), np.roll(np.arange(1, 41), -1)])
    together = rasterise(points, fan, 100, 100).covered
    apart = sum(rasterise(points, [face], 100, 100).covered.astype(int) for face in fan)
    assert apart.max() == 1
    assert np.array_equal(apart == 1, together)


def test_parts_outside_the_picture_and_flat_triangles_are_skipped():
    points = [[-50, -50, 0], [90, -50, 0], [-50, 90, 0], [5, 5, -1], [9, 9, -1], [13, 13, -1]]
    coverage = rasterise(points, [[0, 1, 2], [3, 4, 5]], 20, 20)
    assert (coverage.face == 0).all()
    assert not rasterise(np.empty((0, 3)), np.empty((0, 3), dtype=int), 8, 8).covered.any()


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_the_camera_fits_the_model_and_keeps_it_upright(up):
    vertices = np.random.default_rng(3).normal(size=(50, 3)) * [1, 4, 2] + 10
    camera = fit_camera(vertices, (300, 200), up=up)
    assert camera.axes @ camera.axes.T == pytest.approx(np.eye(3))
    assert np.linalg.det(camera.axes) == pytest.approx(1.0)
    pixels = camera.project(vertices)[:, :2]
    assert (pixels >= 0).all()
    assert (pixels <= [300, 200]).all()
    upward = np.eye(3)["xyz".index(up)]
    assert camera.axes[0] @ upward == pytest.approx(0.0)
    assert camera.axes[1] @ upward > 0.5


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_the_sides_of_a_model(up):
    sides = {name: eye_direction(name, up) for name in ("front", "back", "left", "right", "top", "bottom")}
    assert sides["top"].tolist() == np.eye(3)["xyz".index(up)].tolist()
    for side, opposite in (("front", "back"), ("left", "right"), ("top", "bottom")):
        np.testing.assert_array_equal(sides[side], -sides[opposite])
    # Seen from the front, the right side is to the right in the picture.
    camera = fit_camera(np.eye(3), (9, 9), "front", up)
    np.testing.assert_allclose(camera.axes, [sides["right"], sides["top"], sides["front"]], atol=1e-12)
    more_front, more_right = eye_direction("front-right", up), eye_direction("right-front", up)
    assert more_front @ sides["front"] > more_front @ sides["right"] > 0
    assert more_right @ sides["right"] > more_right @ sides["front"] > 0
    assert eye_direction("front-bottom", up) @ sides["bottom"] > 0


@pytest.mark.parametrize(
    "eye", ["above", "front-", "front-right-top", "left-right", "", (0, 0, 0), (1, 2), (1, np.nan, 0)]
)
def test_an_unknown_eye_is_refused(eye):
    with pytest.raises(OptionError, match="eye"):
        eye_direction(eye)


def test_points_and_lines_behind_the_model_are_hidden():
    model = tube()
    picture = render_mesh(model.vertices, model.faces, size=(160, 160), eye=[1, 0, 0.2], up="z")
    assert picture.visible_points([[1, 0, 0.5], [-1, 0, 0.2]]).tolist() == [True, False]
    assert not picture.visible_points([[0, 9, 0]]).any()
    front, back = np.array([[1, 0, 0.2], [1, 0, 0.8]]), np.array([[-1, 0, 0.1], [-1, 0, 0.4]])
    ends = np.stack([front, back], axis=1)
    pieces, visible = picture.split_segments(*ends)
    assert visible.tolist() == [True, False]
    expected = np.stack([picture.camera.project(side)[:, :2] for side in (front, back)])
    np.testing.assert_allclose(pieces, expected, atol=1e-9)
    pieces, visible = picture.split_segments(np.empty((0, 3)), np.empty((0, 3)))
    assert (pieces.shape, visible.shape) == ((0, 2, 2), (0,))


def test_a_line_is_cut_where_it_vanishes():
    wall = np.array([[0, 0, 1], [4, 0, 1], [4, 4, 1], [0, 4, 1]], dtype=float)
    floor = np.array([[-4, 0, 0], [4, 0, 0], [4, 4, 0], [-4, 4, 0]], dtype=float)
    picture = render_mesh(
        np.vstack([wall, floor]), np.vstack([SQUARE, SQUARE + 4]), size=(400, 200), eye="front"
    )
    pieces, visible = picture.split_segments([[-3.0, 2, 0]], [[3.0, 2, 0]])
    assert visible.tolist() == [True, False]
    # To the step and the reach of the test.
    assert pieces[0, 1, 0] == pytest.approx(200, abs=4)
    np.testing.assert_array_equal(pieces[0, 1], pieces[1, 0])


@pytest.mark.slow
def test_the_squares_of_a_checkerboard_are_squares():
    """A square in the plane is its own layout: the board has straight lines at equal distances."""
    points, faces = shapes.grid(7, 7)
    uv = points[faces][..., :2]
    picture = render_mesh(
        points, faces, size=(400, 400), eye="front", corner_uv=uv, cell=0.1, contrast=0.0, margin=0.0
    )
    light = picture.image[..., 0] > (LIGHT_CELL[0] + DARK_CELL[0]) / 2
    # The centre of every pixel, counted from below as v is.
    place = np.floor((np.arange(400) + 0.5) / 40).astype(int)
    expected = (place[None, :] + place[::-1, None]) % 2 == 0
    np.testing.assert_array_equal(light, expected)
    np.testing.assert_allclose(picture.image[20, 20], [*DARK_CELL, 1], atol=1e-9)
    np.testing.assert_allclose(picture.image[20, 60], [*LIGHT_CELL, 1], atol=1e-9)
