"""Flat maps of the cortex: formats that nibabel reads, labels, and the field's measures."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import numpy as np
import pytest
from command import command
from shapes import grid, sphere

import coneflat
from coneflat.apps.brains import flatten_cortex, measure_flat, metric_distortion, read_flat
from coneflat.base.formats import FREESURFER
from coneflat.errors import MeshFileError, OptionError, UnknownFormatError
from coneflat.io import INPUT_FORMATS, read_label, read_vertex_values

nibabel = pytest.importorskip("nibabel")


def write_gifti(path, *arrays, labels=None):
    image = nibabel.GiftiImage()
    for values, intent in arrays:
        kind = "NIFTI_TYPE_INT32" if np.issubdtype(values.dtype, np.integer) else "NIFTI_TYPE_FLOAT32"
        values = values.astype(np.int32 if "INT" in kind else np.float32)
        image.add_gifti_data_array(
            nibabel.gifti.GiftiDataArray(values, intent=f"NIFTI_INTENT_{intent}", datatype=kind)
        )
    for key, name in (labels or {}).items():
        label = nibabel.gifti.GiftiLabel(key)
        label.label = name
        image.labeltable.labels.append(label)
    nibabel.save(image, path)
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a ball as a left hemisphere, and labels of a cap, its "medial wall", and of another."""
    brain = tmp_path_factory.mktemp("brain")
    vertices, faces = sphere(4)
    vertices = (60 * vertices).astype(np.float32)
    nibabel.freesurfer.write_geometry(brain / "lh.pial", vertices, faces)
    write_gifti(brain / "lh.pial.gii", (vertices, "POINTSET"), (faces, "TRIANGLE"))
    depth = vertices[:, 2].astype(np.float32)
    wall, patch = depth > 45, vertices[:, 0] > 40
    numbers = np.where(wall, 1, 2 * patch).astype(np.int32)
    nibabel.freesurfer.write_morph_data(brain / "lh.sulc", depth)
    nibabel.save(nibabel.freesurfer.MGHImage(depth[:, None, None], np.eye(4)), brain / "lh.depth.mgz")
    write_gifti(brain / "lh.sulc.gii", (depth, "SHAPE"))
    write_gifti(brain / "lh.parts.gii", (numbers, "LABEL"), labels={0: "rest", 1: "wall", 2: "patch"})
    table = np.array([[9, 9, 9, 0], [200, 0, 0, 0], [0, 200, 0, 0]])
    nibabel.freesurfer.write_annot(
        brain / "lh.aparc.annot", numbers, table, ["rest", "wall", "patch"], fill_ctab=True
    )
    rows = [f"{v} 0 0 0 0" for v in np.flatnonzero(wall)]
    (brain / "lh.wall.label").write_text("\n".join(["#!ascii label", str(len(rows)), *rows]) + "\n")
    rows = [f"{v} 0 0 0 0" for v in np.flatnonzero(vertices @ [0.6, 0.64, 0.48] < -45)]
    for name in ("lh.cap.label", "cap.label"):
        (brain / name).write_text("\n".join(["#!ascii label", str(len(rows)), *rows]) + "\n")
    return brain


@pytest.fixture(scope="module")
def flat(folder):
    return flatten_cortex(folder / "lh.pial", remove=[f"{folder}/lh.wall.label"])


def test_surfaces_are_read_as_nibabel_reads_them(folder):
    vertices, faces = nibabel.freesurfer.read_geometry(folder / "lh.pial")
    for name in ("lh.pial", "lh.pial.gii"):
        mesh = coneflat.read_mesh(folder / name)
        assert np.array_equal(mesh.vertices, vertices)
        assert np.array_equal(mesh.triangles, faces)


