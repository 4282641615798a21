from __future__ import annotations

import numpy as np
import pytest
import shapes

import coneflat
from coneflat import TriangleMesh, errors
from coneflat.geometry.overlap import find_overlaps
from coneflat.quality.distortion import measure
from coneflat.quality.rotations import seam_rotations


@pytest.fixture(scope="module")
def results():
    meshes = (shapes.sphere(2), shapes.torus(24, 12), shapes.cylinder(12, 3))
    return [
        coneflat.flatten(vertices * size, faces, charts="atlas")
        for (vertices, faces), size in zip(meshes, (1, 2, 0.5), strict=True)
    ]


def test_charts_of_several_meshes_share_a_texture(results):
    together = coneflat.pack_together(results, resolution=512, padding=4)
    corners = np.concatenate([one.corner_uv for one in together])
    assert corners.min() >= 4 / 512 - 1e-12
    assert corners.max() <= 1 - 4 / 512 + 1e-12
    assert len(find_overlaps(corners).pairs) == 0
    # One scale for all models, and nothing but moved.
    assert len({one.uv_scale for one in together}) == 1
    for before, after in zip(results, together, strict=True):
        sides = [
            np.linalg.norm(one.corner_uv[:, 1] - one.corner_uv[:, 0], axis=1) / one.uv_scale
            for one in (before, after)
        ]
        np.testing.assert_allclose(*sides, rtol=1e-9)
        assert after.packing_efficiency == together[0].packing_efficiency


def test_what_a_result_tells_of_itself_fits_its_new_place(results):
    for one in coneflat.pack_together(results, resolution=512, padding=4, rotate="none"):
        again = measure(TriangleMesh(one.vertices, one.faces), one.corner_uv)
        np.testing.assert_allclose(one.distortion.log_area_scale, again.log_area_scale, rtol=1e-6)
        assert one.distortion.overlapping_pairs == again.overlapping_pairs == 0
        assert (one.settings["resolution"], one.settings["padding"], one.settings["tiles"]) == (512, 4, 1)


def test_areas_are_those_of_the_model():
    """Whatever its unit is."""
    vertices, faces = shapes.sphere(2)
    for size in (1e-3, 7.0):
        one = coneflat.flatten(vertices * size, faces)
        again = measure(TriangleMesh(one.vertices, one.faces), one.corner_uv)
        np.testing.assert_allclose(one.distortion.log_area_scale, again.log_area_scale, atol=1e-9)


@pytest.mark.parametrize("rotate", ["any", "quarter"])
def test_seams_keep_to_the_quanta_of_all(rotate):
    """Quarters and sixths of a turn: halves suit both."""
    vertices, faces = shapes.sphere(4)
    x, y, z = vertices.T
    limbs = vertices * (1 + 2.5 * np.abs(np.cos(2.5 * np.arctan2(y, x))) ** 6 * (1 - z**2))[:, None]
    before = [
        coneflat.flatten(limbs, faces, quantise=2 * np.pi / parts, charts="atlas", distortion=0.1)
        for parts in (4, 6)
    ]
    assert min(one.distortion.charts for one in before) > 1
    for one, parts in zip(coneflat.pack_together(before, rotate=rotate), (4, 6), strict=True):
        mesh = TriangleMesh(one.vertices, one.faces)
        off = seam_rotations(mesh, one.corner_uv, 2 * np.pi / parts).max()
        assert off < 1e-9
        assert one.rotations.worst == off


def test_charts_that_are_not_turned(results):
    for before, after in zip(results, coneflat.pack_together(results, rotate="none"), strict=True):
        sides = [one.corner_uv[:, 1] - one.corner_uv[:, 0] for one in (before, after)]
        ratio = after.uv_scale / before.uv_scale
        np.testing.assert_allclose(sides[0] * ratio, sides[1], atol=1e-9)


def test_tiles(results):
    pair = [results[1]] * 2
    together = coneflat.pack_together(pair, tiles=2)
    tiles = {int(u) for one in together for u in np.floor(one.corner_uv[..., 0].ravel())}
    assert tiles == {0, 1}
    assert together[0].uv_scale > 1.05 * coneflat.pack_together(pair)[0].uv_scale


def test_what_makes_no_sense(results):
    with pytest.raises(errors.OptionError, match="not bool"):
        coneflat.pack_together([True])
    with pytest.raises(errors.OptionError, match="unknown rotate"):
        coneflat.pack_together(results, rotate=np.ones(2))
    with pytest.raises(errors.EmptyMeshError, match="no results"):
        coneflat.pack_together([])
    with pytest.raises(errors.OptionError):
        coneflat.pack_together(results, tiles=0)
