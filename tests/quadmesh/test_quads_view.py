"""The page of quads, and the rectangles that they form."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from grid_maps import CUBE, L_SHAPE, RING, TRIPOD, TWO_RINGS, on_squares, polycube, torus_map

from coneflat.apps.view.quad_page import as_flattening, page_of_quads
from coneflat.quadmesh import find_domains
from coneflat.quadmesh.extract import extract_quads

SOLIDS = {"cube": CUBE, "l": L_SHAPE, "tripod": TRIPOD, "ring": RING, "double torus": TWO_RINGS}


def quads_of(cubes, cells=3):
    return extract_quads(on_squares(*polycube(cubes), cells, inside=4, along=1, seed=5))


def check_domains(mesh, domains):
    """Every domain is a rectangle, quads fill it, and they are neighbours there as they are on the surface."""
    places, sides = domains.places, domains.sides
    assert (sides[:, 0] >= sides[:, 1]).all()
    assert (sides[:, 1] > 0).all()
    np.testing.assert_array_equal(np.bincount(domains.domain), sides.prod(axis=1))
    # Each quad is a unit square, counterclockwise, and no two are the same one.
    first, second = places[:, 1] - places[:, 0], places[:, 3] - places[:, 0]
    np.testing.assert_array_equal(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0], 1)
    np.testing.assert_array_equal(places[:, 2], places[:, 1] + places[:, 3] - places[:, 0])
    low = places.min(axis=1)
    assert len(np.unique(np.column_stack([domains.domain, low]), axis=0)) == len(low)
    assert (low >= 0).all()
    assert (places.max(axis=1) <= sides[domains.domain]).all()
    at, across = {}, {}
    for q, quad in enumerate(mesh.quads.tolist()):
        for i in range(4):
            at[quad[i], quad[(i + 1) % 4]] = q, i
    for (v, w), (q, i) in at.items():
        if (w, v) not in at:
            assert domains.is_cut[4 * q + i]
            continue
        r, j = at[w, v]
        across[4 * q + i] = 4 * r + j
        assert domains.is_cut[4 * q + i] == domains.is_cut[4 * r + j]
        if not domains.is_cut[4 * q + i]:
            assert domains.domain[q] == domains.domain[r]
            np.testing.assert_array_equal(places[q, i], places[r, (j + 1) % 4])
            np.testing.assert_array_equal(places[q, (i + 1) % 4], places[r, j])
    # All lines from irregular vertices are borders.
    odd = np.isin(mesh.quads.ravel(), mesh.irregular)
    assert domains.is_cut[odd].all()


@pytest.mark.parametrize("name", SOLIDS)
def test_domains_of_cubes(name):
    mesh = quads_of(SOLIDS[name])
    check_domains(mesh, find_domains(mesh))


def test_a_cube_has_its_six_sides():
    domains = find_domains(quads_of(CUBE, 4))
    assert sorted(domains.sides.tolist()) == [[4, 4]] * 6


def test_a_torus_without_irregular_vertices_is_cut():
    mesh = extract_quads(torus_map(6, 9, 2))
    domains = find_domains(mesh)
    check_domains(mesh, domains)
    assert domains.sides.prod(axis=1).sum() == len(mesh.quads)


def head_of(page):
    return json.loads(re.search(r'<script[^>]*id="head"[^>]*>(.*?)</script>', page, re.DOTALL)[1])


def test_the_page_of_quads():
    mesh = quads_of(L_SHAPE)
    domains = find_domains(mesh)
    result = as_flattening(mesh)
    assert result.distortion.charts == len(domains.sides)
    assert result.distortion.flipped == 0
    assert result.distortion.overlap == 0
    # Gauss-Bonnet: a quarter turn for each quad that is missing.
    assert result.curvatures.sum() == pytest.approx(4 * np.pi)
    np.testing.assert_array_equal(result.cones, mesh.irregular)
    page = page_of_quads(mesh, name="An L")
    head = head_of(page)
    # Squares of the board are quads: as long as the root of all is, there are so many.
    assert head["squares"] ** 2 == pytest.approx(len(mesh.quads))
    assert head["show"] == "charts"
    assert head["title"].startswith(f"{len(mesh.quads)} quads")
    assert ["irregular", "12", "inner vertices with a valence other than 4: 10 of 3, 2 of 5"] in head["rows"]
    assert ["black dots", "2", "vertices with more than four quads"] in head["rows"]
