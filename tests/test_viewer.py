"""The viewer's page: what is in it, apart from what a browser makes of it."""

from __future__ import annotations

import base64
import json
import re
import subprocess
import sys
import zlib
from dataclasses import replace

import numpy as np
import pytest
import shapes
from shapes import sphere

import coneflat
from coneflat.errors import ArrayShapeError, MeshError, MeshFileError, OptionError, UnknownFormatError
from coneflat.files.texture import read_picture
from coneflat.mesh import end_corners
from coneflat.options.outputs import SHOWS
from coneflat.view import colours
from coneflat.view.figures.raster import rasterise
from coneflat.view.page.content import content_of, outline_halfedges
from coneflat.view.page.webpage import MOST_IN_NOTEBOOK, notebook_html, open_page, page_of
from coneflat.view.quantity import ColorScale

TYPES = {"f4": "<f4", "u4": "<u4", "i4": "<i4", "u2": "<u2", "u1": "u1"}
PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)


@pytest.fixture(scope="module")
def result():
    return coneflat.flatten(*sphere(4), charts="atlas")


def unpack(page):
    """Return what a page carries: its numbers and texts, and its arrays."""
    (head,) = re.findall(r'<script type="application/json" id="head">(.*?)</script>', page, re.DOTALL)
    (text,) = re.findall(r'<script type="text/plain" id="arrays">(.*?)</script>', page, re.DOTALL)
    head, block = json.loads(head), zlib.decompress(base64.b64decode(text))
    arrays = {
        one["name"]: np.frombuffer(block, TYPES[one["type"]], one["count"], one["offset"])
        for one in head["arrays"]
    }
    return head, arrays


