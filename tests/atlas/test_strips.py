"""Outlines placed at their true size on strips and on sheets."""

from __future__ import annotations

import numpy as np
import pytest

from coneflat.atlas import Outlines, pack_sheets, pack_strip
from coneflat.geometry import rotated_up


def rectangles(*sizes):
    corners = [np.array([0, width, width + 1j * height, 1j * height]) for width, height in sizes]
    sides = np.concatenate([np.stack([ring, np.roll(ring, -1)], axis=1) for ring in corners])
    return Outlines(sides, 4 * np.arange(len(sizes) + 1))


def boxes(outlines, packing):
    """Return (k, 4) the boxes of the placed outlines."""
    placed = [
        outlines.points(i) * np.exp(1j * packing.angle[i]) + packing.shift[i] for i in range(len(outlines))
    ]
    return np.array([[p.real.min(), p.imag.min(), p.real.max(), p.imag.max()] for p in placed])


def gaps(corners):
    """Return the distances of all pairs of boxes."""
    first, second = np.triu_indices(len(corners), 1)
    apart = np.maximum(corners[first, :2] - corners[second, 2:], corners[second, :2] - corners[first, 2:])
    return np.linalg.norm(np.maximum(apart, 0.0), axis=1)


FIXED, QUARTERS = np.zeros(1), np.array([0.0, np.pi / 2])


def test_squares_fill_a_strip():
    outlines = rectangles(*[(9.5, 9.5)] * 8)
    packing = pack_strip(outlines, np.tile(FIXED, (8, 1)), 0.0, 40.0)
    corners = boxes(outlines, packing)
    assert corners.min() >= 0
    assert corners[:, 2].max() <= 40
    assert packing.height == pytest.approx(20, abs=1)
    assert corners[:, 3].max() <= packing.height


@pytest.mark.parametrize("gap", [0.5, 3.0])
def test_outlines_are_as_far_apart_as_requested(gap):
    sizes = np.random.default_rng(1).uniform(2, 15, (20, 2))
    outlines = rectangles(*sizes)
    angles = np.tile(QUARTERS, (20, 1))
    for packing in (pack_strip(outlines, angles, gap, 40.0), pack_sheets(outlines, angles, gap, 40.0, 200.0)):
        assert gaps(boxes(outlines, packing)).min() >= gap


def test_an_outline_is_rotated_if_only_that_way_it_fits():
    outlines = rectangles((50, 5))
    assert pack_strip(outlines, FIXED[None], 0.0, 20.0) is None
    packing = pack_strip(outlines, QUARTERS[None], 0.0, 20.0)
    assert packing.angle.tolist() == [np.pi / 2]
    assert boxes(outlines, packing)[0] == pytest.approx([0, 0, 5, 50], abs=0.1)


def test_sheets_are_as_few_as_possible():
    outlines = rectangles(*[(18.0, 28.0)] * 9)
    packing = pack_sheets(outlines, np.tile(FIXED, (9, 1)), 1.0, 40.0, 60.0)
    assert packing.sheet.max() + 1 == 3
    assert np.bincount(packing.sheet).max() == 4
    assert boxes(outlines, packing).max(axis=0)[2:] == pytest.approx([38, 58], abs=3)


def test_an_outline_larger_than_a_sheet_has_no_place():
    assert pack_sheets(rectangles((18, 80)), FIXED[None], 1.0, 40.0, 60.0) is None
    assert pack_sheets(rectangles((18, 50)), FIXED[None], 1.0, 40.0, 60.0) is not None


def test_the_result_is_the_same_each_time():
    outlines = rectangles(*np.random.default_rng(2).uniform(2, 15, (12, 2)))
    packings = [pack_strip(outlines, np.tile(QUARTERS, (12, 1)), 1.0, 50.0) for _ in range(2)]
    assert packings[0].shift.tolist() == packings[1].shift.tolist()


def test_a_direction_of_the_surface_points_up():
    rng = np.random.default_rng(0)
    positions = rng.normal(size=(50, 3))
    positions[:, 2] = 0
    turned = positions[:, :2] @ np.array([[0.6, 0.8], [-0.8, 0.6]])
    flat = rotated_up(turned, positions, np.array([1.0, 0.0, 0.0]), np.ones(50))
    assert flat[:, 1] == pytest.approx(positions[:, 0] - positions[:, 0].mean())
