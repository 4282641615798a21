"""Several textures of the interface of xatlas: as many as a density needs, and images of each."""

from __future__ import annotations

import tracemalloc
from contextlib import nullcontext

import numpy as np
import pytest
import shapes
from scipy.spatial import cKDTree

import coneflat
import coneflat.xatlas as ours
from coneflat import errors
from coneflat.apps.xatlas import arrays as xatlas_arrays
from coneflat.textures import fitting, soup

NONE = 2**32 - 1
STEPS = np.linspace(0, 1, 9)[:-1, None]


def scattered(count, seed=0):
    """Return triangles of similar sizes, each with its own vertices."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 1, 3)) * 10 + rng.normal(size=(count, 3, 3))
    return points.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def generated(meshes, **options):
    """Return the atlas of meshes."""
    atlas = ours.Atlas()
    for vertices, faces in meshes:
        atlas.add_mesh(vertices, faces)
    atlas.generate(pack_options=ours.PackOptions(**options))
    return atlas


def areas(corners):
    """Return the areas of (m, 3, d) triangles."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    squares = (first**2).sum(1) * (second**2).sum(1) - (first * second).sum(1) ** 2
    return np.sqrt(np.maximum(squares, 0)) / 2


MESHES = {
    "a soup": ([scattered(60)], 12.0),
    "two meshes": ([shapes.torus(32, 16), scattered(30)], 14.0),
    "one chart, which is cut": ([shapes.sphere(3)], 60.0),
    "a sheet": ([shapes.hill(20, 20)], 200.0),
}


@pytest.fixture(scope="module", params=MESHES)
def case(request):
    meshes, density = MESHES[request.param]
    return meshes, density, generated(meshes, resolution=128, padding=3, texels_per_unit=density)


class TestLaws:
    def test_the_density_is_reached_in_textures_of_the_resolution(self, case):
        meshes, density, atlas = case
        assert (atlas.width, atlas.height, atlas.notes) == (128, 128, ())
        assert atlas.atlas_count > 1
        assert atlas.texels_per_unit >= density
        on_model = sum(areas(vertices[faces]).sum() for vertices, faces in meshes)
        in_plane = sum(
            areas(uvs[faces].astype(float)).sum() for _, faces, uvs in map(atlas.get_mesh, range(len(meshes)))
        )
        assert 128 * np.sqrt(in_plane / on_model) == pytest.approx(atlas.texels_per_unit, rel=0.02)

    def test_textures_are_few(self, case):
        meshes, density, atlas = case
        area = sum(areas(vertices[faces]).sum() for vertices, faces in meshes) * density**2
        assert area / 128**2 < atlas.atlas_count < 4 * area / 128**2 + 2

    def test_each_chart_is_in_one_texture_and_far_from_those_of_its_texture(self, case):
        meshes, _, atlas = case
        rims: dict = {}
        for i in range(len(meshes)):
            _, faces, uvs = atlas[i]
            textures, charts = atlas.get_mesh_vertex_assignment(i)
            assert (textures[faces] == textures[faces[:, :1]]).all()
            assert (charts[faces] == charts[faces[:, :1]]).all()
            texels = uvs[faces].astype(float) * 128
            assert min(texels.min(), 128 - texels.max()) >= 3 - 1e-3
            for chart in np.unique(charts):
                (texture,) = np.unique(textures[charts == chart])
                sides = texels[charts[faces[:, 0]] == chart]
                points = (1 - STEPS) * sides.reshape(-1, 1, 2) + STEPS * np.roll(sides, -1, 1).reshape(
                    -1, 1, 2
                )
                rims.setdefault(int(texture), []).append(points.reshape(-1, 2))
        assert sorted(rims) == list(range(atlas.atlas_count))
        for of_texture in rims.values():
            for k, rim in enumerate(of_texture[:-1]):
                assert cKDTree(np.concatenate(of_texture[k + 1 :])).query(rim)[0].min() >= 3 - 1e-3

    def test_no_triangles_of_a_texture_overlap(self, case):
        meshes, _, atlas = case
        for texture in range(atlas.atlas_count):
            corners = [
                uvs[faces[textures[faces[:, 0]] == texture]].astype(float)
                for (_, faces, uvs), (textures, _) in (
                    (atlas[i], atlas.get_mesh_vertex_assignment(i)) for i in range(len(meshes))
                )
            ]
            corner_uv = np.concatenate(corners)
            flat = np.pad(corner_uv.reshape(-1, 2), ((0, 0), (0, 1)))
            measured = coneflat.measure_uv(flat, np.arange(len(flat)).reshape(-1, 3), corner_uv).report()
            assert (measured["overlapping_pairs"], measured["flipped"]) == (0, 0)
            assert atlas.get_utilization(texture) == pytest.approx(areas(corner_uv).sum(), rel=1e-4)

    def test_charts_are_those_of_the_vertices(self, case):
        meshes, _, atlas = case
        assert sum(atlas.get_mesh_chart_count(i) for i in range(len(meshes))) == atlas.chart_count
        for i, (_, faces) in enumerate(meshes):
            textures, charts = atlas.get_mesh_vertex_assignment(i)
            listed = [atlas.get_mesh_chart(i, k) for k in range(atlas.get_mesh_chart_count(i))]
            assert np.array_equal(
                np.sort(np.concatenate([chart.faces for chart in listed])), np.arange(len(faces))
            )
            corners = atlas[i][1]
            for chart in listed:
                assert len(np.unique(charts[corners[chart.faces]])) == 1
                assert set(textures[corners[chart.faces]].ravel()) == {chart.atlas_index}


