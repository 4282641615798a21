"""Copies and the two sides of cloth that share texels."""

from dataclasses import replace

import numpy as np
import pytest
import shapes

import coneflat
from coneflat import errors, unwrap
from coneflat.geometry import signed_double_areas


def turned_copies(count):
    """Return the vertices and faces of copies of a hill, each turned and moved."""
    vertices, faces = shapes.hill(8, 6)
    pieces = []
    for k in range(count):
        turn = np.linalg.qr(np.random.default_rng(k).normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        pieces.append((vertices @ turn + [5 * k, 0, 0], faces))
    return shapes.join(*pieces)


def test_copies_share_the_texels_of_the_first():
    vertices, faces = turned_copies(3)
    result, single = unwrap(vertices, faces, stack="copies"), unwrap(*shapes.hill(8, 6))
    count = len(faces) // 3
    assert len(result.faces) == len(faces)
    for k in (1, 2):
        np.testing.assert_array_equal(result.uv_faces[:count], result.uv_faces[k * count : (k + 1) * count])
    assert result.distortion.charts == single.distortion.charts
    assert result.distortion.overlapping_pairs == 0
    assert result.packing_efficiency == pytest.approx(single.packing_efficiency)
    assert any("2 components share the texels of others" in note for note in result.notes)


@pytest.mark.parametrize("shares_vertices", [True, False])
def test_the_back_of_cloth_shares_the_texels_of_the_front(shares_vertices):
    vertices, front = shapes.hill(8, 6)
    back = front[::-1, [0, 2, 1]]
    cloth = (vertices, np.concatenate([front, back]))
    if not shares_vertices:
        cloth = (np.concatenate([vertices, vertices]), np.concatenate([front, back + len(vertices)]))
    result = unwrap(*cloth, repair=True, stack="copies")
    assert len(result.faces) == 2 * len(front)
    of_vertex = {}
    for row, points in zip(result.vertices[result.faces], result.uv[result.uv_faces], strict=True):
        for position, point in zip(row.tolist(), points.tolist(), strict=True):
            of_vertex.setdefault(tuple(position), set()).add(tuple(point))
    single = unwrap(vertices, front)
    assert sum(map(len, of_vertex.values())) == len(single.uv)
    assert result.distortion.overlapping_pairs == 0
    assert result.distortion.flipped == 0


def test_without_the_option_each_side_has_its_own_texels():
    vertices, front = shapes.hill(8, 6)
    cloth = vertices, np.concatenate([front, front[:, [0, 2, 1]]])
    result = unwrap(*cloth, repair=True)
    assert len(result.faces) == 2 * len(front)
    assert result.distortion.overlapping_pairs == 0
    assert len(np.unique(result.uv_faces)) == len(result.uv)


@pytest.mark.parametrize("ending", [".obj", ".glb", ".ply"])
def test_written_files_share_texels_too(ending, tmp_path):
    result = unwrap(*turned_copies(3), stack="copies")
    stored = result.as_written(ending)
    assert stored.distortion.overlapping_pairs == 0
    assert stored.distortion.energy == pytest.approx(result.distortion.energy, rel=1e-4)
    result.save(tmp_path / f"out{ending}")
    assert coneflat.measure_uv(tmp_path / f"out{ending}").distortion.qc_max < 10


def test_copies_of_another_size_have_their_own_texels():
    vertices, faces = shapes.hill(8, 6)
    model = shapes.join((vertices, faces), (3 * vertices + 10, faces))
    result = unwrap(*model, stack="copies")
    np.testing.assert_allclose(
        result.distortion.log_area_scale.mean(), result.distortion.log_area_scale, atol=0.2
    )
    assert any("No component shares" in note for note in result.notes)


def test_lengths_cannot_be_given_for_copies():
    vertices, faces = shapes.hill(8, 6)
    with pytest.raises(errors.OptionError, match="stack copies and lengths cannot be combined"):
        unwrap(vertices, faces, stack="copies", lengths=np.ones(faces.shape))


@pytest.mark.parametrize("order", ["A B A2 B2", "A A2 B B2", "A B B2", "A A2 B2", "B2 A2 A B"])
def test_copies_of_doubled_cloth_share_the_texels_of_one_side(order):
    vertices, front = shapes.hill(8, 6)
    pieces = {"A": (vertices, front), "B": (vertices, front[:, [0, 2, 1]])}
    pieces |= {
        f"{name}2": (vertices + np.array([10.0, 0, 0]), faces) for name, (vertices, faces) in pieces.items()
    }
    names = order.split()
    result = unwrap(*shapes.join(*(pieces[name] for name in names)), stack="copies")
    assert result.uv_faces.min() >= 0
    assert len(result.uv) == len(unwrap(*pieces[names[0]]).uv)
    assert any(f"{len(names) - 1} components share" in note for note in result.notes)
    areas = np.abs(signed_double_areas(result.corner_uv)).reshape(len(names), -1)
    np.testing.assert_array_equal(areas, np.tile(areas[0], (len(names), 1)))


def test_copies_with_positions_in_single_precision_share_texels():
    vertices, faces = turned_copies(4)
    result = unwrap(vertices.astype(np.float32), faces, stack="copies")
    assert any("3 components share" in note for note in result.notes)


def mirrored_copies(count, order=(2, 1, 0)):
    """Return copies of a hill, turned and moved, every second one mirrored, with its corners in an order."""
    vertices, faces = shapes.hill(8, 6)
    images = [(vertices, faces), (vertices * [1, 1, -1], faces[:, order])]
    pieces = [
        (images[k % 2][0] @ shapes.rotation(k).T + [5 * k, 0, 0], images[k % 2][1]) for k in range(count)
    ]
    return shapes.join(*pieces)


@pytest.mark.parametrize("order", [(2, 1, 0), (0, 2, 1), (1, 0, 2)])
def test_mirrored_copies_share_the_texels_of_the_first(order):
    vertices, faces = mirrored_copies(4, order)
    result, single = unwrap(vertices, faces, stack="copies"), unwrap(*shapes.hill(8, 6))
    assert len(result.uv) == len(single.uv)
    areas = signed_double_areas(result.corner_uv).reshape(4, -1)
    assert (areas[::2] > 0).all()
    np.testing.assert_allclose(areas[1::2], -areas[::2], rtol=1e-12)
    assert any("3 components share" in note and "2 of them are mirrored" in note for note in result.notes)
    assert (result.distortion.flipped, result.distortion.overlapping_pairs) == (0, 0)


def test_corners_of_mirrored_copies_have_the_uv_of_their_images():
    """Each side of a copy is stretched as its image in the first."""
    result = unwrap(*mirrored_copies(3), stack="copies")
    in_plane, in_space = (
        np.linalg.norm(corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]], axis=2)
        for corners in (result.corner_uv, result.vertices[result.faces])
    )
    stretch = np.sort(in_plane / in_space, axis=1).reshape(3, -1, 3)
    np.testing.assert_allclose(stretch[1:], stretch[[0, 0]], rtol=1e-9)


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("ending", [".obj", ".glb", ".ply", ".npz"])
def test_written_mirrored_copies_are_not_measured(ending, first):
    vertices, faces = mirrored_copies(4)
    # The mirror images may come first: then they are those that are unwrapped.
    model = (vertices, faces) if first == 0 else (vertices * [1, 1, -1], faces[:, ::-1])
    result = unwrap(*model, stack="copies")
    stored = result.as_written(ending)
    assert (stored.distortion.flipped, stored.distortion.overlapping_pairs) == (0, 0)
    assert stored.distortion.energy == pytest.approx(result.distortion.energy, rel=1e-4)


