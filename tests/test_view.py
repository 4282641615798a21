"""Laws of the rasteriser, the camera and the pictures of meshes."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from shapes import tube

from coneflat.errors import OptionError
from coneflat.geometry.normals import corner_normals
from coneflat.quality.checker import DARK_CELL, LIGHT_CELL
from coneflat.sample import sample_path
from coneflat.view.figures.camera import eye_direction, fit_camera, view_aspect
from coneflat.view.figures.projection import render_mesh
from coneflat.view.figures.raster import Barycentrics, rasterise
from coneflat.view.figures.shading import checkerboard

SQUARE = np.array([[0, 1, 2], [0, 2, 3]])


def test_the_nearer_triangle_hides_the_farther_one_in_either_order():
    near, far = [[2, 2, 1], [18, 2, 1], [2, 18, 1]], [[0, 0, 5], [30, 0, 5], [0, 30, 5]]
    for order in ([near, far], [far, near]):
        coverage = rasterise(np.concatenate(order), [[0, 1, 2], [3, 4, 5]], 32, 32)
        assert coverage.face[5, 5] == order.index(near)
        assert coverage.depth[5, 5] == pytest.approx(1.0)
        assert coverage.face[1, 20] == order.index(far)
        assert coverage.face[31, 31] == -1
        assert np.isinf(coverage.depth[31, 31])


def test_crossing_triangles_are_cut_where_their_depths_are_equal():
    tilted = [[0, 0, 0], [20, 0, 20], [20, 20, 20], [0, 20, 0]]
    level = [[0, 0, 10], [20, 0, 10], [20, 20, 10], [0, 20, 10]]
    coverage = rasterise(tilted + level, np.vstack([SQUARE, SQUARE + 4]), 20, 20)
    assert (coverage.face[:, :10] < 2).all()
    assert (coverage.face[:, 10:] >= 2).all()


def test_the_area_of_a_square_is_the_number_of_its_pixels():
    coverage = rasterise([[3, 4, 0], [33, 4, 0], [33, 24, 0], [3, 24, 0]], SQUARE, 50, 40)
    assert np.count_nonzero(coverage.covered) == 30 * 20


def test_tilted_square_covers_its_projected_area():
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    eye = np.array([0.3, 0.5, 1.0])
    camera = fit_camera(corners, (400, 300), eye)
    covered = rasterise(camera.project(corners), SQUARE, 400, 300).covered
    area = camera.scale**2 * eye[2] / np.linalg.norm(eye)
    assert np.count_nonzero(covered) == pytest.approx(area, rel=0.005)


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


def test_barycentrics_sum_to_one_and_give_back_the_pixel_centres():
    points = np.array([[2.3, 1.1, 0], [28.7, 9.4, 3], [11.2, 30.9, 7]])
    faces = [[0, 1, 2]]
    coverage = rasterise(points, faces, 32, 32)
    row, column = np.nonzero(coverage.covered)
    weights = Barycentrics(points, np.array(faces)).of(np.zeros_like(row), column, row)
    assert weights.sum(axis=1) == pytest.approx(1.0)
    assert weights.min() > -1e-9
    assert (weights @ points)[:, :2] == pytest.approx(np.column_stack([column + 0.5, row + 0.5]))
    assert (weights @ points)[:, 2] == pytest.approx(coverage.depth[coverage.covered])


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


def test_the_view_along_the_upward_axis_is_defined():
    assert np.isfinite(fit_camera(np.eye(3), (10, 10), eye=[0, 1, 0]).axes).all()


def test_front_and_back_views_face_each_other_from_above():
    front, back = eye_direction("front-right", "z"), eye_direction("back-left", "z")
    assert front[2] == back[2] > 0
    assert front[:2] == pytest.approx(-back[:2])


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_the_sides_of_a_model(up):
    sides = {name: eye_direction(name, up) for name in ("front", "back", "left", "right", "top", "bottom")}
    assert sides["top"].tolist() == np.eye(3)["xyz".index(up)].tolist()
    for one, other in (("front", "back"), ("left", "right"), ("top", "bottom")):
        np.testing.assert_array_equal(sides[one], -sides[other])
    # Seen from the front, the right side is to the right in the picture.
    camera = fit_camera(np.eye(3), (9, 9), "front", up)
    np.testing.assert_allclose(camera.axes, [sides["right"], sides["top"], sides["front"]], atol=1e-12)
    more_front, more_right = eye_direction("front-right", up), eye_direction("right-front", up)
    assert more_front @ sides["front"] > more_front @ sides["right"] > 0
    assert more_right @ sides["right"] > more_right @ sides["front"] > 0
    assert eye_direction("front-bottom", up) @ sides["bottom"] > 0


def test_the_aspect_of_a_view():
    box = np.array([[x, y, z] for x in (0, 3) for y in (0, 2) for z in (0, 1)], dtype=float)
    assert view_aspect(box, "front") == pytest.approx(3 / 2)
    assert view_aspect(box, "right") == pytest.approx(1 / 2)
    assert view_aspect(box[:2], "right") == 4.0
    assert view_aspect(box[[0, 2]], "right") == 0.25


def test_an_unknown_upward_axis_is_refused():
    with pytest.raises(OptionError, match="not 'up'"):
        fit_camera(np.eye(3), (10, 10), up="up")


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


def test_a_point_beside_an_outline_is_within_reach():
    model = tube()
    picture = render_mesh(model.vertices, model.faces, size=(160, 160), eye=[1, 0, 0], up="z")
    behind = [[-0.2, 0.98, 0.5]]
    assert not picture.visible_points(behind).any()
    assert picture.visible_points(behind, reach=6.0).all()
    assert not picture.visible_points([[-1, 0, 0.5]], reach=6.0).any()


def test_a_picture_shows_the_model_on_a_transparent_ground():
    model = tube()
    image = render_mesh(model.vertices, model.faces, size=(120, 80), up="z").image
    assert image.shape == (80, 120, 4)
    assert image.min() >= 0.0
    assert image.max() <= 1.0
    assert image[0, 0, 3] == 0.0
    assert 0.2 < (image[..., 3] == 1.0).mean() < 0.9


def test_turning_all_faces_over_does_not_change_the_picture():
    model = tube()
    one = render_mesh(model.vertices, model.faces, size=(60, 60), up="z").image
    two = render_mesh(model.vertices, model.faces[:, ::-1], size=(60, 60), up="z").image
    assert one == pytest.approx(two)


def test_the_checkerboard_alternates_and_fades_to_grey():
    centres = np.array([[0.5, 0.5], [1.5, 0.5], [1.5, 1.5], [-0.5, 0.5]])
    sharp = checkerboard(centres, np.full((4, 2), 1e-3), 1.0)
    assert sharp.ravel() == pytest.approx([1, 0, 1, 0])
    assert checkerboard(centres, np.full((4, 2), 40.0), 1.0) == pytest.approx(0.5)
    assert checkerboard(np.array([[1.0, 0.5]]), np.full((1, 2), 0.5), 1.0) == pytest.approx(0.5)


def test_the_sample_is_a_closed_surface_of_genus_one():
    lines = [line.split() for line in sample_path().read_text(encoding="ascii").splitlines()]
    vertices = np.array([line[1:] for line in lines if line[0] == "v"], dtype=float)
    faces = np.array([line[1:] for line in lines if line[0] == "f"], dtype=int) - 1
    sides = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    assert len(np.unique(sides, axis=0)) == len(sides)
    assert np.array_equal(np.unique(sides, axis=0), np.unique(sides[:, ::-1], axis=0))
    assert len(vertices) - len(sides) // 2 + len(faces) == 0
    assert np.array_equal(np.unique(faces), np.arange(len(vertices)))
    p, q, r = np.moveaxis(vertices[faces], 1, 0)
    assert np.einsum("ij,ij->", p, np.cross(q, r)) > 0


def test_normals_are_smooth_but_at_creases():
    vertices, faces = shapes.box(3, (1, 1, 1))
    np.testing.assert_allclose(np.abs(corner_normals(vertices, faces)).max(axis=2), 1.0)
    vertices, faces = shapes.sphere(3, bumps=0.0)
    np.testing.assert_allclose(corner_normals(vertices, faces), vertices[faces], atol=0.02)


def test_colours_of_faces_and_of_corners_are_those_given():
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    flat = {"size": (100, 100), "eye": "front", "contrast": 0.0, "margin": 0.0}
    colors = np.array([[1, 0, 0], [0, 0, 1]], dtype=float)
    image = render_mesh(square, SQUARE, colors=colors, **flat).image
    # The first face is below the diagonal.
    np.testing.assert_allclose(image[80, 60], [1, 0, 0, 1])
    np.testing.assert_allclose(image[20, 40], [0, 0, 1, 1])
    red = np.zeros((2, 3, 3))
    red[..., 0] = square[SQUARE][..., 0]
    image = render_mesh(square, SQUARE, colors=red, **flat).image
    np.testing.assert_allclose(image[30, :, 0], (np.arange(100) + 0.5) / 100, atol=1e-9)


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


def test_a_board_seen_at_an_angle_has_straight_lines():
    points, faces = shapes.grid(5, 9)
    picture = render_mesh(
        points,
        faces,
        size=(300, 300),
        eye=(1.0, 0.7, 0.5),
        corner_uv=points[faces][..., :2],
        cell=0.25,
        contrast=0.0,
    )
    camera = picture.camera
    u, v = np.meshgrid(np.arange(0.125, 1, 0.25), np.arange(0.125, 1, 0.25), indexing="ij")
    centres = np.stack([u, v, np.zeros_like(u)], axis=-1)
    x, y = np.moveaxis(np.floor(camera.project(centres)[..., :2]).astype(int), -1, 0)
    light = picture.image[y, x, 0]
    i, j = np.indices(u.shape)
    np.testing.assert_allclose(light, np.where((i + j) % 2 == 0, LIGHT_CELL[0], DARK_CELL[0]), atol=1e-9)