class TestXatlas:
    def test_types_and_indices_are_those_of_xatlas(self):
        theirs = pytest.importorskip("xatlas")
        vertices, faces = shapes.sphere(2)
        faces = np.concatenate([faces, [[0, 0, 1]]])
        outputs = []
        for module in (theirs, ours):
            atlas = module.Atlas()
            for _ in range(2):
                atlas.add_mesh(vertices.astype(np.float32), faces.astype(np.uint32))
            options = module.PackOptions()
            options.resolution, options.texels_per_unit = 128, 30.0
            if module is ours:
                with pytest.warns(coneflat.GuaranteeWarning, match="without area"):
                    atlas.generate(pack_options=options)
            else:
                atlas.generate(pack_options=options)
            assert (atlas.width, atlas.height) == (128, 128)
            outputs.append([atlas.get_mesh_vertex_assignment(i) for i in range(2)])
            textures, charts = (np.concatenate(arrays) for arrays in zip(*outputs[-1], strict=True))
            assert set(textures) == {*range(atlas.atlas_count), NONE}
            assert set(charts) == {*range(atlas.chart_count), NONE}
            for wrong in (
                lambda atlas=atlas: atlas.get_mesh_vertex_assignment(2),
                lambda atlas=atlas: atlas.get_mesh_chart(0, 10**6),
                lambda atlas=atlas: atlas.get_mesh_chart_count(2),
                lambda atlas=atlas: atlas.get_utilization(atlas.atlas_count),
            ):
                with pytest.raises(IndexError):
                    wrong()
        for expected, arrays in zip(*outputs, strict=True):
            assert [array.dtype for array in expected] == [array.dtype for array in arrays]


