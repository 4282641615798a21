"""Mirror symmetry: the plane, cones in pairs, a cut and charts that are alike on both sides."""

import numpy as np
import pytest
import shapes
from numpy.testing import assert_allclose

from coneflat import check_mesh, cut_open, find_overlaps, flatten
from coneflat.errors import OptionError
from coneflat.geometry import edge_lengths
from coneflat.geometry.halves import part_halves
from coneflat.geometry.mirror import distance_at, find_mirror, mirrored_corners, mirrored_edges
from coneflat.geometry.planar import signed_double_areas
from coneflat.seams import detail_factors, mirrored_seams


def head(rounds=4):
    """A ball with a nose, eyes, ears and a neck, exactly symmetric about x = 0: a subdivided octahedron."""
    points = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    faces = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
    for _ in range(rounds):
        points, faces = shapes.subdivide(points, faces)
    points /= np.linalg.norm(points, axis=1)[:, None]

    def bump(at, width, height):
        off = points - at
        off[:, 0] = np.abs(points[:, 0]) - at[0]
        return height * np.exp(-(off**2).sum(axis=1) / width**2)

    radius = 1 + bump((0, 0, 1), 0.25, 0.5) + bump((1, 0.1, 0), 0.25, 0.6) + bump((0, -1, -0.2), 0.5, 0.7)
    return points * (radius + bump((0.4, 0.4, 0.8), 0.2, -0.15))[:, None], faces


def turned(points, seed=0):
    """The points moved, turned and scaled."""
    rotation = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    rotation *= np.sign(np.linalg.det(rotation))
    return 7.0 * points @ rotation.T + [1.0, 2.0, 3.0], rotation


def mirror_of(points, faces, tolerance=0.01, normal=None):
    mesh = check_mesh(points, faces).mesh
    return mesh, find_mirror(mesh, edge_lengths(mesh.vertices, mesh.faces), tolerance, normal)


def test_the_plane_of_an_exactly_symmetric_mesh():
    points, faces = head()
    mesh, mirror = mirror_of(points, faces)
    assert_allclose(np.abs(mirror.normal), [1, 0, 0], atol=1e-12)
    assert abs(mirror.offset) < 1e-12
    assert mirror.deviation < 1e-12
    assert mirror.is_exact
    assert_allclose(mesh.vertices[mirror.partner], mesh.vertices * [-1, 1, 1], atol=1e-12)
    # Faces are images of each other, and of none is it itself.
    assert_allclose(mirror.face_partner[mirror.face_partner], np.arange(len(faces)))
    assert (mirror.face_partner != np.arange(len(faces))).all()


def test_the_plane_moves_with_the_mesh_and_does_not_depend_on_its_numbering():
    points, faces = head(3)
    random = np.random.default_rng(1)
    order = random.permutation(len(points))
    moved, rotation = turned(points)
    _, mirror = mirror_of(moved[order], np.argsort(order)[faces][random.permutation(len(faces))])
    assert_allclose(np.abs(mirror.normal @ rotation), [1, 0, 0], atol=1e-9)
    assert abs(mirror.normal @ [1.0, 2.0, 3.0] - mirror.offset) < 1e-9
    assert mirror.is_exact


def test_a_surface_with_bumps_at_random_has_no_plane():
    assert mirror_of(*shapes.sphere(3))[1] is None


def test_a_plane_in_which_all_lies_is_none():
    assert mirror_of(*shapes.grid(5, 3), normal=np.array([0.0, 0.0, 1.0]))[1] is None


def test_the_distance_from_a_triangle():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    mesh = check_mesh(points, [[0, 1, 2]]).mesh
    queries = np.array([[0.2, 0.2, 0.5], [-0.3, -0.4, 0.0], [0.5, -2.0, 0.0], [1.0, 1.0, 0.0]])
    found = distance_at(mesh, points, queries, np.zeros(4, dtype=np.int64))
    assert_allclose(found, [0.5, 0.5, 2.0, np.sqrt(0.5)])


