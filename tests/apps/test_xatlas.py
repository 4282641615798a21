"""The interface of xatlas: types, shapes, and UVs for every face."""

from __future__ import annotations

import subprocess
import sys
import tracemalloc

import numpy as np
import pytest
import shapes
from scipy.spatial import cKDTree

import coneflat.xatlas as ours
from coneflat import errors
from coneflat.apps.xatlas import arrays as xatlas_arrays
from coneflat.textures import soup

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
FACES = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
RANDOM = np.random.default_rng(0)


def areas(indices, uvs):
    corners = uvs[indices].astype(np.float64)
    first_side, second_side = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return (first_side[:, 0] * second_side[:, 1] - first_side[:, 1] * second_side[:, 0]) / 2


SOUPS = {
    "a square": (SQUARE, FACES),
    "a closed surface": shapes.sphere(2),
    "faces given twice": (SQUARE, np.concatenate([FACES, FACES])),
    "opposite orientations": (SQUARE, np.array([[0, 1, 2], [0, 3, 2]])),
    "four faces at an edge": (RANDOM.random((6, 3)), np.array([[0, 1, k] for k in (2, 3, 4, 5)])),
    "separate triangles": (RANDOM.random((60, 3)), np.arange(60).reshape(-1, 3)),
    "random triangles": (RANDOM.random((20, 3)), shapes.sphere(1)[1] % 20),
}


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("soup", SOUPS.values(), ids=SOUPS)
def test_every_face_has_uvs_in_its_own_orientation(soup):
    vertices, faces = soup
    mapping, indices, uvs = ours.parametrize(vertices, faces)
    assert (mapping.dtype, indices.dtype, uvs.dtype) == (np.uint32, np.uint32, np.float32)
    assert uvs.shape == (len(mapping), 2)
    np.testing.assert_array_equal(mapping[indices], faces)
    a, b, c = np.asarray(faces).T
    proper = (a != b) & (b != c) & (c != a)
    assert (areas(indices, uvs)[proper] > 0).all()
    assert 0 <= uvs.min() <= uvs.max() <= 1


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        (SQUARE, np.array([[0, 1, 2], [0, 2, 2], [1, 1, 1]])),
        (np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]), np.array([[0, 1, 2]])),
        (np.concatenate([SQUARE, [[np.nan] * 3]]), np.array([[0, 1, 2], [0, 2, 4]])),
        (SQUARE, np.empty((0, 3), np.uint32)),
        (np.empty((0, 3)), np.empty((0, 3), np.uint32)),
    ],
)
def test_faces_without_area_get_points(vertices, faces):
    mapping, indices, uvs = ours.parametrize(vertices, faces)
    np.testing.assert_array_equal(mapping[indices], faces)
    assert np.isfinite(uvs).all()
    assert (areas(indices, uvs) >= 0).all()


def test_an_atlas_of_several_meshes():
    atlas = ours.Atlas()
    ball = shapes.sphere(2)
    atlas.add_mesh(*ball)
    atlas.add_mesh(SQUARE, FACES, None, SQUARE[:, :2])
    options = ours.PackOptions()
    options.resolution, options.padding, options.create_image, options.bruteForce = 256, 4, True, True
    atlas.generate(ours.ChartOptions(max_cost=1.0), pack_options=options, verbose=False)
    assert (len(atlas), atlas.mesh_count, atlas.atlas_count) == (2, 2, 1)
    assert (atlas.width, atlas.height) == (256, 256)
    covered = sum(areas(*atlas[i][1:]).sum() for i in range(2))
    assert 0 < atlas.utilization == pytest.approx(covered, rel=1e-5)
    assert f"{atlas.utilization:.4f}" == f"{covered:.4f}"
    assert list(atlas.utilization) == [atlas.utilization] == [atlas.get_utilization(0)]
    np.testing.assert_array_equal(atlas.get_chart_image(0), atlas.chart_image)
    with pytest.raises(IndexError):
        atlas.get_utilization(1)
    colored = (atlas.chart_image > 0).any(axis=2).mean()
    assert colored == pytest.approx(atlas.utilization[0], abs=0.02)
    assert len(np.unique(atlas.chart_image.reshape(-1, 3), axis=0)) == atlas.chart_count + 1
    density = np.sqrt(areas(*atlas[1][1:]).sum()) * 256
    assert density == pytest.approx(atlas.texels_per_unit, rel=0.1)
    for index in (2, -1):
        with pytest.raises(IndexError, match="not from 0 to 1"):
            atlas[index]