class TestLimits:
    def test_charts_that_cannot_be_cut_are_as_dense_as_they_can_be(self):
        triangle = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])
        with pytest.warns(
            coneflat.GuaranteeWarning, match=r"texels per unit of length instead of 500, because charts"
        ):
            atlas = generated([triangle], resolution=128, padding=2, texels_per_unit=500.0)
        assert atlas.atlas_count == 1
        # The triangle fills the texture.
        assert 120 <= atlas.texels_per_unit < 180

    @pytest.mark.parametrize(
        ("density", "has_blocks"),
        [(59.0, False), (200.0, False), (55.0, True), pytest.param(58.0, True, marks=pytest.mark.slow)],
    )
    def test_charts_are_not_cut_where_this_permits_no_larger_density(self, density, has_blocks):
        # A side of the cube fills a texture of 64 texels without its padding, and in whole blocks.
        largest = 14 * 4 if has_blocks else 60
        with pytest.warns(coneflat.GuaranteeWarning) if density > largest else nullcontext():
            atlas = generated(
                [shapes.box(1, (1.0, 1.0, 1.0))],
                resolution=64,
                padding=2,
                texels_per_unit=density,
                blockAlign=has_blocks,
            )
        assert (atlas.atlas_count, atlas.chart_count) == (6, 6)
        assert 0.99 * min(density, largest) <= atlas.texels_per_unit <= largest * (1 + 1e-9)

    def test_faces_that_are_packed_separately_begin_at_corners_of_blocks(self, monkeypatch):
        def fails(*arguments, **options):
            raise errors.ConvergenceError("no metric")

        for name in ("unwrap", "unwrap_in_textures"):
            monkeypatch.setattr(soup, name, fails)
        for density in (0.0, 5.0, 40.0):
            with pytest.warns(coneflat.GuaranteeWarning, match="Each face is a chart of its own"):
                atlas = generated([scattered(20)], resolution=128, blockAlign=True, texels_per_unit=density)
            _, faces, uv = atlas[0]
            blocks = (uv[faces] * 128).min(axis=1) / 4
            assert np.abs(blocks - np.round(blocks)).max() < 1e-4

    @pytest.mark.parametrize("density", [5.0, 40.0])
    def test_faces_that_are_packed_separately(self, monkeypatch, density):
        def fails(*arguments, **options):
            raise errors.ConvergenceError("no metric")

        monkeypatch.setattr(soup, "unwrap_in_textures", fails)
        with pytest.warns(coneflat.GuaranteeWarning, match="Each face is a chart of its own"):
            atlas = generated([scattered(40)], resolution=256, padding=2, texels_per_unit=density)
        assert atlas.texels_per_unit >= density
        assert atlas.chart_count == 40
        assert (atlas.atlas_count > 1) == (density > 5)

    @pytest.mark.parametrize("density", [-1.0, float("nan"), float("inf"), "many"])
    def test_invalid_densities_are_named(self, density):
        with pytest.raises(errors.OptionError, match="texels_per_unit"):
            generated([scattered(2)], resolution=128, texels_per_unit=density)

    def test_a_density_that_needs_too_many_textures_is_refused_with_the_possible_one(self):
        for density in (1e4, 1e300):
            with pytest.raises(
                errors.OptionError, match=r"texels_per_unit is too large: 1,000 textures of 128 .* have"
            ):
                generated([shapes.sphere(2)], resolution=128, texels_per_unit=density)

    def test_the_scale_of_the_model_does_not_matter(self):
        vertices, faces = scattered(40)
        first, second = (
            generated([(factor * vertices, faces)], resolution=128, texels_per_unit=12.0 / factor)
            for factor in (1.0, 1024.0)
        )
        assert first.atlas_count == second.atlas_count
        np.testing.assert_allclose(first[0][2], second[0][2], atol=1e-6)

    def test_pieces_fit_in_a_square(self):
        result = coneflat.unwrap(*shapes.hill(20, 20))
        points = result.uv / result.uv_scale
        assert fitting.square_side(points) == pytest.approx(np.ptp(points, axis=0).max(), rel=0.1)


class TestImages:
    def test_each_texture_has_an_image_of_its_charts(self):
        atlas = generated([scattered(60)], resolution=128, texels_per_unit=12.0, create_image=True)
        assert atlas.atlas_count > 1
        assert np.array_equal(atlas.chart_image, atlas.get_chart_image(0))
        for texture in range(atlas.atlas_count):
            image = atlas.get_chart_image(texture)
            assert (image.shape, image.dtype) == ((128, 128, 3), np.uint8)
            assert image.any(axis=2).mean() == pytest.approx(atlas.get_utilization(texture), abs=0.03)
        with pytest.raises(IndexError):
            atlas.get_chart_image(atlas.atlas_count)

    def test_one_image_is_in_memory_at_most(self):
        tracemalloc.start()
        atlas = generated(
            [scattered(60)], resolution=1024, padding=2, texels_per_unit=200.0, create_image=True
        )
        assert atlas.atlas_count > 4
        before = tracemalloc.get_traced_memory()[0]
        for texture in range(atlas.atlas_count):
            image = atlas.get_chart_image(texture)
            size = image.nbytes
            del image
            assert tracemalloc.get_traced_memory()[0] - before < 1.5 * size
        tracemalloc.stop()

    def test_an_image_that_is_too_large_is_refused_with_its_size(self, monkeypatch):
        monkeypatch.setattr(xatlas_arrays, "MAX_IMAGE_SIDE", 64)
        atlas = generated([shapes.box(1)], resolution=128, create_image=True)
        with pytest.raises(errors.TooLargeError, match="an image of 128 texels along a side takes 0.0 GB"):
            _ = atlas.chart_image

    def test_aligned_blocks(self):
        atlas = generated([scattered(20)], resolution=256, padding=2, blockAlign=True)
        _, charts = atlas.get_mesh_vertex_assignment(0)
        for chart in range(atlas.chart_count):
            low = atlas[0][2][charts == chart].min(axis=0) * 256 / 4
            assert np.abs(low - np.round(low)).max() < 1e-3
