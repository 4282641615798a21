"""Lightmaps: padding that suffices at half the resolution, blocks, no shared texels, the second UV set of a GLB."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest
import shapes
from command import command
from scipy.ndimage import binary_dilation

import coneflat
from coneflat.errors import OptionError
from coneflat.textures.options import LIGHTMAP_BLOCK, LIGHTMAP_PADDING

#: Samples along the side of a texel.
SAMPLES = 8


def with_two_parts():
    """Return a torus and a box beside it."""
    (vertices, faces), (corners, sides) = shapes.torus(24, 12), shapes.box(2)
    return np.concatenate([vertices, corners + np.array([5, 0, 0])]), np.concatenate(
        [faces, sides + len(vertices)]
    )


MODELS = {
    "two parts": with_two_parts,
    "sphere": lambda: shapes.sphere(2),
    "box": lambda: shapes.box(3),
    "sheet": lambda: shapes.hill(8, 7),
}


@pytest.fixture(scope="module", params=MODELS)
def model(request):
    return MODELS[request.param]()


@pytest.fixture(scope="module", params=[128, 256])
def lightmap(request, model):
    return request.param, coneflat.unwrap(*model, lightmap=request.param, packing_cuts=1.0)


def chart_of(uv_faces):
    """Return (m,) the chart of each triangle: triangles that share points are in one."""
    label = np.arange(uv_faces.max() + 1)
    while True:
        lowest = label[uv_faces].min(axis=1)
        smaller = label.copy()
        np.minimum.at(smaller, uv_faces.ravel(), np.repeat(lowest, 3))
        if np.array_equal(smaller, label):
            return np.unique(label[uv_faces[:, 0]], return_inverse=True)[1]
        label = smaller


def rasterised(triangles, side):
    """Return (side, side) True for the samples, whose centres are at multiples of 1 from 0.5, inside of triangles."""
    image = np.zeros((side, side), dtype=bool)
    for triangle in triangles:
        low = np.maximum(np.floor(triangle.min(axis=0)).astype(int), 0)
        high = np.minimum(np.ceil(triangle.max(axis=0)).astype(int), side)
        x, y = np.meshgrid(*(np.arange(a, b) + 0.5 for a, b in zip(low, high, strict=True)))
        is_inside = np.ones(x.shape, dtype=bool)
        for (x0, y0), (x1, y1) in zip(triangle, triangle[[1, 2, 0]], strict=True):
            is_inside &= (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) >= -1e-9
        image[low[1] : high[1], low[0] : high[0]] |= is_inside
    return image


def filtered_texels(samples, width):
    """Return the texels, `width` samples wide, that bilinear filtering reads at samples: with centres closer than 1."""
    reached = binary_dilation(samples, np.ones((2 * width - 1, 2 * width - 1), dtype=bool))
    count = len(samples) // width
    centres = (
        reached[width // 2 :: width, width // 2 :: width]
        | reached[width // 2 - 1 :: width, width // 2 - 1 :: width]
    )
    return centres[:count, :count]


class TestLaws:
    def test_charts_share_no_filtered_texel_at_full_and_half_resolution(self, lightmap):
        resolution, result = lightmap
        charts = chart_of(result.uv_faces)
        samples = [
            rasterised(result.corner_uv[charts == i] * resolution * SAMPLES, resolution * SAMPLES)
            for i in range(charts.max() + 1)
        ]
        assert np.sum(samples, axis=0).max() == 1
        for texel in (1, 2):
            shared = np.sum([filtered_texels(image, texel * SAMPLES) for image in samples], axis=0)
            assert shared.max() == 1, f"mip level {texel - 1}"

    def test_charts_share_no_block_and_begin_at_its_corner(self, lightmap):
        resolution, result = lightmap
        charts, texels = chart_of(result.uv_faces), result.corner_uv * resolution
        blocks = []
        for i in range(charts.max() + 1):
            corners = texels[charts == i]
            low = corners.min(axis=(0, 1)) / LIGHTMAP_BLOCK
            assert np.abs(low - np.round(low)).max() < 1e-6
            image = rasterised(corners, resolution)
            count = resolution // LIGHTMAP_BLOCK
            blocks.append(image.reshape(count, LIGHTMAP_BLOCK, count, LIGHTMAP_BLOCK).any(axis=(1, 3)))
        assert np.sum(blocks, axis=0).max() == 1

    def test_charts_are_in_the_unit_square_without_overlaps_at_one_density(self, lightmap):
        resolution, result = lightmap
        margin = LIGHTMAP_PADDING / resolution - 1e-9
        assert margin <= result.corner_uv.min() <= result.corner_uv.max() <= 1 - margin
        assert (result.distortion.overlapping_pairs, result.distortion.flipped) == (0, 0)
        charts = chart_of(result.uv_faces)
        on_model, in_plane = areas(result.vertices[result.faces]), areas(result.corner_uv)
        scales = [
            np.sqrt(in_plane[charts == i].sum() / on_model[charts == i].sum()) for i in np.unique(charts)
        ]
        assert max(scales) < 1.1 * min(scales)
        assert result.settings["resolution"] == result.settings["lightmap"] == resolution


def areas(corners):
    """Return the areas of (m, 3, d) triangles."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    squares = (first**2).sum(1) * (second**2).sum(1) - (first * second).sum(1) ** 2
    return np.sqrt(np.maximum(squares, 0)) / 2


