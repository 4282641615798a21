"""Quads follow their surface, or an error names a number of quads that does."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapes

import coneflat
from coneflat import TriangleMesh
from coneflat.errors import CoarseGridError, GuaranteeWarning
from coneflat.quadmesh.borders import MAX_LAYER_WIDTH
from coneflat.quadmesh.limits import FEWEST_SQUARES, NOTED_TIMES
from coneflat.quadmesh.quad_mesh import QuadMesh
from coneflat.quadmesh.surface_fit import fit_to_surface


def rough_maze(cells=8, corridor=3, seed=0):
    """A flat maze with narrow gaps between its corridors, turned and with an uneven boundary."""
    rng, size = np.random.default_rng(seed), 2 * cells + 1
    is_corridor = shapes.corridors(cells, seed)
    widths = np.where(np.arange(size) % 2, corridor, 1)
    places = np.concatenate([[0.0], np.cumsum(np.repeat(np.where(np.arange(size) % 2, 0.1, 0.06), widths))])
    block = np.repeat(np.arange(size), widths)
    i, j = np.nonzero(is_corridor[np.ix_(block, block)])
    count = len(places)
    corners = np.stack(
        [i * count + j, (i + 1) * count + j, (i + 1) * count + j + 1, i * count + j + 1], axis=1
    )
    numbers, squares = np.unique(corners, return_inverse=True)
    squares = squares.reshape(-1, 4)
    flat = np.stack([places[numbers // count], places[numbers % count]], axis=1)
    flat = flat @ [[np.cos(0.3), np.sin(0.3)], [-np.sin(0.3), np.cos(0.3)]] + rng.normal(
        0, 0.006, (len(flat), 2)
    )
    faces = np.concatenate([squares[:, [0, 1, 2]], squares[:, [0, 2, 3]]])
    return np.column_stack([flat, np.zeros(len(flat))]), faces


def folded_strip(gap=0.1, columns=40):
    """A strip of length 2, folded in the middle, so that its ends are near each other."""
    vertices, faces = shapes.grid(columns, 4)
    along = 2 * vertices[:, 0]
    folded = np.stack(
        [np.minimum(along, 2 - along), vertices[:, 1] / 4, np.where(along > 1, gap, 0.0)], axis=1
    )
    return TriangleMesh(folded, faces)


def quads_at(surface, corners):
    """Quads (p, 4) of vertices of a surface."""
    on = np.array([np.flatnonzero((surface.faces == v).any(axis=1))[0] for v in range(len(surface.vertices))])
    weights = (surface.faces[on] == np.arange(len(on))[:, None]).astype(float)
    numbers, quads = np.unique(corners, return_inverse=True)
    return QuadMesh(
        surface.vertices[numbers], quads.reshape(-1, 4), on[numbers], weights[numbers], 0, 0.0, surface
    )


@pytest.mark.parametrize("make", [lambda: shapes.sphere(3, bumps=0.2), shapes.hill, shapes.torus])
@pytest.mark.parametrize("scale", [1.0, 1e-6])
def test_quads_of_smooth_surfaces_follow_them_at_any_scale(make, scale):
    vertices, faces = make()
    fit = fit_to_surface(coneflat.quads(scale * vertices, faces, quads=300))
    assert fit.problems == ()
    assert 0.9 < fit.area_ratio < 1.01
    assert max(fit.distance_to, fit.distance_from) < 1


def test_a_side_that_leaps_across_a_gap_is_found_although_it_is_short():
    surface = folded_strip()
    columns = len(np.unique(np.round(2 * surface.vertices[:, 1], 9)))
    assert columns == 5
    grid = np.lexsort((surface.vertices[:, 1], surface.vertices[:, 0], surface.vertices[:, 2])).reshape(-1, 5)
    below, above = grid[:20], grid[len(grid) - 20 :]
    flat = [[a[k], a[k + 1], b[k + 1], b[k]] for a, b in pairwise(below) for k in range(4)]
    start = np.argmin(surface.vertices[below[:, 0], 0])
    opposite = above[
        np.argmin(np.abs(surface.vertices[above[:, 0], 0] - surface.vertices[below[start, 0], 0]))
    ]
    leap = [[below[start][k], below[start][k + 1], opposite[k + 1], opposite[k]] for k in range(4)]
    assert fit_to_surface(quads_at(surface, np.array(flat))).leaps == 0
    fit = fit_to_surface(quads_at(surface, np.array(flat + leap)))
    assert fit.leaps >= len(leap)
    assert "leap to another part of the surface" in fit.problems[0]


def test_quads_far_from_the_surface_and_parts_of_it_without_quads_are_found():
    quads = coneflat.quads(*shapes.sphere(3), quads=300)
    fit = fit_to_surface(quads.without(quads.vertices[quads.quads].mean(axis=1)[:, 2] > 0.5))
    assert fit.distance_from > 2
    assert any("away from the quads" in problem for problem in fit.problems)
    points = quads.vertices.copy()
    points[0] *= 8
    fit = fit_to_surface(replace(quads, vertices=points))
    assert fit.distance_to > 2
    assert fit.area_ratio > 1.05
    assert fit.leaps > 0


@pytest.fixture(scope="module")
def maze():
    return rough_maze()


def test_too_few_quads_for_a_maze_are_an_error_with_a_number_that_works(maze):
    with pytest.raises(CoarseGridError, match=r"cannot follow the surface: .*: use ([\d,]+) quads") as caught:
        coneflat.quads(*maze, quads=300, boundary="free")
    assert caught.value.quads is not None
    quads = coneflat.quads(*maze, quads=caught.value.quads, boundary="free")
    assert fit_to_surface(quads).problems == ()


@pytest.mark.parametrize("count", [600, 900])
def test_a_layer_along_a_boundary_does_not_leap_across_gaps(maze, count):
    from coneflat.quadmesh import requested_quads
    from coneflat.quadmesh.request import GridRequest

    request = replace(GridRequest.of(*maze, {"quads": count}, {"boundary": "free"}), for_quads=True)
    quads, _ = requested_quads._attempt(request, 0)
    corners = quads.vertices[quads.quads]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    assert sides.max() < 2 * MAX_LAYER_WIDTH * sides.mean()
    assert fit_to_surface(quads).area_ratio < 1.05


def test_many_more_quads_than_requested_are_a_warning_and_too_many_an_error():
    """Each of eighteen cubes needs six quads."""
    cube = shapes.box(1, (1.0, 1.0, 1.0))
    cubes = shapes.join(*((cube[0] + [3.0 * i, 0, 0], cube[1]) for i in range(18)))
    with pytest.warns(GuaranteeWarning):
        quads = coneflat.quads(*cubes, quads=40)
    assert len(quads.quads) > NOTED_TIMES * 40
    assert any(note.startswith(f"{len(quads.quads)} quads instead of 40") for note in quads.notes)
    with pytest.raises(CoarseGridError, match=r"use at least [\d,]+ quads") as caught:
        coneflat.quads(*cubes, quads=5)
    fewest = caught.value.quads
    assert len(coneflat.quads(*cubes, quads=fewest).quads) <= max(FEWEST_SQUARES, 4 * fewest)


def test_measures_count_inverted_and_leaping_quads():
    measures = coneflat.measure_quads(coneflat.quads(*shapes.sphere(3), quads=300))
    assert (measures.inverted, measures.leaps) == (0, 0)
    assert 0.9 < measures.area_ratio < 1
