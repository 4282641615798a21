"""Laws of thin triangles: none is distorted beyond use unless the model's own is thinner than a millionth."""

from importlib import import_module

import numpy as np
import pytest
import shapes
from needles import with_caps, with_needles

import coneflat
from coneflat.geometry import edge_lengths
from coneflat.geometry.opening import thickness
from coneflat.mesh.check import weld

WORST_QC, THINNEST = 1e3, 1e-6


def check_thin(result, ending=None):
    """Check that only triangles below `THINNEST` are distorted beyond `WORST_QC`, and that these are named."""
    measured = result if ending is None else result.as_written(ending)
    lengths = edge_lengths(result.vertices, result.faces)
    # Triangles of needles that are split again are as small as the rounding of coordinates.
    thin = (thickness(lengths) < THINNEST) | (lengths.max(axis=1) < THINNEST * lengths.mean())
    assert measured.distortion.flipped == 0
    assert measured.distortion.qc[~thin].max() <= WORST_QC
    is_bad = measured.distortion.qc > WORST_QC
    assert any("with a QC distortion above" in note for note in measured.notes) == is_bad.any()


@pytest.mark.parametrize("split", [with_caps, with_needles])
@pytest.mark.parametrize("height", [1e-3, 1e-5, 1.1e-6, 1e-7, 1e-9, 1e-13, 0.0])
@pytest.mark.parametrize("method", [coneflat.flatten, coneflat.unwrap])
def test_thin_triangles_are_laid_out_about_as_thin_as_they_are(method, height, split):
    mesh = split(*shapes.sphere(3), height, 15, np.random.default_rng(0))
    result = method(*mesh)
    check_thin(result)
    check_thin(result, ".glb")
    clean = method(*shapes.sphere(3)).distortion
    assert result.distortion.energy < clean.energy + 0.05
    assert result.distortion.qc_mean < clean.qc_mean + 0.02


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("method", [coneflat.flatten, coneflat.unwrap])
def test_neighbouring_needles_and_caps_of_all_heights_do_not_spoil_one_another(method, seed):
    rng = np.random.default_rng(seed)
    vertices, faces = shapes.sphere(3)
    for _ in range(4):
        split = (with_caps, with_needles)[rng.integers(2)]
        vertices, faces = split(vertices, faces, 10.0 ** rng.uniform(-14, -3), 40, rng)
    check_thin(method(vertices, faces))


def test_a_grid_of_steps_is_flattened_though_most_of_its_triangles_are_thin():
    """A map whose coordinates are rounded to 32-bit numbers, with steps of half the distance of its vertices."""
    vertices, faces = shapes.grid(9, 9)
    vertices = 0.09 * vertices + [5e5, 5.3e6, 200]
    vertices[:, 2] += np.random.default_rng(0).random(len(vertices)) * 0.01
    rounded = vertices.astype(np.float32).astype(float)
    welded, place = weld(rounded)
    faces = place[faces]
    is_face = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    result = coneflat.flatten(rounded[welded], faces[is_face], repair=True)
    assert result.distortion.flipped == 0
    assert np.isfinite(result.uv).all()


def test_an_attempt_that_fails_leaves_the_finished_layout(monkeypatch):
    retries = import_module("coneflat.retries")
    lay_out_components, calls = retries.lay_out_components, []

    def fails_later(components, steps):
        calls.append(len(components))
        if components:
            raise coneflat.errors.ConvergenceError("no metric")
        return lay_out_components(components, steps)

    monkeypatch.setattr(retries, "lay_out_components", fails_later)
    result = coneflat.flatten(*shapes.box(1, (1.0, 2.0, 0.5)))
    assert calls
    assert np.isfinite(result.uv).all()
