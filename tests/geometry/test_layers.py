"""Only what may overlap is compared: near the outline of a layout, and where it winds twice."""

from __future__ import annotations

import numpy as np
import pytest

from coneflat.geometry.layers import may_overlap
from coneflat.geometry.overlap import find_overlaps, overlaps_of_mesh
from coneflat.mesh.charts import open_sides
from coneflat.mesh.connectivity import TriangleMesh


def squares(size):
    """A sheet of so many squares along each side, of two triangles each, one unit wide."""
    u, v = (side.ravel() for side in np.meshgrid(np.arange(size + 1.0), np.arange(size + 1.0), indexing="ij"))
    first = (np.arange(size)[:, None] * (size + 1) + np.arange(size)).ravel()
    square = np.stack([first, first + size + 1, first + size + 2, first + 1], axis=1)
    faces = np.concatenate([square[:, [0, 1, 2]], square[:, [0, 2, 3]]])
    return TriangleMesh(np.stack([u, v, 0 * u], axis=1), faces)


@pytest.mark.parametrize("fault", ["none", "moved", "upside down", "flat", "folded"])
def test_suspected_triangles_include_all_overlapping_ones(fault):
    """Pairs and areas are those of all triangles, whatever their orientation and wherever the layout is torn."""
    random = np.random.default_rng(3)
    size = 30
    mesh = squares(size)
    u, v = mesh.vertices[:, :2].T
    # A ring that is longer than a turn: its ends cover the plane twice.
    places = (1 + v / size) * np.exp(2.3j * np.pi * u / size)
    if fault == "folded":
        places = (u - 0.3 * np.maximum(u - 20, 0) * 5) + 1j * v
    if fault in ("moved", "flat"):
        chosen = random.choice(len(u), 40, replace=False)
        places[chosen] += 0.1 * random.normal(size=40) if fault == "moved" else 0
        if fault == "flat":
            places[chosen] = places[chosen + 1 - 2 * (chosen == len(u) - 1)]
    corners = np.stack([places.real, places.imag], axis=1)[mesh.faces]
    if fault == "moved":  # torn from the rest
        corners[random.choice(len(corners), 30, replace=False)] += 0.2
    if fault == "upside down":
        corners = corners[..., ::-1].copy()
    every, fewer = find_overlaps(corners), overlaps_of_mesh(mesh.edge_halfedges, corners)
    assert len(every.pairs) > 100
    np.testing.assert_array_equal(fewer.pairs, every.pairs)
    assert (fewer.area, fewer.fraction) == (every.area, every.fraction)


def test_no_triangle_inside_a_single_layer_is_suspected():
    size = 100
    mesh = squares(size)
    faces = mesh.faces
    corners = mesh.vertices[:, :2][faces]
    upright = np.ones(len(faces), dtype=np.int64)
    is_open = open_sides(mesh.edge_halfedges, corners, upright - 1)
    np.testing.assert_array_equal(
        np.flatnonzero(is_open), np.sort(mesh.edge_halfedges[mesh.is_boundary_edge, 0])
    )
    middles = corners[may_overlap(corners, upright, is_open)].mean(axis=1)
    assert len(middles) < len(faces) / 5
    assert (np.minimum(middles, size - middles).min(axis=1) < 3).all()
