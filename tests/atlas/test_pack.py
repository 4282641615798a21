"""Charts in a texture."""

from __future__ import annotations

import numpy as np
import pytest
from flat_charts import as_complex, letter_l, star

import coneflat
from coneflat.atlas import pack_charts
from coneflat.atlas.charts import read_charts
from coneflat.errors import ArrayShapeError, NonFiniteError, OptionError


def cross(u, v):
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def signed_areas(corners):
    return cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2


def ring(size: float, hole: float = 0.7, around: int = 24):
    angle = 2 * np.pi * np.arange(around + 1) / around
    inner, outer = (r * size * np.column_stack([np.cos(angle), np.sin(angle)]) for r in (hole, 1.0))
    lower_triangles = np.stack([inner[:-1], outer[:-1], outer[1:]], axis=1)
    return np.concatenate([lower_triangles, np.stack([inner[:-1], outer[1:], inner[1:]], axis=1)])


def charts_of(*parts):
    """Several charts as triangle corners, and the chart of each triangle."""
    return np.concatenate(parts), np.repeat(np.arange(len(parts)), [len(part) for part in parts])


def a_few():
    stars = star(5, 0.4, 1.0), star(7, 0.2, 0.7, 1), star(3, 0.6, 0.5, 2)
    return charts_of(letter_l(0.3), *stars, letter_l(0.6) + 5, ring(0.8), letter_l(0.2))


def without_symmetry():
    return charts_of(*(star(3 + c % 4, 0.5, 1 + c % 3, c) for c in range(7)))


def distance(first_chart, second_chart):
    """The distance between two sets of triangles; 0 if any of them overlap."""
    pairs = np.repeat(first_chart, len(second_chart), axis=0), np.tile(second_chart, (len(first_chart), 1, 1))
    apart, best = np.zeros(len(pairs[0]), dtype=bool), np.inf
    for first, second in (pairs, pairs[::-1]):
        way = np.roll(first, -1, axis=1) - first
        offset = second[:, None] - first[:, :, None]  # of each corner of one from each side of the other
        apart |= (cross(way[:, :, None], offset) <= 0).all(axis=2).any(axis=1)
        along = np.clip((offset * way[:, :, None]).sum(-1) / (way**2).sum(-1)[:, :, None], 0, 1)
        best = min(best, np.linalg.norm(offset - along[..., None] * way[:, :, None], axis=-1).min())
    return best if apart.all() else 0.0


def least_distance(corners, chart):
    parts = [corners[chart == c] for c in range(chart.max() + 1)]
    return min(distance(a, b) for i, a in enumerate(parts) for b in parts[:i])


def similarity(before, after):
    """The factor of the similarity that takes one set of points to the other, and what it leaves, relatively."""
    p, q = (as_complex(corners).ravel() - as_complex(corners).mean() for corners in (before, after))
    factor = np.vdot(p, q) / np.vdot(p, p)
    return factor, np.abs(q - factor * p).max() / np.abs(q).max()


@pytest.mark.parametrize("rotate", ["any", "quarter", "none"])
@pytest.mark.parametrize(("resolution", "padding"), [(1024, 2), (256, 7.5), (4096, 0)])
def test_charts_keep_their_distance(rotate, resolution, padding):
    corners, chart = a_few()
    packed = pack_charts(corners, chart, resolution=resolution, padding=padding, rotate=rotate)
    texels = packed.corner_uv * resolution
    assert texels.min() >= padding - 1e-9
    assert texels.max() <= resolution - padding + 1e-9
    if padding:
        assert least_distance(texels, chart) >= padding * (1 - 1e-9)
    else:
        # Charts may touch then: those a hair smaller must not.
        middle = np.stack([texels[chart == c].mean(axis=(0, 1)) for c in range(7)])[chart][:, None]
        assert least_distance(middle + (texels - middle) * (1 - 1e-9), chart) > 0


def test_the_distance_of_these_tests_sees_overlaps_and_gaps():
    square = letter_l(1.0)[:2]
    assert distance(square, square + np.array([1.25, 0])) == pytest.approx(0.25)
    assert distance(square, square + np.array([4, 5])) == pytest.approx(5)
    assert distance(square, square + np.array([0.9, 0.9])) == 0
    assert distance(5 * square - 2, square) == 0  # one inside the other