@pytest.mark.parametrize(
    "head", ["made by hand\n", "\n", "made\n\n", "made\n\n\n \t\r\n", "made\na comment\n"]
)
def test_headers_are_read_as_freesurfer_and_nibabel_read_them(folder, tmp_path, head):
    """FreeSurfer skips a line and all white space after it; nibabel skips two lines."""
    vertices, faces = nibabel.freesurfer.read_geometry(folder / "lh.pial")
    counts = np.array([len(vertices), len(faces)])
    content = b"".join([counts.astype(">i4").tobytes(), vertices.astype(">f4"), faces.astype(">i4")])
    (tmp_path / "lh.pial").write_bytes(b"\xff\xff\xfe" + head.encode() + content)
    mesh = coneflat.read_mesh(tmp_path / "lh.pial")
    assert np.array_equal(mesh.vertices, vertices)
    assert np.array_equal(mesh.triangles, faces)
    if head.count("\n") == 2:
        assert np.array_equal(nibabel.freesurfer.read_geometry(tmp_path / "lh.pial")[1], faces)
    for short in (content[:6], content[:-4]):
        (tmp_path / "lh.pial").write_bytes(b"\xff\xff\xfe" + head.encode() + short)
        with pytest.raises(MeshFileError, match=r"is truncated at [\d,]+ bytes"):
            coneflat.read_mesh(tmp_path / "lh.pial")


@pytest.mark.parametrize("name", ["lh.fiducial", "lh.graymid", "lh.pial.T1", "rh.sphere.reg", "surface"])
def test_surfaces_are_recognized_by_content(folder, tmp_path, name):
    (tmp_path / name).write_bytes((folder / "lh.pial").read_bytes())
    assert np.array_equal(
        coneflat.read_mesh(tmp_path / name).triangles, coneflat.read_mesh(folder / "lh.pial").triangles
    )
    (tmp_path / name).write_bytes(b"something else")
    with pytest.raises(UnknownFormatError):
        coneflat.read_mesh(tmp_path / name)


@pytest.mark.parametrize(
    ("magic", "kind", "factor"), [(b"\xff\xff\xff", ">i2", 100), (b"\xff\xff\xfd", ">f4", 1)]
)
def test_old_surfaces_of_quads_are_read_as_nibabel_reads_them(tmp_path, magic, kind, factor):
    """Which diagonal splits a quad depends on its first vertex; the older form rounds positions to a hundredth."""
    columns, rows = 5, 4
    x, y = np.meshgrid(np.arange(columns), np.arange(rows))
    vertices = np.stack([x, y, 0.25 * x * y], axis=-1).reshape(-1, 3)
    at = np.arange(columns * rows).reshape(rows, columns)
    quads = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], axis=-1).reshape(-1, 4)

    def three_bytes(values):
        return np.asarray(values, ">u4").reshape(-1, 1).view(np.uint8)[:, 1:].tobytes()

    head = magic + three_bytes([len(vertices), len(quads)])
    content = head + (factor * vertices).astype(kind).tobytes() + three_bytes(quads)
    (tmp_path / "lh.orig").write_bytes(content)
    points, faces = nibabel.freesurfer.read_geometry(tmp_path / "lh.orig")
    mesh = coneflat.read_mesh(tmp_path / "lh.orig")
    assert np.allclose(mesh.vertices, points)

    def rotated(triangles):
        return {tuple(np.roll(face, -int(np.argmin(face))).tolist()) for face in triangles}

    assert rotated(mesh.triangles) == rotated(faces)
    for count in (5, len(content) - 1):
        (tmp_path / "lh.orig").write_bytes(content[:count])
        with pytest.raises(MeshFileError, match="is truncated at"):
            coneflat.read_mesh(tmp_path / "lh.orig")


@pytest.mark.parametrize("up", [None, (0, 1, 0), (1, 0, 0.5)])
def test_a_direction_of_the_surface_points_up_in_the_map(folder, flat, up):
    """Superior by default; by a fit of the map, without weights, it points up to some degrees."""
    flat_map = (
        flat if up is None else flatten_cortex(folder / "lh.pial", remove=[f"{folder}/lh.cap.label"], up=up)
    )
    laid_out = np.unique(flat_map.faces)
    placed, points = flat_map.surface.vertices[laid_out], flat_map.points[laid_out]
    affine = np.linalg.lstsq(placed - placed.mean(axis=0), points - points.mean(axis=0), rcond=None)[0]
    x, y = np.array((0, 0, 1) if up is None else up) @ affine
    assert abs(np.degrees(np.arctan2(x, y))) < 10


