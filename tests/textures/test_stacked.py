"""Copies and the two sides of cloth that share texels."""

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