class TestPage:
    def test_it_carries_the_result(self, result):
        head, arrays = unpack(page_of(result))
        faces = arrays["faces"].reshape(-1, 3)
        np.testing.assert_allclose(arrays["uv"].reshape(-1, 2)[faces], result.corner_uv, atol=1e-7)
        places = arrays["places"].reshape(-1, 3)
        size = np.ptp(result.vertices, axis=0).max() / np.ptp(places, axis=0).max()
        corners = places[arrays["point_vertex"][faces]] * size
        expected = result.vertices[result.faces]
        np.testing.assert_allclose(corners - corners[0, 0], expected - expected[0, 0], atol=1e-6)
        np.testing.assert_allclose(arrays["qc"], result.distortion.qc, rtol=1e-6)
        assert result.vertices[result.cones] == pytest.approx(
            (places[arrays["cones"]] - places[0]) * size + result.vertices[0], abs=1e-6
        )
        assert head["cone_curvatures"] == pytest.approx(result.curvatures.tolist())
        assert np.linalg.norm(places, axis=1).max() == pytest.approx(1.0)
        assert head["rows"] == [list(row) for row in coneflat.result.report.as_rows(result)]

    def test_it_names_no_other_place(self, result):
        page = page_of(result)
        assert not re.findall(r"https?:|//[a-z]+\.|\bfetch\(|XMLHttpRequest|WebSocket|@import|url\(", page)
        assert re.findall(r'(?:src|href)="?([^"> ]+)', page) == ["data:,"]
        assert "default-src 'none'" in page
        assert "{{" not in page.replace("${{", "")

    def test_a_hostile_name_stays_text(self, result):
        name = "</script><script>alert(1)</script><!--\udc80"
        page = page_of(result, name=name)
        assert "<script>alert" not in page
        assert unpack(page)[0]["name"] == name
        page.encode()

    def test_a_page_of_20_thousand_triangles_is_small(self):
        result = coneflat.flatten(*sphere(5))
        assert len(result.faces) == 20480
        assert len(result._repr_html_().encode()) < 5e6 / 4
        assert result._repr_html_().startswith("<iframe srcdoc=")

    def test_a_notebook_holds_a_thinned_mesh(self, result, monkeypatch):
        monkeypatch.setattr("coneflat.view.page.webpage.MOST_IN_NOTEBOOK", 2000)
        assert len(notebook_html(result)) < len(page_of(result))
        assert MOST_IN_NOTEBOOK <= 100_000

    @pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
    def test_units_and_place_do_not_matter(self, result, scale):
        _, one = unpack(page_of(result))
        _, two = unpack(page_of(replace(result, vertices=scale * (result.vertices + np.array([3, -7, 11])))))
        np.testing.assert_allclose(one["places"], two["places"], atol=1e-5)
        np.testing.assert_allclose(one["curvature"], two["curvature"], atol=1e-6)

    def test_vertices_have_the_numbers_of_the_input(self):
        vertices, faces = sphere(2)
        apart = np.concatenate([np.full((5, 3), 9.0), vertices])  # five that no face uses
        _, arrays = unpack(page_of(coneflat.flatten(apart, faces + 5)))
        np.testing.assert_array_equal(arrays["vertex_numbers"], 5 + np.arange(len(vertices)))
        assert np.abs(arrays["places"]).max() <= 1

    def test_what_may_be_shown_first(self, result):
        for show in SHOWS:
            assert unpack(page_of(result, show=show))[0]["show"] == show
        with pytest.raises(
            OptionError, match="unknown show 'heat': choose from checker, picture, charts, qc"
        ):
            page_of(result, show="heat")
        with pytest.raises(OptionError, match="upward axis"):
            page_of(result, up="w")

    def test_a_picture_goes_into_the_page(self, result, tmp_path):
        (tmp_path / "one.png").write_bytes(PIXEL)
        head, arrays = unpack(page_of(result, texture=tmp_path / "one.png"))
        assert head["picture"] == "image/png"
        assert head["show"] == "picture"
        assert arrays["picture"].tobytes() == PIXEL

    def test_no_uvs_nothing_to_show(self, result):
        for missing in (
            {"uv": np.empty((0, 2))},
            {"uv_faces": np.empty((0, 3), dtype=int)},
            {"faces": np.empty((0, 3), dtype=int)},
        ):
            with pytest.raises(ArrayShapeError, match="nothing to show"):
                page_of(replace(result, **missing))

    def test_degenerate_triangles_are_shown_as_undefined(self, result):
        qc, scale = result.distortion.qc.copy(), result.distortion.log_area_scale.copy()
        qc[:3] = scale[:3] = np.nan
        worse = replace(result, distortion=replace(result.distortion, qc=qc, log_area_scale=scale))
        _, arrays = unpack(page_of(worse))
        assert np.isnan(arrays["qc"][:3]).all()
        assert np.isfinite(arrays["area"][3:]).all()


class TestPictures:
    def test_content_counts_not_the_ending(self, tmp_path):
        for name, content, kind in (
            ("a.png", PIXEL, "image/png"),
            ("b.txt", b"\xff\xd8\xff\xe0 jpeg", "image/jpeg"),
            ("c.bin", b"RIFF\x10\0\0\0WEBPVP8 ", "image/webp"),
            ("d.gif", b"GIF89a", "image/gif"),
        ):
            (tmp_path / name).write_bytes(content)
            assert read_picture(tmp_path / name) == (content, kind)

    def test_what_is_none(self, tmp_path):
        with pytest.raises(MeshFileError, match="there is no such file"):
            read_picture(tmp_path / "none.png")
        with pytest.raises(MeshFileError, match="is a folder, not a file"):
            read_picture(tmp_path)
        (tmp_path / "text.png").write_text("no picture")
        with pytest.raises(MeshFileError, match=r"text\.png is no PNG, JPEG, GIF or WebP picture"):
            read_picture(tmp_path / "text.png")
        with open(tmp_path / "large.png", "wb") as file:
            file.write(PIXEL)
            file.truncate(40 * 2**20)
        with pytest.raises(MeshFileError, match="has 40 MiB; a page takes up to 32"):
            read_picture(tmp_path / "large.png")


