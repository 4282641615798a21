from __future__ import annotations

import numpy as np
import pytest
import shapes
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import maximum_flow

import coneflat
from coneflat.atlas.charts import ChartLayout, Seams
from coneflat.atlas.glue import glue_charts
from coneflat.atlas.injective import injective_charts
from coneflat.atlas.sheet import Sheet
from coneflat.atlas.split import _layers, as_disk, find_steps, largest_layers, split_overlaps
from coneflat.geometry.overlap import find_overlaps
from coneflat.mesh.charts import label_charts
from coneflat.mesh.connectivity import TriangleMesh, label_components


def flat_grid(columns=14, rows=9, seed=0):
    """A disk in the plane with edges of different lengths."""
    vertices, faces = shapes.grid(columns, rows)
    rng = np.random.default_rng(seed)
    return TriangleMesh(vertices[:, :2] + rng.uniform(-0.02, 0.02, (len(vertices), 2)), faces)


def lengths_of(mesh):
    ends = mesh.vertices[mesh.edges]
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)


def spiral(turns=1.4, around=120, across=4):
    """A strip wound round by more than a full turn, in the plane."""
    vertices, faces = shapes.grid(around, across)
    box = np.ptp(vertices[:, :2], axis=0)
    x, y = ((vertices[:, :2] - vertices[:, :2].min(axis=0)) / box).T
    angle = 2 * np.pi * turns * x
    points = np.stack([(1 + 0.4 * y) * np.sin(angle), (1 + 0.4 * y) * np.cos(angle)], axis=1)
    return points, upright(points, faces)


def upright(points, faces):
    first_side, second_side = (
        points[faces[:, 1]] - points[faces[:, 0]],
        points[faces[:, 2]] - points[faces[:, 0]],
    )
    return (
        faces[:, ::-1]
        if (first_side[:, 0] * second_side[:, 1] - first_side[:, 1] * second_side[:, 0]).sum() < 0
        else faces
    )


def charts_of(points, faces):
    mesh = TriangleMesh(np.column_stack([points, np.zeros(len(points))]), faces)
    return mesh, injective_charts(mesh, points, faces, lengths_of(mesh))


def overlapping(layout):
    return sum(
        len(find_overlaps(layout.points, layout.corners[layout.chart == c]).pairs)
        for c in np.unique(layout.chart)
    )


def crumpled(cells, seed):
    """A square of paper, its points when it is crumpled in the plane, and the triangles that then overlap."""
    disk = flat_grid(cells, cells)
    bends = np.random.default_rng(seed).normal(size=(4, 2, 2))
    points = disk.vertices + 0.5 * np.sin(5 * disk.vertices @ bends).sum(axis=0)
    return disk, points, find_overlaps(points, disk.faces).pairs