@pytest.mark.parametrize("turned", [True, False], ids=["back", "again"])
@pytest.mark.parametrize("sheet", [shapes.hill(8, 7), shapes.sphere(2)], ids=["hill", "sphere"])
def test_a_doubled_surface_has_the_charts_of_two_sheets(sheet, turned, monkeypatch):
    # Whether a cut pays for packing may depend on rounding: the two sheets have equal areas.
    monkeypatch.setattr("coneflat.textures.further_cuts.cut_for_packing", lambda layouts, *_: layouts)
    vertices, faces = sheet
    second = faces[:, ::-1] if turned else faces
    separate, shared = np.concatenate([faces, len(vertices) + second]), np.concatenate([faces, second])
    counts = []
    for points, triangles in (
        (np.concatenate([vertices, vertices + np.array([8, 0, 0])]), separate),
        (np.concatenate([vertices, vertices]), separate),
        (vertices, shared),
    ):
        atlas = ours.Atlas()
        atlas.add_mesh(points, triangles)
        atlas.generate()
        counts.append(atlas.chart_count)
        assert (areas(*atlas[0][1:]) > 0).all()
    assert counts == [counts[0]] * 3


def fails(*arguments, **options):
    raise errors.ConvergenceError("no metric")


@pytest.mark.filterwarnings("ignore::coneflat.GuaranteeWarning")
@pytest.mark.parametrize("is_possible", [True, False], ids=["unwrapped", "by separate faces"])
@pytest.mark.parametrize(("density", "resolution"), [(0, 256), (5, 0), (20, 0), (100, 0), (400, 0)])
def test_the_padding_is_that_of_the_final_texture(monkeypatch, density, resolution, is_possible):
    if not is_possible:
        monkeypatch.setattr(soup, "unwrap", fails)
    count, steps = 20, np.linspace(0, 1, 21)[:, None]
    atlas = ours.Atlas()
    atlas.add_mesh(np.random.default_rng(0).normal(size=(3 * count, 3)), np.arange(3 * count).reshape(-1, 3))
    options = ours.PackOptions(padding=8, texels_per_unit=density, resolution=resolution)
    atlas.generate(pack_options=options)
    assert (len(atlas.notes) == 0) == is_possible
    _, indices, uvs = atlas[0]
    corners = uvs[indices].astype(float) * atlas.width
    rims = [
        np.concatenate([(1 - steps) * a + steps * b for a, b in zip(t, t[[1, 2, 0]], strict=True)])
        for t in corners
    ]
    gaps = [
        cKDTree(rim).query(np.concatenate([*rims[:i], *rims[i + 1 :]]))[0].min() for i, rim in enumerate(rims)
    ]
    assert min(gaps) >= 8 - 1e-3
    assert min(corners.min(), atlas.width - corners.max()) >= 8 - 1e-3
    assert atlas.texels_per_unit >= density


@pytest.mark.parametrize(
    "options",
    [
        {"padding": -3},
        {"padding": float("nan")},
        {"padding": "wide"},
        {"padding": 10**300},
        {"resolution": -3},
        {"resolution": 2.5},
        {"resolution": 10**300},
        {"texels_per_unit": -3},
        {"texels_per_unit": float("inf")},
        {"texels_per_unit": 10**300},
    ],
)
def test_invalid_options_are_named(options):
    atlas = ours.Atlas()
    atlas.add_mesh(SQUARE, FACES)
    with pytest.raises(errors.OptionError, match=next(iter(options))):
        atlas.generate(pack_options=ours.PackOptions(**options))