class TestContent:
    @pytest.mark.parametrize(("model", "chi"), [(sphere(3), 2), (shapes.torus(), 0), (shapes.genus(2), -2)])
    def test_curvature_sums_to_two_pi_chi_before_and_after(self, model, chi):
        content = content_of(coneflat.flatten(*model), 10**6)
        assert content.curvature.sum() == pytest.approx(2 * chi, abs=1e-9)
        assert content.flat_curvature.sum() == pytest.approx(2 * chi, abs=1e-9)

    def test_boundaries_have_none(self):
        content = content_of(coneflat.flatten(*shapes.hill()), 10**6)
        mesh = coneflat.TriangleMesh(*shapes.hill())
        for values in (content.curvature, content.flat_curvature):
            np.testing.assert_array_equal(np.isnan(values), mesh.is_boundary_vertex)

    def test_after_it_is_at_the_cones_alone(self, result):
        content = content_of(result, 10**6)
        np.testing.assert_allclose(
            content.flat_curvature[content.cones] * np.pi, content.cone_curvatures, atol=1e-9
        )
        assert np.abs(np.delete(content.flat_curvature, content.cones)).max() < 1e-9

    @pytest.mark.parametrize("model", [sphere(3), shapes.torus(), shapes.hill(), shapes.annulus()])
    def test_outlines_are_seams_and_boundary(self, model):
        result = coneflat.flatten(*model, charts="atlas")
        mesh = coneflat.TriangleMesh(result.vertices, result.faces)
        outline, seams = outline_halfedges(mesh, result.uv_faces)
        pairs = np.sort(np.stack([mesh.tails[outline], mesh.heads[outline]], axis=1), axis=1)
        np.testing.assert_array_equal(pairs[: 2 * seams : 2], pairs[1 : 2 * seams : 2])
        assert {*map(tuple, pairs[: 2 * seams].tolist())} == {*map(tuple, np.sort(result.seams, 1).tolist())}
        assert len(outline) - 2 * seams == mesh.is_boundary_edge.sum()

    def test_charts_are_numbered_by_size(self):
        result = coneflat.flatten(*shapes.join(sphere(2), (sphere(3)[0] * 3 + 9, sphere(3)[1])))
        content = content_of(result, 10**6)
        assert np.bincount(content.chart).tolist() == [1280, 320]

    def test_which_side_is_outside(self, result):
        assert content_of(result, 10**6).outward == 1
        vertices, faces = sphere(2)
        assert content_of(coneflat.flatten(vertices, faces[:, ::-1]), 10**6).outward == -1


@pytest.fixture(scope="module")
def fine():
    return coneflat.flatten(*sphere(5), charts="atlas", cone_count=6)