@pytest.mark.parametrize("rotate", ["any", "quarter", "none"])
def test_charts_are_turned_moved_and_scaled_alike_and_nothing_else(rotate):
    corners, chart = a_few()
    packed = pack_charts(corners, chart, rotate=rotate)
    for c in range(7):
        factor, residual = similarity(corners[chart == c], packed.corner_uv[chart == c])
        assert residual < 1e-12
        assert abs(factor) == pytest.approx(packed.scale, rel=1e-12)
        assert abs(np.exp(1j * packed.angle_of_chart[c]) - factor / abs(factor)) < 1e-12
    if rotate == "none":
        np.testing.assert_array_equal(packed.angle_of_chart, 0)
    assert packed.efficiency == pytest.approx(signed_areas(packed.corner_uv).sum(), rel=1e-12)


def test_charts_without_area_are_packed():
    for corners in (np.zeros((4, 3, 2)), np.linspace(0, 1, 12).repeat(2).reshape(4, 3, 2)):
        for chart in (None, np.arange(4)):
            packed = pack_charts(corners, chart)
            assert np.isfinite(packed.corner_uv).all()
            assert packed.corner_uv.min() >= 0
            assert packed.corner_uv.max() <= 1
            assert packed.efficiency < 1e-15


def test_small_charts_go_into_holes():
    corners, chart = charts_of(ring(1.0, 0.8, 64), *(letter_l(0.25) for _ in range(4)))
    packed = pack_charts(corners, chart)
    middle = as_complex(packed.corner_uv[chart == 0]).mean()
    inside = [np.abs(as_complex(packed.corner_uv[chart == c]) - middle).max() < 0.5 for c in range(1, 5)]
    assert all(inside)


def bars(*boxes):
    """Triangles of rectangles, each given by its corners (left, bottom, right, top)."""
    low = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], dtype=float)
    return np.concatenate([low * [r - x, t - y] + [x, y] for x, y, r, t in boxes])


def test_a_chart_may_be_forced_to_the_right():
    """A foot that does not reach the left border, below a block that does: neither may lie lowest and leftmost."""
    corners, chart = charts_of(bars((1, 0, 3, 1), (3, 0, 4, 4)), bars((0, 0, 2.98, 2.98)))
    assert pack_charts(corners, chart, rotate="none", padding=0).efficiency > 0.9


def test_the_longest_chart_ends_where_the_texture_does():
    """Not where a cell of a grid ends: beside it there is room for the others."""
    corners, chart = charts_of(bars((0, 0, np.pi, 0.3)), bars((0, 0, 0.4, 0.5)), star(5, 0.5, 0.3))
    for rotate in ("quarter", "none"):
        packed = pack_charts(corners, chart, rotate=rotate, padding=3)
        assert packed.scale == pytest.approx((1 - 6 / 1024) / np.pi, rel=1e-12)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_one_chart_fills_the_smallest_square(seed):
    corners = star(9, 0.3, 1.0, seed)
    points = as_complex(corners).ravel()
    angles = np.linspace(0, np.pi / 2, 20001)
    turned = points * np.exp(1j * angles)[:, None]
    side = np.maximum(np.ptp(turned.real, axis=1), np.ptp(turned.imag, axis=1)).min()
    packed = pack_charts(corners, padding=0)
    assert side * (1 - 1e-4) < 1 / packed.scale <= side * (1 + 1e-12)
    assert np.ptp(packed.corner_uv, axis=(0, 1)).max() == pytest.approx(1, abs=1e-12)


def test_a_square_on_its_corner_and_a_triangle_alone():
    square = letter_l(1.0)[:2]
    turned = square @ np.array([[1, 1], [-1, 1]]) / np.sqrt(2)
    assert pack_charts(turned, padding=0).efficiency == pytest.approx(1, rel=1e-12)
    # The largest equilateral triangle in a square has sides of sqrt(6) - sqrt(2).
    triangle = np.array([[[0, 0], [1, 0], [0.5, 0.75**0.5]]])
    packed = pack_charts(triangle, resolution=64, padding=0)
    assert packed.scale == pytest.approx(6**0.5 - 2**0.5, rel=1e-12)