def test_the_search_may_have_a_time():
    atlas = ours.Atlas()
    atlas.add_mesh(*shapes.sphere(2))
    atlas.generate(ours.ChartOptions(search_time=0))
    assert any("more than the 0 s for the search" in note for note in atlas.notes)
    assert not (atlas.get_mesh(0)[2] < 0).any()
    with pytest.raises(errors.OptionError, match="search_time must be a number, 0 or more, got -1"):
        atlas.generate(ours.ChartOptions(search_time=-1))


def test_the_size_of_a_texture_without_faces_is_checked():
    atlas = ours.Atlas()
    with pytest.raises(errors.OptionError, match="resolution must be an integer from 1"):
        atlas.generate(pack_options=ours.PackOptions(resolution=-3))


def test_an_atlas_is_equal_to_itself_alone():
    first, second = ours.Atlas(), ours.Atlas()
    for atlas in (first, second):
        atlas.add_mesh(SQUARE, FACES)
    assert first == first
    assert first != second
    assert len({first, second, first}) == 2


def test_the_interface_is_imported_without_the_rest():
    script = "import sys, coneflat.xatlas; print([name for name in ('numpy', 'numba', 'scipy') if name in sys.modules])"
    assert subprocess.check_output([sys.executable, "-c", script], text=True).strip() == "[]"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((SQUARE, iter(FACES.tolist())), "indices must be an array of vertex indices"),
        ((iter(SQUARE.tolist()), FACES), "positions must be an array of numbers"),
        ((SQUARE, FACES + 0.5), "indices must hold integers"),
        ((SQUARE, np.where(FACES == 1, np.nan, FACES)), "indices must hold integers"),
        ((SQUARE, np.where(FACES == 1, np.inf, FACES)), "indices must hold integers"),
        ((SQUARE.astype(complex), FACES), "positions must be an array of numbers"),
        ((SQUARE, FACES, iter([1])), "normals must be an array of numbers"),
        ((SQUARE[:, :2], FACES), "positions must have the shape"),
        ((SQUARE, FACES.ravel()), "indices must have the shape"),
        ((SQUARE, FACES + 2), "indices must be from 0 to 3"),
        ((SQUARE, FACES, SQUARE[:, :2]), "normals must have the shape"),
        ((SQUARE, FACES, SQUARE[:3]), "normals must have the shape"),
        ((SQUARE, FACES, None, SQUARE[:3, :2]), "uvs must have the shape"),
    ],
)
def test_wrong_arrays_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        ours.parametrize(*arguments)


def test_an_image_that_was_not_requested():
    atlas = ours.Atlas()
    with pytest.raises(RuntimeError, match="create_image"):
        _ = atlas.chart_image


def test_the_image_without_faces_is_black():
    atlas = ours.Atlas()
    atlas.add_mesh(np.zeros((3, 3)), np.empty((0, 3), dtype=np.uint32))
    atlas.generate(pack_options=ours.PackOptions(create_image=True, resolution=64))
    assert atlas.chart_image.shape == (64, 64, 3)
    assert not atlas.chart_image.any()


def test_the_image_is_drawn_in_bands(monkeypatch):
    vertices, faces = shapes.sphere(2)
    texture = xatlas_arrays.unwrap_meshes(
        [xatlas_arrays.read_arrays(vertices, faces, None, None)], ours.PackOptions(resolution=2048)
    )
    tracemalloc.start()
    image = xatlas_arrays.draw_charts(texture)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert image.dtype == np.uint8
    # At once, depths and faces alone take 16 bytes for each texel.
    assert peak - image.nbytes < 12 * 2048**2
    monkeypatch.setattr(xatlas_arrays, "TEXELS_PER_BAND", 2048 * 2048)
    np.testing.assert_array_equal(xatlas_arrays.draw_charts(texture), image)


