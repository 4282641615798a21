"""Cuts that let charts be packed more tightly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapes

from coneflat import TriangleMesh, unwrap
from coneflat.atlas import pack_charts
from coneflat.flattening import Steps
from coneflat.geometry import signed_double_areas
from coneflat.io import as_input
from coneflat.mesh import label_faces
from coneflat.options import Options
from coneflat.retries import lay_out_with_thick_triangles
from coneflat.source import Source
from coneflat.textures import pack_cuts
from coneflat.textures.pack_cuts import MIN_PIECE, SHARE, cut_for_packing

GAP = 2 / 1024


def grid(inside, count=48):
    """The triangles of a flat grid of the square [0, 1]^2 whose middles are inside."""
    at = np.arange((count + 1) ** 2).reshape(count + 1, count + 1)
    lower_triangles = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:]], axis=-1).reshape(-1, 3)
    two = np.stack([at[:-1, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 3)
    x, y = np.divmod(np.arange(at.size), count + 1)
    points = np.column_stack([x, y, 0 * x]) / count
    faces = np.concatenate([lower_triangles, two])
    middle = points[faces].mean(axis=1)
    faces = faces[inside(middle[:, 0], middle[:, 1])]
    points_used, faces = np.unique(faces, return_inverse=True)
    return points[points_used], faces.reshape(-1, 3)


def plus(x, y):
    return (np.abs(x - 0.5) < 0.1) | (np.abs(y - 0.5) < 0.1)


def square(x, y):
    return x < 2


def starfish(x, y):
    angle, radius = np.angle(x - 0.5 + 1j * (y - 0.5)), np.hypot(x - 0.5, y - 0.5)
    return radius < 0.12 + 0.35 * np.cos(2.5 * angle) ** 6


def layout_of(vertices, faces):
    """The layout of a mesh in one chart, and the costs of its edges."""
    component = Source(as_input(vertices, faces)).prepared(Options()).components[0]
    layout = lay_out_with_thick_triangles(component, Steps())
    mesh = layout.mesh
    return layout, np.linalg.norm(np.diff(mesh.vertices[mesh.edges], axis=1)[:, 0], axis=1)


def seam_length(layout, costs):
    keys = np.sort(layout.mesh.edges, axis=1) @ [len(layout.mesh.vertices), 1]
    return costs[np.isin(keys, np.sort(layout.seams, axis=1) @ [len(layout.mesh.vertices), 1])].sum()


def efficiency(*layouts):
    flat = np.concatenate([layout.points[layout.corners] for layout in layouts])
    before = np.cumsum([0, *(layout.chart.max() + 1 for layout in layouts)])
    return pack_charts(
        flat, np.concatenate([layout.chart + n for layout, n in zip(layouts, before, strict=False)])
    ).efficiency


@pytest.fixture(scope="module", params=[plus, starfish], ids=["plus", "starfish"])
def branching(request):
    layout, costs = layout_of(*grid(request.param))
    return layout, costs, cut_for_packing([layout], [costs].__getitem__, GAP, 1.0)[0]


def test_a_branching_chart_is_cut_and_packs_more_tightly(branching):
    layout, _, cut_layout = branching
    assert cut_layout.chart.max() > layout.chart.max()
    assert efficiency(cut_layout) > 1.2 * efficiency(layout)


def test_pieces_are_connected_and_large_and_are_only_moved_apart(branching):
    layout, _, cut_layout = branching
    np.testing.assert_array_equal(cut_layout.points[cut_layout.corners], layout.points[layout.corners])
    count, label = label_faces(cut_layout.corners, len(cut_layout.points))
    assert count == cut_layout.chart.max() + 1
    np.testing.assert_array_equal(
        np.unique(np.column_stack([label, cut_layout.chart]), axis=0)[:, 1], np.arange(count)
    )
    for chart in range(count):
        piece = TriangleMesh(*compact(cut_layout.points, cut_layout.corners[cut_layout.chart == chart]))
        assert (piece.euler_characteristic, piece.components[0]) == (1, 1)
    areas = np.bincount(cut_layout.chart, signed_double_areas(cut_layout.points[cut_layout.corners]))
    assert areas.min() >= MIN_PIECE * areas.sum() * (1 - 1e-9)


def compact(points, corners):
    points_used, corners = np.unique(corners, return_inverse=True)
    return points[points_used], corners.reshape(-1, 3)


def test_the_added_seams_are_bounded(branching):
    layout, costs, cut_layout = branching
    present, after = (seam_length(version, costs) for version in (layout, cut_layout))
    borders = costs[layout.mesh.is_boundary_edge].sum() + 2 * present
    assert present < after <= present + SHARE * borders * (1 + 1e-9)


@pytest.fixture(scope="module")
def cross():
    """A closed surface of four branches."""
    vertices, faces = shapes.blocks([" # ", " # ", "####", " # ", " # "], 4)
    # Without sharp edges and symmetry, which decide where it is cut.
    return vertices + 0.3 * np.sin(vertices[:, [1, 2, 0]] + [0, 1, 2]), faces


@pytest.mark.parametrize("strength", [0.1, 0.2, 0.5, 0.9])
def test_cuts_are_at_most_a_share_of_the_seams_of_each_layout(cross, strength):
    (layout, costs), (sheet, sheet_costs) = layout_of(*cross), layout_of(*grid(plus))
    cut_layout, same_sheet = cut_for_packing([layout, sheet], [costs, sheet_costs].__getitem__, GAP, strength)
    total = seam_length(cut_layout, costs)
    assert total - seam_length(layout, costs) <= strength * total * (1 + 1e-9)
    assert same_sheet is sheet


def test_without_strength_nothing_is_cut(branching):
    layout, costs, _ = branching
    assert cut_for_packing([layout], [costs].__getitem__, GAP, 0.0)[0] is layout


@pytest.mark.slow
def test_seams_and_coverage_rise_with_the_strength(cross):
    results = [unwrap(*cross, packing_cuts=strength) for strength in (0, 0.25, 0.5, 1)]
    lengths = np.array([result.distortion.seam_length for result in results])
    assert (lengths[1:] >= 0.98 * lengths[:-1]).all()
    assert lengths[-1] > lengths[0]
    assert results[-1].packing_efficiency > 1.1 * results[0].packing_efficiency
    assert all(result.distortion.energy <= 4.1 for result in results)


def test_a_bent_sheet_within_the_bound_is_cut_only_with_the_largest_strength():
    vertices, faces = grid(plus)
    x, y = vertices[:, 0] - 0.5, vertices[:, 1] - 0.5
    sheet = np.column_stack([x, y, 0.8 * (x**2 + y**2)]), faces
    uncut, cut = unwrap(*sheet), unwrap(*sheet, packing_cuts=1)
    assert 4 + 1e-6 < uncut.distortion.energy <= 4.1
    assert (len(uncut.seams), uncut.distortion.charts) == (0, 1)
    assert cut.distortion.charts > 1
    assert cut.packing_efficiency > 1.2 * uncut.packing_efficiency


def test_edges_of_infinite_cost_are_not_cut(branching):
    layout, costs, cut_layout = branching
    cut = np.isin(
        np.sort(layout.mesh.edges, axis=1) @ [len(layout.mesh.vertices), 1],
        np.sort(cut_layout.seams, axis=1) @ [len(layout.mesh.vertices), 1],
    )
    constrained = cut_for_packing([layout], [np.where(cut, np.inf, costs)].__getitem__, GAP, 1.0)[0]
    assert np.isfinite(seam_length(constrained, np.where(cut, np.inf, costs)))
    assert cut_for_packing([layout], [np.full(len(costs), np.inf)].__getitem__, GAP, 1.0)[0] is layout


def test_a_square_is_not_cut():
    layout, costs = layout_of(*grid(square, 24))
    assert cut_for_packing([layout], [costs].__getitem__, GAP, 1.0)[0] is layout


@pytest.mark.slow
def test_only_large_charts_of_several_layouts_are_cut():
    (large, large_costs), (small, small_costs) = layout_of(*grid(plus)), layout_of(*grid(plus, 20))
    small = replace(small, points=small.points / 20)
    large_cut, small_cut = cut_for_packing([large, small], [large_costs, small_costs].__getitem__, GAP, 1.0)
    assert large_cut.chart.max() > large.chart.max()
    assert small_cut is small


@pytest.mark.slow
def test_scale_motion_and_numbering_change_nothing():
    vertices, faces = grid(lambda x, y: starfish(1.1 * x + 0.1 * y**2, y))
    # Without equal paths, among which the numbering would choose.
    vertices = vertices + np.random.default_rng(0).uniform(-0.2, 0.2, vertices.shape) / 48 * [1, 1, 0]
    layout, costs = layout_of(vertices, faces)
    cut_layout = cut_for_packing([layout], [costs].__getitem__, GAP, 1.0)[0]
    other_vertices, other_faces, _ = shapes.renumber(vertices, faces)
    turned = other_vertices @ shapes.rotation().T * 7 + 3
    turned_layout, turned_costs = layout_of(turned, other_faces)
    again = cut_for_packing([turned_layout], [turned_costs].__getitem__, GAP, 1.0)[0]
    assert again.chart.max() == cut_layout.chart.max()
    relative = [
        seam_length(version, cost) / np.sqrt(version.area)
        for version, cost in ((cut_layout, costs), (again, turned_costs))
    ]
    assert relative[1] == pytest.approx(relative[0], rel=1e-6)
    assert (
        cut_for_packing([layout], [costs].__getitem__, GAP, 1.0)[0].chart.tolist()
        == cut_layout.chart.tolist()
    )


@pytest.mark.slow
def test_with_a_gap_that_leaves_no_space_nothing_is_cut():
    layout, costs = layout_of(*grid(plus, 20))
    assert cut_for_packing([layout, layout, layout], lambda _: costs, 0.6, 1.0)[0] is layout


def test_layouts_without_seams_are_only_packed(monkeypatch):
    """With a strength below 1, no cut of them is allowed, so that none is searched for."""
    monkeypatch.setattr(pack_cuts, "_largest_charts", lambda *_: pytest.fail("cuts are searched for"))
    assert unwrap(*shapes.grid(6)).distortion.charts == 1
    with pytest.raises(pytest.fail.Exception):
        unwrap(*shapes.grid(6), packing_cuts=1.0)
