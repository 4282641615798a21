"""The texture of a file is shown on the model and on its layout, with the UVs of the file."""

from __future__ import annotations

from io import BytesIO

import numpy as np
import pytest
from scenes import SceneMaker
from shapes import sphere
from studio_browsing import Studio, StudioVisit

import coneflat
from coneflat.apps.studio.outputs import own_picture

Image = pytest.importorskip("PIL.Image")


def coloured_ball(size=(4, 2), image=None, slot=None):
    """Return a GLB of a ball whose texture is red where x > 0 and green elsewhere, and of a plain triangle."""
    vertices, faces = sphere(3)
    corners = vertices[faces].reshape(-1, 3)
    is_red = np.repeat(vertices[faces].mean(axis=1)[:, 0] > 0, 3)
    uv = np.stack([np.where(is_red, 0.25, 0.75), np.full(len(corners), 0.5)], axis=1)
    stream, pixels = BytesIO(), np.zeros((size[1], size[0], 3), np.uint8)
    pixels[:, : size[0] // 2, 0] = pixels[:, size[0] // 2 :, 1] = 255
    Image.fromarray(pixels).save(stream, format="PNG")
    make = SceneMaker()
    content = stream.getvalue() if image is None else image
    make.tree |= {
        "images": [{"bufferView": make.view(content), "mimeType": "image/png"}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": slot or {"index": 0}}}, {}],
    }
    ball = {
        "attributes": {
            "POSITION": make.accessor(corners),
            "TEXCOORD_0": make.accessor(uv + np.array([1, 0])),
        },
        "material": 0,
    }
    plain = {"attributes": {"POSITION": make.accessor([[3.0, 0, 0], [4, 0, 0], [3, 1, 0]])}, "material": 1}
    make.tree |= {
        "meshes": [{"primitives": [plain, ball]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
    return make.glb()


def test_the_picture_is_that_of_most_triangles(tmp_path):
    path = tmp_path / "ball.glb"
    path.write_bytes(coloured_ball(size=(4096, 2)))
    picture, uv = own_picture(coneflat.read_mesh(path))
    image = Image.open(BytesIO(picture.content))
    assert max(image.size) == 1024
    assert (uv[:3] == -1e6).all()
    assert set(np.round(uv[3:, 0], 6)) == {1.25, 1.75}  # they repeat


def test_files_without_a_readable_picture_have_none(tmp_path):
    path = tmp_path / "ball.glb"
    path.write_bytes(coloured_ball(slot=5))
    assert own_picture(coneflat.read_mesh(path)) is None
    path.write_bytes(coloured_ball(image=b"\x89PNG\r\n\x1a\n broken"))
    assert own_picture(coneflat.read_mesh(path)) is None
    assert own_picture(coneflat.read_mesh(coneflat.sample_path())) is None


#: The pixel of a pane, as bytes, at the middle of a triangle that is nearest to a place.
PIXELS = """
(() => { const {renderer, panes, model} = coneflat, {canvas, gl} = renderer, out = [];
const bytes = new Uint8Array(4 * canvas.width * canvas.height);
gl.bindFramebuffer(gl.FRAMEBUFFER, null);
gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
for (const pane of panes) for (let i = 0; i < model.triangleCount; i += 7) {
const [middle] = model.shapeOf({kind: "triangle", index: i}, pane.inPlane);
const place = [0, 1, 2].map((k) => (middle[0][k] + middle[1][k] + middle[2][k]) / 3);
const [x, y] = pane.camera.project(place), thing = renderer.pick(pane, x, y, coneflat.state);
if (thing?.kind !== "triangle" || thing.index !== i) continue;
const column = Math.floor((pane.left + x) * renderer.pixel);
const row = canvas.height - 1 - Math.floor((pane.top + y) * renderer.pixel);
const at = 4 * (row * canvas.width + column), centre = model.place(model.vertexAt(3 * i))[0];
out.push([pane.name, centre, bytes[at], bytes[at + 1], bytes[at + 2]]); }
return out; })()
"""


def test_the_texture_of_the_file_is_shown_in_both_views(browser, tmp_path):
    path = tmp_path / "ball.glb"
    path.write_bytes(coloured_ball())
    served = Studio(tmp_path)
    try:
        served.session.open(path)
        visit = StudioVisit(browser, served)
        try:
            visit.settle()
            visit.wait("coneflat.renderer.look.asInFile === true")
            visit.run("coneflat.state.set({show: 'picture', seams: false, cones: false})")
            visit.rest()
            found = visit.run(PIXELS)
            left = [one for one in found if one[0] == "layout"]
            assert {one[0] for one in found} == {"model", "layout"}
            assert len(left) > 50
            is_red, is_green = (np.array([one[2 + k] > 100 + one[3 - k] for one in found]) for k in (0, 1))
            assert is_red.sum() > 30
            assert is_green.sum() > 30
            side = np.array([one[1] for one in found])
            assert side[is_red].min() > side[is_green].max() - 0.4
            # An image of the user is in the UVs of the layout again.
            visit.run("coneflat.renderer.setPicture(coneflat.renderer.look.picture)")
            assert visit.run("coneflat.renderer.look.asInFile") is False
        finally:
            visit.close()
    finally:
        served.close()