class TestOptions:
    def test_it_is_the_sum_of_other_options(self):
        mesh = with_two_parts()
        parts = {"resolution": 256, "padding": LIGHTMAP_PADDING, "block_size": LIGHTMAP_BLOCK}
        np.testing.assert_array_equal(
            coneflat.unwrap(*mesh, lightmap=256).corner_uv, coneflat.unwrap(*mesh, **parts).corner_uv
        )

    @pytest.mark.parametrize(
        "options", [{"padding": 12.0}, {"block_size": 8}, {"padding": 3.0, "block_size": 2}]
    )
    def test_given_options_stay(self, options):
        settings = coneflat.unwrap(*shapes.box(2), lightmap=256, **options).settings
        expected = {"padding": LIGHTMAP_PADDING, "block_size": LIGHTMAP_BLOCK} | options
        assert {name: settings[name] for name in expected} == expected

    @pytest.mark.parametrize(
        ("options", "name"),
        [
            ({"stack": "copies"}, "stack copies"),
            ({"stack": "mirrored"}, "stack mirrored"),
            ({"resolution": 512}, "resolution"),
            ({"texel_density": 3.0}, "texel_density"),
            ({"tiles": 2}, "tiles"),
            ({"charts": "one"}, "charts one"),
        ],
    )
    def test_what_a_lightmap_excludes_is_named(self, options, name):
        with pytest.raises(
            OptionError, match=f"^lightmap and {name} cannot be combined: leave out one of them$"
        ):
            coneflat.unwrap(*shapes.box(1), lightmap=256, **options)

    @pytest.mark.parametrize(
        "options", [{"lightmap": 16}, {"lightmap": 24}, {"lightmap": 64, "padding": 16.0}]
    )
    def test_a_padding_that_leaves_no_space_is_named(self, options):
        with pytest.raises(
            OptionError, match=r"^the padding of a lightmap must be below a quarter of its \d+ texels"
        ):
            coneflat.unwrap(*shapes.box(1), **options)
        assert coneflat.unwrap(*shapes.box(1), **options | {"padding": 3.0}).settings["padding"] == 3.0

    def test_the_same_resolution_is_no_contradiction(self):
        assert coneflat.unwrap(*shapes.box(1), lightmap=256, resolution=256).settings["resolution"] == 256

    def test_the_command_says_it_in_a_line(self, tmp_path):
        (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n")
        done = command("unwrap", "a.obj", "--lightmap", "256", "--stack", "copies", cwd=tmp_path)
        assert done.returncode == 2
        assert done.stderr == (
            "coneflat: error: lightmap and stack copies cannot be combined: leave out one of them\n"
        )


def swapped_sets(path):
    """Return the content of a GLB whose two UV sets are exchanged, for readers of the first one."""
    content = path.read_bytes()
    (length,) = struct.unpack_from("<I", content, 12)
    tree = json.loads(content[20 : 20 + length])
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            names = primitive["attributes"]
            names["TEXCOORD_0"], names["TEXCOORD_1"] = names["TEXCOORD_1"], names["TEXCOORD_0"]
    text = json.dumps(tree, separators=(",", ":")).encode()
    text += b" " * (length - len(text))
    assert len(text) == length
    return content[:20] + text + content[20 + length :]


class TestFiles:
    def test_trimesh_reads_both_sets(self, tmp_path):
        trimesh = pytest.importorskip("trimesh")
        textured = coneflat.unwrap(*with_two_parts()).save(tmp_path / "textured.glb", texture="checker")
        lightmap = coneflat.unwrap(textured, lightmap=256)
        path = lightmap.save(tmp_path / "lightmap.glb")
        (tmp_path / "swapped.glb").write_bytes(swapped_sets(path))
        first, second = (
            trimesh.load(file, process=False, force="mesh") for file in (path, tmp_path / "swapped.glb")
        )
        before = trimesh.load(textured, process=False, force="mesh")
        assert first.visual.material.baseColorTexture.size == before.visual.material.baseColorTexture.size
        np.testing.assert_array_equal(first.visual.uv[first.faces], before.visual.uv[before.faces])
        corner_uv = second.visual.uv[second.faces]
        np.testing.assert_allclose(corner_uv, lightmap.as_written(".glb").corner_uv, atol=1e-7)
        measured = coneflat.measure_uv(second.vertices, second.faces, corner_uv)
        assert measured.report()["overlapping_pairs"] == 0

    def test_the_set_is_the_second_one_where_there_is_one(self, tmp_path):
        result = coneflat.unwrap(*shapes.box(1), lightmap=128)
        assert b"TEXCOORD_1" in result.save(tmp_path / "a.glb").read_bytes()
        assert b"TEXCOORD_1" not in result.save(tmp_path / "b.glb", uv_set=0).read_bytes()
        assert result.save(tmp_path / "a.obj").read_text().count("\nvt ") == len(result.uv)
        for arguments, is_second in (((), True), (("--uv-set", "0"), False)):
            done = command("unwrap", "a.obj", "-o", "c.glb", "--lightmap", "128", *arguments, cwd=tmp_path)
            assert done.returncode == 0
            assert (b"TEXCOORD_1" in (tmp_path / "c.glb").read_bytes()) == is_second

    def test_batches_make_lightmaps(self, tmp_path):
        coneflat.unwrap(*shapes.box(1)).save(tmp_path / "a.obj")
        done = command(
            "batch",
            "a.obj",
            "--out",
            "flat",
            "--format",
            "glb",
            "--lightmap",
            "128",
            "--jobs",
            "1",
            cwd=tmp_path,
        )
        assert done.returncode == 0
        assert b"TEXCOORD_1" in (tmp_path / "flat/a.glb").read_bytes()
