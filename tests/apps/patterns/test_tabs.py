from __future__ import annotations

import numpy as np
import pytest
import shapely
from polyhedra import cube, dodecahedron, icosahedron, prism
from test_net import rough

from coneflat import TriangleMesh
from coneflat.apps.patterns.borders import find_borders
from coneflat.apps.patterns.net import unfold_net
from coneflat.apps.patterns.tabs import glue_tabs

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
    assert len(tabs.lengths_without) >= 60
    parts = sum(len(seam.sides[0].halfedges) for seam in borders.seams)
    assert len(tabs.tabs) + len(tabs.lengths_without) == parts
    (note,) = tabs.notes
    assert f"{len(tabs.lengths_without)} of {parts} glue tabs have no room" in note
    assert f"{tabs.lengths_without.max():.1f} mm" in note


def test_width_zero_is_without_tabs():
    assert tabs_of(cube(), 60.0, 0.0)[2].tabs == ()