class TestThinning:
    def test_as_few_triangles_as_asked_and_not_far_fewer(self, fine):
        whole = content_of(fine, 10**6)
        assert whole.left_out == 0
        for most in (12_000, 6_000):
            thinned = content_of(fine, most)
            assert most / 2 < len(thinned.faces) <= most
            assert len(thinned.faces) + thinned.left_out == len(fine.faces)

    def test_the_layout_stays_covered_and_the_outline_as_it_was(self, fine):
        whole, thinned = content_of(fine, 10**6), content_of(fine, 4000)

        def covered(content):
            flat = np.column_stack([900 * content.uv, np.zeros(len(content.uv))])
            return rasterise(flat, content.faces, 900, 900).covered

        np.testing.assert_array_equal(covered(whole), covered(thinned))

        def outline(content):
            return content.uv[content.faces.ravel()[np.stack(end_corners(content.outline), axis=1)]]

        np.testing.assert_array_equal(outline(whole), outline(thinned))
        assert whole.seams == thinned.seams

    def test_what_stays_is_as_it_was(self, fine):
        whole, thinned = content_of(fine, 10**6), content_of(fine, 4000)
        np.testing.assert_array_equal(thinned.qc, whole.qc[thinned.face_numbers])
        np.testing.assert_array_equal(thinned.places, whole.places[thinned.vertex_numbers])
        np.testing.assert_array_equal(thinned.curvature, whole.curvature[thinned.vertex_numbers])
        np.testing.assert_array_equal(thinned.vertex_numbers[thinned.cones], fine.cones)
        radius = np.linalg.norm(thinned.places[thinned.point_vertex[thinned.faces]].mean(axis=1), axis=1)
        assert radius.min() > 0.5 * np.linalg.norm(whole.places, axis=1).min()

    def test_no_triangle_is_turned_over(self, fine):
        thinned = content_of(fine, 4000)
        p, q, r = np.moveaxis(thinned.uv[thinned.faces], 1, 0)
        assert ((q - p)[:, 0] * (r - p)[:, 1] > (q - p)[:, 1] * (r - p)[:, 0]).all()

    def test_the_page_says_so(self, fine):
        head, arrays = unpack(page_of(fine, most_triangles=4000))
        assert head["left_out"] + arrays["qc"].size == head["triangles"] == len(fine.faces)
        assert arrays["face_numbers"].max() < len(fine.faces)

    def test_too_few_to_be_had(self, fine):
        with pytest.raises(
            MeshError, match=r"20,480 triangles are too many for a page of 50: \d+ of them lie along"
        ):
            content_of(fine, 50)
        with pytest.raises(OptionError, match="at least one triangle, not 0"):
            content_of(fine, 0)


class TestColours:
    @staticmethod
    def lightness(table):
        """L* by the definition, from the luminance of sRGB."""
        share = table / 255
        linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
        y = linear @ [0.2126729, 0.7151522, 0.0721750]
        return 116 * np.where(y > (6 / 29) ** 3, np.cbrt(y), y / (3 * (6 / 29) ** 2) + 4 / 29) - 16

    def test_the_sequential_table_darkens_evenly(self):
        steps = -np.diff(self.lightness(colours.color_table(colours.SEQUENTIAL))[::8])
        assert steps.min() > 0.5
        assert steps.max() < 3 * steps.mean()

    def test_the_diverging_table_is_lightest_in_the_middle(self):
        light = self.lightness(colours.color_table(colours.DIVERGING))
        assert np.argmax(light) in (127, 128)
        assert (np.diff(light[:128:8]) > 0).all()
        assert (np.diff(light[128::8]) < 0).all()
        assert light[0] == pytest.approx(light[-1], abs=4)


