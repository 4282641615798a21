"""The resolution for a texel density: it suffices, and four texels less do not."""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np
import pytest
import shapes

from coneflat import errors, unwrap
from coneflat.errors import OptionError
from coneflat.textures.density import MAX_PACKINGS, expected_resolution, least_resolution
from coneflat.textures.options import MAX_RESOLUTION


class Packer:
    """Squares of one side in rows with padding, and a packing that is up to some per cent worse, at random."""

    def __init__(self, count=1, side=1.0, padding=2.0, noise=0.0):
        self.count, self.side, self.padding, self.noise, self.attempts = count, side, padding, noise, []

    def density(self, resolution):
        rows = np.ceil(np.sqrt(self.count))
        free = resolution - self.padding * (rows + 1)
        worse = 1 + self.noise * np.random.default_rng(resolution).random()
        return max(free, 0.0) / rows / self.side / worse

    def scale(self, resolution):
        self.attempts.append(resolution)
        if not (density := self.density(resolution)):
            raise OptionError("the padding leaves no space")
        return density / resolution


@pytest.mark.parametrize("start", [16, 200, 3000, MAX_RESOLUTION])
@pytest.mark.parametrize(
    ("count", "padding", "density"),
    [(1, 2.0, 300.0), (1, 0.0, 0.3), (300, 16.0, 2.0), (300, 64.0, 1e-9), (50, 2.5, 7000.0)],
)
def test_the_resolution_is_the_smallest_multiple_of_four_if_the_density_rises(count, padding, density, start):
    packer = Packer(count, 1.0, padding)
    resolution = least_resolution(density, padding, start, packer.scale)
    assert resolution % 4 == 0
    assert resolution > 4 * padding
    below = resolution - 4
    assert packer.density(resolution) >= density
    assert below <= 4 * padding or packer.density(below) < density
    assert len(packer.attempts) == len(set(packer.attempts)) <= MAX_PACKINGS


@pytest.mark.parametrize("noise", [0.01, 0.1, 0.5])
@pytest.mark.parametrize("density", [3.0, 40.0, 900.0])
def test_four_texels_less_do_not_suffice_where_packings_differ(density, noise):
    for padding in (0.0, 2.0, 16.0):
        packer = Packer(30, 1.0, padding, noise)
        resolution = least_resolution(density, padding, 128, packer.scale)
        assert packer.density(resolution) >= density
        assert all(packer.density(smaller) < density for smaller in packer.attempts if smaller < resolution)
        assert len(packer.attempts) <= MAX_PACKINGS
        if len(packer.attempts) < MAX_PACKINGS and resolution - 4 > 4 * padding:
            assert packer.density(resolution - 4) < density


def test_the_largest_texture_is_tried_before_a_density_is_refused():
    packer = Packer(9, 1.0, 4.0)
    largest_density = packer.density(MAX_RESOLUTION)
    assert least_resolution(largest_density, 4.0, 64, packer.scale) == MAX_RESOLUTION
    with pytest.raises(OptionError, match=r"at most 65,536 texels per side have about 2.18e\+04 texels"):
        least_resolution(1.01 * largest_density, 4.0, 64, packer.scale)


def test_no_texture_that_charts_cover_entirely_is_refused_in_advance():
    areas = np.full(16, 0.25)
    assert expected_resolution(MAX_RESOLUTION / 2, areas, 0.0, 1) == MAX_RESOLUTION
    with pytest.raises(OptionError, match="too large"):
        expected_resolution(1.01 * MAX_RESOLUTION, areas, 0.0, 1)
    assert expected_resolution(1e-300, areas, 0.0, 1) == 4


def separate(count):
    return np.random.default_rng(0).normal(size=(3 * count, 3)), np.arange(3 * count).reshape(-1, 3)


@pytest.mark.parametrize("density", [1.0, 30.0])
def test_separate_triangles_with_wide_padding_get_the_least_resolution(density):
    """Four texels less are too few, or the padding leaves no space for charts."""
    mesh = separate(40)
    result = unwrap(*mesh, texel_density=density, padding=16)
    side = result.settings["resolution"]
    assert result.uv_scale * side >= density
    with pytest.raises(OptionError, match="leaves no space") if density == 1 else nullcontext():
        assert unwrap(*mesh, resolution=side - 4, padding=16).uv_scale * (side - 4) < density


@pytest.mark.slow
def test_a_texture_of_many_charts_has_a_resolution_where_one_exists():
    mesh = separate(300)
    for density in (10.0, 30.0, 100.0):
        result = unwrap(*mesh, texel_density=density, padding=16)
        assert density <= result.uv_scale * result.settings["resolution"] <= 1.1 * density


def test_a_padding_wider_than_a_quarter_of_the_default_resolution_is_possible():
    result = unwrap(*shapes.box(1), texel_density=100.0, padding=300)
    side = result.settings["resolution"]
    assert side > 1200
    assert result.uv_scale * side >= 100


def test_a_texel_density_beyond_all_textures_is_refused_with_the_possible_one():
    for density in (1e9, 1e155, 1e308):
        with pytest.raises(errors.OptionError, match=r"texel_density is too large: .* have about \d"):
            unwrap(*shapes.box(1), texel_density=density)
