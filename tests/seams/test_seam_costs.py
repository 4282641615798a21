"""What seams cost: creases, what is hidden, and weights of the user."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapes
from test_seams import SURFACES, lengths_of, with_cones

from coneflat import TriangleMesh, errors
from coneflat.geometry import visibility, visible_share
from coneflat.geometry.triangles import dihedral_angles
from coneflat.mesh import cut_open
from coneflat.seams import edge_costs, find_seams


def well(width=1.0, depth=1.0, wall=0.4, rows=12, around=32):
    """A solid of revolution with a round well in its top, and the vertices in the middle of the well's bottom."""
    profile = [
        (0.02, -wall),
        (width + wall, -wall),
        (width + wall, depth),
        (width, depth),
        (width, 0.0),
        (0.02, 0.0),
    ]
    steps = np.linspace(0, 1, rows, endpoint=False)[:, None]
    corners = np.array(profile)
    line = np.concatenate([p + steps * (q - p) for p, q in itertools.pairwise(corners)])
    line = np.concatenate([line, corners[-1:]])
    _, faces = shapes.grid(around, len(line) - 1, wrap=(True, False))
    angle = 2 * np.pi * np.arange(around)[:, None] / around
    vertices = np.stack(
        [
            line[:, 0] * np.cos(angle),
            line[:, 0] * np.sin(angle),
            np.broadcast_to(line[:, 1], (around, len(line))),
        ],
        axis=-1,
    ).reshape(-1, 3)
    return vertices, faces, np.arange(around) * len(line) + len(line) - 1


class TestVisibility:
    @pytest.mark.parametrize("shape", [shapes.sphere(2, 0.0), shapes.box(4)])
    def test_convex_shapes_are_visible_everywhere(self, shape):
        assert visible_share(*shape).min() > 0.97

    @pytest.mark.parametrize("depth", [0.5, 2.0])
    def test_visibility_in_a_well_is_its_view_factor(self, depth):
        vertices, faces, bottom = well(depth=depth)
        share = visible_share(vertices, faces)
        # The view factor of a disk of radius 1 at this distance.
        assert share[bottom].mean() == pytest.approx(1 / (1 + depth**2), abs=0.07)
        outside = np.flatnonzero(np.hypot(*vertices[:, :2].T) > 1.39)
        assert share[outside].min() > 0.97

    def test_visibility_does_not_depend_on_the_orientation(self):
        vertices, faces, _ = well()
        np.testing.assert_allclose(visible_share(vertices, faces[:, ::-1]), visible_share(vertices, faces))

    def test_an_up_direction_hides_the_underside(self):
        vertices, faces = shapes.sphere(3, 0.0)
        for up in ([0, 0, 1], [0, -3, 0]):
            share = visible_share(vertices, faces, np.array(up))
            height = vertices @ np.array(up) / np.linalg.norm(up)
            # Integrals of (1 + z) / 2 by the cosine over the hemispheres of the top, the side and the underside.
            np.testing.assert_allclose(share, 0.6 + 0.4 * height, atol=0.03)

    def test_components_hide_each_other(self):
        ball, plate = shapes.sphere(3, 0.0), shapes.box(6, (4.0, 4.0, 0.1))
        plate = plate[0] - plate[0].mean(axis=0) + [0, 0, 1.1], plate[1]
        share = visible_share(*shapes.join(ball, plate))[: len(ball[0])]
        assert share[np.argmax(ball[0][:, 2])] < 0.2
        assert share[np.argmin(ball[0][:, 2])] > 0.97

    def test_numbering_position_and_size_do_not_matter(self):
        vertices, faces = shapes.sphere(3, 0.6)
        share = visible_share(vertices, faces)
        assert share.min() < 0.95
        for seed, size in ((1, 1e-6), (3, 1e6)):
            moved, turned, number = shapes.renumber(vertices, faces, seed)
            moved_share = visible_share(size * (moved @ shapes.rotation(seed).T + [1, 2, 3]), turned)[number]
            # A vertex on the edge of a pixel may fall to either side.
            assert np.mean(np.abs(moved_share - share) < 1e-6) > 0.99
            assert np.abs(moved_share - share).max() < 0.1

    @pytest.mark.slow
    def test_more_directions_and_pixels_change_little(self, monkeypatch):
        vertices, faces, _ = well()
        share = visible_share(vertices, faces)
        monkeypatch.setattr(visibility, "DIRECTIONS", 200)
        monkeypatch.setattr(visibility, "PIXELS", 512)
        assert np.sqrt(np.mean((visible_share(vertices, faces) - share) ** 2)) < 0.03

    @pytest.mark.parametrize("up", [np.zeros(3), np.ones(2), np.array([0, np.nan, 1])])
    def test_up_must_be_a_direction(self, up):
        with pytest.raises(errors.OptionError, match="up must be a direction"):
            visible_share(*shapes.sphere(1), up)


