"""The general solver: less distortion of a layout whose seams stay rigid copies, with constraints."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat import TriangleMesh, errors, flatten
from coneflat.geometry import edge_lengths, rest_sides
from coneflat.geometry.planar import sides_between, signed_double_areas
from coneflat.optimise import Lines, PointConstraints, StretchEnergy, relax
from coneflat.optimise.elements import Elements
from coneflat.optimise.energies import UntanglingEnergy
from coneflat.optimise.motions import find_motions
from coneflat.optimise.restrictions import check_constraints, find_chains, find_restrictions

ENERGIES = [
    StretchEnergy(0),
    StretchEnergy(0.5),
    StretchEnergy(1),
    StretchEnergy(1.7, 2.0),
    StretchEnergy(0, 1.5),
]


def laid_out(shape, **options):
    """A mesh with an exact layout that is not relaxed: mesh, points, corners, cones."""
    result = flatten(*shape, relax="off", charts="one", **options)
    mesh = TriangleMesh(*shape)
    return mesh, result.uv, result.uv_faces, result.cones


def seam_copies(mesh, corners, points):
    """The sides of each seam edge: (k, 2) points of one and of the other."""
    starts, ends = corners[:, [1, 2, 0]].ravel(), corners[:, [2, 0, 1]].ravel()
    h, t = mesh.edge_halfedges[~mesh.is_boundary_edge].T
    cut = (starts[h] != ends[t]) | (ends[h] != starts[t])
    z = points[:, 0] + 1j * points[:, 1]
    return (z[ends] - z[starts])[h[cut]], (z[starts] - z[ends])[t[cut]]


def angle_sums(mesh, corners, points):
    sides = sides_between(points[corners])
    angles = np.angle(-sides[:, [1, 2, 0]] * np.conj(sides[:, [2, 0, 1]]))
    return np.bincount(mesh.faces.ravel(), angles.ravel())


@pytest.mark.parametrize("energy", [*ENERGIES, UntanglingEnergy(np.full(50, 0.3))])
def test_derivatives_of_energies_are_their_differences(energy):
    """Also at flipped triangles, if their energy is finite."""
    rng = np.random.default_rng(3)
    s2 = rng.uniform(-2 if energy.is_regularised else 0.2, 2, 50)
    s1 = np.abs(s2) + rng.uniform(0.01, 2, 50)
    derivatives, h = energy.derivatives(s1, s2), 1e-5
    assert np.allclose(derivatives.value, energy.values(s1, s2), rtol=1e-12)
    assert np.allclose(
        derivatives.by_1, (energy.values(s1 + h, s2) - energy.values(s1 - h, s2)) / (2 * h), rtol=1e-5
    )
    assert np.allclose(
        derivatives.by_2, (energy.values(s1, s2 + h) - energy.values(s1, s2 - h)) / (2 * h), rtol=1e-5
    )
    up, down = energy.derivatives(s1 + h, s2), energy.derivatives(s1 - h, s2)
    assert np.allclose(derivatives.by_11, (up.by_1 - down.by_1) / (2 * h), rtol=1e-5, atol=1e-6)
    assert np.allclose(derivatives.by_12, (up.by_2 - down.by_2) / (2 * h), rtol=1e-5, atol=1e-6)
    up, down = energy.derivatives(s1, s2 + h), energy.derivatives(s1, s2 - h)
    assert np.allclose(derivatives.by_22, (up.by_2 - down.by_2) / (2 * h), rtol=1e-5, atol=1e-6)


def test_the_minimum_of_the_energy_is_one_at_isometries():
    rng = np.random.default_rng(4)
    s1, s2 = rng.uniform(0.1, 5, (2, 200))
    for energy in ENERGIES:
        assert energy.values(np.ones(1), np.ones(1)) == pytest.approx(1)
        assert (energy.values(s1, s2) >= 1).all()
        assert np.allclose(energy.values(s1, s2), energy.values(s2, s1))
    # StretchEnergy of angles does not know of scale.
    assert np.allclose(StretchEnergy().values(s1, s2), StretchEnergy().values(7 * s1, 7 * s2))


@pytest.mark.parametrize("energy", ENERGIES)
def test_the_gradient_of_a_cut_surface_is_that_of_its_energy(energy):
    mesh, uv, corners, _ = laid_out(shapes.sphere(2), cones="greedy", max_cones=5)
    z = uv[:, 0] + 1j * uv[:, 1]
    is_free = np.ones(len(mesh.vertices), dtype=bool)
    restrictions = find_restrictions(mesh, corners, z, is_free, check_constraints(PointConstraints(), uv))
    motions = find_motions(z, restrictions)
    target_shapes = rest_sides(edge_lengths(mesh.vertices, mesh.faces))
    elements = Elements.of(motions, corners, target_shapes, 1.0, np.ones(len(corners)))

    def total(step):
        return elements.energies(energy, elements.maps(z + motions.shifts(step))).sum()

    gradient, pull, hessian = elements.newton_system(energy, elements.maps(z), 0.0)
    assert not pull.any()
    rng = np.random.default_rng(5)
    h = 1e-6 * np.abs(uv).max()
    for _ in range(5):
        step = np.append(rng.standard_normal(motions.count), 0.0)
        slope = (total(h * step) - total(-h * step)) / (2 * h)
        assert slope == pytest.approx(gradient @ step[:-1], rel=1e-4)
    largest = hessian.diagonal().max()
    assert np.abs((hessian - hessian.T).toarray()).max() < 1e-12 * largest
    assert np.linalg.eigvalsh(hessian.toarray()).min() > -1e-9 * largest


@pytest.mark.parametrize("stretch", [0.0, 1.0])
@pytest.mark.parametrize(
    "shape",
    [shapes.sphere(2), shapes.torus(20, 10), shapes.hill()],
    ids=["sphere", "torus", "hill"],
)
def test_seams_stay_rigid_copies_and_cones_keep_their_angles(shape, stretch):
    mesh, uv, corners, _ = laid_out(shape)
    relaxed = relax(mesh, uv, corners, StretchEnergy(stretch))
    assert relaxed.energy < relaxed.energy_before
    assert (signed_double_areas(relaxed.points[corners]) > 0).all()
    first, second = seam_copies(mesh, corners, relaxed.points)
    assert np.allclose(np.abs(first), np.abs(second), rtol=1e-9)
    before = seam_copies(mesh, corners, uv)
    assert np.allclose(second / first, before[1] / before[0], atol=1e-8)
    inside = ~mesh.is_boundary_vertex
    assert np.allclose(
        angle_sums(mesh, corners, relaxed.points)[inside], angle_sums(mesh, corners, uv)[inside], atol=1e-9
    )


def test_a_developable_surface_becomes_isometric():
    # Half of a cylinder, its rectangle of the plane sheared and stretched.
    vertices, faces = shapes.grid(12, 9)
    x, y = vertices[:, 0] / 11, vertices[:, 1] / 8
    mesh = TriangleMesh(np.stack([np.cos(3 * x), np.sin(3 * x), y], axis=1), faces)
    relaxed = relax(mesh, np.stack([2 * x + 0.3 * y**2, y], axis=1), faces, StretchEnergy(1), tolerance=1e-14)
    lengths = np.abs(sides_between(relaxed.points[faces]))
    # Up to scale: the layout keeps the area that it has.
    ratio = lengths / edge_lengths(mesh.vertices, faces)
    assert relaxed.energy == pytest.approx(1, abs=1e-9)
    assert np.allclose(ratio, ratio.mean(), rtol=1e-4)


def test_pinned_points_and_lines_hold_after_relaxation():
    vertices, faces = shapes.hill(14, 10)
    mesh = TriangleMesh(vertices, faces)
    start = vertices[:, :2]
    left, right = (np.flatnonzero(start[:, 0] == edge) for edge in (start[:, 0].min(), start[:, 0].max()))
    low = np.flatnonzero(start[:, 1] == start[:, 1].min())
    lines = Lines(
        np.concatenate([left, right, low]),
        np.repeat([0, 1, 2], [len(left), len(right), len(low)]),
        [[0, 1], [0, 2.0], [1, 0.1]],
        [-start[:, 0].min() + 0.05, np.nan, np.nan],
    )
    inner = int(np.argmin(np.linalg.norm(start - start.mean(axis=0), axis=1)))
    goal = start[inner] + 0.2 * (start.max(axis=0) - start.min(axis=0)) * [0.3, -0.4]
    relaxed = relax(
        mesh, start, faces, StretchEnergy(1), PointConstraints(pinned=[inner], places=[goal], lines=lines)
    )
    points = relaxed.points
    assert np.allclose(points[inner], goal, atol=1e-12)
    assert np.allclose(points[left, 0], start[:, 0].min() - 0.05, atol=1e-9)
    assert np.ptp(points[right, 0]) < 1e-9
    across = points[low] @ [-0.1, 1.0]
    assert np.ptp(across) < 1e-9
    assert (signed_double_areas(points[faces]) > 0).all()


def test_only_free_vertices_move():
    mesh, uv, corners, _ = laid_out(shapes.sphere(2))
    free = np.zeros(len(mesh.vertices), dtype=bool)
    free[mesh.faces[:40]] = True
    relaxed = relax(mesh, uv, corners, free=free)
    stays = ~free[mesh.faces]
    assert np.array_equal(relaxed.points[corners[stays]], uv[corners[stays]])
    assert relaxed.energy < relaxed.energy_before


def test_the_result_does_not_depend_on_numbers_scale_or_place():
    vertices, faces = shapes.sphere(2)
    mesh, uv, corners, _ = laid_out((vertices, faces))
    plain = relax(mesh, uv, corners, StretchEnergy(0.5), tolerance=1e-12)
    turn = np.exp(0.7j)
    z = (uv[:, 0] + 1j * uv[:, 1]) * 1e5 * turn + (3e5 - 1e5j)
    moved = relax(
        TriangleMesh(1e-3 * vertices @ shapes.rotation(), faces),
        np.stack([z.real, z.imag], axis=1),
        corners,
        StretchEnergy(0.5),
        tolerance=1e-12,
    )
    sides = np.abs(sides_between(plain.points[corners]))
    assert moved.energy == pytest.approx(plain.energy, rel=1e-9)
    assert np.allclose(np.abs(sides_between(moved.points[corners])), 1e5 * sides, rtol=1e-4)
    order = np.random.default_rng(1).permutation(len(faces))
    shuffled = relax(
        TriangleMesh(vertices, faces[order]), uv, corners[order], StretchEnergy(0.5), tolerance=1e-12
    )
    assert shuffled.energy == pytest.approx(plain.energy, rel=1e-9)


def test_flipped_triangles_stay_and_no_other_is_flipped():
    vertices, faces = shapes.grid(10, 10)
    mesh = TriangleMesh(vertices, faces)
    points = vertices[:, :2].copy()
    inner = int(np.argmin(np.linalg.norm(points - points.mean(axis=0), axis=1)))
    points[inner] += 1.5 * (points[1] - points[0])
    before = signed_double_areas(points[faces])
    assert (before <= 0).any()
    relaxed = relax(mesh, points, faces, StretchEnergy(1))
    after = signed_double_areas(relaxed.points[faces])
    assert np.array_equal(after <= 0, before <= 0)


def test_a_progress_that_returns_true_ends_the_iteration():
    mesh, uv, corners, _ = laid_out(shapes.sphere(2))
    seen = []
    relaxed = relax(
        mesh, uv, corners, StretchEnergy(1), progress=lambda step, energy: seen.append(energy) or step == 2
    )
    assert relaxed.steps == len(seen) == 2
    assert seen[1] < seen[0]
    assert relax(mesh, uv, corners, StretchEnergy(1), steps=0).energy == pytest.approx(relaxed.energy_before)


def test_bad_input_is_refused_by_name():
    vertices, faces = shapes.grid(5, 4)
    mesh, points = TriangleMesh(vertices, faces), vertices[:, :2]
    for wrong, error in [
        ({"points": points[:, :1]}, errors.ArrayShapeError),
        ({"points": points * np.nan}, errors.NonFiniteError),
        ({"corners": faces[1:]}, errors.ArrayShapeError),
        ({"corners": faces + 99}, errors.FaceIndexError),
        ({"free": [True]}, errors.ArrayShapeError),
        ({"weights": [1.0]}, errors.ArrayShapeError),
        ({"weights": np.zeros(len(faces))}, errors.OptionError),
        ({"tolerance": 2.0}, errors.OptionError),
        ({"lengths": np.ones((2, 3))}, errors.ArrayShapeError),
        ({"constraints": PointConstraints(pinned=[99])}, errors.OptionError),
        ({"constraints": PointConstraints(pinned=[1, 1])}, errors.OptionError),
        ({"constraints": PointConstraints(pinned=[1], places=[[0, np.nan]])}, errors.OptionError),
        ({"constraints": PointConstraints(lines=Lines([0], [0], [[0, 0]]))}, errors.OptionError),
        ({"constraints": PointConstraints(lines=Lines([0, 1], [0], [[1, 0]]))}, errors.OptionError),
    ]:
        with pytest.raises(error):
            relax(**{"mesh": mesh, "points": points, "corners": faces} | wrong)
    for energy in ({"stretch": -1}, {"stretch": np.nan}, {"sharpness": 0.5}):
        with pytest.raises(errors.OptionError):
            StretchEnergy(**energy)


def test_constraints_that_cannot_hold_are_refused():
    vertices, faces = shapes.grid(5, 4)
    mesh, points = TriangleMesh(vertices, faces), vertices[:, :2]
    twice = Lines([0, 0, 0], [0, 1, 2], [[1, 0], [0, 1], [1, 1]], [0.0, 0.0, 5.0])
    with pytest.raises(errors.OptionError, match="contradict"):
        relax(mesh, points, faces, constraints=PointConstraints(lines=twice))
    with pytest.raises(errors.ConvergenceError, match="are only .* satisfied"):
        relax(
            mesh, points, faces, constraints=PointConstraints(pinned=np.arange(len(points)), places=-points)
        )


def test_seams_whose_sides_are_not_rigid_copies_are_refused():
    mesh, uv, corners, _ = laid_out(shapes.sphere(2))
    bent = uv.copy()
    bent[:, 0] *= 1.3
    with pytest.raises(errors.SeamError, match="not copies"):
        relax(mesh, bent, corners)


def test_tied_seams_get_their_translations():
    """A seam's motion is asked for at one half-edge, from the triangle across to its own."""
    mesh, points, corners, _ = laid_out(shapes.torus(24, 12), cones="none")
    starts, ends = corners[:, [1, 2, 0]].ravel(), corners[:, [2, 0, 1]].ravel()
    h, t = mesh.edge_halfedges[~mesh.is_boundary_edge].T
    cut = np.flatnonzero((starts[h] != ends[t]) | (ends[h] != starts[t]))
    z = points @ [1, 1j]
    move = z[starts[h]] - z[ends[t]]  # a torus without cones has translations alone
    first, translation = h[cut[0]], move[cut[0]] * 1.1 + 0.02j
    relaxed = relax(
        mesh,
        points,
        corners,
        constraints=PointConstraints(tied=[first], translations=[[translation.real, translation.imag]]),
    )
    after = relaxed.points @ [1, 1j]
    moved = after[starts[h]] - after[ends[t]]
    is_same_seam = np.abs(move - move[cut[0]]) < 1e-9
    assert is_same_seam[cut].sum() > 1
    assert np.abs(moved - translation)[is_same_seam & np.isin(np.arange(len(h)), cut)].max() < 1e-9
    assert signed_double_areas(relaxed.points[corners]).min() > 0


