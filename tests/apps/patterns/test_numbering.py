"""Numbers of pieces and names of seams do not depend on the numbering of the mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flat_pieces import cut_at, sheet
from polyhedra import cube, icosphere, turned, uv_sphere
from shapes import renumber

import coneflat
from coneflat import Pattern, TriangleMesh
from coneflat.apps.patterns.pieces.cut_surface import CutSurface
from coneflat.apps.patterns.pieces.numbering import order_around, order_by_size

HEIGHTS = np.linspace(0, 2, 9)
VASE = turned(0.6 + 0.3 * np.sin(2.5 * HEIGHTS), HEIGHTS)


def seam_places(pattern):
    """Return the middle of each seam on the surface, its pieces and whether it is a dart, by name."""
    mesh = pattern.surface.mesh
    places = {}
    for seam in pattern.seams:
        middle = mesh.vertices[mesh.edges[mesh.halfedge_edges[seam.sides[0].halfedges]]].mean(axis=(0, 1))
        places[seam.name] = (*np.round(middle, 6) + 0.0, *(side.piece for side in seam.sides), seam.is_dart)
    return places


def renumbered(surface: CutSurface, seed: int) -> CutSurface:
    """The same cut surface with triangles, vertices and points in another order."""
    rng = np.random.default_rng(seed)
    mesh = surface.mesh
    vertex, point = rng.permutation(len(mesh.vertices)), rng.permutation(len(surface.points))
    faces = rng.permutation(len(mesh.faces))
    turns = (np.arange(3) + rng.integers(0, 3, (len(faces), 1))) % 3
    vertices, points = np.empty_like(mesh.vertices), np.empty_like(surface.points)
    vertices[vertex], points[point] = mesh.vertices, surface.points
    shuffled = [
        np.take_along_axis(table[faces], turns, axis=1)
        for table in (vertex[mesh.faces], point[surface.corners])
    ]
    return CutSurface(TriangleMesh(vertices, shuffled[0]), shuffled[1], points)


def patterns():
    """Patterns of all kinds; their lengths in millimetres."""
    ball, box = uv_sphere(), cube()
    yield "cloth", coneflat.pattern(ball.vertices, ball.faces, unit="cm", scale=5, strain="5%")
    yield "net", coneflat.pattern(box.vertices, box.faces, unit="cm", kind="net")
    yield "sheet", Pattern("sheet", cut_at(cut_at(sheet(), 40.0), 80.0, 40.0), 1.0)


@pytest.mark.parametrize(
    ("kind", "pattern"), [*patterns()], ids=lambda value: value if isinstance(value, str) else ""
)
@pytest.mark.parametrize("seed", [0, 1])
def test_names_of_seams_do_not_depend_on_the_numbering_of_vertices(kind, pattern, seed):
    again = Pattern(kind, renumbered(pattern.surface, seed), 1.0, settings=pattern.settings)
    assert len(pattern.seams) > 0
    assert seam_places(again) == seam_places(pattern)


@pytest.mark.parametrize("mesh", [uv_sphere(), icosphere(2), VASE], ids=["sphere", "icosphere", "vase"])
def test_each_gore_is_sewn_to_the_following_one(mesh):
    count = 6
    options = {"kind": "gores", "gores": count, "unit": "cm", "axis": (0, 0, 1)}
    result = coneflat.pattern(mesh.vertices, mesh.faces, **options)
    # A is between 1 and 2, B between 2 and 3, and so on.
    pairs = [tuple(side.piece for side in seam.sides) for seam in result.seams]
    assert pairs == [(piece, (piece + 1) % count) for piece in range(count)]


def test_the_first_gore_does_not_depend_on_the_numbering_of_vertices():
    # Without symmetry, so that one vertex is farthest from the axis.
    x, y, z = uv_sphere().vertices.T
    positions, faces = np.stack([1.2 * x + 0.1 * x * y, y + 0.05 * x * x, z], axis=1), uv_sphere().faces
    options = {"kind": "gores", "gores": 5, "unit": "cm", "axis": (0, 0, 1)}
    vertices, shuffled, _ = renumber(positions, faces)
    places, expected = (
        seam_places(coneflat.pattern(*arrays, **options))
        for arrays in ((vertices, shuffled), (positions, faces))
    )
    assert places.keys() == expected.keys()
    for name, place in places.items():
        assert place == pytest.approx(expected[name], abs=1e-4)


def test_pieces_are_numbered_by_size():
    # The narrower of two pieces of 80 and 40 mm, which has fewer triangles, is drawn out to 200 mm.
    surface = cut_at(sheet(), 80.0)
    x, y, z = surface.mesh.vertices.T
    drawn_out = np.stack([np.where(x > 80, 5 * x - 320, x), y, z], axis=1)
    surface = replace(surface, mesh=TriangleMesh(drawn_out, surface.mesh.faces))
    areas = np.bincount(surface.pieces, surface.edges.double_areas) / 2
    assert areas.tolist() == pytest.approx([200 * 80, 80 * 80])


def test_each_triangle_and_each_point_belongs_to_its_piece():
    surface = cut_at(sheet(), 80.0)
    shuffled = renumbered(surface, 0)
    for cut in (surface, shuffled):
        assert np.array_equal(np.sort(np.concatenate(cut.triangles_of_pieces)), np.arange(len(cut.pieces)))
        assert np.array_equal(np.sort(np.concatenate([*cut.points_of_pieces])), np.arange(len(cut.points)))
        for piece, (triangles, points) in enumerate(
            zip(cut.triangles_of_pieces, cut.points_of_pieces, strict=True)
        ):
            assert (cut.pieces[triangles] == piece).all()
            assert (cut.piece_of_point[points] == piece).all()


def test_neighbouring_sides_have_neighbouring_names():
    ball = uv_sphere()
    pattern = coneflat.pattern(ball.vertices, ball.faces, unit="cm", scale=5, strain="5%")
    names = [seam.name for seam in pattern.seams if any(side.piece == 0 for side in seam.sides)]
    # The first piece has the first names.
    assert names == [seam.name for seam in pattern.seams[: len(names)]]


def test_equal_sizes_are_ordered_by_position():
    positions = np.array([[2.0, 0, 0], [1, 0, 0], [3, 0, 0], [1, 1, 0]])
    sizes = np.array([1.0, 1 + 1e-12, 5.0, 1 - 1e-12])
    assert order_by_size(sizes, positions).tolist() == [2, 1, 3, 0]
    assert order_by_size(np.empty(0), np.empty((0, 3))).tolist() == []


def test_places_around_an_axis_are_in_order():
    angles = 2 * np.pi * np.array([0.1, 0.7, 0.4, 0.9])
    positions = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    order = order_around(positions - positions.mean(axis=0), np.array([0.0, 0.0, 2.0])).tolist()
    assert [order[(order.index(0) + i) % 4] for i in range(4)] == [0, 2, 1, 3]
