"""Pieces of the same shape, and mirror images."""

from __future__ import annotations

import numpy as np
import pytest
from flat_pieces import gores, two_pieces

from coneflat import Pattern, TriangleMesh
from coneflat.apps.patterns.drawing.counterparts import SAME_SHAPE
from coneflat.apps.patterns.pages.steps import steps_of
from coneflat.apps.patterns.pieces.cut_surface import CutSurface

pytest.importorskip("shapely")
# A quadrilateral without any symmetry, mm.
CORNERS = np.array([[0.0, 0.0], [50.0, 0.0], [60.0, 30.0], [10.0, 80.0]])


def turned(degrees, mirrored=False, begin=0, corners=CORNERS):
    """The quadrilateral, reflected along x, then turned, with another first corner."""
    corners = corners[::-1] * [-1, 1] if mirrored else corners
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.roll(corners @ np.array([[c, s], [-s, c]]), begin, axis=0)


def pattern_of(*pieces, kind="cloth", **settings):
    """A pattern of quadrilaterals side by side, which are not connected."""
    points = np.concatenate([corners + np.array([200.0 * i, 0]) for i, corners in enumerate(pieces)])
    faces = np.concatenate([4 * i + np.array([[0, 1, 2], [0, 2, 3]]) for i in range(len(pieces))])
    mesh = TriangleMesh(np.pad(points, ((0, 0), (0, 1))), faces)
    return Pattern(kind, CutSurface(mesh, faces, points), 1.0, settings=settings)


def numbers(pattern):
    """The numbers of the report: as which piece each is, and of which it is the mirror image."""
    return [(piece["same_as"], piece["mirror_image_of"]) for piece in pattern.report()["each_piece"]]


@pytest.mark.parametrize("degrees", [0, 180, 77])
@pytest.mark.parametrize("begin", range(4))
def test_equal_and_mirrored_pieces(degrees, begin):
    def pieces(settings):
        shapes = 1.1 * CORNERS, CORNERS, turned(degrees, begin=begin), turned(degrees, True, begin)
        return pattern_of(*shapes, **settings)

    expected = [(None, None), (None, 4), (2, None), (None, 2)]
    assert numbers(pieces({"grain": "none"})) == expected
    # Along the grain, pieces are turned by half turns only.
    assert numbers(pieces({})) == (expected if degrees % 180 == 0 else [(None, None)] * 4)


def test_several_pairs():
    pattern = pattern_of(CORNERS, turned(0, True), turned(180), turned(180, True), turned(0, True))
    assert numbers(pattern) == [(None, 2), (None, 1), (1, 4), (2, 3), (2, None)]
    assert pattern.counterparts.pairs == [(0, 1), (2, 3)]


def test_shapes_that_differ_slightly():
    for change, is_same in ((0.5, True), (3.0, False)):
        corners = CORNERS.copy()
        corners[2, 0] += change * SAME_SHAPE * 40
        assert numbers(pattern_of(CORNERS, turned(0, True, corners=corners)))[0] == (
            None,
            2 if is_same else None,
        )


def test_holes_belong_to_the_shape():
    def ring(x):
        """A square with a hole that is off its centre."""
        outer, inner = (np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half for half in (30.0, 10.0))
        return np.concatenate([outer, inner + np.array([x, 5])])

    walls = [[[i, (i + 1) % 4, 4 + (i + 1) % 4], [i, 4 + (i + 1) % 4, 4 + i]] for i in range(4)]
    faces = np.reshape(walls, (-1, 3))
    for second, expected in ((8.0, (1, None)), (-8.0, (None, 1)), (3.0, (None, None))):
        points = np.concatenate([ring(8.0), ring(second) + np.array([200, 0])])
        corners = np.concatenate([faces, faces + 8])
        mesh = TriangleMesh(np.pad(points, ((0, 0), (0, 1))), corners)
        assert numbers(Pattern("cloth", CutSurface(mesh, corners, points), 1.0))[1] == expected


def test_allowances_belong_to_the_shape():
    assert numbers(two_pieces()) == [(None, None), (1, None)]
    assert numbers(gores(8)) == [(None, None)] + [(1, None)] * 7


def test_the_guide_names_pairs_that_are_cut_from_doubled_cloth():
    pattern = pattern_of(1.1 * CORNERS, CORNERS, turned(0, True))
    steps = " ".join(steps_of(pattern))
    assert (
        "Mirror images may be cut together from doubled cloth, with the paper of one of them: 2 and 3."
        in steps
    )
    assert "doubled" not in " ".join(steps_of(two_pieces()))
