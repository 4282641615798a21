"""Shading that a file has is kept in what is written, whatever the formats."""

from __future__ import annotations

import numpy as np
import pytest

import coneflat
from coneflat.io import read_mesh

trimesh = pytest.importorskip("trimesh")

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
SIDES = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
OUTWARD = np.array([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]], dtype=float)


def cube_obj(path, normals=True, smoothing=None):
    lines = ["v {} {} {}".format(*p) for p in CORNERS]
    if normals:
        # Of any length, as programs write them.
        lines += ["vn {} {} {}".format(*(2.5 * n)) for n in OUTWARD]
    for i, side in enumerate(SIDES):
        if smoothing is not None:
            lines.append(f"s {smoothing[i]}")
        lines.append("f " + " ".join(f"{v + 1}//{i + 1}" if normals else f"{v + 1}" for v in side))
    path.write_text("\n".join(lines) + "\n")
    return path


def cube_ply(path):
    rows = [
        f"{' '.join(map(str, [*CORNERS[v], *n]))}"
        for side, n in zip(SIDES, OUTWARD, strict=True)
        for v in side
    ]
    names = [f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")]
    faces = [f"4 {4 * i} {4 * i + 1} {4 * i + 2} {4 * i + 3}" for i in range(6)]
    head = ["ply", "format ascii 1.0", "element vertex 24", *names, "element face 6"]
    path.write_text(
        "\n".join([*head, "property list uchar int vertex_indices", "end_header", *rows, *faces]) + "\n"
    )
    return path


def cube_off(path):
    rows = [
        " ".join(map(str, [*CORNERS[v], *n])) for side, n in zip(SIDES, OUTWARD, strict=True) for v in side
    ]
    faces = [f"4 {4 * i} {4 * i + 1} {4 * i + 2} {4 * i + 3}" for i in range(6)]
    path.write_text("\n".join(["NOFF", "24 6 0", *rows, *faces]) + "\n")
    return path


def cube_glb(path):
    mesh = trimesh.Trimesh(
        CORNERS[SIDES].reshape(-1, 3),
        np.arange(24).reshape(6, 4)[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3),
        process=False,
    )
    mesh.vertex_normals = np.repeat(OUTWARD, 4, axis=0)
    path.write_bytes(trimesh.Scene(mesh).export(file_type="glb", include_normals=True))
    return path


MAKERS = {".obj": cube_obj, ".ply": cube_ply, ".off": cube_off, ".glb": cube_glb}


def seen_normals(path):
    """Return the positions (m, 3, 3) and normals (m, 3, 3) at the corners of the triangles that trimesh sees."""
    (mesh,) = trimesh.load_scene(path, process=False).geometry.values()
    normals = mesh.vertex_normals / np.linalg.norm(mesh.vertex_normals, axis=1, keepdims=True)
    return mesh.vertices[mesh.faces], normals[mesh.faces]


@pytest.mark.parametrize("into", [".obj", ".ply", ".glb"])
@pytest.mark.parametrize("out_of", sorted(MAKERS))
def test_a_flat_shaded_cube_stays_flat_shaded(tmp_path, out_of, into):
    source = read_mesh(MAKERS[out_of](tmp_path / f"cube{out_of}"), weld=out_of != ".obj")
    assert len(source.vertices) == 8
    out = coneflat.flatten(source).save(tmp_path / f"flat{into}")
    places, normals = seen_normals(out)
    outward = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
    assert len(outward) == 12
    np.testing.assert_allclose(normals, np.repeat(outward[:, None], 3, axis=1), atol=1e-6)


@pytest.mark.parametrize("into", [".ply", ".glb"])
def test_smoothing_groups_shade_where_there_are_no_normals(tmp_path, into):
    # The first two sides have an edge-free pair of planes; the other four make one smooth band.
    path = cube_obj(tmp_path / "cube.obj", normals=False, smoothing=["off", "0", "7", "7", "7", "7"])
    places, normals = seen_normals(coneflat.flatten(path).save(tmp_path / f"flat{into}"))
    side = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
    flat = np.abs(side[:, 0]) > 0.5
    assert flat.sum() == 4
    np.testing.assert_allclose(normals[flat], np.repeat(side[flat][:, None], 3, axis=1), atol=1e-6)
    # Along the band the normals are across the edges, between those of the sides.
    np.testing.assert_allclose(normals[~flat][..., 0], 0, atol=1e-6)
    assert (np.einsum("mki,mi->mk", normals[~flat], side[~flat]) < 0.95).all()


def test_without_normals_or_groups_the_surface_is_smooth(tmp_path):
    path = cube_obj(tmp_path / "cube.obj", normals=False)
    places, normals = seen_normals(coneflat.flatten(path).save(tmp_path / "flat.glb"))
    side = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
    assert (np.einsum("mki,mi->mk", normals, side) < 0.9).all()


def test_unusable_normals_are_ignored(tmp_path):
    path = cube_obj(tmp_path / "cube.obj")
    text = path.read_text().replace("vn 2.5 0.0 0.0", "vn 0 0 0").replace("vn 0.0 2.5 0.0", "vn -1.#IND 0 0")
    path.write_text(text.replace("//6", "//99"))
    source = read_mesh(path)
    assert source.normals is None
    assert source.obj is not None
    path.write_text(text.replace("-1.#IND", "nan").replace("//6", "//99"))
    source = read_mesh(path)
    assert sorted(set(source.normal.tolist())) == [-1, 0, 2, 4]
    places, normals = seen_normals(coneflat.flatten(source).save(tmp_path / "flat.glb"))
    side = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
    has_normal = side.min(axis=1) < -0.5
    np.testing.assert_allclose(
        normals[has_normal], np.repeat(side[has_normal][:, None], 3, axis=1), atol=1e-6
    )
    assert np.isfinite(normals).all()
