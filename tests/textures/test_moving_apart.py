"""Small overlaps, moved apart instead of cut."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapes

import coneflat
from coneflat import TriangleMesh
from coneflat.geometry import edge_lengths, find_overlaps, signed_double_areas
from coneflat.textures import moving_apart
from coneflat.textures.free_seams import laid_out
from coneflat.textures.moving_apart import moved_apart

NO_EDGES = np.empty(0, dtype=np.int64)


def forked(bend):
    """Return the layout of a sheet with a slit, whose two arms are bent towards each other."""
    vertices, faces = shapes.grid(24, 24)
    centres = vertices[faces].mean(axis=1)
    is_slit = (np.abs(centres[:, 0] - 0.5) < 0.05) & (centres[:, 1] > 0.4)
    vertices, faces = shapes.without(vertices, faces, is_slit)
    height = np.clip(vertices[:, 1] - 0.4, 0, None)
    bent = vertices[:, :2].copy()
    bent[:, 0] -= np.sign(bent[:, 0] - 0.5) * bend * height**1.5
    mesh = TriangleMesh(vertices, faces)
    return laid_out(mesh, edge_lengths(vertices, faces), bent[faces], NO_EDGES, NO_EDGES)


@pytest.mark.parametrize("bend", [0.1, 0.14, 0.16, 0.2])
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_small_overlaps_are_moved_apart_without_a_flip(bend, size):
    layout = forked(bend)
    layout = replace(layout, points=size * layout.points, lengths=size * layout.lengths)
    places = layout.points[layout.corners]
    assert len(find_overlaps(places).pairs)
    apart = moved_apart(layout, 1e-2)
    assert apart is not None
    assert not len(find_overlaps(apart.points[apart.corners]).pairs)
    assert (signed_double_areas(apart.points[apart.corners]) > 0).all()
    assert not apart.chart.any()
    assert not len(apart.seams)


def test_layouts_without_overlaps_or_with_large_ones_are_left():
    assert moved_apart(forked(0.0), 1e-2) is None
    large = forked(0.5)
    assert len(find_overlaps(large.points[large.corners]).pairs) > moving_apart.MAX_PAIRS
    assert moved_apart(large, 1e-2) is None


def test_noisy_sheets_with_holes_are_one_chart():
    """Noise makes short overlaps at the borders of large ones; cuts around them would leave charts of few triangles."""
    vertices, faces = noisy_sheet()
    result = coneflat.unwrap(vertices, faces)
    d = result.distortion
    assert (d.charts, d.overlapping_pairs, d.flipped) == (1, 0, 0)
    assert d.energy <= 4.1


def noisy_sheet(columns=200):
    """Return a curved sheet with 60 holes and normal noise of about a fifth of its edges."""
    vertices, faces = shapes.grid(
        columns, columns, lambda x, y: 0.05 * np.sin(5 * x) + 0.04 * np.cos(4 * x + 3 * y)
    )
    places = (np.stack(np.divmod(np.arange(60), 8), axis=1) + 0.5) / 8
    centres = vertices[faces].mean(axis=1)[:, :2]
    is_hole = (np.linalg.norm(centres[:, None] - places, axis=2) < 1 / 32).any(axis=1)
    vertices, faces = shapes.without(vertices, faces, is_hole)
    return vertices + 0.2 / columns * np.random.default_rng(0).standard_normal(vertices.shape), faces