class TestScales:
    def test_places_on_each_kind(self):
        linear = ColorScale(1.0, 3.0, "sequential", "linear", ())
        assert linear.position(np.array([0.5, 1, 2, 3, 9])) == pytest.approx([0, 0, 0.5, 1, 1])
        log = ColorScale(0.25, 4.0, "diverging", "log", ())
        assert log.position(np.array([0.25, 0.5, 1, 2, 4, 99])) == pytest.approx([0, 0.25, 0.5, 0.75, 1, 1])
        both = ColorScale(1e-4, 1.0, "diverging", "signed log", ())
        values = np.array([-9, -1, -1e-2, -1e-4, 0, 1e-9, 1e-2, 1])
        assert both.position(values) == pytest.approx([0, 0, 0.25, 0.5, 0.5, 0.5, 0.75, 1])
        assert np.isnan(both.position(np.array([np.nan])))[0]

    def test_ticks_say_what_lies_there(self, result):
        scales = content_of(result, 10**6).scales
        in_page = unpack(page_of(result))[0]["scales"]
        assert set(scales) == set(in_page) < set(SHOWS)
        for name in ("qc", "area"):
            for place, label in in_page[name]["ticks"]:
                assert scales[name].position(np.array([float(label)]))[0] == pytest.approx(place, abs=0.02)
        plain = str.maketrans("−⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "--0123456789")
        places = [place for place, _ in in_page["flat"]["ticks"]]
        assert places == pytest.approx([0, 0.25, 0.5, 0.75, 1])
        for place, label in in_page["flat"]["ticks"]:
            sign, _, power = label.translate(plain).rpartition("10")
            value = float(f"{sign}1e{power}") if "10" in label else float(label.translate(plain))
            assert scales["flat"].position(np.array([value]))[0] == pytest.approx(place)


class TestFiles:
    def test_view_writes_a_page(self, result, tmp_path):
        path = result.view(tmp_path / "out.html")
        assert path == tmp_path / "out.html"
        assert unpack(path.read_text(encoding="utf-8"))[0]["triangles"] == len(result.faces)

    def test_without_a_path_it_is_opened(self, result, monkeypatch):
        opened = []
        monkeypatch.setattr("coneflat.view.page.webpage.open_page", opened.append)
        path = result.view()
        assert opened == [path]
        assert path.read_text(encoding="utf-8").startswith("<!doctype html>")
        path.unlink()

    def test_no_browser_is_started_without_a_display(self, tmp_path, monkeypatch):
        monkeypatch.setattr(sys, "platform", "linux")
        monkeypatch.delenv("DISPLAY", raising=False)
        monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
        assert open_page(tmp_path / "out.html") is False

    def test_bad_targets(self, result, tmp_path):
        with pytest.raises(
            UnknownFormatError,
            match=r"ends with '.png', which is no known format; pages are written as .html, .htm",
        ):
            result.view(tmp_path / "out.png")
        with pytest.raises(MeshFileError, match="there is no folder"):
            result.view(tmp_path / "none" / "out.html")
        with pytest.raises(MeshFileError, match="there is no such file"):
            result.view(tmp_path / "out.html", texture=tmp_path / "none.jpg")
        assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def saved(result, tmp_path_factory):
    return result.save(tmp_path_factory.mktemp("saved") / "ball.npz")


class TestCommand:
    @staticmethod
    def run(*arguments, cwd):
        command = [sys.executable, "-m", "coneflat", "view", *map(str, arguments)]
        return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=120, check=False)

    def test_a_result(self, saved, tmp_path):
        done = self.run(saved, "-o", "ball.html", "--show", "qc", "--up", "z", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert "wrote ball.html" in done.stdout
        assert "QC distortion" in done.stdout
        head, _ = unpack((tmp_path / "ball.html").read_text(encoding="utf-8"))
        assert (head["name"], head["show"]) == ("ball.npz", "qc")
        assert head["turn"][1][2] > 0.5

    def test_a_mesh_is_flattened_without_overlaps(self, tmp_path):
        shapes.write_obj(tmp_path / "box.obj", *shapes.box(3))
        done = self.run("box.obj", "-q", cwd=tmp_path)
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
        head, _ = unpack((tmp_path / "box_view.html").read_text(encoding="utf-8"))
        assert ["overlap", "none"] == next(row for row in head["rows"] if row[0] == "overlap")[:2]

    def test_what_goes_wrong_is_said_in_one_line(self, saved, tmp_path):
        with np.load(saved) as archive:
            np.savez(tmp_path / "bare.npz", **{k: v for k, v in archive.items() if k != "uv"})
        for arguments, message in (
            (("bare.npz",), "holds no UVs"),
            ((saved, "--texture", "none.png"), "none.png: there is no such file"),
            ((saved, "--show", "heat"), "'heat' is not one of"),
            ((saved, "-o", "page.pdf"), "ends with '.pdf'"),
            ((saved, "--most-triangles", "9"), "too many for a page of 9"),
            (("none.npz",), "there is no such file"),
        ):
            done = self.run(*arguments, cwd=tmp_path)
            assert done.returncode == 2, message
            assert message in done.stderr
            assert len(done.stderr.splitlines()) == 1
        assert [path.name for path in tmp_path.iterdir()] == ["bare.npz"]
