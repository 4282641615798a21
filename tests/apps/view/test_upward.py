"""The axis of a model that points up, guessed from its format and its shape."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

import coneflat
from coneflat.apps.view import upward_axis
from coneflat.apps.view.upward import axis_of
from coneflat.errors import OptionError


def standing(axis):
    """A tall cone that stands on its base, in a plane of constant `axis`."""
    around = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    ring = np.column_stack([np.cos(around), np.sin(around), np.zeros(24)])
    vertices = np.concatenate([ring, [[0, 0, 0], [0.1, 0.2, 3]]])
    index, following = np.arange(24), (np.arange(24) + 1) % 24
    sides = np.column_stack([index, following, np.full(24, 25)])
    base = np.column_stack([following, index, np.full(24, 24)])
    # A cyclic order of the axes keeps the orientation.
    return np.roll(vertices, "xyz".index(axis) - 2, axis=1), np.concatenate([sides, base])


def terrain(axis):
    """A sheet of low hills, open on all sides."""
    vertices, faces = shapes.hill(10, 8)
    flat = vertices * [1, 1, 0.2 * np.ptp(vertices[:, :2]) / np.ptp(vertices[:, 2])]
    return np.roll(flat, "xyz".index(axis) - 2, axis=1), faces


@pytest.mark.parametrize("axis", ["y", "z"])
@pytest.mark.parametrize("shape", [standing, terrain])
@pytest.mark.parametrize("ending", ["", ".obj", ".off", ".ply"])
def test_a_model_stands_on_its_ground(axis, shape, ending):
    vertices, faces = shape(axis)
    assert upward_axis(vertices, faces, ending) == axis
    # Neither units, nor the position, nor the order of the triangles matter.
    moved = 1e-3 * vertices[::-1] + [5, -3, 2]
    assert upward_axis(moved, len(vertices) - 1 - faces[::-1], ending) == axis


@pytest.mark.parametrize(("ending", "axis"), [(".glb", "y"), (".gltf", "y"), (".STL", "z"), (".pial", "z")])
@pytest.mark.parametrize("on", ["y", "z"])
def test_formats_with_a_convention_have_it(ending, axis, on):
    assert upward_axis(*standing(on), ending) == axis


@pytest.mark.parametrize(("ending", "axis"), [(".ply", "z"), (".obj", "y"), ("", "y")])
def test_shapes_without_a_ground_have_the_usual_axis(ending, axis):
    assert upward_axis(*shapes.sphere(3), ending) == axis
    assert upward_axis(np.zeros((3, 3)), np.array([[0, 1, 2]]), ending) == axis
    assert upward_axis(np.zeros((0, 3)), np.zeros((0, 3), int), ending) == axis


@pytest.mark.parametrize("up", ["", "w", None, np.eye(3)])
def test_other_words_are_refused(up):
    with pytest.raises(OptionError, match='must be "auto", "x", "y" or "z"'):
        axis_of(up, coneflat.flatten(*shapes.hill()))


def test_figures_have_the_axis_of_the_page(tmp_path):
    pytest.importorskip("matplotlib")
    result = coneflat.flatten(*standing("z"))
    assert axis_of("auto", result) == "z"
    for kind in ("cones", "checker", "quality", "curvature"):
        pictures = {
            up: coneflat.make_figure(result, kind, up=up, dpi=40).axes[0].images[0].get_array()
            for up in ("auto", "z", "y")
        }
        np.testing.assert_array_equal(pictures["auto"], pictures["z"])
        assert pictures["auto"].shape != pictures["y"].shape or (pictures["auto"] != pictures["y"]).any()
