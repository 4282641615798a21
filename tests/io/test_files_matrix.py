"""Whatever is read and written, other people's code finds the same mesh in the file, and the measures reported."""

from __future__ import annotations

import struct
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from shapes import hill, join, sphere

import coneflat
from coneflat import check_mesh
from coneflat.io import read_mesh
from coneflat.io.write import as_written
from coneflat.measures.distortion import measure

trimesh = pytest.importorskip("trimesh")
meshio = pytest.importorskip("meshio")

ROUNDING, SINGLE = 1e-9, 1e-5
"""What double and single precision leave of a measure."""


class Polygons(NamedTuple):
    vertices: np.ndarray
    faces: list[list[int]]


# Shapes ---------------------------------------------------------------------------------------------------------------


def triangles():
    vertices, faces = sphere(1)
    return Polygons(vertices, faces.tolist())


def quads():
    vertices, faces = hill(6, 5)
    half = len(faces) // 2
    return Polygons(
        vertices, [[*a, c[2]] for a, c in zip(faces[:half].tolist(), faces[half:].tolist(), strict=True)]
    )


def ngons():
    """Hexagons and pentagons: the dual of a ball of triangles."""
    vertices, faces = sphere(1)
    middles = vertices[faces].mean(axis=1)
    around = []
    for v in range(len(vertices)):
        around_vertex = np.flatnonzero((faces == v).any(axis=1))
        x = np.cross(vertices[v], middles[around_vertex[0]])
        y = np.cross(vertices[v], x)
        angles = np.arctan2(middles[around_vertex] @ y, middles[around_vertex] @ x)
        around.append(around_vertex[np.argsort(angles)].tolist())
    return Polygons(middles, around)


def prism(outline):
    """An outline, drawn up: quads along the sides, and two lids that are one polygon each."""
    outline = np.asarray(outline, dtype=float)
    k = len(outline)
    vertices = np.concatenate([np.column_stack([outline, np.full(k, z)]) for z in (0.0, 0.8)])
    sides = [[i, (i + 1) % k, k + (i + 1) % k, k + i] for i in range(k)]
    return Polygons(vertices, [*sides, list(range(k))[::-1], list(range(k, 2 * k))])


def mixed():
    angle = 2 * np.pi * np.arange(9) / 9
    solid = prism(np.column_stack([np.cos(angle), np.sin(angle)]))
    # One lid of triangles, that meet in its middle.
    lid = solid.faces[-1]
    top = len(solid.vertices)
    vertices = np.concatenate([solid.vertices, [[0, 0, 1.1]]])
    return Polygons(
        vertices, solid.faces[:-1] + [[a, b, top] for a, b in zip(lid, lid[1:] + lid[:1], strict=True)]
    )


def concave():
    return prism([(0, 0), (2, 0), (2, 2), (1.1, 0.6), (0.9, 0.6), (0, 2)])


def twice(shape):
    """A shape and another component, smaller and aside."""
    second = shape.vertices * 0.7 + [4, 0.5, -0.25]
    count = len(shape.vertices)
    return Polygons(
        np.concatenate([shape.vertices, second]),
        shape.faces + [[v + count for v in face] for face in shape.faces],
    )


def doubled(shape):
    """A shape of which every corner has a vertex of its own."""
    corners = [v for face in shape.faces for v in face]
    starts = np.cumsum([0] + [len(face) for face in shape.faces])
    return Polygons(shape.vertices[corners], [list(range(a, b)) for a, b in pairwise(starts.tolist())])


def fans(faces):
    return np.array([[face[0], face[i], face[i + 1]] for face in faces for i in range(1, len(face) - 1)])


# Files in -------------------------------------------------------------------------------------------------------------


def obj_in(path, shape):
    lines = ["v {!r} {!r} {!r}".format(*map(float, p)) for p in shape.vertices]
    lines += ["f " + " ".join(str(v + 1) for v in face) for face in shape.faces]
    path.write_text("\n".join(lines) + "\n")


