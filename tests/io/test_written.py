"""What files hold is what is reported of them, in their own precision and as others read them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapes

from coneflat import flatten, measure_uv
from coneflat.atlas.touch import round_safely
from coneflat.errors import MeshFileError
from coneflat.geometry.overlap import find_overlaps
from coneflat.geometry.planar import signed_double_areas
from coneflat.io.convex_pieces import merge_convex
from coneflat.io.write import stored_in_glb, write_measured
from coneflat.mesh.connectivity import TriangleMesh

trimesh = pytest.importorskip("trimesh")


def quads(rounds: int, noise: float):
    """A bumpy ball of quads (n, 3), (q, 4): each triangle of an icosphere in three."""
    vertices, faces = shapes.sphere(rounds)
    points, index = list(vertices), {}

    def middle(*ends):
        key = tuple(sorted(ends))
        if key not in index:
            index[key] = len(points)
            points.append(vertices[list(ends)].mean(axis=0))
        return index[key]

    rows = []
    for face in faces.tolist():
        centre = middle(*face)
        for k in range(3):
            a, b, c = face[k], face[(k + 1) % 3], face[k - 1]
            rows.append([a, middle(a, b), centre, middle(a, c)])
    places = np.array(points)
    return places + noise * np.random.default_rng(0).normal(size=places.shape), np.array(rows)


def write_quads(path, vertices, faces):
    lines = ["v " + " ".join(map(repr, row)) for row in vertices.tolist()]
    lines += ["f " + " ".join(str(v + 1) for v in row) for row in faces.tolist()]
    path.write_text("\n".join(lines) + "\n")
    return path


def seen_by_others(path):
    """Return (m, 3, 2) the UVs that trimesh reads, polygons as fans."""
    mesh = trimesh.load(path, process=False, force="mesh")
    return np.asarray(mesh.visual.uv, dtype=np.float64)[mesh.faces]


def face_sizes(path):
    return [len(line.split()) - 1 for line in path.read_text().splitlines() if line.startswith("f ")]


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, 0.01, 0.05])
def test_fans_of_written_polygons_are_upright_and_apart(tmp_path, noise):
    vertices, faces = quads(2, noise)
    result = flatten(write_quads(tmp_path / "in.obj", vertices, faces), charts="atlas")
    written = write_measured(result, tmp_path / "out.obj")
    uv = seen_by_others(tmp_path / "out.obj")
    assert (signed_double_areas(uv) > 0).all()
    assert len(find_overlaps(uv).pairs) == written.distortion.overlapping_pairs == 0
    sizes = face_sizes(tmp_path / "out.obj")
    assert sum(size - 2 for size in sizes) == 2 * len(faces)
    pieces = [note for note in written.notes if "convex pieces" in note]
    assert bool(pieces) == (3 in sizes)
    if noise == 0.0:
        assert set(sizes) == {4}


def test_polygons_concave_on_the_model_are_written_in_pieces(tmp_path):
    """A prism over an L, its caps concave polygons of six corners."""
    outline = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2.0]])
    vertices = np.concatenate([np.column_stack([outline, np.full(6, z)]) for z in (0.0, 1.0)])
    lines = ["v " + " ".join(map(repr, row)) for row in vertices.tolist()]
    lines += ["f 6 5 4 3 2 1", "f 7 8 9 10 11 12"]
    lines += [f"f {k + 1} {(k + 1) % 6 + 1} {(k + 1) % 6 + 7} {k + 7}" for k in range(6)]
    (tmp_path / "in.obj").write_text("\n".join(lines))
    written = write_measured(flatten(tmp_path / "in.obj", charts="atlas"), tmp_path / "out.obj")
    assert any("2 polygons are written in convex pieces" in note for note in written.notes)
    uv = seen_by_others(tmp_path / "out.obj")
    assert (signed_double_areas(uv) > 0).all()
    assert len(find_overlaps(uv).pairs) == 0
    sizes = face_sizes(tmp_path / "out.obj")
    assert sizes.count(4) >= 6
    assert sum(size - 2 for size in sizes) == 20
    # An L falls into two convex pieces.
    assert len(sizes) == 6 + 2 * 2


def test_pieces_are_merged_while_they_are_convex():
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    assert merge_convex(square, [[(0, 0), (1, 1), (2, 2)], [(0, 0), (2, 2), (3, 3)]]) == [
        [(0, 0), (1, 1), (2, 2), (3, 3)]
    ]
    dart = np.array([[0, 0], [1, 0], [0.2, 0.2], [0, 1.0]])
    assert len(merge_convex(dart, [[(0, 0), (1, 1), (2, 2)], [(0, 0), (2, 2), (3, 3)]])) == 2


def test_measures_of_a_glb_are_those_of_its_32_bit_numbers(tmp_path):
    result = flatten(*shapes.sphere(4), charts="atlas", padding=0.0)
    written = write_measured(result, tmp_path / "out.glb")
    uv = seen_by_others(tmp_path / "out.glb")
    assert np.array_equal(np.sort(uv.reshape(-1)), np.sort(written.corner_uv.reshape(-1)))
    assert len(find_overlaps(uv).pairs) == written.distortion.overlapping_pairs == 0
    assert (signed_double_areas(uv) > 0).all()
    assert written.distortion.qc_mean != result.distortion.qc_mean
    assert written.as_written(".glb") is written


def test_marked_seams_of_an_obj_turn_freely_whatever_its_diagonals(tmp_path):
    """The report names seams that the quantum binds: edges of the fans are others than those of our triangles."""
    vertices, faces = quads(1, 0.05)
    write_quads(tmp_path / "in.obj", vertices, faces)
    # All around the quads of one triangle of the ball.
    sides = {(a, b) for row in faces[:3].tolist() for a, b in zip(row, row[1:] + row[:1], strict=True)}
    ring = np.array(sorted((a, b) for a, b in sides if (b, a) not in sides))
    result = flatten(tmp_path / "in.obj", seams=ring, quantise=np.pi / 2, charts="atlas")
    written = result.as_written(".obj")
    edges, written_edges = (
        set(map(tuple, TriangleMesh(vertices, mesh.faces).edges.tolist())) for mesh in (result, written)
    )
    assert edges != written_edges
    assert result.rotations.worst < 1e-9
    assert written.rotations.worst < 1e-9
    assert not any("multiples of" in note for note in written.notes)


def test_charts_that_touch_are_apart_in_single_precision():
    """Squares in a row, turned so that none of their corners is a number of 32 bits."""
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    points = np.concatenate([square + np.array([k, k / 3]) for k in range(5)]) @ np.array(
        [[0.8, 0.6], [-0.6, 0.8]]
    )
    points = (points - points.min(axis=0)) / 7.0
    corners = np.array([[4 * k + i for i in row] for k in range(5) for row in ((0, 1, 2), (0, 2, 3))])
    assert len(find_overlaps(stored_in_glb(points), corners).pairs)
    apart, _ = round_safely(points, corners, stored_in_glb)
    assert len(find_overlaps(apart, corners).pairs) == 0
    assert np.abs(apart - points).max() < 1e-6
    assert np.array_equal(stored_in_glb(apart), apart)


def test_positions_beyond_single_precision_are_refused(tmp_path):
    vertices, faces = shapes.tetrahedron()
    result = flatten(vertices * 1e39, faces)
    with pytest.raises(MeshFileError, match=r"beyond the 32-bit numbers of \.glb"):
        result.save(tmp_path / "out.glb")
    assert not (tmp_path / "out.glb").exists()


@pytest.mark.slow
def test_notes_of_a_file_are_those_of_its_numbers():
    """What 32 bits cannot hold apart is told."""
    result = flatten(*shapes.sphere(3), charts="atlas")
    tiny = replace(result, uv=0.5 + (result.uv - 0.5) * 1e-6)
    written = tiny.as_written(".glb")
    assert written.distortion.flipped + written.distortion.degenerate > 0
    assert any("flipped triangles" in note or "degenerate triangle" in note for note in written.notes)
    assert not result.as_written(".glb").notes


def all_notes(path, ending):
    out = path.with_name(f"out{ending}")
    return write_measured(flatten(path), out).notes


def test_notes_name_what_another_format_does_not_keep(tmp_path):
    vertices, faces = shapes.sphere(1)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    lines = [*(f"v {x} {y} {z}" for x, y, z in vertices), "usemtl skin"]
    lines += [f"f {a} {b} {c}" for a, b, c in faces + 1]
    (tmp_path / "painted.obj").write_text("\n".join(lines))
    mesh.visual = trimesh.visual.TextureVisuals(
        material=trimesh.visual.material.PBRMaterial(name="skin", baseColorFactor=[1.0, 0.0, 0.0, 1.0])
    )
    (tmp_path / "scene.glb").write_bytes(trimesh.Scene([mesh]).export(file_type="glb"))
    mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=np.full((len(vertices), 4), 9, np.uint8))
    mesh.export(tmp_path / "coloured.ply")
    mesh.export(tmp_path / "coloured.obj", include_color=True)
    told = {
        "painted.obj": "materials; .obj keeps them.",
        "scene.glb": "materials",
        "coloured.ply": "vertex colours, vertex properties (alpha); .ply keeps them.",
        "coloured.obj": "vertex colours; .obj keeps them.",
    }
    for name, data in told.items():
        for ending in (".obj", ".ply", ".glb", ".npz"):
            keeps = name.endswith(ending) or (ending in (".ply", ".glb") and "coloured" in name)
            note = f"These data of the input are not kept in {ending}: {data}"
            assert any(note in text for text in all_notes(tmp_path / name, ending)) != keeps


def bent_quads_with_corners_on_sides(count):
    """Return vertices and polygons of a curved sheet of quads, one of whose sides has `count` further corners."""
    x, y = np.meshgrid(np.arange(6.0), np.arange(6.0))
    vertices = np.stack([x.ravel(), y.ravel(), 0.3 * np.sin(x.ravel()) * np.cos(y.ravel())], axis=1)
    quads = [[6 * i + j, 6 * i + j + 1, 6 * i + j + 7, 6 * i + j + 6] for i in range(5) for j in range(5)]
    start, end = vertices[14], vertices[15]
    extra = [len(vertices) + k for k in range(count)]
    share = (np.arange(count) + 1) / (count + 1)
    vertices = np.concatenate([vertices, start + share[:, None] * (end - start)])
    quads[2 * 5 + 2] = [14, *extra, 15, 21, 20]
    quads[1 * 5 + 2] = [8, 9, 15, *extra[::-1], 14]
    return vertices, quads


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("first", range(5))
def test_fans_of_written_polygons_have_no_triangles_with_area_in_the_plane_alone(count, first, tmp_path):
    """Corners on the side of a polygon make triangles without area in some of its fans, which readers make."""
    vertices, polygons = bent_quads_with_corners_on_sides(count)
    lines = [f"v {' '.join(map(repr, point))}" for point in vertices.tolist()]
    for polygon in polygons:
        k = first % len(polygon)
        lines.append("f " + " ".join(str(v + 1) for v in polygon[k:] + polygon[:k]))
    source = tmp_path / "quads.obj"
    source.write_text("\n".join(lines) + "\n")
    result = flatten(source)
    result.save(tmp_path / "out.obj")
    measured = measure_uv(tmp_path / "out.obj").distortion
    assert measured.qc_max < 2
