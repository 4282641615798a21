"""Where UVs are bad: by the definitions, on grids whose UVs are damaged."""

from __future__ import annotations

import numpy as np
import pytest
from gltf_scenes import SceneMaker

import coneflat
from coneflat.apps.view import Ranges, conformal_distortion, own_flattening, uv_faults
from coneflat.apps.view.faults import FAULTS, FLIPPED, OUTSIDE, OVERLAPPING, fault_places
from coneflat.apps.view.from_uv import uv_flattening
from coneflat.apps.view.quantity import stretch
from coneflat.errors import OptionError
from coneflat.io import UVMesh, read_joined

SIDE = 6


def sheet():
    """A square grid in the plane, within the unit square: points, triangles."""
    axis = np.linspace(0.1, 0.9, SIDE + 1)
    x, y = (values.ravel() for values in np.meshgrid(axis, axis))
    lower_left = (np.arange(SIDE)[:, None] * (SIDE + 1) + np.arange(SIDE)).ravel()
    a, b, c, d = lower_left, lower_left + 1, lower_left + SIDE + 2, lower_left + SIDE + 1
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return np.column_stack([x, y, 0.1 * x * y]), faces


def mapped(corner_uv, vertices, faces):
    return uv_flattening(UVMesh(vertices, faces, corner_uv, len(faces), 0, 0))


def test_a_good_layout_has_no_faults():
    vertices, faces = sheet()
    faults = uv_faults(mapped(vertices[faces][:, :, :2], vertices, faces))
    assert faults.counts() == {"flipped": 0, "overlapping": 0, "outside": 0}
    assert faults.complete


def test_a_mirrored_chart_is_not_flipped():
    vertices, faces = sheet()
    result = mapped((vertices * [-1, 1, 1] + [1, 0, 0])[faces][:, :, :2], vertices, faces)
    assert not uv_faults(result).bits.any()


def test_a_moved_point_flips_what_it_passes():
    vertices, faces = sheet()
    middle = (SIDE // 2) * (SIDE + 1) + SIDE // 2
    uv = vertices[:, :2].copy()
    uv[middle] += [0.8 / SIDE * 1.5, 0.02]
    result = mapped(uv[faces], vertices, faces)
    bits = uv_faults(result).bits
    first, second = (uv[faces][:, k] - uv[faces][:, 0] for k in (1, 2))
    negative = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0] < 0
    assert negative.any()
    np.testing.assert_array_equal((bits & FLIPPED) > 0, negative)
    assert uv_faults(result).counts()["flipped"] == result.distortion.flipped
    # A fold covers its neighbours twice.
    assert ((bits & OVERLAPPING) > 0)[negative].all()


def test_overlaps_are_those_of_brute_force():
    vertices, faces = sheet()
    uv = vertices[faces][:, :, :2].copy()
    is_moved = faces.max(axis=1) >= (SIDE + 1) * (SIDE - 1)
    uv[is_moved] -= [0.013, 0.31]
    result = mapped(uv, vertices, faces)
    pairs = coneflat.geometry.find_overlaps(uv).pairs
    expected = np.isin(np.arange(len(faces)), pairs)
    assert 0 < expected.sum() < len(faces)
    np.testing.assert_array_equal((uv_faults(result).bits & OVERLAPPING) > 0, expected)


def test_outside_is_outside_the_unit_square():
    vertices, faces = sheet()
    uv = vertices[faces][:, :, :2] + [0.3, 0]
    bits = uv_faults(mapped(uv, vertices, faces)).bits
    np.testing.assert_array_equal(bits == OUTSIDE, (uv[:, :, 0] > 1).any(axis=1))


def test_places_are_connected_and_the_largest_is_first():
    vertices, faces = sheet()
    bits = np.zeros(len(faces), dtype=np.uint8)
    centres = vertices[faces].mean(axis=1)
    bits[centres[:, 0] < 0.2] |= OUTSIDE
    bits[centres[:, 0] > 0.6] |= OUTSIDE
    bits[0] |= FLIPPED
    places = fault_places(bits, vertices[:, :2], faces)
    assert places[:, 1].tolist() == [FLIPPED, OUTSIDE, OUTSIDE]
    assert places[0, 0] == 0
    assert centres[places[1, 0], 0] > 0.6
    assert centres[places[2, 0], 0] < 0.2
    assert fault_places(0 * bits, vertices[:, :2], faces).shape == (0, 2)
    assert [*FAULTS.values()] == sorted(FAULTS.values())


def test_triangles_of_different_textures_do_not_overlap(tmp_path):
    make = SceneMaker()
    triangle = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    uv = np.array([[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]])
    pixel = make.view(b"\x89PNG\r\n\x1a\n"), make.view(b"\x89PNG\r\n\x1a\n ")
    make.tree |= {
        "images": [{"bufferView": view, "mimeType": "image/png"} for view in pixel],
        "textures": [{"source": 0}, {"source": 1}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": i}}} for i in (0, 1)],
    }

    def primitive(shift, material):
        attributes = {"POSITION": make.accessor(triangle + shift), "TEXCOORD_0": make.accessor(uv)}
        return {"attributes": attributes, "material": material}

    for materials, count in (((0, 1), 0), ((1, 1), 2)):
        make.tree["meshes"] = [{"primitives": [primitive(3 * i, m) for i, m in enumerate(materials)]}]
        make.tree |= {"nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}]}
        (tmp_path / "two.glb").write_bytes(make.glb())
        result = own_flattening(read_joined(tmp_path / "two.glb"))
        assert uv_faults(result).counts()["overlapping"] == count


class TestRanges:
    def test_ends_of_scales_can_be_fixed(self):
        result = coneflat.flatten(*sheet())
        assert conformal_distortion(result, 1.5).scale.high == 1.5
        scale = stretch(result, 2.0).scale
        assert (scale.low, scale.high) == (0.5, 2.0)
        assert [text for _, text in scale.ticks] == ["0.5", "1", "2"]

    @pytest.mark.parametrize(
        "values", [{"qc_max": 1.0}, {"scale_max": 0.5}, {"qc_max": float("nan")}, {"qc_max": "a"}]
    )
    def test_ends_must_be_above_1(self, values):
        with pytest.raises(OptionError, match=f"{next(iter(values))}"):
            Ranges(**values)
