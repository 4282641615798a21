"""Charts that are moved, pinned and packed around each other."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from scipy.spatial import cKDTree

import coneflat
from coneflat.atlas import similarities
from coneflat.errors import OptionError
from coneflat.mesh import label_faces

#: Points along each side of a border at which distances of charts are measured.
SAMPLES = np.linspace(0, 1, 9)


@pytest.fixture(scope="module")
def result():
    """Six charts."""
    return coneflat.unwrap(coneflat.sample_path(), charts=6, resolution=512, padding=4)


def charts_of(result):
    """Return the chart of each triangle, and a triangle of each chart."""
    _, chart = label_faces(result.uv_faces, len(result.uv))
    return chart, np.unique(chart, return_index=True)[1]


def gap_between(result):
    """Return the smallest distance of points on the borders of different charts."""
    chart, _ = charts_of(result)
    sides = np.stack([result.uv_faces, np.roll(result.uv_faces, -1, axis=1)], axis=2).reshape(-1, 2)
    _, index, count = np.unique(np.sort(sides, axis=1), axis=0, return_index=True, return_counts=True)
    border = index[count == 1]
    a, b = (result.uv[sides[border, end]][:, None] for end in (0, 1))
    points = (a + (b - a) * SAMPLES[:, None]).reshape(-1, 2)
    owner = np.repeat(chart[border // 3], len(SAMPLES))
    gaps = [
        cKDTree(points[owner != number]).query(points[owner == number])[0].min()
        for number in np.unique(owner)
    ]
    return min(gaps)


def complex_corners(result):
    return np.ascontiguousarray(result.corner_uv).view(np.complex128)[..., 0]


def moves_between(before, after):
    chart, first = charts_of(before)
    return similarities(before.corner_uv, after.corner_uv, chart, len(first))


def about(result, face, factor):
    """Return the move of the chart of a triangle by a factor about the middle of its box."""
    chart, _ = charts_of(result)
    uv = result.corner_uv[chart == chart[face]].reshape(-1, 2)
    middle = complex(*(uv.min(axis=0) + uv.max(axis=0)) / 2)
    return factor, middle - factor * middle


def largest_chart(result):
    """Return a triangle of the chart with most triangles."""
    chart, first = charts_of(result)
    return int(first[np.bincount(chart).argmax()])


@pytest.fixture(scope="module", params=[1, 1j, -1], ids=["pinned", "quarter turn", "half turn"])
def packed(request, result):
    """The largest chart, and a layout in which it is turned and the others are packed around it."""
    face = largest_chart(result)
    return face, coneflat.repack(result, moves={face: about(result, face, request.param)})


class TestPacking:
    def test_nothing_overlaps(self, packed):
        _, changed = packed
        assert changed.distortion.overlapping_pairs == 0
        assert changed.distortion.flipped == 0
        measured = coneflat.measure_uv(changed)
        assert measured.distortion.overlapping_pairs == 0
        assert changed.packing_efficiency == pytest.approx(measured.counts["packing_efficiency"], rel=1e-9)

    def test_pinned_charts_keep_their_place_and_scale(self, result, packed):
        face, changed = packed
        chart, _ = charts_of(result)
        is_pinned = chart == chart[face]
        moves = moves_between(result, changed)
        number = chart[face]
        assert abs(moves.factor[number]) == pytest.approx(1, abs=1e-12)
        expected = about(result, face, np.round(moves.factor[number]))
        old, moved = (complex_corners(layout)[is_pinned] for layout in (result, changed))
        np.testing.assert_allclose(moved, expected[0] * old + expected[1], atol=1e-12)

    def test_the_others_are_similar_and_have_one_scale(self, result, packed):
        face, changed = packed
        chart, _ = charts_of(result)
        moves = moves_between(result, changed)
        old, moved = (complex_corners(layout) for layout in (result, changed))
        expected = moves.factor[chart][:, None] * old + moves.shift[chart][:, None]
        np.testing.assert_allclose(moved, expected, atol=1e-12)
        scales = np.abs(np.delete(moves.factor, chart[face]))
        np.testing.assert_allclose(scales, scales[0], rtol=1e-9)
        assert 0.5 < scales[0] <= 1 + 1e-9
        assert any("are scaled by" in note for note in changed.notes) == (scales[0] < 1 - 1e-8)

    def test_all_charts_keep_the_padding(self, packed):
        face, changed = packed
        gap = 4 / 512
        assert gap_between(changed) >= gap * (1 - 1e-9)
        chart, _ = charts_of(changed)
        packed_uv = changed.corner_uv[chart != chart[face]]
        assert packed_uv.min() >= gap * (1 - 1e-9)
        assert packed_uv.max() <= 1 - gap * (1 - 1e-9)

    def test_it_is_deterministic(self, result, packed):
        face, changed = packed
        factor = np.round(moves_between(result, changed).factor[charts_of(result)[0][face]])
        again = coneflat.repack(result, moves={face: about(result, face, factor)})
        np.testing.assert_array_equal(again.uv, changed.uv)


def test_a_chart_in_the_way_makes_the_others_smaller(result):
    face = largest_chart(result)
    chart, _ = charts_of(result)
    uv = result.corner_uv[chart == chart[face]].reshape(-1, 2)
    shift = complex(*(0.5 - (uv.min(axis=0) + uv.max(axis=0)) / 2))
    changed = coneflat.repack(result, moves={face: (1, shift)})
    assert changed.distortion.overlapping_pairs == 0
    (note,) = [note for note in changed.notes if "are scaled by" in note]
    scales = np.abs(moves_between(result, changed).factor)
    assert f"{np.delete(scales, chart[face]).min():.3f}" in note


def test_without_packing_only_the_named_charts_move(result):
    face = largest_chart(result)
    chart, _ = charts_of(result)
    with pytest.warns(coneflat.GuaranteeWarning, match="overlap"):
        changed = coneflat.repack(result, moves={face: (1, 0.11 + 0.07j)}, pack=False)
    moved = changed.corner_uv - result.corner_uv
    assert np.abs(moved[chart == chart[face]] - [0.11, 0.07]).max() < 1e-12
    assert not moved[chart != chart[face]].any()
    assert changed.distortion.overlapping_pairs > 0
    assert changed.distortion.energy == pytest.approx(result.distortion.energy, rel=1e-9)


def test_all_charts_pinned_are_the_result(result):
    _, first = charts_of(result)
    np.testing.assert_array_equal(coneflat.repack(result, first.tolist()).uv, result.uv)


def test_up_and_blocks_are_kept():
    mesh = shapes.join(*[(points + 3 * i, faces) for i, (points, faces) in enumerate([shapes.sphere(2)] * 3)])
    result = coneflat.unwrap(*mesh, up=(0, 1, 0), resolution=256, padding=4)
    changed = coneflat.repack(result, [0])
    np.testing.assert_allclose(np.angle(moves_between(result, changed).factor), 0, atol=1e-12)
    lightmap = coneflat.unwrap(*mesh, lightmap=256)
    changed = coneflat.repack(lightmap, [0])
    chart, first = charts_of(changed)
    lows = np.array(
        [changed.corner_uv[chart == number].reshape(-1, 2).min(axis=0) for number in range(len(first))]
    )
    blocks = lows[chart[0] != np.arange(len(first))] * 256 / 4
    np.testing.assert_allclose(blocks, np.round(blocks), atol=1e-6)
    assert changed.distortion.overlapping_pairs == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"pinned": [10**7]}, "there is no triangle 10000000"),
        ({"pinned": [-1]}, "there is no triangle -1"),
        ({"pinned": [0.5]}, "there is no triangle 0.5"),
        ({"moves": {0: 3}}, "must be two numbers"),
        ({"moves": {0: (1, "x")}}, "must be two numbers"),
        ({"moves": {0: (0, 1)}}, "its factor not 0"),
        ({"moves": {0: (1, float("nan"))}}, "must be finite"),
    ],
)
def test_bad_arguments_are_named(result, arguments, message):
    with pytest.raises(OptionError, match=message):
        coneflat.repack(result, **arguments)


def test_what_cannot_be_packed_is_named(result):
    chart, _ = charts_of(result)
    triangles = np.flatnonzero(chart == chart[0])[:2].tolist()
    with pytest.raises(OptionError, match="in one chart, which is moved twice"):
        coneflat.repack(result, moves=dict.fromkeys(triangles, (1, 0)))
    tiled = coneflat.unwrap(coneflat.sample_path(), charts=6, tiles=2)
    with pytest.raises(OptionError, match="cannot be moved with tiles 2"):
        coneflat.repack(tiled, [0])
    # The whole texture is in one triangle.
    middle = complex_corners(result)[0].mean()
    with pytest.raises(OptionError, match="leave no space"):
        coneflat.repack(result, moves={0: (10_000, 0.5 + 0.5j - 10_000 * middle)})
