"""What a result says of itself is so on the points that it returns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapes
from comparisons import flatten_by

from coneflat import flatten
from coneflat.atlas.pack import turns_of_quantum
from coneflat.errors import ArrayShapeError, FaceIndexError
from coneflat.geometry import edge_lengths
from coneflat.measures.distortion import measure
from coneflat.measures.guarantees import unmet_guarantees
from coneflat.mesh.connectivity import TriangleMesh


def seam_turns(result):
    """Return the rotation between the two sides of every inner edge, radians."""
    mesh = TriangleMesh(result.vertices, result.faces)
    places = result.corner_uv @ np.array([1, 1j])
    sides = (places[:, [2, 0, 1]] - places[:, [1, 2, 0]]).ravel()
    first, second = mesh.edge_halfedges[~mesh.is_boundary_edge].T
    return np.angle(-sides[second] / sides[first])


def error_text(angles, quantum):
    return np.abs(angles - quantum * np.round(angles / quantum)).max()


@pytest.fixture(scope="module")
def limbs():
    """A sphere with limbs, which needs several charts."""
    vertices, faces = shapes.sphere(3)
    x, y, z = vertices.T
    stretch = 1 + 2.5 * np.abs(np.cos(2.5 * np.arctan2(y, x))) ** 6 * (1 - z**2)
    return vertices * stretch[:, None], faces


@pytest.mark.slow
@pytest.mark.parametrize(("parts", "up"), [(4, None), (6, (0.0, 0.3, 1.0))])
def test_seams_of_an_atlas_turn_by_whole_quanta(limbs, parts, up):
    quantum = 2 * np.pi / parts
    result = flatten(*limbs, quantise=quantum, charts="atlas", distortion=0.07, up=up)
    assert result.distortion.charts > 1
    assert error_text(seam_turns(result), quantum) < 1e-9
    assert result.rotations.worst == pytest.approx(error_text(seam_turns(result), quantum), abs=1e-12)


def test_charts_turn_by_parts_of_a_turn_that_are_multiples_of_the_quantum():
    for quantum, turns in (
        (np.pi / 2, 4),
        (np.pi, 2),
        (2 * np.pi, 1),
        (np.pi / 3, 6),
        (np.pi / 180, 15),
        (1.0, 1),
    ):
        assert turns_of_quantum(quantum) == turns


def test_sound_results_break_no_promise():
    for mesh in (shapes.sphere(3), shapes.grid(6, 5)):
        result = flatten(*mesh, charts="atlas")
        assert unmet_guarantees(result) == ()
        assert result.distortion.angle_sum_error < 1e-9


def spoiled(result, uv):
    """Return a result with other points, measured on them."""
    mesh = TriangleMesh(result.vertices, result.faces)
    measures = measure(mesh, uv[result.uv_faces], cones=result.cones, prescribed=result.prescribed)
    return replace(result, uv=uv, distortion=measures)


def test_a_point_out_of_place_is_named():
    result = flatten(*shapes.sphere(3), charts="atlas")
    inner = np.setdiff1d(
        np.arange(len(result.vertices)), np.concatenate([result.seams.ravel(), result.cones])
    )[0]
    point = result.uv_faces[result.faces == inner][0]
    uv = result.uv.copy()
    uv[point] += 3 * np.abs(uv[result.uv_faces[(result.faces == inner).any(axis=1)]] - uv[point]).max()
    notes = " ".join(unmet_guarantees(spoiled(result, uv)))
    assert "flipped triangle" in notes
    assert "overlap in the atlas" in notes
    assert "angle sum differs" in notes


def test_a_triangle_without_area_is_named_and_where():
    result = flatten(*shapes.grid(4, 3))
    uv = result.uv.copy()
    uv[result.uv_faces[0]] = uv[result.uv_faces[0, 0]]
    bad = spoiled(result, uv)
    assert (bad.distortion.flipped, bad.distortion.degenerate) != (0, 0)
    note = unmet_guarantees(bad)[0]
    assert f"{bad.distortion.degenerate} degenerate triangles in the plane" in note


def test_a_vertex_that_triangles_go_around_twice_is_off_by_a_full_turn():
    """A fan whose triangles are all upright, and wind twice around the hub."""
    count = 24
    angle = 2 * np.pi * np.arange(count) / count
    vertices = np.vstack([np.zeros(3), np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)])
    rim = 1 + np.arange(count)
    faces = np.stack([np.zeros(count, int), rim, np.roll(rim, -1)], axis=1)
    twice = np.vstack([np.zeros(2), np.stack([np.cos(2 * angle), np.sin(2 * angle)], axis=1)])
    prescribed = np.where(np.arange(count + 1) == 0, 0.0, np.nan)
    measures = measure(TriangleMesh(vertices, faces), twice[faces], prescribed=prescribed)
    assert measures.flipped == 0
    assert measures.angle_sum_error == pytest.approx(2 * np.pi)


def test_sides_of_seams_that_differ_are_told():
    result = flatten(*shapes.sphere(3))
    uv = result.uv.copy()
    on_seam = np.isin(result.faces, result.seams)
    uv[result.uv_faces[on_seam][0]] *= 1 + 1e-4
    assert any("sides of seams differ" in note for note in unmet_guarantees(spoiled(result, uv)))


@pytest.mark.slow
@pytest.mark.parametrize("method", ["linear", "bff", "lscm"])
def test_overlaps_in_an_atlas_are_told_whatever_the_method(method):
    vertices, faces = shapes.sphere(3)
    x, y, _ = vertices.T
    rough = vertices * (1 + 0.5 * np.sin(9 * x) * np.cos(8 * y))[:, None]
    result = flatten_by(method, rough, faces, charts="atlas")
    told = any("in the atlas" in note for note in result.notes)
    assert told == bool(result.distortion.overlapping_pairs)


@pytest.mark.parametrize("unit", [2.0**-53, 2.0**-24])
def test_a_side_without_length_hides_no_seams_whose_sides_differ(unit):
    """What rounding may do is counted at each seam for itself."""
    result = flatten(*shapes.sphere(2), charts="atlas")
    uv = result.uv * [1.4, 1.0]
    corners = result.uv_faces
    inner = ~TriangleMesh(uv, corners).is_boundary_vertex
    face = np.flatnonzero(inner[corners].all(axis=1))[0]
    uv[corners[face, 0]] = uv[corners[face, 1]]
    mesh = TriangleMesh(result.vertices, result.faces)
    torn = replace(result, uv=uv, distortion=measure(mesh, uv[corners], prescribed=result.prescribed))
    assert torn.distortion.seam_mismatch_max > 0.01
    assert any("two sides of seams differ" in note for note in unmet_guarantees(torn, unit))


def test_arrays_that_do_not_fit_the_mesh_are_refused():
    """Compiled loops would write beyond their ends."""
    vertices, faces = shapes.grid(4, 3)
    mesh, uv = TriangleMesh(vertices, faces), vertices[:, :2][faces]
    with pytest.raises(ArrayShapeError, match="prescribed must have the shape"):
        measure(mesh, uv, prescribed=np.zeros(1))
    with pytest.raises(ArrayShapeError, match="corner_uv must have the shape"):
        measure(mesh, uv[:2])
    with pytest.raises(FaceIndexError, match="vertices 0 to 19, but there are 3"):
        edge_lengths(vertices[:3], faces)


def test_a_round_boundary_that_is_none_is_told():
    result = flatten(*shapes.grid(6, 5), boundary="disk")
    assert not any("not a circle" in note for note in result.notes)
    rim = TriangleMesh(result.vertices, result.faces).is_boundary_vertex
    uv = result.uv.copy()
    point = result.uv_faces[np.isin(result.faces, np.flatnonzero(rim))][0]
    uv[point] += 0.3 * (uv.mean(axis=0) - uv[point])
    assert any("not a circle: at vertex" in note for note in unmet_guarantees(spoiled(result, uv)))


def test_needles_are_named():
    vertices, faces = shapes.sphere(2)
    start, end, _ = faces[0]
    vertices = vertices.copy()
    vertices[start] = vertices[end] + 1e-10 * (vertices[start] - vertices[end])
    result = flatten(vertices, faces, relax="off")
    assert result.distortion.qc_max > 1000
    assert any(note.startswith("2 triangles with a QC distortion above 1000: 0, 4") for note in result.notes)
