"""Measures of UVs that files have, whatever wrote them."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
import reference_measures
import shapes
from click.testing import CliRunner
from gltf_scenes import SceneMaker

import coneflat
from coneflat import MeshFile, errors, measure_uv
from coneflat.apps.cli.main import cli
from coneflat.apps.uv_measures import MEASURED
from coneflat.mesh.polygons import fan_corners

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
UNIT = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"


def written(folder, text, name="a.obj"):
    path = folder / name
    path.write_text(text)
    return path


def agree(path):
    """Compare the report with measures by their definitions, and return it."""
    ours, theirs = measure_uv(path).report(), reference_measures.measures(*reference_measures.read_obj(path))
    for name, value in theirs.items():
        # Overlap by definition counts pixels.
        tolerance = {"abs": 0.01} if name == "overlap" else {"rel": 1e-9, "abs": 1e-12}
        assert ours[name] == pytest.approx(value, **tolerance), name
    return ours


class TestAgainstDefinitions:
    @pytest.mark.slow
    def test_uvs_of_artists(self, shared):
        report = agree(shared("spot.obj"))
        assert report["charts"] > 10
        assert report["flipped"] > 0
        assert report["overlapping_pairs"] > 0

    def test_files_that_flatten_writes(self, tmp_path):
        result = coneflat.flatten(*shapes.genus(2), charts="atlas")
        report = agree(result.save(tmp_path / "out.obj"))
        for measure in ("qc_mean", "area_std", "flipped", "seam_length", "overlapping_pairs"):
            assert report[measure] == pytest.approx(getattr(result.distortion, measure), rel=1e-9)

    def test_polygons_as_fans(self, tmp_path):
        """A quad and a pentagon that are not convex in the plane: one half of each fan is flipped."""
        text = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv 4 0 0\nv 5 1 0\nv 4 2 0\n"
        text += "vt 0 0\nvt .5 0\nvt .1 .1\nvt 0 .5\nvt 1 0\nvt .6 .1\nvt 1 .5\nvt .5 .5\n"
        text += "f 1/1 2/2 3/3 4/4\nf 2/2 5/5 6/6 7/7 3/8\n"
        report = agree(written(tmp_path, text))
        assert (report["polygons"], report["triangles"]) == (2, 5)
        turned = "f 2/2 3/3 4/4 1/1\n"
        turned_report = agree(written(tmp_path, text.replace("f 1/1 2/2 3/3 4/4\n", turned)))
        assert report["flipped"] != turned_report["flipped"]


class TestKnownAnswers:
    def test_the_identity(self, tmp_path):
        report = measure_uv(written(tmp_path, SQUARE + UNIT + "f 1/1 2/2 3/3 4/4\n")).report()
        exact = {
            "qc_mean": 1, "qc_max": 1, "area_std": 0, "flipped": 0, "degenerate": 0, "charts": 1, "seam_length": 0,
            "overlap": 0, "packing_efficiency": 1, "box_efficiency": 1, "outside": 0, "tiles": 1,
            "density_spread": 1, "triangles": 2, "polygons": 1, "vertices": 4,
        }  # fmt: skip
        assert {name: report[name] for name in exact} == pytest.approx(exact)

    def test_two_halves_on_top_of_each_other(self, tmp_path):
        text = SQUARE + "vt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\nf 3/1 4/2 1/3\n"
        report = measure_uv(written(tmp_path, text)).report()
        assert (report["overlap"], report["overlapping_pairs"], report["charts"]) == (1, 1, 2)
        assert report["packing_efficiency"] == pytest.approx(0.5)
        assert report["seam_length"] == pytest.approx(math.sqrt(2))

    def test_borders_that_coincide_are_seams(self, tmp_path):
        """As of PLY and glTF, which have one UV for each vertex; what is left open has no seam there."""
        text = SQUARE + "v 0 0 0\nv 1 1 0\n" + UNIT + "vt 0.1 0\nvt 1 0.9\nf 1/1 2/2 3/3\nf 6/6 4/4 5/5\n"
        path = written(tmp_path, text)
        joined, apart = measure_uv(path).report(), measure_uv(path, weld=False).report()
        assert joined["seam_length"] == pytest.approx(math.sqrt(2))
        assert apart["seam_length"] == 0
        assert "Closed 1 edge" in joined["notes"][0]

    def test_outside_and_tiles(self, tmp_path):
        for shift, outside, tiles in ((0, 0, 1), (0.25, 1, 1), (1, 1, 2)):
            text = SQUARE + UNIT + f"vt {shift} 0\nvt {1 + shift} 1\nvt {shift} 1\n"
            report = measure_uv(written(tmp_path, text + "f 1/1 2/2 3/3\nf 1/5 3/6 4/7\n")).report()
            assert (report["outside"], report["tiles"]) == (outside, tiles)

    def test_corners_without_uvs_are_counted_and_left_out(self, tmp_path):
        text = SQUARE + UNIT + "vt nan 0\n"
        report = measure_uv(written(tmp_path, text + "f 1/1 2/2 3/3\nf 1/1 3/3 4\n")).report()
        assert (report["corners_without_uv"], report["triangles_without_uv"], report["triangles"]) == (
            1,
            1,
            2,
        )
        assert (report["qc_max"], report["charts"]) == (pytest.approx(1), 1)
        assert "1 corner with no UV: 1 triangle left out" in report["notes"][0]
        report = measure_uv(written(tmp_path, text + "f 1/1 2/2 3/3\nf 1/1 3/3 4/5\n")).report()
        assert (report["corners_not_finite"], report["triangles_without_uv"]) == (1, 1)
        assert "not finite" in report["notes"][0]
        report = measure_uv(written(tmp_path, text + "f 1/1 2/2 3/3\nf 1/1 2/2 3\nf 1/1 3/3 4/5\n")).report()
        assert report["notes"][0] == (
            "1 corner with no UV and 1 corner with a UV that is not finite: 2 triangles left out of the measures."
        )

    @pytest.mark.parametrize("turns", [1, 2])
    def test_winding_around_a_point_is_an_angle_error(self, turns):
        """A fan of twelve that goes around once, or twice."""
        rim = 2 * np.pi * np.arange(12) / 12
        vertices = np.r_[[[0, 0, 1]], np.stack([np.cos(rim), np.sin(rim), 0 * rim], 1)]
        faces = np.array([[0, 1 + k, 1 + (k + 1) % 12] for k in range(12)])
        uv = np.r_[[[0, 0]], np.stack([np.cos(turns * rim), np.sin(turns * rim)], 1)]
        report = measure_uv(vertices, faces, uv[faces]).report()
        assert report["angle_sum_error"] == pytest.approx(2 * np.pi * (turns - 1), abs=1e-12)
        assert report["flipped"] == 0
        assert (report["overlapping_pairs"] > 0) == (turns == 2)

    @pytest.mark.parametrize("scale", [1e-150, 1e150])
    def test_sizes_do_not_matter(self, scale):
        vertices, faces = shapes.hill(6, 5)
        uv = vertices[:, :2][faces]
        report = measure_uv(vertices, faces, uv).report()
        for points, places in ((vertices * scale, uv), (vertices, uv * scale)):
            scaled_report = measure_uv(points, faces, places).report()
            for name in ("qc_mean", "area_std", "flipped", "degenerate", "charts", "box_efficiency"):
                assert scaled_report[name] == pytest.approx(report[name], rel=1e-9), name

    def test_fans(self):
        assert fan_corners(np.array([0, 3, 7, 12])).tolist() == [
            [0, 1, 2], [3, 4, 5], [3, 5, 6], [7, 8, 9], [7, 9, 10], [7, 10, 11]
        ]  # fmt: skip


#: Two squares side by side, each with the whole unit square as its UVs.
PAIR = SQUARE + "v 2 0 0\nv 2 1 0\n" + UNIT
LEFT, RIGHT = "f 1/1 2/2 3/3 4/4\n", "f 2/1 5/2 6/3 3/4\n"


def pair_of_materials(folder, library):
    """Write two squares of two materials, and their library if there is one."""
    if library is not None:
        written(folder, library, "a.mtl")
    return written(folder, f"mtllib a.mtl\n{PAIR}usemtl one\n{LEFT}usemtl the other\n{RIGHT}")


def pair_of_primitives(folder, images, materials=(0, 1)):
    """Write two squares as primitives of materials with the textures 0 and 1, which have some images."""
    make = SceneMaker()
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    uv, indices = make.accessor(corners[:, :2].copy()), make.accessor([0, 1, 2, 0, 2, 3], 5125)
    primitives = [
        {
            "attributes": {"POSITION": make.accessor(corners + np.array([place, 0, 0])), "TEXCOORD_0": uv},
            "indices": indices,
            "material": material,
        }
        for place, material in enumerate(materials)
    ]
    view = make.view(b"no image is read")
    make.tree |= {
        "images": [{"bufferView": view, "mimeType": "image/png"}] * 2,
        "textures": [{"source": image} for image in images],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": i}}} for i in (0, 1)]
        + [{}, {}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "meshes": [{"primitives": primitives}],
    }
    path = folder / "a.glb"
    path.write_bytes(make.glb())
    return path


PLY = """ply
format ascii 1.0
comment TextureFile a.png
comment TextureFile b.png
element vertex 6
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
property list uchar float texcoord
property int texnumber
end_header
0 0 0
1 0 0
1 1 0
0 1 0
2 0 0
2 1 0
4 0 1 2 3 8 0 0 1 0 1 1 0 1 {}
4 1 4 5 2 8 0 0 1 0 1 1 0 1 {}
"""


class TestTextures:
    """Charts in different textures do not overlap; each texture has its own unit square."""

    def apart(self, path):
        report = measure_uv(path).report()
        assert (report["overlap"], report["overlapping_pairs"], report["outside"]) == (0, 0, 0)
        assert (report["textures"], report["tiles"], report["packing_efficiency"]) == (2, 2, 1)
        assert report["box_efficiency"] == pytest.approx(1)
        assert "Charts of 2 textures: overlaps and packing are those within each texture." in report["notes"]

    def together(self, path):
        report = measure_uv(path).report()
        assert (report["overlap"], report["textures"], report["tiles"]) == (1, 1, 1)
        return report["notes"]

    def test_images_of_obj_materials(self, tmp_path):
        self.apart(pair_of_materials(tmp_path, "newmtl one\nmap_Kd a.png\nnewmtl the other\nmap_Kd b.png\n"))
        self.together(
            pair_of_materials(tmp_path, "newmtl one\nmap_Kd a.png\nnewmtl the other\nmap_Kd a.png\n")
        )
        self.together(pair_of_materials(tmp_path, "newmtl one\nKd 1 0 0\nnewmtl the other\nKd 0 1 0\n"))
        # A material without an image is not in the texture of another one.
        self.apart(pair_of_materials(tmp_path, "newmtl one\nKd 1 0 0\nnewmtl the other\nmap_Kd b.png\n"))

    def test_libraries_that_cannot_be_read_are_named(self, tmp_path):
        (note,) = self.together(pair_of_materials(tmp_path, None))
        assert note == (
            "Materials that are in no library that can be read count as one texture: one, the other."
        )

    def test_images_of_primitives(self, tmp_path):
        self.apart(pair_of_primitives(tmp_path, (0, 1)))
        self.apart(pair_of_primitives(tmp_path, (0, 1), (0, 2)))
        self.together(pair_of_primitives(tmp_path, (1, 1)))
        self.together(pair_of_primitives(tmp_path, (0, 1), (0, 0)))
        self.together(pair_of_primitives(tmp_path, (0, 1), (2, 3)))

    def test_numbers_of_ply_faces(self, tmp_path):
        self.apart(written(tmp_path, PLY.format(0, 1), "a.ply"))
        self.together(written(tmp_path, PLY.format(1, 1), "a.ply"))

    def test_overlaps_within_textures_are_counted(self, tmp_path):
        """Of three squares in one texture, two overlap; another texture is half full."""
        text = PAIR + "v 3 0 0\nv 3 1 0\nvt 0.5 0\nvt 0.5 1\n"
        text += f"usemtl one\n{LEFT}{RIGHT}usemtl the other\nf 5/1 7/5 8/6 6/4\n"
        written(tmp_path, "newmtl one\nmap_Kd a.png\nnewmtl the other\nmap_Kd b.png\n", "a.mtl")
        report = measure_uv(written(tmp_path, "mtllib a.mtl\n" + text)).report()
        assert report["overlap"] == pytest.approx(1 / 1.5)
        assert report["packing_efficiency"] == pytest.approx(0.75)
        assert report["box_efficiency"] == pytest.approx(2.5 / 2)

    def test_charts_end_where_the_texture_changes(self, tmp_path):
        """Also where the UVs continue: the second square is in the next tile, as of a repeated image."""
        text = f"mtllib a.mtl\n{PAIR}vt 2 0\nvt 2 1\nusemtl one\n{LEFT}usemtl the other\nf 2/2 5/5 6/6 3/3\n"
        for image, charts, length in (("a.png", 1, 0), ("b.png", 2, 1 / math.sqrt(2))):
            written(tmp_path, f"newmtl one\nmap_Kd a.png\nnewmtl the other\nmap_Kd {image}\n", "a.mtl")
            report = measure_uv(written(tmp_path, text)).report()
            assert (report["charts"], report["tiles"], report["packing_efficiency"]) == (charts, 2, 1)
            assert report["seam_length"] == pytest.approx(length)
            assert (report["flipped"], report["seam_mismatch"]) == (0, 0)

    def test_udim_tiles_are_separate_in_one_texture(self, tmp_path):
        shifted = PAIR + "vt 1 0\nvt 2 0\nvt 2 1\nvt 1 1\n"
        report = measure_uv(written(tmp_path, shifted + LEFT + "f 2/5 5/6 6/7 3/8\n")).report()
        assert (report["overlap"], report["tiles"], report["packing_efficiency"]) == (0, 2, 1)


class TestFormats:
    @pytest.mark.parametrize("ending", ["obj", "ply", "npz"])
    def test_every_format_measures_as_the_result_does(self, tmp_path, ending):
        result = coneflat.flatten(*shapes.sphere(2), charts="atlas")
        report = measure_uv(result.save(tmp_path / f"a.{ending}")).report()
        direct = measure_uv(result).report()
        for name in MEASURED:
            if name != "vertices":
                assert report[name] == pytest.approx(direct[name], rel=1e-9, abs=1e-12), name
        for name in ("qc_mean", "seam_length", "charts", "flipped", "overlap", "seam_mismatch_max"):
            assert report[name] == pytest.approx(getattr(result.distortion, name), rel=1e-9, abs=1e-12)
        assert report["packing_efficiency"] == pytest.approx(result.packing_efficiency)
        assert report["angle_sum_error"] < 1e-9

    def test_meshes_that_are_not_manifold_are_measured(self, tmp_path):
        """Three faces at an edge, one of them given twice: overlaps are those of all."""
        text = (
            SQUARE
            + "v .5 .5 1\n"
            + UNIT
            + "vt 2 0\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\nf 1/1 3/3 5/5\nf 3/3 4/4 1/1\n"
        )
        path = written(tmp_path, text)
        report = measure_uv(path).report()
        assert report["triangles"] == 4
        assert report["overlapping_pairs"] == 2
        assert "Put 1 face on the same three vertices as others" in report["notes"][0]
        with pytest.raises(errors.NonManifoldError):
            measure_uv(path, strict=True)

    def test_a_soup_of_overlapping_triangles_takes_bounded_time(self):
        """Every triangle on every other one."""
        faces = np.arange(3 * 2000).reshape(-1, 3)
        vertices = np.random.default_rng(0).random((faces.size, 3))
        uv = np.tile([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], (len(faces), 1, 1))
        report = measure_uv(vertices, faces, uv).report()
        assert report["overlap"] == pytest.approx(1)
        assert report["overlapping_pairs"] == 16_000
        assert "More than 16,000 pairs" in report["notes"][-1]
        assert report["packing_efficiency"] == pytest.approx(0.5, abs=1e-3)

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            (SQUARE + "f 1 2 3\n", "has no UV coordinates"),
            (SQUARE + "f 1/1 2/2 3/3\n", "refers to UV coordinates, but does not contain them"),
            (SQUARE + "vt nan 1\nf 1/1 2/1 3/1\n", "none of 1 triangle has finite UVs"),
        ],
    )
    def test_nothing_to_measure(self, tmp_path, text, message):
        with pytest.raises(errors.MissingUVError, match=message):
            measure_uv(written(tmp_path, text))

    def test_arrays_that_do_not_fit(self):
        vertices, faces = shapes.hill(3, 3)
        with pytest.raises(errors.MissingUVError, match="corner_uv"):
            measure_uv(vertices, faces)
        with pytest.raises(errors.ArrayShapeError, match=r"\(18, 3, 2\), got \(18, 2\)"):
            measure_uv(vertices, faces, np.zeros((18, 2)))
        with pytest.raises(errors.ArrayShapeError, match="cannot read UVs from int"):
            measure_uv(7)


class TestCommand:
    def run(self, *words):
        return CliRunner().invoke(cli, ["measure", *map(str, words)])

    def test_table_and_json(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        path = written(tmp_path, SQUARE + UNIT + "f 1/1 2/2 3/3 4/4\n")
        done = self.run(path, "--report", "r.json")
        assert done.exit_code == 0
        for word in ("charts", "overlap", "none", "flipped", "texel density", "seam length", "wrote r.json"):
            assert word in done.stdout
        report = json.loads((tmp_path / "r.json").read_text())
        assert report == measure_uv(path).report()
        assert set(MEASURED) < set(report)
        assert json.loads(self.run(path, "--json").stdout) == report
        assert self.run(path, "-q").stdout == ""

    def test_a_measure_that_is_unknown_is_null(self, tmp_path):
        """All in one point: there is no distortion to speak of."""
        path = written(tmp_path, SQUARE + "vt .5 .5\nf 1/1 2/1 3/1 4/1\n")
        done = self.run(path, "--json")
        report = json.loads(done.stdout)
        assert (report["qc_mean"], report["degenerate"]) == (None, 2)
        assert "unknown" in self.run(path).stdout
        assert self.run(path, "--require", "qc_mean<=2").exit_code == 3


def test_mesh_files_and_arrays_agree(tmp_path):
    vertices, faces = shapes.hill(5, 4)
    uv = vertices[:, :2]
    arrays = measure_uv(vertices, faces, uv[faces]).report()
    mesh = MeshFile(
        tmp_path / "x.obj",
        vertices,
        faces.reshape(-1),
        np.arange(0, faces.size + 1, 3),
        texture=faces.reshape(-1),
        uv=uv,
    )
    assert {**measure_uv(mesh).report(), "input": None} == arrays


@pytest.mark.parametrize("seed", range(2))
def test_damaged_files_are_measured_or_refused_in_one_line(tmp_path, seed):
    """Words and lines replaced, left out and repeated; no warning of numpy's, either."""
    random = np.random.default_rng(seed)
    path = coneflat.flatten(*shapes.sphere(1), charts="atlas").save(tmp_path / "a.obj")
    lines = path.read_text().split("\n")
    words = ["nan", "inf", "-1", "0", "1e308", "1e-320", "-5", "999", "", "1/2", "1//2", "x", "1e400", "/"]
    outcomes, messages = set(), []
    for _ in range(40):
        damaged = list(lines)
        for row in random.integers(len(lines), size=random.choice([1, 2, 30])):
            parts = damaged[row].split()
            if len(parts) > 1 and random.random() < 0.6:
                parts[random.integers(1, len(parts))] = str(random.choice(words))
            elif random.random() < 0.5:
                parts = lines[random.integers(len(lines))].split()
            damaged[row] = " ".join(parts)
        path.write_text("\n".join(damaged))
        try:
            report = measure_uv(path).report()
        except errors.ConeflatError as error:
            messages.append(str(error))
            outcomes.add("refused")
        else:
            json.dumps(report, allow_nan=False)
            outcomes.add("measured")
    assert outcomes == {"refused", "measured"}
    assert not any("\n" in message for message in messages)


def test_glb_measures_as_the_result_does_up_to_its_precision(tmp_path):
    result = coneflat.flatten(*shapes.sphere(2), charts="atlas")
    report = measure_uv(result.save(tmp_path / "a.glb")).report()
    for name in ("triangles", "charts", "flipped", "degenerate", "overlapping_pairs", "outside"):
        assert report[name] == measure_uv(result).report()[name], name
    for name in ("qc_mean", "area_std", "seam_length", "packing_efficiency", "density_spread"):
        assert report[name] == pytest.approx(measure_uv(result).report()[name], rel=1e-4), name
