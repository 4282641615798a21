"""Angle based flattening, linear and to the end, with cones."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat import PAPER, corner_angles, edge_lengths, errors, flatten, read_mesh
from coneflat.apps.compare.run import flatten as flatten_by_any
from coneflat.cones import ConeSolution
from coneflat.flat.angle_based import flatten as abf
from coneflat.flat.angle_based.conditions import angle_conditions, wanted_angles
from coneflat.flat.angle_based.flatten import angle_based, linear_angles
from coneflat.geometry import angle_defect
from coneflat.geometry.handles import handle_loops
from coneflat.input.validation import check_mesh
from coneflat.layout.least_squares import shapes_of_angles, shapes_of_lengths
from coneflat.mesh import TriangleMesh
from coneflat.quality.distortion import measure
from coneflat.seams import cut_open

BOTH = ("linear-abf", "abf++")
CLOSED = {
    "sphere": shapes.sphere(2),
    "torus": shapes.torus(20, 10),
    "genus 2": shapes.blocks(["#####", "#.#.#", "#####"], 2),
}
OPEN = {"hill": shapes.hill(), "annulus": shapes.annulus(), "cylinder": shapes.cylinder()}


def metric_of(shape):
    """Return a mesh with its angles and its curvature."""
    mesh = check_mesh(*shape).mesh
    angles = corner_angles(edge_lengths(mesh.vertices, mesh.faces))
    return mesh, angles, angle_defect(mesh.faces, angles, mesh.is_boundary_vertex)


def problem(shape, curvature=None):
    """Return conditions and wanted angles on a mesh."""
    mesh, angles, _ = metric_of(shape)
    curvature = np.zeros(len(mesh.vertices)) if curvature is None else curvature
    return angle_conditions(mesh, curvature), wanted_angles(mesh, angles, curvature)


@pytest.mark.parametrize("shape", (CLOSED | OPEN).values(), ids=CLOSED | OPEN)
def test_angles_of_a_metric_fulfil_the_conditions(shape):
    """The angles of any mesh are those of a flat metric with a cone at every vertex."""
    mesh, angles, curvature = metric_of(shape)
    conditions = angle_conditions(mesh, curvature)
    assert conditions.residual(angles.ravel()) < 1e-12
    # All that is left free are the metrics with this curvature: an edge is a length, of which one is the unit.
    inside = (~mesh.is_boundary_vertex).sum() - (not mesh.is_boundary_vertex.any())
    triangles = np.repeat(np.eye(len(mesh.faces)), 3, axis=1)
    rows = np.vstack([triangles, conditions.slopes(angles.ravel()).toarray()])
    assert np.linalg.matrix_rank(rows) == len(rows) == mesh.faces.size - (len(mesh.edges) - 1 - inside)


def test_angles_that_are_off_do_not():
    mesh, angles, curvature = metric_of(shapes.torus(20, 10))
    conditions = angle_conditions(mesh, curvature)
    turned = angles[:, [1, 2, 0]].ravel()
    assert np.abs(conditions.off(turned)[: len(conditions.totals)]).max() > 0.1
    assert np.abs(conditions.off(turned)[len(conditions.totals) :]).max() > 0.1


def test_loops_around_holes():
    """With those of holes, all loops there are but those around inner vertices."""
    for shape in (shapes.annulus(), shapes.bottle(), shapes.hill(), shapes.torus()):
        mesh = check_mesh(*shape).mesh
        count = max(1 - mesh.euler_characteristic + (not mesh.is_boundary_vertex.any()), 0)
        assert len(handle_loops(mesh, holes=True)) == count
        assert len(handle_loops(mesh)) == 2 * mesh.genus()


def test_linear_angles_are_the_least_norm_solution():
    """As the paper of linear ABF has it, literally: a wheel after the other, and a dense pseudo-inverse."""
    mesh = check_mesh(*shapes.hill(5, 4)).mesh
    conditions, wanted = problem(shapes.hill(5, 4))
    rows, right = [], []
    for face in range(len(mesh.faces)):
        rows.append(np.isin(np.arange(mesh.faces.size), 3 * face + np.arange(3)) * 1.0)
        right.append(np.pi - wanted[3 * face : 3 * face + 3].sum())
    for vertex in np.flatnonzero(~mesh.is_boundary_vertex):
        around = np.flatnonzero(mesh.faces.ravel() == vertex)
        after, before = (around - around % 3 + (around + step) % 3 for step in (1, 2))
        rows.append(np.isin(np.arange(mesh.faces.size), around) * 1.0)
        right.append(2 * np.pi - wanted[around].sum())
        wheel = np.zeros(mesh.faces.size)
        wheel[after] += 1 / np.tan(wanted[after])
        wheel[before] -= 1 / np.tan(wanted[before])
        rows.append(wheel)
        right.append(np.log(np.sin(wanted[before])).sum() - np.log(np.sin(wanted[after])).sum())
    relative = np.linalg.pinv(np.array(rows) * wanted) @ np.array(right)
    found = linear_angles(conditions, wanted)
    np.testing.assert_allclose(found.angles, wanted * (1 + relative), atol=1e-10)


def test_nearest_angles_are_a_minimum():
    """The gradient is a sum of the conditions' (Lagrange), and the conditions hold."""
    for shape in (shapes.hill(8, 6), shapes.annulus(12, 4)):
        conditions, wanted = problem(shape)
        found = abf.nearest_angles(conditions, wanted)
        assert found.converged
        assert found.residual < 1e-9
        assert conditions.residual(found.angles) == found.residual
        gradient = (found.angles - wanted) / wanted**2
        triangles = np.repeat(np.eye(len(wanted) // 3), 3, axis=1)
        normals = np.vstack([triangles, conditions.slopes(found.angles).toarray()]).T
        left = gradient - normals @ np.linalg.lstsq(normals, gradient, rcond=None)[0]
        assert np.abs(left).max() < 1e-4 * np.abs(gradient).max()
        linear = linear_angles(conditions, wanted).angles
        assert np.abs(linear - found.angles).max() < 0.2 * np.abs(found.angles - wanted).max()


def test_shapes_by_angles_and_by_lengths_are_the_same():
    vertices, faces = shapes.sphere(2)
    lengths = edge_lengths(vertices, faces)
    by_lengths, by_angles = shapes_of_lengths(lengths), shapes_of_angles(corner_angles(lengths))
    np.testing.assert_array_equal(by_lengths.third, by_angles.third)
    np.testing.assert_allclose(by_lengths.turn, by_angles.turn, atol=1e-13)
    assert not by_angles.is_broken.any()
    broken = shapes_of_angles(np.array([[-0.1, -0.2, np.pi + 0.3], [1.0, np.pi, -0.5]]))
    assert broken.is_broken.all()
    assert (broken.turn.imag > 0).all()


@pytest.mark.parametrize("method", BOTH)
@pytest.mark.parametrize("shape", [shapes.grid(9, 5), shapes.box(), shapes.cylinder(), shapes.grid(5, 1)])
def test_developable_meshes_come_back_as_they_are(method, shape):
    d = flatten(*shape, method=method).distortion
    assert d.qc_max < 1 + 1e-9
    assert d.area_std < 1e-9
    assert d.seam_mismatch_max < 1e-9


@pytest.mark.parametrize("shape", (CLOSED | OPEN).values(), ids=CLOSED | OPEN)
def test_abf_has_the_cones_and_seams_that_close(shape):
    """Around handles and holes, too: nothing is cut but what is unfolded."""
    result = flatten(*shape, method="abf++")
    d = result.distortion
    assert d.flipped == 0
    assert d.curvature_error_max < 1e-8
    assert d.seam_mismatch_max < 1e-8
    assert d.seam_motion_mismatch < 1e-7
    assert result.notes == ()
    assert d.qc_mean < flatten(*shape).distortion.qc_mean + 0.01


def test_a_single_wide_cone_on_a_torus():
    """With the curvature of one cone taken back by another, as wide as its six triangles bear."""
    result = flatten(*shapes.torus(), method="abf++", cones={0: -1.9 * np.pi, 405: 1.9 * np.pi})
    assert result.distortion.curvature_error_max < 1e-8
    assert result.distortion.seam_mismatch_max < 1e-8
    assert result.distortion.flipped == 0


@pytest.mark.parametrize("shape", (CLOSED | OPEN).values(), ids=CLOSED | OPEN)
def test_linear_abf_is_near(shape):
    linear, full = (flatten(*shape, method=method).distortion for method in BOTH)
    assert linear.flipped == 0
    assert linear.qc_mean == pytest.approx(full.qc_mean, abs=2e-3)
    assert linear.curvature_error_max < 0.05


@pytest.mark.parametrize("method", BOTH)
def test_scale_motion_and_numbering(method):
    vertices, faces = shapes.sphere(3)
    cones = {0: np.pi, 17: np.pi, 40: np.pi, 333: np.pi}
    base = flatten(vertices, faces, method=method, cones=cones)
    new_vertices, new_faces, new = shapes.renumber(vertices, faces)
    renamed = {int(new[v]): k for v, k in cones.items()}
    for other in (
        flatten(vertices * 1e-6, faces, method=method, cones=cones),
        flatten(vertices * 1e6, faces, method=method, cones=cones),
        flatten(vertices @ shapes.rotation().T, faces, method=method, cones=cones),
        flatten(new_vertices, new_faces, method=method, cones=renamed),
    ):
        for name in ("qc_mean", "qc_p95", "qc_max", "area_std", "seam_length"):
            assert getattr(other.distortion, name) == pytest.approx(
                getattr(base.distortion, name), rel=1e-6
            ), name


def test_slivers():
    vertices, faces = shapes.hill()
    d = flatten(vertices * [1, 1e-3, 1], faces, method="abf++").distortion
    assert d.flipped == 0
    assert d.curvature_error_max < 1e-8
    assert d.seam_mismatch_max < 1e-8


def test_several_components():
    parts = shapes.join(shapes.sphere(2), shapes.hill(), shapes.torus())
    d = flatten(*parts, method="abf++").distortion
    assert d.charts == 3
    assert d.curvature_error_max < 1e-8


def test_a_cone_without_room_is_refused():
    cones = {0: -3.5 * np.pi, 5: 1.9 * np.pi, 7: 1.9 * np.pi, 100: 1.9 * np.pi, 200: 1.8 * np.pi}
    for method in BOTH:
        with pytest.raises(
            errors.CurvatureError, match=r"1 cone too wide .* 5 of them cannot make an angle of 5.5 pi"
        ):
            flatten(*shapes.sphere(3), method=method, cones=cones)


def test_what_did_not_converge_is_refused_or_noted(monkeypatch):
    monkeypatch.setattr(abf, "STEPS", 1)
    with pytest.raises(errors.ConvergenceError, match=r"after 1 step .* off by .*--best-effort"):
        flatten(*shapes.sphere(2), method="abf++")
    result = flatten(*shapes.sphere(2), method="abf++", best_effort=True)
    assert "did not converge" in result.notes[0]
    assert result.solve.newton_steps == 1


@pytest.mark.parametrize("method", BOTH)
def test_a_cut_without_cones_is_noted(method):
    result = flatten_by_any(*shapes.annulus(), method=f"{method}/free")
    assert not len(result.cones)
    assert len(result.seams)
    assert result.notes == (
        "The mesh was cut first: the angles of cones, and lengths along seams, were left free.",
    )
    assert not flatten_by_any(*shapes.hill(), method=f"{method}/free", cones="none").notes


def test_negative_angles_are_noted():
    vertices, faces = shapes.sphere(3)
    result = flatten(vertices * [1, 1, 1e-3], faces, method="linear-abf")
    assert result.solve.broken > 0
    assert f"{result.solve.broken} triangles got an angle below 0" in result.notes[0]
    assert np.isfinite(result.uv).all()


def cut_first(result, solve):
    """Return the layout by a method that leaves cones free, with the cones and the cut of another result."""
    mesh = TriangleMesh(result.vertices, result.faces)
    pairs = np.sort(result.seams, axis=1)
    key = mesh.edges @ [len(mesh.vertices), 1]
    edges = np.flatnonzero(np.isin(key, pairs @ [len(mesh.vertices), 1]))
    zero = np.zeros(len(mesh.vertices))
    solution = ConeSolution(result.cones, zero, zero)
    lengths = edge_lengths(mesh.vertices, mesh.faces)
    laid_out = angle_based(mesh, lengths, solution, False, solve, cones="free").lay_out(
        cut_open(mesh, edges).mesh, edges
    )
    return laid_out, measure(mesh, laid_out.points[laid_out.corners])


@pytest.mark.parametrize(
    ("name", "published", "constrained"),
    [("fandisk.obj", 1.007, 1.0116), ("rocker-arm.obj", 1.027, 1.0279)],
)
def test_table_2_of_the_paper(shared, name, published, constrained):
    """Its figures are those of a mesh that was cut first; with the cones as constraints, there is less freedom."""
    base = flatten(shared(name), **(PAPER | {"method": "linear-abf"}))
    assert base.distortion.qc_mean == pytest.approx(constrained, abs=1e-3)
    assert base.distortion.seam_mismatch < 0.005
    for solve in (linear_angles, abf.nearest_angles):
        laid_out, distortion = cut_first(base, solve)
        assert distortion.qc_mean == pytest.approx(published, abs=0.0015)
        assert distortion.flipped == 0
        assert 0.005 < distortion.seam_mismatch < 0.03
        assert "cut first" in laid_out.notes[0]


def test_unknown_choice_at_cones():
    mesh, _, curvature = metric_of(shapes.sphere(1))
    lengths = edge_lengths(mesh.vertices, mesh.faces)
    solution = ConeSolution(np.arange(3), curvature, curvature)
    with pytest.raises(errors.OptionError, match="choose from prescribed, free"):
        angle_based(mesh, lengths, solution, False, linear_angles, cones="some")


@pytest.mark.parametrize(
    "name",
    ["fandisk.obj", "rocker-arm.obj", "hand.obj", "bunny.obj", "elephant.obj", "spot.obj", "3holes.off",
     "camelhead.off", "face.obj", "knight.off", "plane-holes.obj", "human.obj"],
)  # fmt: skip
def test_real_models(shared, name):
    result = flatten(read_mesh(shared(name)), method="abf++")
    assert result.distortion.flipped == 0
    assert result.distortion.curvature_error_max < 1e-8
    assert result.distortion.seam_mismatch_max < 1e-7
    assert result.solve.newton_steps <= 30


def test_free_cones_are_an_option():
    mesh = shapes.sphere(3)
    free = flatten_by_any(*mesh, method="abf++/free")
    held = flatten(*mesh, method="abf++")
    assert free.distortion.seam_mismatch > 1e-3 > 1e-9 > held.distortion.seam_mismatch
    with pytest.raises(errors.OptionError, match="unknown method 'lscm/free'"):
        flatten_by_any(*mesh, method="lscm/free")
    with pytest.raises(errors.OptionError, match=r"unknown method 'abf\+\+/free'"):
        flatten(*mesh, method="abf++/free")


def test_angles_that_round_to_nothing_are_wanted_a_little_wider():
    """A needle whose two sides are equal to the last bit: its angle is 0 as far as numbers go."""
    vertices, faces = shapes.hill(6, 5)
    mesh = TriangleMesh(vertices, faces)
    angles = corner_angles(edge_lengths(vertices, faces))
    angles[20] = [0.0, np.pi / 2, np.pi / 2]
    around = np.flatnonzero(~mesh.is_boundary_vertex[faces[20]])
    assert len(around)
    wanted = wanted_angles(mesh, angles, np.zeros(len(vertices)))
    assert (wanted > 0).all()
    assert wanted[60] < 2e-8
    conditions = angle_conditions(mesh, np.zeros(len(vertices)))
    assert np.isfinite(conditions.residual(wanted))
    assert np.isfinite(linear_angles(conditions, wanted).angles).all()


def test_a_cone_of_a_whole_turn_is_refused():
    vertices, faces = shapes.sphere(1)
    curvature = np.zeros(len(vertices))
    curvature[[0, 3]] = 2 * np.pi
    with pytest.raises(errors.CurvatureError, match="2 cones without an angle: .* one of 0 pi"):
        wanted_angles(TriangleMesh(vertices, faces), corner_angles(edge_lengths(vertices, faces)), curvature)
