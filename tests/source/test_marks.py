"""Seams that the user marks, and sharp edges."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

import coneflat
from coneflat import errors
from coneflat.geometry.overlap import find_overlaps
from coneflat.geometry.triangles import dihedral_angles
from coneflat.mesh.connectivity import TriangleMesh, end_corners


def seam_pairs(result):
    return {tuple(sorted(pair)) for pair in result.seams.tolist()}


def test_sharp_edges_take_a_box_apart_into_its_sides():
    result = coneflat.flatten(*shapes.box(), sharp_angle=1.0)
    assert result.distortion.charts == 6
    assert len(result.cones) == 0
    assert result.distortion.qc_max == pytest.approx(1, abs=1e-9)
    assert result.distortion.area_std == pytest.approx(0, abs=1e-9)
    assert len(result.seams) == 12 * 4
    assert result.distortion.seam_mismatch_max < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("seed", [10, 26])
def test_charts_that_touch_themselves_do_not_overlap(seed):
    """Flat pieces of a box lie beside their own sides, which rounding must not push across each other."""
    vertices, faces = shapes.box()
    edges = TriangleMesh(vertices, faces).edges
    seams = edges[np.random.default_rng(seed).random(len(edges)) < 0.5]
    result = coneflat.flatten(vertices, faces, charts="atlas", seams=seams)
    assert result.distortion.overlapping_pairs == len(find_overlaps(result.corner_uv).pairs) == 0


def test_named_seams_are_cut_and_act_like_a_boundary():
    vertices, faces = shapes.torus()
    mesh = TriangleMesh(vertices, faces)
    ring = mesh.edges[np.abs(vertices[mesh.edges][:, :, 1]).max(axis=1) < 1e-9]
    ring = ring[(vertices[ring][:, :, 0] > 0).all(axis=1)]  # one circle around the tube
    result = coneflat.flatten(vertices, faces, seams=ring, charts="atlas")
    assert {tuple(sorted(pair)) for pair in ring.tolist()} <= seam_pairs(result)
    assert result.distortion.charts == 1
    assert result.distortion.seam_mismatch_max < 1e-9
    assert result.distortion.flipped == 0
    # Each vertex of the closed seam has a place on either side.
    at = [len(np.unique(result.uv_faces[result.faces == vertex])) for vertex in np.unique(ring)]
    assert min(at) >= 2


def test_seams_through_numbers_and_settings():
    vertices, faces = shapes.box()
    mesh = TriangleMesh(vertices, faces)
    sharp = mesh.edges[dihedral_angles(mesh) > 1]
    by_angle = coneflat.flatten(vertices, faces, sharp_angle=1.0)
    by_name = coneflat.flatten(vertices, faces, seams=sharp)
    assert seam_pairs(by_name) == seam_pairs(by_angle)
    assert by_name.report()["settings"]["seams"] == sharp.tolist()
    shuffled, turned, number = shapes.renumber(vertices, faces)
    renumbered = coneflat.flatten(shuffled, turned, seams=number[sharp])
    assert renumbered.distortion.seam_length == pytest.approx(by_name.distortion.seam_length)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"seams": [[0, 0]]}, "1 seam of 1 between vertices that no edge connects: 0-0"),
        ({"seams": [[0, 99999], [0, 1]]}, "no edge connects: 0-99999"),
        ({"seams": [0, 1]}, "pairs of vertices"),
        ({"seams": [[0.5, 1.0]]}, "pairs of vertices"),
        ({"seams": [[0, 1], [2]]}, "seams: setting an array"),
        ({"hide_seams": np.ones(2)}, "hide_seams must be a number"),
        ({"hide_seams": np.nan}, "hide_seams must be a number from 0 to 10"),
        ({"up": [[1], [1, 2]]}, "up: setting an array"),
        ({"seams": "uv"}, "unknown seams"),
        ({"seams": "input"}, "no UV coordinates"),
        ({"no_seams": [[0, 1, 2]]}, r"vertices \(k,\) or pairs of vertices \(k, 2\), got shape \(1, 3\)"),
        ({"no_seams": [0.5]}, "vertices .* and type float64"),
        ({"sharp_angle": 0}, "between 0 and pi"),
        ({"sharp_angle": "x"}, "sharp_angle: 'x' is not a valid angle"),
        ({"charts": "many"}, "unknown charts"),
    ],
)
def test_invalid_seams_are_refused(options, message):
    with pytest.raises(errors.OptionError, match=message):
        coneflat.flatten(*shapes.torus(), **options)


def two_edges(mesh):
    """Two inner edges at one vertex."""
    middle = mesh.edges[len(mesh.edges) // 2, 0]
    return mesh.edges[(mesh.edges == middle).any(axis=1)][:2]


def test_a_cone_cannot_lie_on_a_marked_seam():
    vertices, faces = shapes.torus()
    slit = two_edges(TriangleMesh(vertices, faces))
    with pytest.raises(errors.OptionError, match="lies on a seam"):
        coneflat.flatten(vertices, faces, seams=slit, required_cones=slit[0, :1])


@pytest.mark.parametrize("charts", ["one", "atlas"])
@pytest.mark.parametrize("shape", ["hill", "torus"])
def test_seams_are_the_edges_with_two_places(shape, charts):
    """Also where some of those marked meet no other, or are tied to others."""
    vertices, faces = getattr(shapes, shape)()
    mesh = TriangleMesh(vertices, faces)
    chosen = np.random.default_rng(3).choice(len(mesh.edges), 40, replace=False)
    result = coneflat.flatten(vertices, faces, seams=mesh.edges[chosen], charts=charts)
    pairs = seam_pairs(result)
    assert len(pairs) == len(result.seams)
    inside = np.flatnonzero(~mesh.is_boundary_edge)
    first_ends, second_ends = (
        result.uv_faces.ravel()[np.stack(end_corners(h), axis=1)] for h in mesh.edge_halfedges[inside].T
    )
    cut = (first_ends != second_ends[:, ::-1]).any(axis=1)
    assert {tuple(pair) for pair in mesh.edges[inside[cut]].tolist()} == pairs


def test_an_edge_alone_is_no_cut():
    vertices, faces = shapes.sphere(2)
    mesh = TriangleMesh(vertices, faces)
    plain, marked = (coneflat.flatten(vertices, faces, seams=seams) for seams in (None, mesh.edges[100:101]))
    a, b = mesh.edges[100]
    assert [note for note in marked.notes if f"Not cut: 1 edge ({a}-{b})" in note]
    assert np.array_equal(plain.cones, marked.cones)
    assert seam_pairs(plain) == seam_pairs(marked)
    # Two are a slit.
    assert {tuple(pair) for pair in two_edges(mesh).tolist()} <= seam_pairs(
        coneflat.flatten(vertices, faces, seams=two_edges(mesh))
    )


def test_forbidden_edges_are_not_marked():
    vertices, faces = shapes.box()
    mesh = TriangleMesh(vertices, faces)
    sharp = mesh.edges[dihedral_angles(mesh) > 1]
    top = sharp[(vertices[sharp][:, :, 2] == 3).all(axis=1)]
    result = coneflat.flatten(vertices, faces, sharp_angle=1.0, no_seams=top)
    assert not {tuple(pair) for pair in top.tolist()} & seam_pairs(result)
    assert {tuple(pair) for pair in sharp.tolist()} - {tuple(pair) for pair in top.tolist()} <= seam_pairs(
        result
    )
    with pytest.raises(errors.SeamError, match=f"1 edge given both as seams and .* {top[0, 0]}-{top[0, 1]}"):
        coneflat.flatten(vertices, faces, seams=top, no_seams=top[:1])


def test_all_weights_of_a_component_may_be_zero():
    """Weights that are 0 all over one of the components say nothing about it."""
    first, second = shapes.sphere(2, seed=1), shapes.sphere(2, seed=2)
    vertices, faces = shapes.join(first, (second[0] + 5, second[1]))
    weights = (vertices[:, 0] < 2.5).astype(float)
    plain = coneflat.flatten(vertices, faces)
    weighed = coneflat.flatten(vertices, faces, weights=weights, seam_weights=weights)
    assert seam_pairs(weighed) == seam_pairs(plain)


def test_errors_name_the_component():
    vertices, faces = shapes.join(shapes.hill(), shapes.tetrahedron())
    edges = TriangleMesh(vertices, faces).edges
    barred = edges[(edges >= len(vertices) - 4).all(axis=1)]
    with pytest.raises(
        errors.SeamError, match=r"component of vertex 525 \(4 triangles\): 3 edges of 6 are needed"
    ):
        coneflat.flatten(vertices, faces, no_seams=barred)


def test_no_seams_change_nothing():
    unmarked = coneflat.flatten(*shapes.torus())
    none = coneflat.flatten(*shapes.torus(), seams=[])
    assert np.array_equal(np.sort(unmarked.cones), np.sort(none.cones))


class TestPolyhedra:
    def test_a_box_unfolds_without_distortion(self):
        result = coneflat.flatten(*shapes.box(), charts="atlas")
        assert len(result.cones) == 8
        assert result.distortion.qc_max == pytest.approx(1, abs=1e-9)
        assert result.distortion.charts == 1
        assert result.distortion.overlapping_pairs == 0

    def test_only_where_corners_are_few_and_nothing_else_is_asked(self):
        assert len(coneflat.flatten(*shapes.box(), cones="sparse").cones) < 8
        assert len(coneflat.flatten(*shapes.box(), max_cones=5).cones) <= 5
        assert len(coneflat.flatten(*shapes.cylinder(40, caps=True)).cones) < 24

    @pytest.mark.parametrize("shape", [(6, 1), (24, 8)])
    def test_open_cylinders_unroll_to_strips(self, shape):
        result = coneflat.flatten(*shapes.cylinder(*shape), charts="atlas")
        assert len(result.cones) == 0
        assert result.distortion.qc_max == pytest.approx(1, abs=1e-9)
        # Along the cylinder and no further: the cut is straight.
        assert result.distortion.seam_length == pytest.approx(
            3 / np.sqrt(3 * 2 * shape[0] * np.sin(np.pi / shape[0])), rel=1e-6
        )


@pytest.mark.parametrize("ending", ["obj", "glb"])
def test_seams_of_the_input_are_kept(tmp_path, ending):
    vertices, faces = shapes.sphere(2)
    first = coneflat.flatten(vertices, faces, charts="atlas")
    path = first.save(tmp_path / f"first.{ending}")
    again = coneflat.flatten(path, seams="input")
    # As sets of positions: a GLB has a vertex for every place.
    assert len(again.seams) == len(first.seams)
    middles = [np.sort(r.vertices[r.seams].mean(axis=1), axis=0) for r in (first, again)]
    assert np.allclose(*middles, atol=1e-6)
    assert again.distortion.charts == 1
    assert len(again.cones) <= len(first.cones)


def test_relative_texture_indices(tmp_path):
    """Of two quads that share an edge, the second repeats the UVs of the first there, or has its own."""
    head = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\n"
    first = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/-4 2/-3 3/-2 4/-1\n"
    joined = "vt 2 0\nvt 2 1\nf 2/-5 5/-2 6/-1 3/-4\n"
    apart = "vt 0 0\nvt 0 1\nvt 2 0\nvt 2 1\nf 2/-4 5/-2 6/-1 3/-3\n"
    for second, count in ((joined, 0), (apart, 1)):
        path = tmp_path / "quads.obj"
        path.write_text(head + first + second)
        assert len(coneflat.flatten(path, seams="input").seams) == count


class TestCosts:
    def test_a_polyhedron_opens_along_its_edges(self):
        vertices, faces = shapes.box(3)
        result = coneflat.flatten(vertices, faces)
        mesh = TriangleMesh(result.vertices, result.faces)
        sharp = {tuple(pair) for pair in mesh.edges[dihedral_angles(mesh) > 1].tolist()}
        assert seam_pairs(result) <= sharp

    def test_forbidden_edges_are_not_cut(self):
        vertices, faces = shapes.sphere(3, bumps=0.4, seed=5)
        free = coneflat.flatten(vertices, faces)
        barred = free.seams[: len(free.seams) // 2]
        result = coneflat.flatten(vertices, faces, no_seams=barred)
        assert not {tuple(sorted(pair)) for pair in barred.tolist()} & seam_pairs(result)
        assert result.distortion.seam_length > free.distortion.seam_length
        with pytest.raises(errors.OptionError, match="no edge connects"):
            coneflat.flatten(vertices, faces, no_seams=[[0, 0]])

    def test_seams_keep_off_what_weighs_more(self):
        vertices, faces = shapes.sphere(3, bumps=0.4, seed=5)
        free = coneflat.flatten(vertices, faces)
        weights = np.ones(len(vertices))
        inner = np.setdiff1d(free.seams, free.cones)
        weights[inner] = 20.0
        result = coneflat.flatten(vertices, faces, seam_weights=weights)
        assert len(np.intersect1d(result.seams, inner)) < len(inner) / 2
        with pytest.raises(errors.OptionError, match="seam weights must be"):
            coneflat.flatten(vertices, faces, seam_weights=weights[1:])

    def test_hidden_places_are_preferred(self):
        vertices, faces = shapes.sphere(3, bumps=0.5, seed=2)
        from coneflat.geometry.visibility import visible_share

        share = visible_share(vertices, faces)
        seen = [
            share[coneflat.flatten(vertices, faces, distortion=0.1, hide_seams=hide).seams].mean()
            for hide in (0.0, 3.0)
        ]
        assert seen[1] < seen[0]
