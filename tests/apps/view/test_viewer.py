"""The viewer's page: what is in it, apart from what a browser makes of it."""

from __future__ import annotations

import base64
import json
import re
import zlib

import numpy as np
import pytest
import shapes
from command import command
from shapes import sphere

import coneflat
from coneflat.apps.view.figures.render import rasterise
from coneflat.apps.view.page.content import content_of, outline_halfedges
from coneflat.apps.view.page.webpage import page_html
from coneflat.errors import MeshError, MeshFileError, OptionError, UnknownFormatError
from coneflat.io.texture import read_picture
from coneflat.measures.report import as_rows
from coneflat.mesh.connectivity import end_corners

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
        array["name"]: np.frombuffer(block, TYPES[array["type"]], array["count"], array["offset"])
        for array in head["arrays"]
    }
    return head, arrays


class TestPage:
    def test_it_carries_the_result(self, result):
        head, arrays = unpack(page_html(result))
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
        assert head["rows"] == [list(row) for row in as_rows(result)]

    def test_it_refers_to_no_other_address(self, result):
        page = page_html(result)
        assert not re.findall(r"https?:|//[a-z]+\.|\bfetch\(|XMLHttpRequest|WebSocket|@import|url\(", page)
        assert re.findall(r'(?:src|href)="?([^"> ]+)', page) == ["data:,"]
        assert "default-src 'none'" in page
        assert "{{" not in page.replace("${{", "")

    def test_a_hostile_name_stays_text(self, result):
        name = "</script><script>alert(1)</script><!--\udc80"
        page = page_html(result, name=name)
        assert "<script>alert" not in page
        assert unpack(page)[0]["name"] == name
        page.encode()

    def test_a_picture_goes_into_the_page(self, result, tmp_path):
        (tmp_path / "one.png").write_bytes(PIXEL)
        head, arrays = unpack(page_html(result, texture=tmp_path / "one.png"))
        assert head["picture"] == "image/png"
        assert head["show"] == "picture"
        assert arrays["picture"].tobytes() == PIXEL


class TestPictures:
    def test_pictures_are_recognized_by_content(self, tmp_path):
        for name, content, kind in (
            ("a.png", PIXEL, "image/png"),
            ("b.txt", b"\xff\xd8\xff\xe0 jpeg", "image/jpeg"),
            ("c.bin", b"RIFF\x10\0\0\0WEBPVP8 ", "image/webp"),
            ("d.gif", b"GIF89a", "image/gif"),
        ):
            (tmp_path / name).write_bytes(content)
            assert read_picture(tmp_path / name) == (content, kind)

    def test_invalid_requirements_are_refused(self, tmp_path):
        with pytest.raises(MeshFileError, match="there is no such file"):
            read_picture(tmp_path / "none.png")
        with pytest.raises(MeshFileError, match="is a folder, not a file"):
            read_picture(tmp_path)
        (tmp_path / "text.png").write_text("no picture")
        with pytest.raises(MeshFileError, match=r"text\.png is not a PNG, JPEG, GIF or WebP picture"):
            read_picture(tmp_path / "text.png")
        with open(tmp_path / "large.png", "wb") as file:
            file.write(PIXEL)
            file.truncate(40 * 2**20)
        with pytest.raises(MeshFileError, match="has 40 MiB; the limit for a page is 32"):
            read_picture(tmp_path / "large.png")