@pytest.mark.parametrize("count", [2, 3])
def test_flips_of_measured_copies_are_found(count):
    result = unwrap(*mirrored_copies(count), stack="copies")
    uv = result.uv.copy()
    corner = result.uv_faces[0]
    uv[corner[0]] += 2 * (uv[corner[1:]].mean(axis=0) - uv[corner[0]])
    assert replace(result, uv=uv).as_written(".glb").distortion.flipped > 0


def test_a_component_with_some_reversed_faces_is_no_copy():
    vertices, faces = shapes.hill(8, 6)
    turned = faces.copy()
    turned[: len(faces) // 2] = turned[: len(faces) // 2, ::-1]
    result = unwrap(*shapes.join((vertices, faces), (vertices + 10, turned)), stack="copies", repair=True)
    assert result.distortion.overlapping_pairs == 0


@pytest.mark.parametrize("is_mirrored", [False, True])
def test_copies_with_other_numbers_share_texels(is_mirrored):
    vertices, faces = shapes.sphere(2, seed=3)
    pieces = [(vertices, faces)]
    for seed in (1, 2):
        moved, corners, _ = shapes.renumber(vertices, faces, seed=seed)
        moved = moved * [1, -1 if is_mirrored else 1, 1] @ shapes.rotation(seed).T + [5.0 * seed, 0, 0]
        pieces.append((moved, corners[:, ::-1] if is_mirrored else corners))
    result = unwrap(*shapes.join(*pieces), stack="copies")
    assert len(result.uv) == len(unwrap(vertices, faces).uv)
    signs = np.sign(signed_double_areas(result.corner_uv)).reshape(3, -1)
    assert (signs == np.array([[1], [-1], [-1]] if is_mirrored else [[1]] * 3)).all()
    assert any("2 components share" in note for note in result.notes)
    in_plane, in_space = (
        np.linalg.norm(corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]], axis=2).ravel()
        for corners in (result.corner_uv, result.vertices[result.faces])
    )
    count = len(in_plane) // 3
    for k in (1, 2):
        parts = slice(count), slice(k * count, (k + 1) * count)
        stretches = [np.sort((in_plane / in_space)[part]) for part in parts]
        np.testing.assert_allclose(*stretches, rtol=1e-6)


