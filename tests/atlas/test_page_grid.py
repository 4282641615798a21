"""Outlines on pages that overlap."""

from __future__ import annotations

import numpy as np
import pytest
from test_strips import FIXED, boxes, gaps, rectangles

from coneflat.atlas import PageGrid, pack_page_grid

# Pages of 100 by 150 that overlap by 10; outlines are 1 away from their borders.
GRID = PageGrid(100.0, 150.0, 10.0, 1.0, 4, 4)
COLUMNS, GAP, EDGE = 740, 2.0, 1.0


def packed(*sizes, angles=FIXED, grid=GRID):
    outlines = rectangles(*sizes)
    packing = pack_page_grid(outlines, np.tile(angles, (len(sizes), 1)), GAP, grid, COLUMNS)
    return None if packing is None else boxes(outlines, packing)


def pages_of(corners):
    """Return (k, p) whether each box is on each page, EDGE away from its border, and whether only this page has it."""
    step = np.array([90.0, 140.0])
    low = np.stack(np.meshgrid(step[0] * np.arange(4), step[1] * np.arange(4)), axis=-1).reshape(-1, 2)
    high = low + np.array([100.0, 150.0])
    is_inside = (corners[:, None, :2] >= low + EDGE - 1e-9) & (corners[:, None, 2:] <= high - EDGE + 1e-9)
    meets = (corners[:, None, :2] < high - 10) & (corners[:, None, 2:] > low + 10)
    return is_inside.all(axis=2), meets.all(axis=2)


def test_outlines_that_fit_on_a_page_cross_no_border():
    corners = packed((150.0, 60.0), *[(45.0, 40.0)] * 7)
    is_inside, _ = pages_of(corners)
    assert is_inside[1:].any(axis=1).all()
    assert not is_inside[0].any()
    assert gaps(corners).min() >= GAP


def test_pages_are_as_few_as_can_be():
    # The long one needs two pages, and leaves room for all others.
    corners = packed((150.0, 40.0), *[(44.0, 30.0)] * 6)
    _, meets = pages_of(corners)
    assert meets.any(axis=0).sum() == 2


def test_an_outline_in_the_overlap_of_pages_needs_one_of_them():
    # Each is 5 mm longer than the distance of pages.
    corners = packed((95.0, 145.0), (95.0, 145.0))
    is_inside, _ = pages_of(corners)
    assert is_inside.any(axis=1).all()


@pytest.mark.parametrize("seed", range(4))
def test_random_outlines_are_apart_and_on_the_pages(seed):
    sizes = np.random.default_rng(seed).uniform(5, 140, (9, 2))
    corners = packed(*sizes, angles=np.array([0.0, np.pi / 2]))
    assert gaps(corners).min() >= GAP
    assert corners[:, :2].min() >= EDGE - 1e-9
    assert (corners[:, 2:].max(axis=0) <= [370 - EDGE + 1e-9, 570 - EDGE + 1e-9]).all()
    assert corners.tolist() == packed(*sizes, angles=np.array([0.0, np.pi / 2])).tolist()


def test_without_room_there_is_no_packing():
    assert packed((380.0, 20.0)) is None
    assert packed((98.0, 148.0), (98.0, 148.0), grid=PageGrid(100.0, 150.0, 10.0, 1.0, 1, 1)) is None