def grouped_obj_in(path, shape):
    lines = ["# a model", "mtllib some.mtl", "o model"]
    lines += ["v {!r} {!r} {!r}".format(*map(float, p)) for p in shape.vertices]
    lines += ["vt 0.5 0.5", "vn 0 0 1"]
    for i, face in enumerate(shape.faces):
        if i % 7 == 0:
            lines += [f"g group {i // 7}", f"usemtl paint{i // 7 % 2}", f"s {i // 7 % 3}"]
        # What is red has UVs and normals, the rest counts backwards.
        form = ("{0}/1/1 ", "{1} ")[i // 7 % 2]
        lines.append("f " + "".join(form.format(v + 1, v - len(shape.vertices)) for v in face))
    path.write_text("\n".join([*lines, "l 1 2", "# the end"]) + "\n")


def off_in(path, shape):
    lines = ["OFF", f"{len(shape.vertices)} {len(shape.faces)} 0"]
    lines += ["{!r} {!r} {!r}".format(*map(float, p)) for p in shape.vertices]
    lines += [f"{len(face)} " + " ".join(map(str, face)) for face in shape.faces]
    path.write_text("\n".join(lines) + "\n")


def ply_in(path, shape):
    head = ["ply", "format binary_big_endian 1.0", f"element vertex {len(shape.vertices)}"]
    head += [*(f"property double {c}" for c in "xyz"), f"element face {len(shape.faces)}"]
    head += ["property list uchar uint vertex_indices", "end_header"]
    body = shape.vertices.astype(">f8").tobytes()
    for face in shape.faces:
        body += struct.pack(f">B{len(face)}I", len(face), *face)
    path.write_bytes("\n".join(head).encode() + b"\n" + body)


def exported_in(path, shape):
    """Write triangles by trimesh."""
    mesh = trimesh.Trimesh(shape.vertices, fans(shape.faces), process=False)
    # It reads UVs only where there is a material.
    mesh.visual = trimesh.visual.TextureVisuals(shape.vertices[:, :2], trimesh.visual.material.PBRMaterial())
    mesh.export(path)


class Input(NamedTuple):
    ending: str
    write: object
    weld: bool | None = None
    only: tuple = ()


INPUTS = {
    "obj": Input(".obj", obj_in, None, (concave, mixed)),
    "obj grouped": Input(".obj", grouped_obj_in, None, (ngons,)),
    "obj grouped welded": Input(".obj", lambda path, shape: grouped_obj_in(path, doubled(shape)), True, (mixed,)),
    "off": Input(".off", off_in, None, (ngons,)),
    "off welded": Input(".off", lambda path, shape: off_in(path, doubled(shape)), True, (concave,)),
    "ply": Input(".ply", ply_in, None, (quads,)),
    "ply welded": Input(".ply", lambda path, shape: ply_in(path, doubled(shape)), True, (ngons,)),
    "stl": Input(".stl", exported_in, None, (triangles,)),
    "glb": Input(".glb", exported_in, None, (quads,)),
    "glb doubled": Input(".glb", lambda path, shape: exported_in(path, doubled(shape)), None, (mixed,)),
}  # fmt: skip
CASES = [
    pytest.param(name, shape, id=f"{name}-{shape.__name__}")
    for name, input_format in INPUTS.items()
    for shape in input_format.only
]


# Files out ------------------------------------------------------------------------------------------------------------


class Seen(NamedTuple):
    """What a reader finds in a file: positions, (m, 3) triangles, and (m, 3, 2) UVs at their corners."""

    points: np.ndarray
    faces: np.ndarray
    corner_uv: np.ndarray


def by_trimesh(path):
    scene = trimesh.load_scene(path, process=False)
    parts, count = [], 0
    for name in sorted(scene.graph.nodes_geometry):
        matrix, geometry = scene.graph[name]
        mesh = scene.geometry[geometry]
        points = np.asarray(mesh.vertices) @ matrix[:3, :3].T + matrix[:3, 3]
        parts.append((points, mesh.faces + count, np.asarray(mesh.visual.uv)[mesh.faces]))
        count += len(points)
    return Seen(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def by_meshio(path):
    mesh = meshio.read(path)
    uv = np.column_stack([mesh.point_data["s"], mesh.point_data["t"]])
    faces = mesh.cells_dict["triangle"]
    return Seen(mesh.points, faces, uv[faces])


def by_numpy(path):
    with np.load(path) as arrays:
        return Seen(arrays["vertices"], arrays["faces"], arrays["uv"][arrays["uv_faces"]])


def by_eye(path):
    """Return an OBJ file's polygons, and the UVs of their corners, by the letter."""
    lines = [line.split() for line in path.read_text().splitlines()]
    points = np.array([line[1:4] for line in lines if line[:1] == ["v"]], dtype=float)
    uv = np.array([line[1:3] for line in lines if line[:1] == ["vt"]], dtype=float)
    corners = [[word.split("/") for word in line[1:]] for line in lines if line[:1] == ["f"]]

    def index(word, count):
        assert 1 <= int(word) <= count or -count <= int(word) <= -1
        return int(word) - 1 if int(word) > 0 else int(word) + count

    faces = [[index(word[0], len(points)) for word in face] for face in corners]
    return points, faces, [[uv[index(word[1], len(uv))] for word in face] for face in corners]


def obj_by_eye(path):
    points, faces, uvs = by_eye(path)
    return Seen(
        points,
        fans(faces),
        np.array([[uv[0], uv[i], uv[i + 1]] for uv in uvs for i in range(1, len(uv) - 1)]),
    )


READERS = {
    ".obj": (by_trimesh, obj_by_eye),
    ".ply": (by_trimesh, by_meshio),
    ".glb": (by_trimesh,),
    ".npz": (by_numpy,),
}


def rings(points, faces, single=False):
    """Return faces as what they are in space, wherever they begin, in an order that tells them apart."""
    points = points.astype("f4").astype(float) if single else points
    turned = []
    for face in faces:
        ring = [tuple(row) for row in (points[face] + 0.0).tolist()]
        smallest = ring.index(min(ring))
        turned.append(tuple(ring[smallest:] + ring[:smallest]))
    return sorted(turned)


def measured(seen):
    """Return the measures of what was seen, vertices at one position being one."""
    points, number = np.unique(seen.points, axis=0, return_inverse=True)
    checked = check_mesh(points, number.reshape(-1)[seen.faces])
    assert len(checked.mesh.faces) == len(seen.faces)
    assert not checked.is_flipped.any()
    return measure(checked.mesh, seen.corner_uv)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "shape"), CASES)