@pytest.mark.slow
def test_tiles():
    corners, chart = charts_of(*(star(5, 0.5, 1.0, seed) for seed in range(24)))
    one_tile, twelve_tiles = pack_charts(corners, chart), pack_charts(corners, chart, tiles=12)
    assert twelve_tiles.scale > 2.5 * one_tile.scale
    assert set(twelve_tiles.tile_of_chart.tolist()) == set(range(12))
    tile = twelve_tiles.tile_of_chart[chart]
    inside = twelve_tiles.corner_uv - np.stack([tile % 10, tile // 10], axis=1)[:, None]
    assert inside.min() >= 2 / 1024 - 1e-12
    assert inside.max() <= 1 - 2 / 1024 + 1e-12
    assert least_distance(twelve_tiles.corner_uv * 1024, chart) >= 2 * (1 - 1e-9)
    assert twelve_tiles.efficiency == pytest.approx(
        signed_areas(twelve_tiles.corner_uv).sum() / 12, rel=1e-12
    )


def test_more_tiles_than_charts():
    corners, chart = charts_of(letter_l(1.0), star(5, 0.5, 0.5))
    packed = pack_charts(corners, chart, tiles=7)
    assert sorted(packed.tile_of_chart.tolist()) == [0, 1]


@pytest.mark.slow
def test_many_charts():
    rng = np.random.default_rng(5)
    corners = rng.random((600, 3, 2)) * rng.uniform(0.2, 1.0, (600, 1, 1))
    corners = np.where((signed_areas(corners) < 0)[:, None, None], corners[:, ::-1], corners)
    packed = pack_charts(corners, np.arange(600), padding=1)
    assert packed.efficiency > 0.4
    # No texel belongs to two.
    points = (np.stack(np.meshgrid(*[np.arange(1024)] * 2), axis=-1).reshape(-1, 2) + 0.5) / 1024
    count = np.zeros(len(points), dtype=int).reshape(1024, 1024)
    for triangle in packed.corner_uv:
        low, high = (
            np.floor(triangle.min(axis=0) * 1024).astype(int),
            np.ceil(triangle.max(axis=0) * 1024).astype(int),
        )
        cells = np.s_[low[1] : high[1], low[0] : high[0]]
        cell_points = points.reshape(1024, 1024, 2)[cells]
        sides = np.roll(triangle, -1, axis=0) - triangle
        count[cells] += np.all(
            [cross(side, cell_points - start) > 0 for side, start in zip(sides, triangle, strict=True)],
            axis=0,
        )
    assert count.max() == 1
    assert count.sum() / 1024**2 == pytest.approx(packed.efficiency, rel=0.01)


@pytest.mark.slow
def test_packing_is_deterministic_and_independent_of_the_order_of_triangles():
    corners, chart = without_symmetry()
    packed = pack_charts(corners, chart)
    np.testing.assert_array_equal(packed.corner_uv, pack_charts(corners, chart).corner_uv)
    order = np.random.default_rng(1).permutation(len(chart))
    shuffled = pack_charts(corners[order][:, [1, 2, 0]], chart[order])
    np.testing.assert_allclose(shuffled.corner_uv[:, [2, 0, 1]], packed.corner_uv[order], atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1e-6, 1.0, 1e6])
def test_packing_is_invariant_under_rotation_and_scale(factor):
    corners, chart = without_symmetry()
    turn = factor * np.array([[0.6, 0.8], [-0.8, 0.6]])
    packed, again = pack_charts(corners, chart), pack_charts(corners @ turn + 3 * factor, chart)
    assert again.scale * factor == pytest.approx(packed.scale, rel=1e-9)
    np.testing.assert_allclose(again.corner_uv, packed.corner_uv, atol=1e-9)


def test_the_winding_of_an_outline_is_what_triangles_cover():
    """Of a strip that lies over itself, the sides between its triangles are no outline."""
    angle = np.linspace(0, 2.5 * np.pi, 60)
    inner, outer = np.exp(1j * angle), 1.5 * np.exp(1j * angle)
    lower_triangles = np.stack([inner[:-1], outer[:-1], outer[1:]], axis=1)
    corners = np.concatenate([lower_triangles, np.stack([inner[:-1], outer[1:], inner[1:]], axis=1)])
    charts = read_charts(np.stack([corners.real, corners.imag], axis=2), None)
    outlines = charts.outlines()
    assert len(outlines.sides) == 2 * 59 + 2
    start, end = outlines.sides.T
    assert (np.conj(start) * end).imag.sum() / 2 == pytest.approx(charts.areas.sum(), rel=1e-12)
    # Turned over, a triangle still covers what it does.
    corners[10] = corners[10, ::-1]
    charts = read_charts(np.stack([corners.real, corners.imag], axis=2), None)
    start, end = charts.outlines().sides.T
    assert (np.conj(start) * end).imag.sum() / 2 == pytest.approx(np.abs(charts.areas).sum(), rel=1e-12)


def test_a_flattening(shared):
    result = coneflat.flatten(shared("spot.obj"))
    middle = result.corner_uv.mean(axis=1)
    chart = (middle[:, 0] > 0.5) + 2 * (middle[:, 1] > 0.4)
    packed = pack_charts(result.corner_uv, chart)
    assert packed.efficiency > 0.6
    for c in range(4):
        _, residual = similarity(result.corner_uv[chart == c], packed.corner_uv[chart == c])
        assert residual < 1e-12


def test_bad_input():
    corners, chart = a_few()
    for uv, error, said in (
        (corners[..., 0], ArrayShapeError, r"\(\d+, 3\)"),
        (corners[:0], ArrayShapeError, r"\(0, 3, 2\)"),
        (np.where(chart[:, None, None] == 2, np.nan, corners), NonFiniteError, "14 triangles"),
        (
            np.where(chart[:, None, None] == 3, corners[..., ::-1], corners),
            OptionError,
            "1 of 7 charts .* 3 with area -",
        ),
    ):
        with pytest.raises(error, match=said):
            pack_charts(uv, chart if len(uv) else [])
    for labels, error, said in (
        (chart[1:], ArrayShapeError, "must have one integer"),
        (chart * 1.0, ArrayShapeError, "float64"),
        (chart * 2, OptionError, "7 different numbers from 0 to 12"),
        (chart - 1, OptionError, "from -1 to 5"),
    ):
        with pytest.raises(error, match=said):
            pack_charts(corners, labels)
    for name, argument in (
        ("corner_uv", ("charts", chart)),
        ("chart_of_triangle", (corners, [[0], [1, 2]])),
    ):
        with pytest.raises(ArrayShapeError, match=f"{name} must be an array of numbers") as caught:
            pack_charts(*argument)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"resolution": 0}, "resolution must be .* got 0"),
        ({"resolution": 10.5}, "resolution must be .* got 10.5"),
        ({"padding": -1}, "padding must be .* got -1"),
        ({"padding": "2"}, "padding must be .* got '2'"),
        ({"padding": float("nan")}, "padding must be .* got nan"),
        ({"tiles": 0}, "tiles must be .* got 0"),
        ({"tiles": True}, "tiles must be .* got True"),
        ({"rotate": "free"}, "'free': choose from any, quarter, none"),
        ({"padding": 512}, "512 texels of padding leave no space in a texture of 1024"),
        pytest.param({"padding": 370}, "a gap of .* % .* between 7 charts", marks=pytest.mark.slow),
    ],
)
def test_bad_options(options, said):
    corners, chart = a_few()
    with pytest.raises(OptionError, match=said):
        pack_charts(corners, chart, **options)


@pytest.mark.slow
def test_a_gap_that_leaves_no_space_is_refused_soon():
    square = np.array([[[0.0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]])
    corners = np.concatenate([square + 2 * i for i in range(13)])
    with pytest.raises(OptionError, match="leaves no space"):
        pack_charts(corners, np.arange(13).repeat(2), resolution=1, padding=0.2)
