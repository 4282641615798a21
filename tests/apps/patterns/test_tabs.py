from __future__ import annotations

import numpy as np
import pytest
import shapely
from polyhedra import cube, dodecahedron, icosahedron, prism
from test_net import rough

from coneflat import TriangleMesh
from coneflat.apps.patterns.drawing.shapes import fold_of_tab, piece_shapes
from coneflat.apps.patterns.finish import Finish
from coneflat.apps.patterns.net.net import unfold_net
from coneflat.apps.patterns.net.tabs import glue_tabs
from coneflat.apps.patterns.pieces.borders import find_borders

SOLIDS = {"cube": cube, "dodecahedron": dodecahedron, "icosahedron": icosahedron, "prism": lambda: prism(9)}


def tabs_of(mesh: TriangleMesh, size: float, width: float):
    """Return the net of a mesh of a size, its borders and its tabs."""
    surface = unfold_net(mesh.moved_to(mesh.vertices * size / np.ptp(mesh.vertices, axis=0).max())).surface
    borders = find_borders(surface)
    return surface, borders, glue_tabs(surface, borders, width)


def assert_free(surface, tabs) -> None:
    """No two tabs overlap, and none overlaps a piece."""
    shapes = [shapely.Polygon(tab.polygon) for tab in tabs.tabs]
    pieces = shapely.union_all(shapely.polygons(surface.places))
    for i, shape in enumerate(shapes):
        assert shape.is_valid
        assert shape.exterior.is_ccw
        assert shape.intersection(pieces).area < 1e-4 * shape.area
        assert all(shape.intersection(after).area < 1e-4 * shape.area for after in shapes[i + 1 :])


@pytest.mark.parametrize("name", SOLIDS)
def test_every_straight_part_of_a_seam_has_one_tab(name):
    surface, borders, tabs = tabs_of(SOLIDS[name](), 100.0, 5.0)
    assert not len(tabs.lengths_without)
    assert not tabs.notes
    assert_free(surface, tabs)
    covered = sorted((tab.seam, tab.edges if tab.side == 0 else ()) for tab in tabs.tabs)
    assert {seam for seam, _ in covered} == set(range(len(borders.seams)))
    # The edges of the sides with tabs, and of those without, are each seam edge once.
    edges = sum(tab.edges[1] - tab.edges[0] for tab in tabs.tabs)
    assert edges == sum(len(seam.sides[0].halfedges) for seam in borders.seams)


def test_the_base_of_a_tab_is_on_its_side_and_its_width_is_that_given():
    surface, borders, tabs = tabs_of(cube(), 60.0, 4.0)
    for tab in tabs.tabs:
        side = borders.seams[tab.seam].sides[tab.side]
        ends = surface.points[side.points[list(tab.edges)]]
        base = shapely.LineString(ends)
        assert max(base.distance(shapely.Point(corner)) for corner in tab.polygon[[0, -1]]) < 1e-9
        assert max(base.distance(shapely.Point(corner)) for corner in tab.polygon) == pytest.approx(4.0)
        assert tab.piece == side.piece


def test_tabs_of_a_rough_model_do_not_collide():
    surface, _, tabs = tabs_of(rough(), 200.0, 6.0)
    assert len(tabs.tabs) > 50
    assert_free(surface, tabs)


def test_tabs_without_room_are_counted():
    _, borders, tabs = tabs_of(prism(60), 100.0, 30.0)
    # The bases are glued to faces that are 5 mm wide, with tabs from a quarter of the width.
    assert len(tabs.lengths_without) > 10
    parts = sum(len(seam.sides[0].halfedges) for seam in borders.seams)
    assert len(tabs.tabs) + len(tabs.lengths_without) == parts
    (note,) = tabs.notes
    assert f"{len(tabs.lengths_without)} of {parts} glue tabs have no room" in note
    assert f"{tabs.lengths_without.max():.1f} mm" in note


def test_sides_shorter_than_a_tab_is_wide_have_tabs():
    surface, _, tabs = tabs_of(icosahedron(), 6.5, 8.0)
    assert surface.edges.lengths.max() == pytest.approx(4.0, abs=0.1)
    assert not len(tabs.lengths_without)
    assert_free(surface, tabs)


def test_outlines_with_tabs_have_the_exact_corners_of_the_net():
    surface, borders, tabs = tabs_of(rough(), 200.0, 6.0)
    shapes = piece_shapes(surface, borders, Finish(), tabs.tabs)
    folds = [fold_of_tab(surface, borders, tab) for tab in tabs.tabs]
    drawn = np.concatenate([*(ring for shape in shapes for ring in shape.cut_rings), *folds])
    corners = surface.points[
        np.unique(np.concatenate([side.points for seam in borders.seams for side in seam.sides]))
    ]
    assert (corners[:, None] == drawn).all(axis=2).any(axis=1).all()
    for piece, shape in enumerate(shapes):
        # Nothing is inside twice.
        area = sum(shapely.Polygon(ring).area for ring in shape.cut_rings)
        tabs_of_piece = sum(shapely.Polygon(tab.polygon).area for tab in tabs.tabs if tab.piece == piece)
        assert area == pytest.approx(shape.inside.area + tabs_of_piece, rel=1e-6)


def test_width_zero_is_without_tabs():
    assert tabs_of(cube(), 60.0, 0.0)[2].tabs == ()