def test_the_anatomical_structure_is_kept(folder, tmp_path):
    """That of a GIFTI surface, whatever its name; else that of the name."""
    vertices, faces = nibabel.freesurfer.read_geometry(folder / "lh.pial")
    for name, meta, expected in (
        ("surface.gii", "CortexRight", "CortexRight"),
        ("lh.pial.gii", "CortexRight", "CortexRight"),
        ("rh.pial.gii", "", "CortexRight"),
        ("surface.gii", "Cerebellum", "Cerebellum"),
        ("surface.gii", "", None),
    ):
        write_gifti(tmp_path / name, (vertices, "POINTSET"), (faces, "TRIANGLE"))
        image = nibabel.load(tmp_path / name)
        if meta:
            image.darrays[0].meta["AnatomicalStructurePrimary"] = meta
        nibabel.save(image, tmp_path / name)
        flat = flatten_cortex(tmp_path / name, remove=[f"{folder}/cap.label"], stretch=0, distortion=9.0)
        written = nibabel.load(flat.save(tmp_path / "flat.gii")).darrays[0].meta
        assert written.get("AnatomicalStructurePrimary") == expected, (name, meta)
    image = nibabel.load(folder / "lh.parts.gii")
    image.meta["AnatomicalStructurePrimary"] = "CortexLeft"
    nibabel.save(image, tmp_path / "parts.gii")
    with pytest.raises(OptionError, match="must be of the right hemisphere, like .*, got the left one"):
        flatten_cortex(tmp_path / "rh.pial.gii", remove=[f"{tmp_path}/parts.gii:wall"])


def test_labels_of_another_surface_are_refused(folder, tmp_path):
    """A file with a value for each vertex has as many as the surface, and a list has its vertices."""
    numbers = np.ones(700, dtype=np.int32)
    numbers[:300] = 0
    table = np.array([[9, 9, 9, 0], [200, 0, 0, 0]])
    nibabel.freesurfer.write_annot(tmp_path / "short.annot", numbers, table, ["wall", "rest"], fill_ctab=True)
    nibabel.freesurfer.write_morph_data(tmp_path / "short.curv", numbers.astype(np.float32))
    write_gifti(tmp_path / "short.gii", (numbers, "LABEL"), labels={0: "wall", 1: "rest"})
    for label in ("short.annot:wall", "short.curv", "short.gii:wall", "short.gii"):
        with pytest.raises(OptionError, match=r"which has 2,562 vertices, got a file of 700 vertices"):
            flatten_cortex(folder / "lh.pial", remove=[f"{tmp_path}/{label}"])
    (tmp_path / "cut.label").write_text("#!ascii label\n3\n1 0 0 0 0\n2 0 0 0 0\n")
    with pytest.raises(MeshFileError, match="must have 3 vertices, as it says, got 2"):
        flatten_cortex(folder / "lh.pial", remove=[f"{tmp_path}/cut.label"])


def test_warnings_of_nibabel_are_lines_of_the_log(folder, tmp_path, monkeypatch, caplog, recwarn):
    package = nibabel.freesurfer
    annotation = package.read_annot

    def read_annot(path):
        warnings.warn("something\nodd", stacklevel=2)
        return annotation(path)

    monkeypatch.setattr(package, "read_annot", read_annot)
    read_label(f"{folder}/lh.aparc.annot:wall")
    assert [record.getMessage() for record in caplog.records] == [f"{folder}/lh.aparc.annot: something odd"]
    assert len(recwarn) == 0


def test_values_and_labels_are_read_in_all_formats(folder):
    depth = nibabel.freesurfer.read_morph_data(folder / "lh.sulc")
    for name in ("lh.sulc", "lh.sulc.gii", "lh.depth.mgz"):
        assert np.array_equal(read_vertex_values(folder / name), depth)
    for name in ("lh.wall.label", "lh.aparc.annot:wall", "lh.parts.gii:wall"):
        assert np.array_equal(read_label(f"{folder}/{name}"), np.flatnonzero(depth > 45)), name
    parts = nibabel.load(folder / "lh.parts.gii").agg_data()
    assert np.array_equal(read_label(f"{folder}/lh.parts.gii"), np.flatnonzero(parts))


def test_a_gifti_map_is_read_by_other_libraries(folder, flat, tmp_path):
    path = flat.save(tmp_path / "lh.flat.gii")
    image = nibabel.load(path)
    points, faces = image.agg_data("pointset"), image.agg_data("triangle")
    assert np.array_equal(points[:, :2], flat.points.astype(np.float32))
    assert np.array_equal(faces, flat.faces)
    assert (len(points), np.abs(points[:, 2]).max()) == (len(flat.surface.vertices), 0)
    assert image.darrays[0].meta["AnatomicalStructurePrimary"] == "CortexLeft"