class TestContent:
    @pytest.mark.parametrize(("model", "chi"), [(sphere(3), 2), (shapes.torus(), 0), (shapes.genus(2), -2)])
    def test_curvature_sums_to_two_pi_chi_on_the_model_and_in_the_plane(self, model, chi):
        content = content_of(coneflat.flatten(*model), 10**6)
        assert content.curvature.sum() == pytest.approx(2 * chi, abs=1e-9)
        assert content.flat.sum() == pytest.approx(2 * chi, abs=1e-9)

    def test_boundaries_have_no_curvature(self):
        content = content_of(coneflat.flatten(*shapes.hill()), 10**6)
        mesh = coneflat.TriangleMesh(*shapes.hill())
        for values in (content.curvature, content.flat):
            np.testing.assert_array_equal(np.isnan(values), mesh.is_boundary_vertex)

    def test_flat_curvature_is_at_cones_only(self, result):
        content = content_of(result, 10**6)
        np.testing.assert_allclose(content.flat[content.cones] * np.pi, content.cone_curvatures, atol=1e-9)
        assert np.abs(np.delete(content.flat, content.cones)).max() < 1e-9

    @pytest.mark.parametrize("model", [sphere(3), shapes.torus(), shapes.hill(), shapes.annulus()])
    def test_outlines_are_seams_and_boundary(self, model):
        result = coneflat.flatten(*model, charts="atlas")
        mesh = coneflat.TriangleMesh(result.vertices, result.faces)
        outline, seams = outline_halfedges(mesh, result.uv_faces)
        pairs = np.sort(np.stack([mesh.tails[outline], mesh.heads[outline]], axis=1), axis=1)
        np.testing.assert_array_equal(pairs[: 2 * seams : 2], pairs[1 : 2 * seams : 2])
        assert {*map(tuple, pairs[: 2 * seams].tolist())} == {*map(tuple, np.sort(result.seams, 1).tolist())}
        assert len(outline) - 2 * seams == mesh.is_boundary_edge.sum()


@pytest.fixture(scope="module")
def fine():
    return coneflat.flatten(*sphere(5), charts="atlas", cone_count=6)


class TestThinning:
    @pytest.mark.slow
    def test_simplification_keeps_almost_the_requested_number_of_triangles(self, fine):
        complete = content_of(fine, 10**6)
        assert complete.left_out == 0
        for limit in (12_000, 6_000):
            thinned = content_of(fine, limit)
            assert limit / 2 < len(thinned.faces) <= limit
            assert len(thinned.faces) + thinned.left_out == len(fine.faces)

    def test_the_layout_stays_covered_and_the_outline_as_it_was(self, fine):
        complete, thinned = content_of(fine, 10**6), content_of(fine, 4000)

        def covered(content):
            flat = np.column_stack([900 * content.uv, np.zeros(len(content.uv))])
            return rasterise(flat, content.faces, 900, 900).covered

        np.testing.assert_array_equal(covered(complete), covered(thinned))

        def outline(content):
            return content.uv[content.faces.ravel()[np.stack(end_corners(content.outline), axis=1)]]

        np.testing.assert_array_equal(outline(complete), outline(thinned))
        assert complete.seams == thinned.seams

    def test_a_number_of_triangles_that_cannot_be_reached_is_an_error(self, fine):
        with pytest.raises(
            MeshError, match=r"20,480 triangles cannot be reduced to 50 for display: \d+ of them lie along"
        ):
            content_of(fine, 50)
        with pytest.raises(OptionError, match="must be 1 or more, got 0"):
            content_of(fine, 0)


class TestFiles:
    def test_without_a_path_it_is_opened(self, result, monkeypatch):
        opened = []
        monkeypatch.setattr("coneflat.apps.view.page.webpage.open_page", opened.append)
        path = result.view()
        assert opened == [path]
        assert path.read_text(encoding="utf-8").startswith("<!doctype html>")
        path.unlink()

    def test_bad_targets(self, result, tmp_path):
        with pytest.raises(
            UnknownFormatError,
            match=r"ends with '.png', which is not a known format; pages are written as .html, .htm",
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
    def test_errors_are_one_line(self, saved, tmp_path):
        with np.load(saved) as archive:
            np.savez(tmp_path / "bare.npz", **{k: v for k, v in archive.items() if k != "uv"})
        for arguments, message in (
            (("bare.npz",), "holds no result of coneflat with UVs"),
            ((saved, "--texture", "none.png"), "none.png: there is no such file"),
            ((saved, "--show", "heat"), "'heat' is not one of"),
            ((saved, "-o", "page.pdf"), "ends with '.pdf'"),
            ((saved, "--most-triangles", "9"), "cannot be reduced to 9 for display"),
            (("none.npz",), "there is no such file"),
        ):
            done = command("view", *arguments, cwd=tmp_path)
            assert done.returncode == 2, message
            assert message in done.stderr
            assert len(done.stderr.splitlines()) == 1
        assert [path.name for path in tmp_path.iterdir()] == ["bare.npz"]