def test_images_of_edges_and_corners():
    mesh, mirror = mirror_of(*head(3))
    image = mirrored_edges(mesh, mirror.partner)
    assert_allclose(image[image], np.arange(len(image)))
    costs = np.ones(len(mesh.edges))
    is_left = part_halves(mesh, mirror, costs, np.zeros(len(costs), dtype=bool))
    assert is_left.sum() * 2 == len(is_left)
    corner = mirrored_corners(mesh, mirror.partner, is_left)
    right = np.flatnonzero(corner >= 0)
    assert len(right) * 2 == len(corner)
    flat = mesh.faces.ravel()
    assert_allclose(mirror.partner[flat[right]], flat[corner[right]])
    assert_allclose(corner[right] // 3, mirror.face_partner[right // 3])


def test_a_mesh_that_is_nearly_symmetric_is_parted_by_one_curve():
    """Faces across the plane, and vertices off their images: both sides are disks all the same."""
    points, faces = shapes.sphere(4, bumps=0.0)
    points = points * [1.0, 1.3, 0.7] @ np.array([[0.96, 0.28, 0], [-0.28, 0.96, 0], [0, 0, 1]])
    mesh, mirror = mirror_of(points, faces)
    costs = np.linalg.norm(np.diff(mesh.vertices[mesh.edges], axis=1)[:, 0], axis=1)
    is_left = part_halves(mesh, mirror, costs, np.zeros(len(costs), dtype=bool))
    sides = is_left[mesh.edge_faces]
    curve = mesh.edges[sides[:, 0] != sides[:, 1]]
    # Every vertex of the curve has two edges of it, and it runs within an edge of the plane.
    assert set(np.bincount(curve.ravel())) == {0, 2}
    size = np.sqrt(4 * np.pi)
    assert np.abs(mirror.height[curve]).max() * size < costs.max()


def test_symmetric_seams_cut_to_a_disk_and_are_their_own_image():
    mesh, mirror = mirror_of(*head(4))
    costs = np.linalg.norm(np.diff(mesh.vertices[mesh.edges], axis=1)[:, 0], axis=1)
    none = np.zeros(len(costs), dtype=bool)
    is_left = part_halves(mesh, mirror, costs, none)
    random = np.random.default_rng(3)
    for _ in range(5):
        some = random.choice(np.flatnonzero(~mirror.own), 3, replace=False)
        alone = random.choice(np.flatnonzero(mirror.own), 2, replace=False)
        cones = np.unique(np.concatenate([some, mirror.partner[some], alone]))
        seams = mirrored_seams(mesh, mirror, is_left, cones, costs, none, np.empty(0, dtype=np.int64))
        opened = cut_open(mesh, seams)
        assert opened.pieces == 1
        assert opened.mesh.is_boundary_vertex[np.isin(opened.origin, cones)].all()
        assert set(mirrored_edges(mesh, mirror.partner)[seams]) == set(seams)


def test_forbidden_edges_are_not_part_of_symmetric_seams():
    points, faces = head(4)
    _, mirror = mirror_of(points, faces)
    free = flatten(points, faces, symmetric="x", charts="one")
    along = free.seams[mirror.own[free.seams].all(axis=1) & ~np.isin(free.seams, free.cones).any(axis=1)]
    barred = along[len(along) // 2 :][:1]
    result = flatten(points, faces, symmetric="x", forbidden_seams=barred, charts="one")
    assert result.symmetry[0].seams
    assert set(barred[0]) not in [set(pair) for pair in result.seams.tolist()]


def test_detail_of_a_sphere_is_its_mean_curvature():
    points, faces = shapes.sphere(4, bumps=0.0)
    mesh = check_mesh(points, faces).mesh
    factors = detail_factors(mesh, edge_lengths(mesh.vertices, mesh.faces))
    # sqrt(4 pi) R / R, of the 60 that count as full of detail, where it costs 2 more.
    assert_allclose(factors, 1 + 2 * np.sqrt(4 * np.pi) / 60, rtol=0.01)


@pytest.mark.parametrize("rounds", [3, 4])
def test_cones_seams_and_layout_are_symmetric(rounds):
    points, faces = head(rounds)
    result = flatten(points, faces, symmetric="auto")
    (symmetry,) = result.symmetry
    assert symmetry.is_exact
    assert symmetry.cones
    assert symmetry.seams
    assert symmetry.layout < 1e-9
    _, mirror = mirror_of(points, faces)
    image = mirror.partner[result.cones]
    assert set(image) == set(result.cones)
    carried = dict(zip(result.cones.tolist(), result.curvatures, strict=True))
    assert_allclose([carried[v] for v in image.tolist()], result.curvatures, atol=1e-9)
    assert_allclose(result.log_scale[mirror.partner], result.log_scale, atol=1e-8)
    assert result.solve.area_distortion_linear <= 0.2
    assert result.distortion.flipped == 0
    assert result.distortion.overlapping_pairs == 0
    assert result.distortion.angle_sum_error < 1e-9


def test_symmetry_costs_few_cones():
    points, faces = head(4)
    plain, alike = flatten(points, faces), flatten(points, faces, symmetric="x")
    assert len(alike.cones) <= 1.2 * len(plain.cones) + 1


def test_the_axis_of_a_symmetric_chart_stands_upright():
    points, faces = head(4)
    result = flatten(points, faces, symmetric="x", charts="one")
    _, mirror = mirror_of(points, faces)
    seen, inverse = np.unique(result.uv_faces.ravel(), return_index=True)
    point = np.full(len(points), -1)
    copies = np.zeros(len(points), dtype=int)
    vertex = result.faces.ravel()[inverse]
    point[vertex] = seen
    np.add.at(copies, vertex, 1)
    inside = np.flatnonzero((copies == 1) & (copies[mirror.partner] == 1))
    one, two = result.uv[point[inside]], result.uv[point[mirror.partner[inside]]]
    assert len(inside) > len(points) / 2
    # Mirrored along u, at equal heights.
    assert_allclose(one[:, 1], two[:, 1], atol=1e-9)
    assert np.ptp(one[:, 0] + two[:, 0]) < 1e-9


def test_the_seam_is_at_the_back_of_the_head():
    """From the top of the head to the neck, over the smooth back and not over the nose, where both are as long."""
    points, faces = head(4)
    mesh, mirror = mirror_of(points, faces)
    lengths = edge_lengths(mesh.vertices, mesh.faces)
    height = np.where(mirror.own, points[:, 1], 0.0)
    cones = np.array([np.argmax(height), np.argmin(height)])
    none = np.zeros(len(mesh.edges), dtype=bool)
    costs = detail_factors(mesh, lengths)
    is_left = part_halves(mesh, mirror, costs, none)
    seams = mirrored_seams(mesh, mirror, is_left, cones, costs, none, np.empty(0, dtype=np.int64))
    assert mirror.own[mesh.edges[seams]].all()
    assert (points[mesh.edges[seams], 2] <= 1e-12).all()


def test_both_sides_in_one_place():
    points, faces = head(4)
    apart = flatten(points, faces, symmetric="x")
    result = flatten(points, faces, symmetric="x", mirrored="overlap")
    measures = result.distortion
    assert measures.flipped == 0
    assert measures.charts == 2 * measures.mirrored_charts
    assert measures.angle_sum_error < 1e-9
    assert measures.seam_mismatch_max < 1e-9
    assert result.uv_scale > apart.uv_scale
    assert 0 <= result.uv.min()
    assert result.uv.max() <= 1
    assert result.symmetry[0].overlaid
    assert measures.overlap > 0.99
    assert any("nothing else overlaps" in note for note in result.notes)
    # Texels are shared, to far below one.
    _, mirror = mirror_of(points, faces)
    one, two = result.corner_uv, result.corner_uv[mirror.face_partner]
    there = (result.faces[mirror.face_partner][:, None] == mirror.partner[result.faces][:, :, None]).argmax(
        axis=2
    )
    images = np.take_along_axis(two, there[:, :, None], axis=1)
    assert np.abs(one - images).max() * 1024 < 0.01
    left = signed_double_areas(one) > 0
    assert left.sum() * 2 == len(faces)
    assert not len(find_overlaps(result.uv, result.uv_faces[left]).pairs)


def test_what_has_no_symmetry_is_as_without():
    points, faces = shapes.sphere(3)
    plain, auto = flatten(points, faces), flatten(points, faces, symmetric="auto")
    assert not auto.symmetry
    assert np.array_equal(plain.uv, auto.uv)


def test_a_plane_about_which_a_model_is_not_symmetric_is_refused_with_numbers():
    points, faces = shapes.sphere(3, bumps=1.0)
    with pytest.raises(OptionError, match=r"normal x: it is off its mirror image by 0\.\d+ of its size"):
        flatten(points, faces, symmetric="x")


def test_overlap_without_symmetry_or_atlas_is_refused():
    for options in ({}, {"symmetric": "x", "charts": "one"}):
        with pytest.raises(OptionError, match="needs an atlas and symmetry"):
            flatten(*head(2), mirrored="overlap", **options)


def test_cones_that_are_given_come_before_symmetry():
    points, faces = head(3)
    off = int(np.argmax(0.5 * points[:, 0] - points[:, 2]))
    result = flatten(points, faces, symmetric="x", required_cones=[off])
    assert off in result.cones
    assert not result.symmetry[0].cones
    assert not result.symmetry[0].seams
    assert any("its cones and seams are not" in note for note in result.notes)


def test_whole_quanta_keep_working():
    points, faces = head(3)
    result = flatten(points, faces, symmetric="x", quantise=np.pi / 2)
    assert_allclose(result.curvatures / (np.pi / 2), np.round(result.curvatures / (np.pi / 2)), atol=1e-9)


def test_a_torus_is_cut_symmetrically():
    points, faces = shapes.grid(40, 20, wrap=(True, True))
    s, t = 2 * np.pi * points[:, 0], 2 * np.pi * points[:, 1]
    r = 0.4 * (1 + 0.3 * np.cos(s))
    ring = 1 + r * np.cos(t)
    points = np.stack([ring * np.cos(s), ring * np.sin(s), r * np.sin(t)], axis=1)
    result = flatten(points, faces, symmetric="y")
    (symmetry,) = result.symmetry
    assert symmetry.seams
    assert result.distortion.flipped == 0
    assert symmetry.layout is not None
    assert symmetry.layout < 1e-2


@pytest.mark.parametrize("name", ["spot.obj", "human.obj", "face.obj", "camelhead.off"])
def test_real_models(shared, name):
    """Models whose triangles are no images of each other, though vertices or shapes are."""
    path = shared(name)
    plain, result = flatten(path), flatten(path, symmetric="auto")
    largest = result.symmetry[0]
    assert largest.cones
    assert largest.seams
    assert largest.deviation < 1e-3
    assert len(result.cones) <= len(plain.cones) + 1
    assert result.distortion.flipped == 0
    assert result.distortion.overlapping_pairs == 0
    assert result.distortion.angle_sum_error < 1e-9


def test_cones_of_a_rough_model_are_different_vertices(shared):
    """Nearest vertices of images need not be images of each other: no vertex may be in two pairs."""
    result = flatten(shared("knight.off"), symmetric="x")
    assert result.symmetry[0].cones
    assert len(set(result.cones.tolist())) == len(result.cones)
    assert_allclose(result.curvatures.sum(), 4 * np.pi, rtol=1e-9)


def test_the_report_and_archives_tell_of_it(tmp_path):
    from coneflat import read_flattening

    result = flatten(*head(3), symmetric="auto")
    (told,) = result.report()["symmetry"]
    assert told["cones"] is True
    assert len(told["normal"]) == 3
    again = read_flattening(result.save(tmp_path / "head.npz"))
    assert again.symmetry == result.symmetry