def test_dihedral_angles_of_ridges_are_positive_and_of_valleys_negative():
    mesh = TriangleMesh(*shapes.grid(12, 4, lambda x, y: 3 * np.abs(np.abs(x - 0.5) - 0.25)))
    angles = dihedral_angles(mesh)
    middle = mesh.vertices[mesh.edges].mean(axis=1)
    along = np.ptp(mesh.vertices[mesh.edges][:, :, 0], axis=1) < 1e-9
    inner = along & ~mesh.is_boundary_edge
    bend = 2 * np.arctan(3)
    np.testing.assert_allclose(angles[inner & np.isclose(middle[:, 0], 0.5)], bend)
    for x in (0.25, 0.75):
        np.testing.assert_allclose(angles[inner & np.isclose(middle[:, 0], x)], -bend)
    assert np.count_nonzero(np.abs(angles) > 1e-9) == 3 * 4


class TestCosts:
    def test_without_constraints_costs_are_lengths(self):
        mesh = TriangleMesh(*shapes.sphere(2))
        np.testing.assert_array_equal(edge_costs(mesh, lengths_of(mesh)), lengths_of(mesh))

    def test_seams_of_a_box_run_along_its_edges_if_these_are_cheap(self):
        mesh = TriangleMesh(*shapes.box(8, (1.0, 1.0, 1.0)))
        corners = np.flatnonzero((np.abs(mesh.vertices - mesh.vertices.mean(axis=0)) > 0.49).all(axis=1))
        assert len(corners) == 8
        sharp = np.abs(dihedral_angles(mesh)) > 1
        lengths = lengths_of(mesh)
        # A tree of 7 of the 12 edges of the cube.
        seams = find_seams(mesh, corners, edge_costs(mesh, lengths, creases=1.0))
        assert sharp[seams].all()
        assert lengths[seams].sum() == pytest.approx(7)
        # Between opposite corners the way over the faces is shorter than that along three edges.
        opposite = corners[
            [0, np.argmax(np.linalg.norm(mesh.vertices[corners] - mesh.vertices[corners[0]], axis=1))]
        ]
        seams = find_seams(mesh, opposite, edge_costs(mesh, lengths, creases=1.0))
        assert sharp[seams].all()
        assert lengths[seams].sum() == pytest.approx(3)
        assert lengths[find_seams(mesh, opposite, lengths)].sum() < 2.9

    def test_full_creases_cost_a_tenth(self):
        mesh = TriangleMesh(*shapes.box(4))
        costs = edge_costs(mesh, lengths_of(mesh), creases=1.0) / lengths_of(mesh)
        sharp = np.abs(dihedral_angles(mesh)) > 1
        np.testing.assert_allclose(costs[sharp], 0.1)
        np.testing.assert_allclose(costs[~sharp], 1.0)

    def test_seams_prefer_hidden_places(self):
        mesh, cones = with_cones(shapes.genus(2), 5)
        share, lengths = visible_share(mesh.vertices, mesh.faces), lengths_of(mesh)
        costs = edge_costs(mesh, lengths, hiding=1)
        plain, hidden = find_seams(mesh, cones, lengths), find_seams(mesh, cones, costs)
        seen = [
            np.average(share[mesh.edges[seams]].mean(axis=1), weights=lengths[seams])
            for seams in (plain, hidden)
        ]
        assert seen[1] < seen[0] - 0.05
        assert costs[hidden].sum() < costs[plain].sum()

    def test_hidden_edges_are_cheap(self):
        vertices, faces, bottom = well(depth=3.0)
        mesh = TriangleMesh(vertices, faces)
        ratio = edge_costs(mesh, lengths_of(mesh), hiding=1) / lengths_of(mesh)
        at_bottom = np.isin(mesh.edges, bottom).all(axis=1)
        assert ratio[at_bottom].max() < 0.2
        assert ratio.max() <= 1 + 1e-12
        assert ratio.min() > 0
        all_visible = edge_costs(mesh, lengths_of(mesh), hiding=1, visibility=np.ones(len(vertices)))
        valley = dihedral_angles(mesh) < -1e-3
        assert (all_visible[valley] < lengths_of(mesh)[valley]).all()
        np.testing.assert_allclose(all_visible[~valley], lengths_of(mesh)[~valley])
        inside_out = TriangleMesh(vertices, faces[:, ::-1])
        turned = edge_costs(inside_out, lengths_of(inside_out), hiding=1) / lengths_of(inside_out)
        np.testing.assert_allclose(np.sort(turned), np.sort(ratio))

    def test_seams_follow_cheap_weights(self):
        # A detour that is three times as long, at a tenth of the cost.
        columns, rows = 20, 20
        mesh, _ = with_cones(shapes.grid(columns, rows), 0)
        at = lambda i, j: i * (rows + 1) + j  # noqa: E731
        lane = [at(4, j) for j in range(4, 17)] + [at(i, 16) for i in range(4, 11)]
        lane += [at(10, j) for j in range(4, 17)]
        cheap = np.isin(np.arange(len(mesh.vertices)), lane)
        # Far from the boundary, where leaving the grid is not a way.
        costs = edge_costs(mesh, lengths_of(mesh), vertex_weights=np.where(cheap, 0.1, 1.0))
        boundary = mesh.is_boundary_vertex[mesh.edges].any(axis=1)
        costs[boundary] *= 100
        seams = find_seams(mesh, np.array([at(4, 4), at(10, 4)]), costs)
        inner = seams[~boundary[seams]]
        on_lane = cheap[mesh.edges[inner]].all(axis=1)
        assert on_lane.sum() >= 28  # of 30; corners are cut

    def test_weights_of_zero_become_small(self):
        mesh = TriangleMesh(*shapes.sphere(2))
        weights = np.zeros(len(mesh.vertices))
        weights[:10] = 2.0
        costs = edge_costs(mesh, lengths_of(mesh), vertex_weights=weights)
        is_small = (mesh.edges >= 10).all(axis=1)
        np.testing.assert_allclose(costs[is_small], lengths_of(mesh)[is_small] * 2e-3)
        assert cut_open(mesh, find_seams(mesh, np.array([3, 50, 80]), costs)).mesh.components[0] == 1

    @pytest.mark.parametrize(
        ("constraints", "message"),
        [
            ({"hiding": np.inf}, "hiding must be a number from 0 to 10, got inf"),
            (
                {"vertex_weights": np.ones(3)},
                r"vertex weights of seams must be 162 numbers, got shape \(3,\)",
            ),
            ({"vertex_weights": np.zeros(162)}, "not all 0, got 0 to 0"),
            ({"vertex_weights": np.full(162, -1.0)}, "got -1 to -1"),
            ({"vertex_weights": np.full(162, np.nan)}, "must be finite"),
        ],
    )
    def test_invalid_constraints_are_refused(self, constraints, message):
        mesh = TriangleMesh(*shapes.sphere(2))
        with pytest.raises(errors.OptionError, match=message):
            edge_costs(mesh, lengths_of(mesh), **constraints)

    def test_costs_do_not_depend_on_numbering_position_or_size(self):
        vertices, faces = SURFACES["genus 1"]
        mesh = TriangleMesh(vertices, faces)
        ratio = edge_costs(mesh, lengths_of(mesh), creases=1.0, hiding=1) / lengths_of(mesh)
        for seed, size in ((1, 1e-6), (3, 1e6)):
            moved, turned, number = shapes.renumber(vertices, faces, seed)
            moved_mesh = TriangleMesh(size * (moved @ shapes.rotation(seed).T + [1, 2, 3]), turned)
            moved_ratio = edge_costs(moved_mesh, lengths_of(moved_mesh), creases=1.0, hiding=1) / lengths_of(
                moved_mesh
            )
            ends = np.sort(number[mesh.edges], axis=1)
            place = np.lexsort((ends[:, 1], ends[:, 0]))
            moved_place = np.lexsort((moved_mesh.edges[:, 1], moved_mesh.edges[:, 0]))
            assert np.mean(np.isclose(moved_ratio[moved_place], ratio[place], rtol=1e-6)) > 0.98
