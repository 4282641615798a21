"""Laws of the rasteriser, the camera and the demo figure."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from coneflat.errors import OptionError
from coneflat.sample import sample_path
from coneflat.view.camera import default_eye, fit_camera
from coneflat.view.projection import render_mesh
from coneflat.view.raster import barycentrics, rasterise
from coneflat.view.shading import checkerboard

SQUARE = np.array([[0, 1, 2], [0, 2, 3]])


def tube(around=48, along=12):
    """A cylinder about z with UVs cut along one line; its cones, if any, are at the cut's two ends."""
    angle, z = np.meshgrid(np.arange(around + 1) / around, np.linspace(0.0, 1.0, along), indexing="ij")
    uv = np.column_stack([angle.ravel(), z.ravel() / (2 * np.pi)])
    corner = (np.arange(around)[:, None] * along + np.arange(along - 1)).ravel()
    uv_faces = np.vstack(
        [
            np.column_stack([corner, corner + along, corner + along + 1]),
            np.column_stack([corner, corner + along + 1, corner + 1]),
        ]
    )
    turn = 2 * np.pi * angle[:-1].ravel()
    vertices = np.column_stack([np.cos(turn), np.sin(turn), z[:-1].ravel()])
    seams = np.column_stack([np.arange(along - 1), np.arange(1, along)])
    faces = uv_faces % len(vertices)
    qc = np.linspace(1.0, 1.2, len(faces))
    qc[0] = np.nan
    return SimpleNamespace(
        vertices=vertices,
        faces=faces,
        uv=uv,
        uv_faces=uv_faces,
        corner_uv=uv[uv_faces],
        cones=np.array([0, along - 1]),
        curvatures=np.array([1.0, -1.0]),
        seams=seams,
        distortion=SimpleNamespace(qc=qc, qc_mean=1.1, flipped=0, seam_length=0.4),
        source=None,
    )


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
    weights = barycentrics(points, faces, coverage)
    row, column = np.nonzero(coverage.covered)
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
    front, back = default_eye("z"), default_eye("z", behind=True)
    assert front[2] == back[2]
    assert front[:2] == pytest.approx(-back[:2])


def test_an_unknown_upward_axis_is_refused():
    with pytest.raises(OptionError, match="not 'up'"):
        fit_camera(np.eye(3), (10, 10), up="up")


def test_points_and_lines_behind_the_model_are_hidden():
    model = tube()
    picture = render_mesh(model.vertices, model.faces, size=(160, 160), eye=[1, 0, 0.2], up="z")
    assert picture.visible_points([[1, 0, 0.5], [-1, 0, 0.2]]).tolist() == [True, False]
    assert not picture.visible_points([[0, 9, 0]]).any()
    front, back = np.array([[1, 0, 0.2], [1, 0, 0.8]]), np.array([[-1, 0, 0.1], [-1, 0, 0.4]])
    pieces = picture.visible_segments(front[:1], front[1:])
    length = np.linalg.norm(pieces[:, 1] - pieces[:, 0], axis=1).sum()
    assert length == pytest.approx(np.linalg.norm(np.diff(picture.camera.project(front)[:, :2], axis=0)))
    assert len(picture.visible_segments(back[:1], back[1:])) == 0
    assert picture.visible_segments(np.empty((0, 3)), np.empty((0, 3))).shape == (0, 2, 2)


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


class TestFigure:
    @pytest.fixture(autouse=True)
    def _needs_matplotlib(self):
        pytest.importorskip("matplotlib")

    def test_the_demo_figure_is_a_picture(self, tmp_path):
        from coneflat.view import demo_figure, save_figure

        figure = demo_figure(tube(), up="z")
        path = save_figure(figure, tmp_path / "demo.png")
        assert path.read_bytes().startswith(b"\x89PNG")
        assert [file.name for file in tmp_path.iterdir()] == ["demo.png"]
        figure.canvas.draw()
        pixels = np.asarray(figure.canvas.buffer_rgba())[..., :3]
        assert 0.05 < (pixels < 250).any(axis=2).mean() < 0.9
        red = (pixels[..., 0] > 200) & (pixels[..., 1:] < 60).all(axis=2)
        assert red.any()

    def test_a_flattening_without_cones_or_seams_has_a_figure(self):
        from coneflat.view import demo_figure

        model = tube()
        model.cones, model.curvatures = np.empty(0, dtype=int), np.empty(0)
        model.seams = np.empty((0, 2), dtype=int)
        model.distortion.qc[:] = np.nan
        assert not demo_figure(model).legends

    def test_cones_appear_in_the_layout_once_for_each_of_their_points(self):
        from coneflat.view.panels import layout_cones, layout_edges

        model = tube()
        vertex, point = layout_cones(model)
        assert vertex.tolist() == [0, 0, 11, 11]
        assert len(set(point.tolist())) == 4
        inner, outline = layout_edges(model.uv_faces)
        assert len(outline) == 2 * 48 + 2 * 11
        assert 2 * len(inner) + len(outline) == 3 * len(model.faces)

    def test_the_colour_scale_ends_at_a_round_number(self):
        from coneflat.view.panels import qc_top

        assert qc_top(np.ones(9)) == pytest.approx(1.05)
        assert qc_top(np.full(9, 1.12)) == pytest.approx(1.15)
        assert qc_top(np.full(9, 2.3)) == pytest.approx(2.5)
        assert qc_top(np.array([np.nan, np.nan])) == pytest.approx(1.05)


def test_a_missing_matplotlib_is_named_with_its_remedy(monkeypatch):
    from coneflat.view import demo_figure

    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(OptionError, match=r'pip install "coneflat\[figures\]"'):
        demo_figure(tube())