def test_other_readers_find_the_mesh_and_its_measures(tmp_path, name, shape):
    mesh = twice(shape())
    ending, write, weld, _ = INPUTS[name]
    (tmp_path / "some.mtl").write_text("newmtl paint0\nnewmtl paint1\n")
    path = tmp_path / f"in{ending}"
    write(path, mesh)
    source = read_mesh(path, weld)
    assert len(source.vertices) == len(mesh.vertices)
    result = coneflat.flatten(source, charts="atlas")
    single = ending in (".stl", ".glb")
    in_space = rings(mesh.vertices, fans(mesh.faces) if single else mesh.faces, single)
    assert rings(source.vertices, np.split(source.corners, source.offsets[1:-1])) == in_space
    for out, readers in READERS.items():
        file = result.save(tmp_path / f"out{out}")
        if out == ".obj":
            points, faces, _ = by_eye(file)
            # Its own vertices stand in an OBJ, those that were merged, too.
            assert len(points) == (
                len(doubled(mesh).vertices) if name.startswith("obj") and weld else len(mesh.vertices)
            )
            assert sorted({v for face in faces for v in face}) == list(range(len(points)))
            if len(faces) == len(in_space):
                assert rings(points, faces) == in_space
            # Polygons may be written in pieces.
            assert len(fans(faces)) == len(result.faces)
        for read in readers:
            seen = read(file)
            assert len(seen.faces) == len(result.faces)
            if out != ".obj":
                single = out == ".glb"
                assert rings(seen.points, seen.faces) == rings(result.vertices, result.faces, single)
            expected = as_written(result, out).distortion
            distortion = measured(seen)
            for name in ("flipped", "degenerate", "overlapping_pairs", "charts", "mirrored_charts"):
                assert getattr(distortion, name) == getattr(expected, name), (
                    read.__name__,
                    out,
                    name,
                )
            for name in ("qc_mean", "qc_max", "area_std", "seam_length"):
                tolerance = SINGLE if out == ".glb" else ROUNDING
                close = pytest.approx(getattr(expected, name), rel=tolerance, abs=tolerance)
                assert getattr(distortion, name) == close, (read.__name__, out, name)


trimesh = pytest.importorskip("trimesh")


def test_the_parts_of_a_welded_vertex_that_is_split_again_have_one_number_in_an_obj(tmp_path):
    ball, second = sphere(1), sphere(1)
    top = ball[0][ball[0][:, 2].argmax()]
    shifted = (second[0] + top - second[0][second[0][:, 2].argmin()], second[1])
    vertices, faces = join(ball, shifted)
    trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "two.stl")
    result = coneflat.flatten(tmp_path / "two.stl", repair=True)
    assert result.distortion.charts == 2
    out = result.save(tmp_path / "two.obj")
    assert len(read_mesh(out).vertices) == len(vertices) - 1
    seen = trimesh.load(out, process=False, maintain_order=True)
    np.testing.assert_allclose(seen.vertices[seen.faces], vertices[faces], atol=1e-6)