def test_a_patch_has_the_layout_of_freesurfer(flat, tmp_path):
    """Two big-endian numbers, then a number and a point for each vertex; pycortex reads it by this record."""
    path = flat.save(tmp_path / "lh.flat.patch.3d")
    content = path.read_bytes()
    rows = np.frombuffer(content[8:], [("vert", ">i4"), ("x", ">f4"), ("y", ">f4"), ("z", ">f4")])
    assert np.frombuffer(content[:8], ">i4").tolist() == [-1, len(rows)]
    inner, border = rows[rows["vert"] > 0]["vert"] - 1, -rows[rows["vert"] < 0]["vert"] - 1
    vertices = np.concatenate([inner, border])
    assert len(np.unique(vertices)) == len(vertices)
    points = np.stack([rows["x"], rows["y"]], axis=1)
    assert np.array_equal(points, flat.points[np.abs(rows["vert"]) - 1].astype(np.float32))
    # The surface's triangles with all vertices in the patch are those of the map, and the border is theirs.
    faces = flat.surface.triangles
    faces = faces[np.isin(faces, vertices).all(axis=1)]
    assert {tuple(face) for face in faces.tolist()} == {
        tuple(face) for face in flat.uv_mesh(path).faces.tolist()
    }
    mesh = coneflat.check_mesh(flat.surface.vertices, faces).mesh
    assert set(border.tolist()) == set(np.unique(faces)[mesh.is_boundary_vertex].tolist())


@pytest.mark.parametrize("ending", [".gii", ".3d"])
def test_maps_that_are_read_back_have_equal_measures(folder, flat, tmp_path, ending):
    path = flat.save(tmp_path / f"lh.flat{ending}")
    written, read_back = measure_flat(flat.uv_mesh(path)), measure_flat(read_flat(path, folder / "lh.pial"))
    assert written.report() | {"input": ""} == read_back.report() | {"input": ""}
    assert (written.inverted, written.uv.distortion.overlap) == (0, 0)


def test_no_cut_crosses_a_label_that_is_kept(folder):
    flat = flatten_cortex(
        folder / "lh.pial",
        remove=[f"{folder}/lh.wall.label"],
        keep=[f"{folder}/lh.aparc.annot:patch"],
        distortion=0.05,
    )
    patch = read_label(f"{folder}/lh.aparc.annot:patch")
    is_uncut = np.zeros(len(flat.surface.vertices), dtype=bool)
    is_uncut[patch] = True
    origin = flat.result.vertex_origin
    assert len(flat.result.seams) > 0
    assert not is_uncut[origin[flat.result.seams]].all(axis=1).any()
    # Cones may be on the border of the label, where seams end.
    faces = flat.surface.triangles
    border = np.unique(faces[~is_uncut[faces].all(axis=1)])
    assert not is_uncut[np.setdiff1d(origin[flat.result.cones], border)].any()


def test_separate_pieces_are_left_out(folder, tmp_path):
    island = read_label(f"{folder}/lh.wall.label")[40:60]
    faces = coneflat.read_mesh(folder / "lh.pial").triangles
    wall = np.setdiff1d(read_label(f"{folder}/lh.wall.label"), faces[np.isin(faces, island).any(axis=1)])
    values = np.zeros(faces.max() + 1, np.float32)
    values[wall] = 1
    nibabel.freesurfer.write_morph_data(tmp_path / "lh.curv", values)
    flat = flatten_cortex(folder / "lh.pial", remove=[f"{tmp_path}/lh.curv"])
    assert flat.result.distortion.charts == 1


def test_metric_distortion_of_a_flat_sheet_is_small_and_has_no_scale():
    vertices, faces = grid(20, 20)
    flat = vertices[:, :2]
    exact = metric_distortion(vertices, faces, flat)
    assert 0 <= exact < 3  # paths along edges and diagonals are slightly too long
    assert metric_distortion(vertices, faces, 5 * flat) == pytest.approx(exact)
    assert metric_distortion(vertices, faces, flat * [2, 0.5]) > 30


