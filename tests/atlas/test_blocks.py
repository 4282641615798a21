"""Charts that begin at the corners of blocks of texels."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from coneflat.atlas import pack_charts
from coneflat.atlas.grid import Blocks
from coneflat.errors import OptionError

STEPS = np.linspace(0, 1, 17)[:-1, None]


def triangles(count, seed=0):
    """Return (count, 3, 2) counter-clockwise triangles of various sizes."""
    rng = np.random.default_rng(seed)
    corners = rng.random((count, 3, 2)) * rng.uniform(0.3, 3.0, (count, 1, 1))
    first, second = (corners[:, i] - corners[:, 0] for i in (1, 2))
    is_mirrored = first[:, 0] * second[:, 1] < first[:, 1] * second[:, 0]
    corners[is_mirrored] = corners[is_mirrored][:, ::-1]
    return corners


def rims(corners):
    """Return points along the sides of each triangle."""
    return [
        np.concatenate([(1 - STEPS) * a + STEPS * b for a, b in zip(t, t[[1, 2, 0]], strict=True)])
        for t in corners
    ]


def from_multiples(texels, size):
    """Return how far numbers are from the nearest multiples of a size."""
    return np.abs(texels - size * np.round(texels / size)).max()


@pytest.mark.parametrize("count", [1, 2, 9, 40])
@pytest.mark.parametrize(
    ("resolution", "padding", "block_size"),
    [(1024, 8, 4), (256, 6, 4), (250, 3.5, 4), (4096, 2, 8), (8192, 5, 4), (255, 0, 16), (64, 2, 2)],
)
def test_boxes_begin_at_corners_of_blocks_and_keep_the_padding(count, resolution, padding, block_size):
    corners, charts = triangles(count), np.arange(count)
    options = {"resolution": resolution, "padding": padding}
    packed = pack_charts(corners, charts, **options, block_size=block_size)
    texels = packed.corner_uv * resolution
    assert from_multiples(texels.min(axis=1), block_size) < 1e-6
    assert min(texels.min(), resolution - texels.max()) >= padding - 1e-6
    outlines = rims(texels)
    for i, outline in enumerate(outlines):
        neighbours = np.concatenate([*outlines[:i], *outlines[i + 1 :], np.full((1, 2), 10.0**9)])
        assert cKDTree(neighbours).query(outline)[0].min() >= padding - 1e-6
    sides = np.linalg.norm(np.roll(corners, 1, axis=1) - corners, axis=2)
    scaled = np.linalg.norm(np.roll(packed.corner_uv, 1, axis=1) - packed.corner_uv, axis=2)
    np.testing.assert_allclose(scaled, packed.scale * sides, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("rotate", ["any", "quarter", "none", 8])
@pytest.mark.parametrize("tiles", [1, 3])
def test_blocks_of_several_textures_at_any_rotation(rotate, tiles):
    packed = pack_charts(
        triangles(12), np.arange(12), resolution=512, padding=6, rotate=rotate, tiles=tiles, block_size=4
    )
    assert len(np.unique(packed.tile_of_chart)) == tiles
    assert from_multiples(packed.corner_uv.min(axis=1) * 512, 4) < 1e-6


def test_charts_share_no_block_with_a_padding_of_its_diagonal():
    resolution, size = 256, 4
    packed = pack_charts(triangles(30), np.arange(30), resolution=resolution, padding=6, block_size=size)
    owners: dict = {}
    for chart, outline in enumerate(rims(packed.corner_uv * resolution)):
        for block in {tuple(block) for block in np.floor(outline / size).astype(int).tolist()}:
            owners.setdefault(block, set()).add(chart)
    assert max(map(len, owners.values())) == 1


@pytest.mark.parametrize(("resolution", "share"), [(256, 0.85), (1024, 0.92), (4096, 0.95)])
def test_blocks_take_little_space(resolution, share):
    options = {"resolution": resolution, "padding": 6}
    areas = [
        pack_charts(triangles(20), np.arange(20), **options, block_size=size).efficiency for size in (1, 4)
    ]
    assert areas[1] > share * areas[0]


def test_charts_without_extent_begin_at_a_corner():
    for count in (1, 3):
        packed = pack_charts(
            np.zeros((count, 3, 2)), np.arange(count), resolution=64, padding=4, block_size=4
        )
        assert np.isfinite(packed.corner_uv).all()
        assert from_multiples(packed.corner_uv * 64, 4) < 1e-6


@pytest.mark.parametrize("count", [1, 7, 250, 399, 400, 401, 1000, 16384])
def test_cells_divide_blocks_or_blocks_divide_cells(count):
    blocks = Blocks.of(count, 400)
    assert blocks.across >= 400
    assert count * blocks.step == pytest.approx(blocks.across * (count // 400 if count >= 400 else 1))
    assert blocks.step == 1 or blocks.across / blocks.step == count


@pytest.mark.parametrize(("block_size", "message"), [(0, "block_size must be"), (2.5, "block_size must be")])
def test_invalid_blocks_are_refused(block_size, message):
    with pytest.raises(OptionError, match=message):
        pack_charts(triangles(2), np.arange(2), block_size=block_size)


def test_blocks_larger_than_the_texture_leave_no_space():
    with pytest.raises(OptionError, match="leave no space"):
        pack_charts(triangles(2), np.arange(2), resolution=32, padding=2, block_size=64)


@pytest.mark.parametrize(
    ("options", "count"),
    [
        ({"resolution": 100, "padding": 2, "block_size": 256}, 1),
        ({"resolution": 16, "padding": 3.9, "block_size": 8}, 3),
        ({"resolution": 256, "padding": 0, "block_size": 256}, 3),
        ({"resolution": 256, "padding": 0, "block_size": 200}, 3),
    ],
)
def test_errors_name_the_blocks_that_leave_no_space(options, count):
    charts = triangles(count), np.arange(count)
    with pytest.raises(OptionError, match=r"blocks.* space .*use a smaller block_size"):
        pack_charts(*charts, **options)
    pack_charts(*charts, **options | {"block_size": 1})


def test_errors_do_not_name_blocks_where_the_padding_alone_leaves_no_space():
    with pytest.raises(OptionError, match="leave no space") as caught:
        pack_charts(triangles(2), np.arange(2), resolution=32, padding=16, block_size=4)
    assert "block" not in str(caught.value)
