"""Components that can be laid out without distortion and without seams need no search."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat import unwrap
from coneflat.textures.candidates import CutModel

SIDE = 20


def sheet():
    vertices, faces = shapes.grid(SIDE, SIDE)
    return np.asarray(vertices, dtype=float), np.asarray(faces)


def rotated(vertices):
    return vertices @ np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]


def bent(vertices):
    """Return points rolled onto a circular cylinder, along the lines of the grid."""
    radius = np.ptp(vertices[:, 0]) / 3
    angle = vertices[:, 0] / radius
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), vertices[:, 1]])


def without(vertices, faces, is_left_out):
    return vertices, faces[~is_left_out(vertices[faces].mean(axis=1))]


def hole(centres):
    middle = centres[:, :2].mean(axis=0)
    return np.abs(centres[:, :2] - middle).max(axis=1) < 0.25 * np.ptp(centres[:, 0])


def quarter(centres):
    """Return the corner that is missing from an L."""
    return (centres[:, :2] > centres[:, :2].mean(axis=0) - 0.2 * np.ptp(centres[:, 0])).all(axis=1)


VERTICES, FACES = sheet()
FLAT = {
    "grid": (VERTICES, FACES),
    "rotated": (rotated(VERTICES), FACES),
    "of a file": (np.round(rotated(VERTICES), 6), FACES),
    "bent": (bent(VERTICES), FACES),
    "bent, of a file": (np.round(bent(VERTICES), 6), FACES),
    "with a hole": without(VERTICES, FACES, hole),
}


@pytest.fixture
def searches(monkeypatch):
    """The layouts that a search computes."""
    laid_out = []
    original = CutModel.laid_out
    monkeypatch.setattr(
        CutModel, "laid_out", lambda model, cones: laid_out.append(model) or original(model, cones)
    )
    return laid_out


@pytest.mark.parametrize("name", FLAT)
@pytest.mark.parametrize("options", [{}, {"area": 0.05}, {"seams": "none"}])
def test_flat_components_are_not_searched(searches, name, options):
    assert len(FLAT[name][1]) > 500
    result = unwrap(*FLAT[name], repair=True, **options)
    d = result.distortion
    assert not searches
    assert abs(d.energy - 4) <= 1e-9
    assert (d.charts, d.seam_length, d.flipped, d.overlapping_pairs) == (1, 0, 0, 0)
    assert not [note for note in result.notes if not note.startswith("Left out")]


def test_curved_components_and_tubes_are_searched(searches):
    bump = VERTICES.copy()
    bump[:, 2] += 0.05 * np.exp(-((VERTICES[:, :2] - VERTICES[:, :2].mean(axis=0)) ** 2).sum(axis=1))
    unwrap(bump, FACES)
    assert searches
    searches.clear()
    unwrap(*shapes.cylinder())  # It has no curvature, but closes up.
    assert searches


def test_flat_components_are_cut_where_the_packing_wants_it(searches):
    shape = without(VERTICES, FACES, quarter)
    assert unwrap(*shape, repair=True, packing_cuts=0.5).distortion.charts == 1
    cut = unwrap(*shape, repair=True, packing_cuts=1.0)
    assert cut.distortion.charts > 1
    assert cut.distortion.energy < 4 + 1e-9
    assert not searches