def test_metric_distortion_by_hand():
    """Two triangles of a square: four sides, and two diagonals, one of which is unfolded."""
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    assert metric_distortion(square, faces, square[:, :2]) == pytest.approx(0, abs=1e-12)
    bent = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0.5, 0.5, np.sqrt(0.5)]])
    assert metric_distortion(bent, faces, square[:, :2]) == pytest.approx(0, abs=1e-12)
    wide = square[:, :2] * [2, 0.5]
    sides, diagonals = 2 * 1.0 + 2 * 0.5, 2 * (np.hypot(2, 0.5) - np.sqrt(2))
    assert metric_distortion(square, faces, wide) == pytest.approx(
        100 * (sides + diagonals) / (4 + 2 * np.sqrt(2))
    )


def test_bad_input_is_named(folder, flat, tmp_path):
    wall = f"{folder}/lh.wall.label"
    with pytest.raises(OptionError, match=r"must have the label 'wal', got patch, rest, wall"):
        flatten_cortex(folder / "lh.pial", remove=[f"{folder}/lh.aparc.annot:wal"])
    with pytest.raises(MeshFileError, match="no such file"):
        flatten_cortex(folder / "lh.pial", remove=["lh.none.label"])
    (tmp_path / "rh.wall.label").write_text(Path(wall).read_text())
    with pytest.raises(OptionError, match="must be of the left hemisphere, like .*, got the right one"):
        flatten_cortex(folder / "lh.pial", remove=[f"{tmp_path}/rh.wall.label"])
    (tmp_path / "lh.far.label").write_text("#!ascii label\n1\n99999 0 0 0 0\n")
    with pytest.raises(OptionError, match=r"which has 2,562 vertices, got vertex 99999"):
        flatten_cortex(folder / "lh.pial", remove=[f"{tmp_path}/lh.far.label"])
    with pytest.raises(OptionError, match="must leave triangles"):
        flatten_cortex(folder / "lh.pial", remove=[wall, f"{folder}/lh.sulc"])
    with pytest.raises(UnknownFormatError):
        flat.save(tmp_path / "flat.obj")
    with pytest.raises(MeshFileError, match="got a GIFTI file without positions"):
        coneflat.read_mesh(folder / "lh.sulc.gii")
    (tmp_path / "lh.pial").write_bytes((folder / "lh.pial").read_bytes()[:-5])
    with pytest.raises(MeshFileError, match="or is truncated at"):
        coneflat.read_mesh(tmp_path / "lh.pial")
    (tmp_path / "lh.bad.3d").write_bytes(b"12345678")
    with pytest.raises(MeshFileError, match="must be a FreeSurfer patch"):
        read_flat(tmp_path / "lh.bad.3d", folder / "lh.pial")


@pytest.mark.parametrize("name", ["flatten", "unwrap", "quads", "view"])
def test_help_names_all_formats_that_are_read(name):
    text = command(name, "--help").stdout
    assert {ending for ending in INPUT_FORMATS if ending not in text} <= set(FREESURFER) - {".pial"}
    if name == "view":
        assert "lh.sulc" in text


@pytest.mark.slow
def test_the_commands_write_measure_and_draw(folder, tmp_path):
    done = command(
        "brain", folder / "lh.pial", "--remove-label", folder / "lh.wall.label", "-o", "lh.flat.gii", "-o", "lh.npz",
        "--report", "r.json", cwd=tmp_path,
    )  # fmt: skip
    assert (done.returncode, "metric distortion" in done.stdout) == (0, True), done.stderr
    assert json.loads((tmp_path / "r.json").read_text())["inverted"] == 0
    done = command(
        "measure",
        "lh.flat.gii",
        "--surface",
        folder / "lh.pial",
        "--require",
        "inverted=0,metric_distortion<20",
        cwd=tmp_path,
    )
    assert (done.returncode, "areal distortion" in done.stdout) == (0, True), done.stderr
    done = command("measure", "lh.flat.gii", "--surface", folder / "lh.pial", "--weld", cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n"), "--weld" in done.stderr) == (2, 1, True)
    pytest.importorskip("matplotlib")
    done = command(
        "figure", "lh.npz", "--color", folder / "lh.sulc", "-o", "a.png", "--dpi", 50, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    done = command("brain", folder / "lh.pial", "--remove-label", "lh.none.label", cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