def test_a_mirrored_copy_that_a_rotation_fits_is_not_flipped():
    vertices, faces = shapes.box()
    model = shapes.join((vertices, faces), (vertices * [-1, 1, 1] + [9, 0, 0], faces[:, ::-1]))
    result = unwrap(*model, stack="copies")
    assert (signed_double_areas(result.corner_uv) > 0).all()
    assert any("1 component shares" in note and "mirrored" not in note for note in result.notes)


@pytest.mark.parametrize("is_renumbered", [False, True])
@pytest.mark.parametrize("height", [1.01, 1.1, 1.4])
def test_components_of_another_shape_far_from_the_origin_share_no_texels(height, is_renumbered):
    vertices, faces = shapes.hill(8, 6)
    stretched = vertices * [1, 1, height] + [1e4, 0, 0], faces
    if is_renumbered:
        stretched = shapes.renumber(*stretched, seed=1)[:2]
    model = shapes.join((vertices, faces), stretched)
    result = unwrap(*model, stack="copies")
    assert any("No component shares" in note for note in result.notes)


def copies_of_sphere(kind):
    """Return the vertices and faces of a sphere, and those of a copy of it."""
    vertices, faces = shapes.sphere(1, seed=3)
    if kind == "back":
        return (vertices, faces), (vertices, faces[:, ::-1])
    if kind == "mirrored":
        return (vertices, faces), (vertices * [-1, 1, 1] + [5, 0, 0], faces[:, ::-1])
    moved = vertices + np.array([5, 0, 0]), faces
    return (vertices, faces), shapes.renumber(*moved, seed=1)[:2] if kind == "renumbered" else moved