class TestSeparate:
    @pytest.mark.parametrize("seed", range(4))
    def test_no_cut_is_cheaper(self, seed):
        disk = flat_grid(seed=seed)
        rng = np.random.default_rng(seed)
        costs = rng.integers(1, 50, len(disk.edges))
        first_set, second_set = np.zeros((2, len(disk.faces)), dtype=bool)
        first, second = rng.choice(len(disk.faces), 2, replace=False)
        if seed % 2:  # on the border
            first = disk.edge_faces[disk.halfedge_edges[disk.boundary_walks()[0]][0], 0]
        if first == second:
            second = (first + 1) % len(disk.faces)
        first_set[first] = second_set[second] = True
        sheet = Sheet(disk, costs.astype(float)[disk.halfedge_edges])
        assert len(sheet.separate(0, first_set, second_set)) > 1
        pieces = sheet.piece
        assert pieces[first] != pieces[second]
        inside = np.flatnonzero(~disk.is_boundary_edge)
        a, b = disk.edge_faces[inside].T
        cost = costs[inside][pieces[a] != pieces[b]].sum()
        count = len(disk.faces)
        both_orders = np.concatenate([a, b]), np.concatenate([b, a])
        capacity = csr_matrix(
            (np.tile(costs[inside], 2).astype(np.int32), both_orders), shape=(count, count), dtype=np.int32
        )
        flow = maximum_flow(capacity, int(first), int(second)).flow_value
        on_border = disk.is_boundary_edge[disk.halfedge_edges.reshape(-1, 3)].any(axis=1)
        if on_border[first] or on_border[second]:
            assert cost == flow
        else:  # the way that one of them is given to the border is not cut
            assert flow <= cost <= 4 * flow

    @pytest.mark.parametrize("seed", range(2))
    def test_pieces_of_pieces_hang_together_and_keep_their_borders(self, seed):
        disk = flat_grid(20, 20, seed)
        rng = np.random.default_rng(seed)
        sheet = Sheet(disk, lengths_of(disk)[disk.halfedge_edges])
        inside = ~disk.is_boundary_edge
        piece_count = 1
        for _ in range(8):
            chosen_piece = int(rng.choice(np.flatnonzero(np.bincount(sheet.piece) > 1)))
            members = np.flatnonzero(sheet.piece == chosen_piece)
            before = sheet.piece.copy()
            first_set, second_set = np.zeros((2, len(disk.faces)), dtype=bool)
            first, second = rng.choice(members, 2, replace=False)
            first_set[first] = second_set[second] = True
            pieces = sheet.separate(chosen_piece, first_set, second_set)
            assert pieces is not None
            assert sheet.piece[first] != sheet.piece[second]
            assert chosen_piece in pieces
            assert set(pieces) == set(sheet.piece[members])
            assert np.array_equal(before[before != chosen_piece], sheet.piece[before != chosen_piece])
            lowest = [np.flatnonzero(sheet.piece == piece)[0] for piece in pieces]
            assert lowest == sorted(lowest)
            piece_count += len(pieces) - 1
            across = sheet.piece[disk.edge_faces]
            count, _ = label_charts(disk, inside & (across[:, 0] == across[:, 1]))
            assert count == piece_count == sheet.piece.max() + 1
        for piece in range(piece_count):
            border = sheet.border(piece)
            sides = sheet.piece[np.arange(disk.faces.size) // 3] == piece
            twins = np.where(
                disk.edge_halfedges[disk.halfedge_edges, 0] == np.arange(disk.faces.size),
                disk.edge_halfedges[disk.halfedge_edges, 1],
                disk.edge_halfedges[disk.halfedge_edges, 0],
            )
            sides &= (twins < 0) | (sheet.piece[twins // 3] != piece)
            assert np.array_equal(np.sort(border), np.flatnonzero(sides))
            tails, heads = disk.ends_of(border)
            assert np.array_equal(heads, np.roll(tails, -1))
            assert sheet.is_pinched(piece) == (len(np.unique(tails)) < len(tails))

    def test_one_kept_from_the_border_by_the_other_stays(self):
        disk = flat_grid(9, 9)
        middle = disk.vertices[disk.faces].mean(axis=1)
        centre = int(np.argmin(np.abs(middle - middle.mean(axis=0)).sum(axis=1)))
        first_set, second_set = np.zeros((2, len(disk.faces)), dtype=bool)
        first_set[centre] = True
        second_set[np.setdiff1d(np.arange(len(second_set)), centre)] = True
        sheet = Sheet(disk, np.ones(disk.faces.size))
        # Of what lies around, a single triangle will do.
        assert len(sheet.separate(0, first_set, second_set)) > 1

    def test_widened_sets_stay_apart_and_reach_the_area(self):
        disk = flat_grid(30, 20)
        first_set, second_set = np.zeros((2, len(disk.faces)), dtype=bool)
        first_set[0] = second_set[-1] = True
        areas = np.ones(len(disk.faces))
        sheet = Sheet(disk, np.ones(disk.faces.size))
        wider_first, wider_second = sheet.widened(0, first_set, second_set, areas, 50.0)
        assert wider_first.sum() == wider_second.sum() == 50
        assert wider_first[0]
        assert wider_second[-1]
        assert not (wider_first & wider_second).any()
        narrow, _ = sheet.widened(0, first_set, second_set, areas, 0.0)
        assert narrow.sum() == 1


class TestSplit:
    def test_a_spiral_is_cut_once(self):
        points, faces = spiral()
        pairs = find_overlaps(points, faces).pairs
        assert len(pairs) > 100
        mesh, layout = charts_of(points, faces)
        assert layout.chart.max() == 1
        assert overlapping(layout) == 0
        # Across the strip, and no further.
        assert lengths_of(mesh)[Seams(mesh, layout).edges].sum() < 0.5

    def test_several_turns_need_several_cuts(self):
        points, faces = spiral(3.5, 300)
        _, layout = charts_of(points, faces)
        assert 3 <= layout.chart.max() <= 4
        assert overlapping(layout) == 0

    def test_what_is_flat_stays_whole(self):
        disk = flat_grid()
        _, layout = charts_of(disk.vertices, disk.faces)
        assert layout.chart.max() == 0
        assert np.array_equal(layout.points[layout.corners], disk.vertices[disk.faces])

    def test_pieces_have_the_area_asked_for(self):
        points, faces = spiral(1.05)
        mesh = TriangleMesh(np.column_stack([points, np.zeros(len(points))]), faces)
        areas = np.ones(len(faces))
        # Cheapest at the start of the strip.
        costs = (lengths_of(mesh) * (1 + mesh.edges[:, 0]))[mesh.halfedge_edges]
        pairs = find_overlaps(points, faces).pairs
        arguments = as_disk(points, faces), costs, areas, pairs
        small = np.bincount(split_overlaps(*arguments)).min()
        large = np.bincount(split_overlaps(*arguments, 0.2 * len(faces))).min()
        assert small < 0.2 * len(faces) <= large

    @pytest.mark.parametrize("seed", range(2))
    def test_layers_are_disjoint_and_the_largest_of_all_regions(self, seed):
        """Of crumpled paper, whose overlaps are many, and some of them wound up."""
        disk, _, pairs = crumpled(18, seed)
        areas = np.random.default_rng(seed).uniform(1, 2, len(disk.faces))
        steps = find_steps(pairs, disk.faces)
        count, region = label_components(2 * len(pairs), *np.hstack([steps, steps ^ 1]))
        # Each region is there twice, its layers in either order.
        every = [_layers(pairs, np.flatnonzero(region == i)) for i in range(count)]
        assert all(not len(np.intersect1d(first_layer, second_layer)) for first_layer, second_layer in every)
        assert len(every) > 2
        sizes = [
            min(areas[first_layer].sum(), areas[second_layer].sum()) for first_layer, second_layer in every
        ]
        for layer, largest in zip(
            largest_layers(pairs, steps, areas), every[int(np.argmax(sizes))], strict=True
        ):
            assert np.array_equal(layer, largest)

    @pytest.mark.slow
    @pytest.mark.parametrize("seed", range(2))
    def test_charts_of_crumpled_paper_hang_together_and_do_not_overlap(self, seed):
        """Many cuts, after which pieces touch themselves in points."""
        disk, points, pairs = crumpled(24, seed)
        costs = lengths_of(disk)[disk.halfedge_edges]
        chart = split_overlaps(as_disk(points, disk.faces), costs, np.ones(len(disk.faces)), pairs)
        assert chart.max() > 10
        across = chart[disk.edge_faces]
        count, _ = label_charts(disk, ~disk.is_boundary_edge & (across[:, 0] == across[:, 1]))
        assert count == chart.max() + 1 == len(np.unique(chart))
        assert (chart[pairs[:, 0]] != chart[pairs[:, 1]]).all()

    def test_too_many_charts_are_given_up(self):
        points, faces = spiral(3.5, 300)
        mesh = TriangleMesh(np.column_stack([points, np.zeros(len(points))]), faces)
        arguments = as_disk(points, faces), lengths_of(mesh)[mesh.halfedge_edges], np.ones(len(faces))
        pairs = find_overlaps(points, faces).pairs
        count = split_overlaps(*arguments, pairs).max() + 1
        assert split_overlaps(*arguments, pairs, max_charts=2) is None
        assert split_overlaps(*arguments, pairs, max_charts=count).max() + 1 == count


class TestGlue:
    def test_sides_that_lie_on_each_other_are_joined(self):
        """An annulus, cut open, is one again, and its border two loops."""
        vertices, faces = shapes.annulus()
        result = coneflat.flatten(vertices * [1, 1, 0], faces, cones="none", charts="atlas")
        assert len(result.seams) == 0
        assert result.distortion.charts == 1
        assert result.distortion.overlapping_pairs == 0

    def test_a_chart_moves_to_where_it_fits(self):
        """Of a strip bent round, whose ends meet, one end is cut off and goes to the other end."""
        vertices, faces = shapes.cylinder(40, 6)
        result = coneflat.flatten(vertices, faces, cones="none")
        assert result.distortion.charts == 1
        length = lengths_of(TriangleMesh(result.vertices, result.faces))
        middle = result.corner_uv.mean(axis=1)
        low, high = np.quantile(middle[:, 0], [0.0, 1.0])
        chart = (middle[:, 0] < low + 0.2 * (high - low)).astype(np.int64)
        single_chart = ChartLayout(result.uv, result.uv_faces, np.zeros(len(faces), dtype=np.int64))
        layout = glue_charts(TriangleMesh(result.vertices, result.faces), single_chart.split(chart), length)
        assert len(np.unique(layout.chart)) == 1
        assert overlapping(layout) == 0

    def test_many_pieces_are_put_together_again(self):
        """Of a sheet torn into pieces, each of them somewhere else, turned, one after the other finds its place."""
        disk = flat_grid()
        middle = disk.vertices[disk.faces].mean(axis=1)
        chart = (5 * middle[:, 0]).astype(int) * 3 + (3 * middle[:, 1]).astype(int)
        torn = ChartLayout(disk.vertices, disk.faces, np.zeros(len(chart), dtype=np.int64)).split(chart)
        piece = np.empty(len(torn.points), dtype=np.int64)
        piece[torn.corners] = chart[:, None]
        places = torn.places * np.exp(1j * piece) + 3 * piece
        scattered = ChartLayout(np.stack([places.real, places.imag], axis=1), torn.corners, chart)
        layout = glue_charts(disk, scattered, lengths_of(disk)).renumbered()
        assert layout.chart.max() == 0
        assert len(layout.points) == len(disk.vertices)
        assert overlapping(layout) == 0
        flat_lengths = lengths_of(TriangleMesh(layout.points, layout.corners))
        assert np.allclose(np.sort(flat_lengths), np.sort(lengths_of(disk)))


@pytest.mark.parametrize("seed", range(2))
def test_nothing_overlaps_and_seams_still_fit(seed):
    vertices, faces = shapes.sphere(3, bumps=0.5, seed=seed)
    result = coneflat.flatten(vertices, faces, distortion=0.05)
    atlas = coneflat.flatten(vertices, faces, distortion=0.05, charts="atlas")
    assert atlas.distortion.overlapping_pairs == 0
    assert atlas.distortion.overlap == 0
    assert atlas.distortion.flipped == 0
    assert atlas.distortion.seam_mismatch_max < 1e-9
    assert atlas.distortion.qc_mean == pytest.approx(result.distortion.qc_mean, rel=1e-9)
    assert atlas.distortion.charts <= 4
    assert atlas.report()["overlap"] == 0
    assert result.report()["overlapping_pairs"] == len(find_overlaps(result.corner_uv).pairs)


def test_charts_do_not_depend_on_the_numbering():
    vertices, faces = shapes.sphere(3, bumps=0.6, seed=3)
    result = coneflat.flatten(vertices, faces, distortion=0.05, charts="atlas")
    renumbered = coneflat.flatten(*shapes.renumber(vertices, faces)[:2], distortion=0.05, charts="atlas")
    assert renumbered.distortion.charts == result.distortion.charts
    assert renumbered.distortion.seam_length == pytest.approx(result.distortion.seam_length, rel=1e-9)


def test_handles_and_borders():
    for vertices, faces in (shapes.torus(), shapes.genus(2), shapes.hill()):
        result = coneflat.flatten(vertices, faces, charts="atlas")
        assert result.distortion.overlapping_pairs == 0
        assert result.distortion.flipped == 0
