"""The map of the strain on the first page."""

from __future__ import annotations

import numpy as np
import pytest
from flat_pieces import sheet, two_pieces

from coneflat import Pattern
from coneflat.apps.patterns.pages.strain_map import is_strained, side_strains, strain_map

LOW, SIZE = np.array([10.0, 20.0]), np.array([80.0, 90.0])


def test_shrunk_pieces_are_blue_and_the_legend_says_by_how_much():
    pattern = two_pieces(shrink=0.9)
    (picture, bar), drawing = strain_map(pattern, LOW, SIZE)
    assert is_strained(pattern)
    red, _, blue = picture.pixels.reshape(-1, 3).astype(int).T
    # The second piece is half of the pieces and 10 % shorter; the first one is grey.
    assert 0.3 < (blue > red + 50).sum() / ((red < 250) | (blue < 250)).sum() < 0.6
    assert not (red > blue + 50).any()
    texts = [text.text for text in drawing.texts]
    assert texts[:3] == ["-10 %", "0", "+10 %"]
    assert texts[-1].startswith("largest 10 %, mean ")
    for part in (picture, bar):
        assert (part.low >= LOW).all()
        assert (part.low + np.array([part.width, part.height]) <= LOW + SIZE + 1e-9).all()


def test_strains_are_those_of_the_sides():
    strains = side_strains(two_pieces(shrink=0.9).surface)
    assert sorted(set(np.round(strains, 9))) == pytest.approx([-0.1, 0.0])
    assert not is_strained(Pattern("sheet", sheet(), 1.0))
