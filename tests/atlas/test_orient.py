"""Charts turned upright, or into the least rectangle."""

from __future__ import annotations

import numpy as np
import pytest
from flat_charts import as_complex, letter_l, star
from shapes import hill, rotation

from coneflat import TriangleMesh
from coneflat.atlas import arrange_charts, pack_charts
from coneflat.atlas.rectangles import square_angle, straight_angle

NONE = np.empty(0)  # directions of a border that is not straight


def _straight(corner_uv):
    """One chart at its own scale, turned by quarter turns from where its border lies along the axes."""
    packed = pack_charts(corner_uv, rotate="quarter", padding=0)
    return packed.corner_uv / packed.scale


@pytest.mark.parametrize("angle", [0.0, 0.3, 2.0])
def test_straight_charts(angle):
    rectangle = letter_l(1.0)[:2] * [3, 1]
    points = as_complex(rectangle).ravel() * np.exp(1j * angle)
    turned = points * np.exp(1j * straight_angle(points, NONE))
    np.testing.assert_allclose([np.ptp(turned.real), np.ptp(turned.imag)], [3, 1], rtol=1e-12)
    square = points * np.exp(1j * square_angle(points, NONE))
    assert max(np.ptp(square.real), np.ptp(square.imag)) == pytest.approx(4 / 2**0.5, rel=1e-12)


def test_straight_charts_have_the_least_rectangle():
    points = as_complex(star(8, 0.5, 1.0, 3)).ravel()
    turned = points * np.exp(1j * np.linspace(0, np.pi, 20001))[:, None]
    smallest_area = (np.ptp(turned.real, axis=1) * np.ptp(turned.imag, axis=1)).min()
    straight = points * np.exp(1j * straight_angle(points, NONE))
    assert np.ptp(straight.real) * np.ptp(straight.imag) <= smallest_area * (1 + 1e-12)
    assert np.ptp(straight.real) >= np.ptp(straight.imag)


@pytest.mark.parametrize("quarters", range(4))
def test_upright_charts_show_up_as_v(quarters):
    """A wall with its long side up, however it was laid out, stands."""
    vertices, faces = hill()
    space = rotation()
    wall = np.column_stack([vertices[:, 0], 0.2 * vertices[:, 2], 3 * vertices[:, 1]]) @ space.T
    turn = np.exp(1j * (quarters * np.pi / 2 + 0.2))
    uv = (vertices[:, 0] + 3j * vertices[:, 1]) * turn
    corner_uv = np.stack([uv.real, uv.imag], axis=1)[faces]
    mesh, chart = TriangleMesh(wall, faces), np.zeros(len(faces), dtype=np.int64)
    options = {"resolution": 512, "padding": 0, "tiles": 1, "edge_halfedges": mesh.edge_halfedges}
    heights = wall[faces] @ space[:, 2]
    packed = arrange_charts(corner_uv, chart, np.zeros(1, dtype=np.int64), heights, **options)
    laid = packed.corner_uv / packed.scale
    shift = as_complex(laid) - as_complex(corner_uv) / turn
    assert np.ptp(shift.real) < 0.1
    assert np.ptp(shift.imag) < 0.1
    lying = _straight(corner_uv)
    assert np.ptp(lying[..., 0]) > 2.5
    assert np.ptp(laid[..., 1]) > 2.5


def test_without_an_up_direction_the_heavier_half_is_below():
    for turn in (1, -1):
        laid = _straight(turn * letter_l(1.0))[..., 1]
        weights = np.ones(6) / 6
        assert weights @ laid.mean(axis=1) < (laid.min() + laid.max()) / 2
