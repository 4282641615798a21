"""Laws of surfaces with holes: a planar domain of little distortion needs no seam to reach a hole."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

import coneflat
from coneflat.geometry import corner_angles, edge_lengths, signed_double_areas
from coneflat.geometry.planar import layout_curvature
from coneflat.io import as_input
from coneflat.mesh import find_holes
from coneflat.options import Options
from coneflat.source import Source, coarse


def with_holes(mesh, centres, radius):
    """Return a mesh without the triangles within a radius of places in its first two coordinates."""
    vertices, faces = mesh
    middles = vertices[faces].mean(axis=1)[:, :2]
    is_outside = np.linalg.norm(middles[:, None] - np.asarray(centres)[None], axis=2).min(axis=1) > radius
    is_outside |= np.ptp(vertices[faces][:, :, 0], axis=1) > 0.5  # around a tube
    vertex_indices, corners = np.unique(faces[is_outside], return_inverse=True)
    return vertices[vertex_indices], corners.reshape(-1, 3)


def sheet(count, size=40, height=0.1):
    """Return a curved sheet with count x count holes."""
    uncut = shapes.grid(size, size, lambda x, y: height * np.sin(3 * x) * np.cos(2.5 * y))
    places = (np.arange(count) + 0.5) / count
    return with_holes(uncut, [(x + 0.02, y - 0.01) for x in places for y in places], 0.25 / count)


def tower(rows=3, columns=5, around=60, along=36, waves=0.08):
    """Return a curved tube of two open ends, with windows."""
    vertices, faces = with_holes(
        shapes.grid(around, along, wrap=(True, False)),
        [((i + 0.45) / columns, (j + 0.5) / rows) for i in range(columns) for j in range(rows)],
        0.25 / columns,
    )
    turn, height = 2 * np.pi * vertices[:, 0], 3 * vertices[:, 1]
    radius = 1 - 0.1 * height + waves * np.sin(2.3 * height)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1), faces


def walks_of(result):
    """Return the mesh of a result, and its holes."""
    mesh = coneflat.check_mesh(result.vertices, result.faces).mesh
    return mesh, find_holes(mesh)


SEAMLESS = {
    "flatten": lambda *mesh: coneflat.flatten(*mesh),
    "flatten, cones none": lambda *mesh: coneflat.flatten(*mesh, cones="none"),
    "flatten, linear": lambda *mesh: coneflat.flatten(*mesh, method="linear"),
    "unwrap": lambda *mesh: coneflat.unwrap(*mesh),
    "unwrap, seams none": lambda *mesh: coneflat.unwrap(*mesh, seams="none"),
    "unwrap, one": lambda *mesh: coneflat.unwrap(*mesh, charts="one"),
}


@pytest.mark.parametrize("count", [1, 2, 5])
@pytest.mark.parametrize("method", SEAMLESS)
def test_a_sheet_keeps_its_holes(method, count):
    result = SEAMLESS[method](*sheet(count))
    measures = result.distortion
    assert len(walks_of(result)[1]) == count**2
    assert (measures.charts, measures.seam_length, len(result.cones)) == (1, 0, 0)
    assert (measures.flipped, measures.overlapping_pairs) == (0, 0)
    assert measures.energy < 4.02
    assert result.notes == ()


@pytest.mark.parametrize("flat", [coneflat.flatten, coneflat.unwrap])
def test_numbering_position_and_size_do_not_matter(flat):
    vertices, faces = sheet(3)
    before = flat(vertices, faces).distortion
    moved, renumbered, _ = shapes.renumber(1e-3 * vertices @ shapes.rotation() + 0.7, faces)
    after = flat(moved, renumbered).distortion
    assert (after.charts, after.seam_length) == (before.charts, before.seam_length) == (1, 0)
    assert after.energy == pytest.approx(before.energy, rel=1e-6)
    assert after.qc_mean == pytest.approx(before.qc_mean, rel=1e-6)


def test_a_flat_sheet_keeps_its_shape_around_holes_of_any_shape():
    vertices, faces = shapes.grid(30, 30)
    x, y = vertices[faces].mean(axis=1)[:, :2].T
    is_l = (abs(x - 0.3) < 0.15) & (abs(y - 0.5) < 0.3) | (abs(x - 0.5) < 0.35) & (abs(y - 0.28) < 0.08)
    is_bar = (abs(x - 0.75) < 0.02) & (abs(y - 0.65) < 0.25)
    mesh = coneflat.check_mesh(vertices, faces[~(is_l | is_bar)], repair=True).mesh
    for result in (coneflat.flatten(mesh.vertices, mesh.faces), coneflat.unwrap(mesh.vertices, mesh.faces)):
        assert len(walks_of(result)[1]) == 2
        assert result.distortion.qc_max == pytest.approx(1, abs=1e-6)
        assert result.distortion.area_std == pytest.approx(0, abs=1e-6)
        assert result.distortion.seam_length == 0


def test_the_border_of_a_kept_hole_turns_by_a_full_turn():
    """The loop around it has no holonomy: neither a rotation, nor a translation, as it closes up."""
    result = coneflat.flatten(*sheet(2, height=0.3))
    mesh, holes = walks_of(result)
    curvature = layout_curvature(mesh, result.uv[result.uv_faces])
    for hole in holes:
        assert curvature[mesh.tails[hole]].sum() == pytest.approx(-2 * np.pi, abs=1e-9)
    assert len(result.uv) == len(result.vertices)


def test_the_metric_stays_exact_with_kept_holes():
    result = coneflat.flatten(*sheet(3), relax="off")
    mesh, _ = walks_of(result)
    inner = ~mesh.is_boundary_vertex
    assert np.abs(layout_curvature(mesh, result.uv[result.uv_faces])[inner]).max() < 1e-9
    places = np.pad(result.uv[result.uv_faces].reshape(-1, 2), ((0, 0), (0, 1)))
    flat = edge_lengths(places, np.arange(len(places)).reshape(-1, 3))
    scale = result.log_scale[mesh.faces]
    factors = (scale[:, [1, 2, 0]] + scale[:, [2, 0, 1]]) / 2 + np.log(result.uv_scale)
    lengths = edge_lengths(mesh.vertices, mesh.faces)
    # Edges that are flipped in the intrinsic Delaunay triangulation are not scaled by their ends alone.
    assert np.median(np.abs(np.log(flat / lengths) - factors)) < 1e-9
    assert np.isfinite(corner_angles(flat)).all()


@pytest.mark.parametrize("flat", [coneflat.flatten, coneflat.unwrap])
def test_the_ends_of_a_tube_are_opened_and_its_windows_are_not(flat):
    options = {"charts": "one"} if flat is coneflat.unwrap else {}
    result = flat(*tower(), **options)
    mesh, holes = walks_of(result)
    assert len(holes) == 16
    # A seam along the tower, of length 3, partly through windows: less than one that reaches all of them.
    area = signed_double_areas(result.uv[result.uv_faces]).sum() / 2 / result.uv_scale**2
    assert 0 < result.distortion.seam_length * np.sqrt(area) < 3.2
    assert result.distortion.flipped == 0
    ends = result.seams[np.isin(result.seams, np.flatnonzero(mesh.is_boundary_vertex))]
    assert {0.0, 3.0} <= set(np.round(mesh.vertices[ends, 2], 9))


def test_a_long_tube_gets_a_seam_even_if_none_is_wanted():
    vertices, faces = shapes.cylinder(height=6.0)
    for result in (
        coneflat.unwrap(vertices, faces, seams="none"),
        coneflat.flatten(vertices, faces, cones="none"),
    ):
        assert result.distortion.charts == 1
        assert result.distortion.seam_length > 0
        assert result.distortion.energy == pytest.approx(4, abs=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_layouts_of_sieves_are_injective(seed):
    """Holes of single triangles, some of which touch in vertices that the repair splits."""
    vertices, faces = shapes.hill(16, 14)
    random = np.random.default_rng(seed)
    result = coneflat.unwrap(vertices, faces[random.random(len(faces)) > 0.15], repair=True)
    assert (result.distortion.flipped, result.distortion.overlapping_pairs) == (0, 0)
    assert result.distortion.energy <= 4.1


def test_a_ramp_with_holes_is_separated_where_it_overlaps_itself():
    points, faces = shapes.grid(90, 8)
    keep = np.ones(len(faces), dtype=bool)
    keep[np.random.default_rng(1).integers(len(faces), size=40)] = False
    turn, radius = 4.5 * np.pi * points[:, 0], 0.5 + points[:, 1]
    ramp = np.stack([radius * np.cos(turn), radius * np.sin(turn), 0.05 * turn], axis=1)
    for flat in (coneflat.flatten, coneflat.unwrap):
        measures = flat(ramp, faces[keep], repair=True).distortion
        assert measures.charts > 1
        assert (measures.flipped, measures.overlapping_pairs) == (0, 0)


def test_a_sheet_with_holes_is_cut_into_a_number_of_charts():
    result = coneflat.unwrap(*sheet(2), charts=3)
    assert (result.distortion.charts, result.distortion.overlapping_pairs) == (3, 0)
    assert result.notes == ()


def test_many_small_sheets_keep_their_holes():
    pieces = [sheet(1, size=8 + i % 3, height=0.05 + 0.002 * i) for i in range(34)]
    vertices, faces = shapes.join(*((v + np.array([2.0 * i, 0, 0]), f) for i, (v, f) in enumerate(pieces)))
    for flat in (coneflat.flatten, coneflat.unwrap):
        measures = flat(vertices, faces).distortion
        assert (measures.charts, measures.seam_length) == (34, 0)


def test_a_large_sheet_keeps_its_holes():
    """Large components are compared on a coarse mesh."""
    mesh = sheet(4, size=72)
    assert len(mesh[1]) > 8_000
    for flat in (coneflat.flatten, coneflat.unwrap):
        assert flat(*mesh).distortion.seam_length == 0


def test_a_flattener_gives_the_same_with_holes_again():
    mesh = sheet(2)
    flattener, once = coneflat.Flattener(*mesh), coneflat.flatten(*mesh)
    for _ in range(2):
        assert np.array_equal(flattener.flatten().uv, once.uv)


def test_holes_that_a_seam_opens_are_not_filled():
    vertices, faces = sheet(2)
    mesh = coneflat.check_mesh(vertices, faces).mesh
    hole = find_holes(mesh)[0]
    starts, edges = mesh.incident_edges
    at = mesh.tails[hole[0]]
    inner = [e for e in edges[starts[at] : starts[at + 1]] if not mesh.is_boundary_edge[e]]
    marked = Source(as_input(vertices, faces)).prepared(Options(seams=mesh.edges[inner[:1]])).components[0]
    plain = Source(as_input(vertices, faces)).prepared(Options()).components[0]
    assert (len(marked.fill.holes), len(plain.fill.holes)) == (3, 4)


@pytest.mark.parametrize("boundary", ["lengths", "disk", "straight"])
def test_a_prescribed_boundary_includes_that_of_holes(boundary):
    component = Source(as_input(*sheet(2))).prepared(Options(boundary=boundary)).components[0]
    assert component.fill is None


def test_forbidden_edges_around_a_hole_keep_it_on_a_large_mesh(monkeypatch):
    """A coarse mesh, on which holes are compared, has no forbidden edges."""
    monkeypatch.setattr(coarse, "COARSE", 250)
    vertices, faces = shapes.sphere(3, bumps=0.0)
    middles = vertices[faces].mean(axis=1)
    vertex_indices, corners = np.unique(faces[np.abs(middles[:, 2]) < 0.8], return_inverse=True)
    mesh = coneflat.TriangleMesh(vertices[vertex_indices], corners.reshape(-1, 3))
    border = mesh.tails[find_holes(mesh)[0]]
    at_hole = mesh.edges[np.isin(mesh.edges, border).any(axis=1)]
    result = coneflat.flatten(mesh.vertices, mesh.faces, no_seams=at_hole)
    assert not result.distortion.flipped