@pytest.mark.parametrize(
    ("arguments", "kind"),
    [
        ((SQUARE, FACES, SQUARE[:3, :2]), errors.ArrayShapeError),
        ((SQUARE, FACES, None, SQUARE[:, :2]), errors.ArrayShapeError),
        ((SQUARE,), errors.ArrayShapeError),
        ((SQUARE, FACES + 0.5), errors.ArrayShapeError),
        ((SQUARE, FACES + 2), errors.FaceIndexError),
        ((SQUARE * np.nan, FACES), errors.NonFiniteError),
    ],
)
def test_export_writes_nothing_of_wrong_arrays(tmp_path, arguments, kind):
    with pytest.raises(kind):
        ours.export(tmp_path / "wrong.obj", *arguments)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("path", ["missing/square.obj", "", "with\0zero.obj", None, 3])
def test_export_to_a_path_that_cannot_be_written(tmp_path, path):
    with pytest.raises(errors.MeshFileError, match="cannot be written|file name must be"):
        ours.export(str(tmp_path / path) if path else path, SQUARE, FACES) if path != 3 else ours.export(
            3, SQUARE, FACES
        )


def test_export_without_indices_or_with_normals_alone(tmp_path):
    ours.export(tmp_path / "a.obj", SQUARE[:3])
    assert (tmp_path / "a.obj").read_text().endswith("f 1 2 3\n")
    ours.export(tmp_path / "a.obj", SQUARE, FACES, None, SQUARE)
    assert "f 1//1 2//2 3//3\n" in (tmp_path / "a.obj").read_text()


def test_export(tmp_path):
    mapping, indices, uvs = ours.parametrize(SQUARE, FACES)
    ours.export(tmp_path / "square.obj", SQUARE[mapping], indices, uvs, SQUARE[mapping])
    text = (tmp_path / "square.obj").read_text()
    assert text.count("\nvt ") == 4
    assert "f 1/1/1 2/2/2" in text


def test_the_types_of_xatlas():
    theirs = pytest.importorskip("xatlas")
    vertices, faces = (np.asarray(array) for array in shapes.sphere(2))
    for expected, mapped in zip(
        theirs.parametrize(vertices, faces), ours.parametrize(vertices, faces), strict=True
    ):
        assert expected.dtype == mapped.dtype
        assert expected.ndim == mapped.ndim
    for name in ("ChartOptions", "PackOptions"):
        fields = {key for key in dir(getattr(theirs, name)()) if not key.startswith("_")}
        assert fields <= set(dir(getattr(ours, name)()))
    missing = {key for key in dir(theirs.Atlas) if not key.startswith("_")} - set(dir(ours.Atlas))
    assert missing <= {"add_uv_mesh"} | set(vars(ours.Atlas()))


def test_call_sites_work_with_another_import(monkeypatch):
    """Pipelines take UVs by `parametrize` and index the vertices by its mapping; trimesh imports xatlas itself."""
    trimesh = pytest.importorskip("trimesh")
    vertices, faces = shapes.sphere(2)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mapping, indices, uvs = ours.parametrize(mesh.vertices, mesh.faces)
    textured = trimesh.Trimesh(mesh.vertices[mapping], indices, process=False)
    textured.visual = trimesh.visual.TextureVisuals(uv=uvs)
    np.testing.assert_array_equal(textured.triangles, mesh.triangles)
    monkeypatch.setitem(sys.modules, "xatlas", ours)
    unwrapped = mesh.unwrap()
    np.testing.assert_allclose(unwrapped.triangles, mesh.triangles)
    np.testing.assert_array_equal(unwrapped.visual.uv, uvs.astype(np.float64))