@pytest.mark.parametrize("kind", ["moved", "renumbered", "mirrored", "back"])
def test_edges_that_are_forbidden_in_a_copy_are_not_cut(kind):
    first, second = copies_of_sphere(kind)
    model = shapes.join(first, second)
    stacked = unwrap(*model, stack="copies")
    assert any("1 component shares" in note for note in stacked.notes)
    in_copy = stacked.seams[(stacked.seams >= len(first[0])).all(axis=1)]
    assert len(in_copy)
    result = unwrap(*model, stack="copies", no_seams=in_copy)
    cut, forbidden = ({tuple(sorted(edge)) for edge in edges.tolist()} for edges in (result.seams, in_copy))
    assert not cut & forbidden
    assert any("No component shares" in note for note in result.notes)


@pytest.mark.parametrize("is_mirrored", [False, True])
def test_copies_with_the_same_forbidden_edges_share_texels(is_mirrored):
    first, second = copies_of_sphere("mirrored" if is_mirrored else "moved")
    forbidden = unwrap(*first).seams[:3]
    pairs = np.concatenate([forbidden, forbidden + len(first[0])])
    result = unwrap(*shapes.join(first, second), stack="copies", no_seams=pairs)
    assert any("1 component shares" in note for note in result.notes)


@pytest.mark.parametrize(("is_third_mirrored", "count"), [(False, 2), (True, 1)])
def test_the_number_of_mirrored_copies_is_that_of_flipped_ones(is_third_mirrored, count):
    """A renumbered mirror image, and a copy or mirror image of that with its numbers."""
    vertices, faces = shapes.hill(8, 6)
    image, corners, _ = shapes.renumber(vertices * [-1, 1, 1] + [5, 0, 0], faces[:, ::-1], seed=3)
    third = (image * [-1, 1, 1], corners[:, ::-1]) if is_third_mirrored else (image, corners)
    model = shapes.join((vertices, faces), (image, corners), (third[0] + [20, 0, 0], third[1]))
    result = unwrap(*model, stack="copies")
    areas = signed_double_areas(result.corner_uv).reshape(3, -1)
    assert ((areas < 0).all(axis=1)).sum() == count
    assert any(f"{count} of them {'is' if count == 1 else 'are'} mirrored" in note for note in result.notes)


def quad_patch(start, is_mirrored=False):
    """Return the vertices and quads of a curved patch; each quad begins with its corner `start`."""
    number = np.arange(36).reshape(6, 6)
    corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    quads = np.roll(np.stack(corners, axis=2).reshape(-1, 4), -start, axis=1)
    x, y = (values.ravel() / 5 for values in np.meshgrid(np.arange(6), np.arange(6), indexing="ij"))
    vertices = np.stack([x * (1 + 0.5 * y), y + 0.2 * x * x, 0.3 * np.sin(4 * x + y)], axis=1)
    return (vertices * [-1, 1, 1], quads[:, ::-1]) if is_mirrored else (vertices, quads)


@pytest.mark.parametrize("ending", [".obj", ".glb", ".ply"])
@pytest.mark.parametrize("is_mirrored", [False, True])
@pytest.mark.parametrize("start", [0, 1, 2])
def test_written_quads_of_copies_do_not_overlap_however_they_begin(tmp_path, start, is_mirrored, ending):
    """Readers split the quads of the copy along other diagonals than those of the first."""
    patches = [quad_patch(0), quad_patch(start), quad_patch(start, is_mirrored)]
    path = tmp_path / "quads.obj"
    with path.open("w") as file:
        for k, (vertices, quads) in enumerate(patches):
            vertices = vertices + np.array([3 * k, 0, 0])
            file.writelines(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in vertices)
            file.writelines("f " + " ".join(map(str, quad)) + "\n" for quad in quads + 1 + 36 * k)
    result = unwrap(path, stack="copies")
    assert any("2 components share" in note for note in result.notes)
    stored = result.as_written(ending)
    assert (stored.distortion.flipped, stored.distortion.overlapping_pairs) == (0, 0)
    assert stored.distortion.charts == result.distortion.charts
