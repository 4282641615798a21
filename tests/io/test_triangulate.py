"""Triangulating polygons."""

from __future__ import annotations

import numpy as np
import pytest

from coneflat.errors import DegenerateFaceError, FaceIndexError
from coneflat.geometry.triangulate import is_polygon_side, triangulate

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])


def triangulated(points, *rings):
    corners = np.concatenate(rings)
    offsets = np.cumsum([0, *map(len, rings)])
    faces, face_corners = triangulate(np.asarray(points, float), corners, offsets)
    np.testing.assert_array_equal(corners[face_corners], faces)
    return faces, face_corners, offsets


def area_vectors(points, faces):
    a, b, c = np.asarray(points, float)[faces].transpose(1, 0, 2)
    return np.cross(b - a, c - a) / 2


def triangle_set(faces):
    return {tuple(np.roll(f, -int(np.argmin(f)))) for f in faces}


def lifted(plane):
    """Turn points of the plane into a plane of space that is along no axis."""
    plane = np.asarray(plane, dtype=float)
    u, v = np.array([2, 1, 0]) / 5**0.5, np.array([-1, 2, 5]) / 30**0.5
    return plane[:, :1] * u + plane[:, 1:] * v + [3, -4, 5]


DENT = [(0, 0), (4, 0), (1, 1), (0, 4)]  # concave at corner 2
ARROW = [(0, 0), (4, 0), (4, 4), (2, 1), (0, 4)]  # concave at corner 3
COMB = [(0, 0), (7, 0), (7, 3), (6, 1), (5, 3), (4, 1), (3, 3), (2, 1), (1, 3)]
SIDE_POINTS = [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
# No corner sees all of it, and there are corners along its sides.
CLASP = [
    (0, 0), (2, 0), (4, 0), (6, 0), (6, 3), (6, 6), (4, 6), (4, 2), (3, 2), (2, 2), (2, 6), (0, 6), (0, 3),
]  # fmt: skip
# A square with a hole, to which a bridge leads there and back.
FRAME = [(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)]
REGULAR = [(np.cos(t), np.sin(t)) for t in np.arange(7) * 2 * np.pi / 7]


class TestTriangulate:
    def test_order_and_sides_of_mixed_polygons(self):
        points = [*lifted(REGULAR), [9, 9, 9]]
        _, face_corners, offsets = triangulated(points, [0, 1, 2], [0, 2, 3, 4], [5, 4, 3, 2, 0], [6, 5, 0])
        polygon = np.searchsorted(offsets, face_corners, side="right") - 1
        assert polygon.tolist() == [[0] * 3, [1] * 3, [1] * 3, [2] * 3, [2] * 3, [2] * 3, [3] * 3]
        sides = is_polygon_side(face_corners, offsets)
        # A polygon of k corners has k sides, and k - 3 diagonals seen from both ends.
        assert [int(sides[polygon[:, 0] == i].sum()) for i in range(4)] == [3, 4, 5, 3]
        np.testing.assert_array_equal(is_polygon_side(face_corners[:, ::-1], offsets).sum(1), sides.sum(1))

    @pytest.mark.parametrize("shape", [SQUARE[:, :2], DENT, ARROW, COMB, SIDE_POINTS, CLASP, FRAME, REGULAR])
    def test_triangles_tile_the_polygon(self, shape):
        points = lifted(shape)
        count = len(points)
        total = area_vectors(points, [[0, i, i + 1] for i in range(1, count - 1)]).sum(0)
        for start in range(count):
            for ring in (np.roll(np.arange(count), start), np.roll(np.arange(count)[::-1], start)):
                faces, _, _ = triangulated(points, ring)
                assert faces.shape == (count - 2, 3)
                assert set(faces.ravel()) == set(range(count))
                up = total if ring[1] == (ring[0] + 1) % count else -total
                parts = area_vectors(points, faces) @ up / (up @ up)
                # All turned the polygon's way, none empty, and together as large as it.
                assert parts.min() > 1e-3
                assert parts.sum() == pytest.approx(1, abs=1e-12)

    def test_quads_take_the_shorter_diagonal(self):
        kite = [(0, 0), (3, -1), (4, 0), (3, 1)]
        faces, _, _ = triangulated(lifted(kite), [0, 1, 2, 3])
        assert triangle_set(faces) == {(0, 1, 3), (1, 2, 3)}

    def test_concave_quad_is_split_at_its_dent(self):
        faces, _, _ = triangulated(lifted(DENT), [0, 1, 2, 3])
        # The other diagonal, 1-3, is longer here; with the dent moved out it is the shorter and yet wrong.
        assert triangle_set(faces) == {(0, 1, 2), (0, 2, 3)}
        thin = [(-9, 0), (1, 0.5), (0, 0), (1, -0.5)]
        faces, _, _ = triangulated(lifted(thin), [0, 3, 2, 1])
        assert triangle_set(faces) == {(0, 3, 2), (0, 2, 1)}

    @pytest.mark.parametrize("turn", [0, 0.3, 1.1])
    def test_squares_do_not_depend_on_the_first_corner(self, turn):
        rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        points = lifted(SQUARE[:, :2] @ rotation.T)
        splits = [triangle_set(triangulated(points, np.roll(np.arange(4), k))[0]) for k in range(4)]
        assert all(split == splits[0] for split in splits)

    @pytest.mark.parametrize("shape", [SQUARE[:, :2], ARROW, COMB])
    def test_bad_coordinates_give_valid_indices(self, shape):
        for value in (np.nan, np.inf, 1e200):
            points = lifted(shape)
            points[1] = value
            faces, _, _ = triangulated(points, np.arange(len(points)))
            assert faces.shape == (len(points) - 2, 3)
            assert set(faces.ravel()) == set(range(len(points)))
        faces, _, _ = triangulated(np.zeros((len(shape), 3)), np.arange(len(shape)))
        assert faces.shape == (len(shape) - 2, 3)

    def test_bad_input(self):
        with pytest.raises(FaceIndexError, match="face 1 refers to vertex 4, but there are 4"):
            triangulated(SQUARE, [0, 1, 2], [0, 1, 4])
        with pytest.raises(FaceIndexError, match="vertex -1"):
            triangulated(SQUARE, [0, 1, -1])
        with pytest.raises(DegenerateFaceError, match="face 1 has 2 corners"):
            triangulated(SQUARE, [0, 1, 2], [0, 1])