@pytest.mark.parametrize(
    ("tied", "translations", "message"),
    [([0], [], "1 half-edge tied, but 0 translations"), ([0], [[0, 0]], "tied half-edge 0 is on no seam")],
)
def test_ties_without_seam_or_translation_are_refused(tied, translations, message):
    mesh, points, corners, _ = laid_out(shapes.hill(), cones="none")
    with pytest.raises(errors.OptionError, match=message):
        relax(mesh, points, corners, constraints=PointConstraints(tied=tied, translations=translations))


@pytest.mark.parametrize("collapsed", [0.0, np.nan])
def test_seam_edges_without_length_are_counted(collapsed: float):
    mesh = TriangleMesh(np.eye(4, 3), np.array([[0, 1, 2], [0, 2, 3]]))
    corners, points = np.arange(6).reshape(2, 3), np.full(6, collapsed, dtype=np.complex128)
    with pytest.raises(errors.SeamError, match="1 seam edges have no length"):
        find_chains(mesh, corners, points, np.empty(0, dtype=np.int64))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("stretch", [0.0, 0.5, 1.0])
def test_triangles_flipped_by_rounding_give_no_warnings(stretch):
    derivatives = StretchEnergy(stretch).derivatives(np.array([1.0, 1.0]), np.array([-1e-12, 0.0]))
    assert len(derivatives.value) == 2


def test_lengths_are_reached_whatever_the_area_of_the_layout():
    mesh = TriangleMesh(*shapes.grid(8, 4))
    flat = mesh.vertices[:, :2]
    middle, left = np.median(flat[:, 0]), flat[:, 0].min()
    stretched = flat.copy()
    stretched[:, 0] += 0.6 * np.maximum(flat[:, 0] - middle, 0)
    problem = mesh, stretched, mesh.faces, StretchEnergy(1)
    free, tolerance = flat[:, 0] > left, 1e-9
    reached = relax(*problem, free=free, to_scale=True, tolerance=tolerance).points
    assert reached == pytest.approx(flat, abs=1e-8)
    assert np.ptp(relax(*problem, free=free, tolerance=tolerance).points) > 1.1 * np.ptp(flat)
