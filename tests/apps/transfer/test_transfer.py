"""Colours survive the way from old UVs to new ones."""

from __future__ import annotations

from io import BytesIO

import numpy as np
import pytest
from command import command
from gltf_scenes import SceneMaker

import coneflat
from coneflat.apps.transfer import transfer
from coneflat.errors import MeshFileError, MissingUVError, OptionError
from coneflat.geometry.nearest import TriangleTree

Image = pytest.importorskip("PIL.Image")

SIDE = 256
TURN = 2 * np.pi


def torus(u, v, bumps=0.0):
    radius = 0.4 * (1 + bumps * np.sin(3 * TURN * u))
    ring = 1 + radius * np.cos(TURN * v)
    return [ring * np.cos(TURN * u), ring * np.sin(TURN * u), radius * np.sin(TURN * v)]


def ball(u, v, power=1.0):
    a, b = TURN * u, np.pi * (0.02 + 0.96 * v)
    round_ = [np.sin(b) * np.cos(a), np.sin(b) * np.sin(a), np.cos(b)]
    return [np.sign(x) * np.abs(x) ** power for x in round_]


def knot(u, v):
    a, b = TURN * u, TURN * v
    ring = 2 + np.cos(3 * a) + 0.3 * np.cos(b)
    return [ring * np.cos(2 * a), ring * np.sin(2 * a), np.sin(3 * a) + 0.3 * np.sin(b)]


#: Surfaces by their parameters, which are the old UVs.
MODELS = {
    "torus": torus,
    "bumpy torus": lambda u, v: torus(u, v, 0.3),
    "ball": ball,
    "rounded box": lambda u, v: ball(u, v, 0.6),
    "octahedron": lambda u, v: ball(u, v, 1.4),
    "knot": knot,
    "sheet": lambda u, v: [u, v, 0.1 * np.sin(9 * u) * np.cos(7 * v)],
    "cup": lambda u, v: [v * np.cos(TURN * u), v * np.sin(TURN * u), v**3],
    "vase": lambda u, v: [(0.5 + 0.2 * np.sin(6 * v)) * f(TURN * u) for f in (np.cos, np.sin)] + [2 * v],
    "spiral": lambda u, v: [(0.3 + u) * np.cos(9 * u), (0.3 + u) * np.sin(9 * u), v],
}


def colour(points):
    """Return the (..., 3) sRGB colours of points in space."""
    waves = np.sin(points @ [[2.0, -1, 1], [1.0, 2, -1], [-1.0, 1.0, 3]] + [0.0, 1, 2])
    return 0.5 + 0.35 * waves


def model(surface, count=48, image=True, colours=False):
    """Return a GLB whose texture or vertex colours are `colour`."""
    u, v = (x.ravel() for x in np.meshgrid(*[np.linspace(0, 1, count)] * 2, indexing="ij"))
    at = np.arange(count**2).reshape(count, count)
    a, b, c, d = (x.ravel() for x in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    vertices = np.stack(np.broadcast_arrays(*surface(u, v)), axis=1)
    make = SceneMaker()
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    primitive = {
        "attributes": {"POSITION": make.accessor(vertices), "TEXCOORD_0": make.accessor(np.stack([u, v], 1))},
        "indices": make.accessor(faces.ravel(), 5125),
    }
    if colours:
        primitive["attributes"]["COLOR_0"] = make.accessor(colour(vertices) ** 2.2)
    if image:
        s, t = np.meshgrid(*[(np.arange(SIDE) + 0.5) / SIDE] * 2)
        pixels = colour(np.stack(np.broadcast_arrays(*surface(s, t)), axis=-1))
        stream = BytesIO()
        Image.fromarray(np.round(255 * pixels).astype(np.uint8)).save(stream, format="PNG")
        make.tree |= {
            "images": [{"bufferView": make.view(stream.getvalue()), "mimeType": "image/png"}],
            "textures": [{"source": 0}],
            "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        }
        primitive["material"] = 0
    make.tree |= {"meshes": [{"primitives": [primitive]}], "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}]}
    return make.glb()


def mean_difference(path):
    """Return the mean difference, in steps of 8 bits, of a GLB's texture and `colour` at points of its surface."""
    mesh = coneflat.read_mesh(path)
    data = mesh.scene.data
    slot = data.tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"]
    view = data.tree["images"][data.tree["textures"][slot]["source"]]["bufferView"]
    image = np.asarray(Image.open(BytesIO(bytes(data.view(view)))).convert("RGB")).astype(float)
    weights = np.random.default_rng(0).dirichlet([1, 1, 1], len(mesh.corners) // 3)
    points = np.einsum("fi,fix->fx", weights, mesh.vertices[mesh.corners.reshape(-1, 3)])
    uv = np.einsum("fi,fix->fx", weights, mesh.uv[mesh.texture.reshape(-1, 3)])
    side = len(image)
    column, row = (np.clip((x * side).astype(int), 0, side - 1) for x in (uv[:, 0], 1 - uv[:, 1]))
    return np.abs(image[row, column] - 255 * colour(points)).mean()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a textured torus, and the same with new UVs."""
    folder_path = tmp_path_factory.mktemp("torus")
    (folder_path / "old.glb").write_bytes(model(torus))
    coneflat.flatten(str(folder_path / "old.glb")).save(folder_path / "new.glb")
    return folder_path


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_colours_of_ten_models_arrive(name, tmp_path):
    old, target, out = (tmp_path / f"{stem}.glb" for stem in ("old", "new", "out"))
    old.write_bytes(model(MODELS[name]))
    coneflat.flatten(str(old), repair=True).save(target)
    transfer(old, target, resolution=512).save(out)
    # Rounding gives half a step of 8 bits; texels of the thin knot are read at their centre here.
    assert mean_difference(out) < 3.0
    assert mean_difference(target) > 10.0


@pytest.mark.slow
def test_vertex_colours_arrive_on_other_triangles(folder, tmp_path):
    fine = tmp_path / "fine.glb"
    fine.write_bytes(model(torus, count=150, image=False, colours=True))
    coneflat.flatten(str(fine), repair=True).save(tmp_path / "coloured.glb")
    out = transfer(folder / "old.glb", tmp_path / "coloured.glb", resolution=16).save(tmp_path / "out.glb")
    primitive = coneflat.read_mesh(out).scene.data.tree["meshes"][0]["primitives"][0]
    assert "COLOR_0" not in primitive["attributes"]  # viewers would multiply the image by it
    baked = transfer(fine, folder / "new.glb", resolution=256)
    assert mean_difference(baked.save(tmp_path / "out.glb")) < 4.0
    assert baked.notes == ()


@pytest.mark.slow
def test_the_image_of_an_obj_is_given(folder, tmp_path):
    coneflat.flatten(str(folder / "old.glb")).save(tmp_path / "new.ply")
    lines = ["v 0 0 0", "v 1 0 0", "v 0 1 0", "vt 0 0", "vt 1 0", "vt 0 1", "f 1/1 2/2 3/3"]
    (tmp_path / "one.obj").write_text("\n".join(lines))
    pixels = np.arange(16 * 16 * 3).reshape(16, 16, 3) % 256
    Image.fromarray(pixels.astype(np.uint8)).save(tmp_path / "image.png")
    baked = transfer(
        tmp_path / "one.obj", tmp_path / "one.obj", resolution=16, texture=tmp_path / "image.png"
    )
    image = np.asarray(Image.open(baked.save(tmp_path / "out.png")))
    # The centres of the texels on the diagonal are on the border.
    rows, columns = np.nonzero(np.tri(16, k=-1, dtype=bool))
    assert np.array_equal(image[rows, columns], pixels[rows, columns])
    assert coneflat.read_mesh(baked.save(tmp_path / "out.glb")).uv is not None


def test_images_are_clamped_or_repeated_as_their_samplers_say(tmp_path):
    stream, make = BytesIO(), SceneMaker()
    pixels = np.array([[[0, 0, 0], [255, 0, 0]], [[0, 255, 0], [255, 255, 0]]], np.uint8)
    Image.fromarray(pixels).save(stream, format="PNG")
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    make.tree |= {
        "images": [{"bufferView": make.view(stream.getvalue()), "mimeType": "image/png"}],
        "samplers": [{"wrapS": 33071}],
        "textures": [{"source": 0, "sampler": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
    attributes = {
        "POSITION": make.accessor(corners),
        "TEXCOORD_0": make.accessor(2 * corners[:, :2] - 0.5),
    }
    indices = make.accessor(np.array([0, 1, 2, 0, 2, 3]), 5125)
    make.tree["meshes"] = [{"primitives": [{"attributes": attributes, "indices": indices, "material": 0}]}]
    (tmp_path / "old.glb").write_bytes(make.glb())
    lines = ["v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 1 0", "vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1"]
    (tmp_path / "new.obj").write_text("\n".join([*lines, "f 1/1 2/2 3/3", "f 1/1 3/3 4/4"]))
    red, green = np.moveaxis(
        transfer(tmp_path / "old.glb", tmp_path / "new.obj", resolution=8).images["baseColorTexture"], 2, 0
    )[:2]
    assert (red[:, :3] == 0).all()
    assert (red[:, 5:] == 255).all()
    assert np.array_equal(green[:4], green[4:])
    assert np.ptp(green) > 50


def test_triangles_without_area_in_the_texture_have_no_texels(tmp_path):
    corners = ["v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 1 0", "v 2 0 0", "v 2 1 0", "v 3 0 0"]
    points = ["vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1", "vt 0.25 0.25"]
    faces = ["f 5/1 6/3 7/5", "f 1/1 2/2 3/3", "f 1/1 3/3 4/4"]
    (tmp_path / "new.obj").write_text("\n".join(corners + points + faces))
    Image.new("RGB", (1, 1), (9, 9, 9)).save(tmp_path / "image.png")
    path, image = tmp_path / "new.obj", tmp_path / "image.png"
    baked = transfer(path, path, resolution=64, texture=image)
    assert not any("overlap" in note for note in baked.notes)
    assert (baked.images["baseColorTexture"][..., :3] == 9).all()


def test_normal_maps_turn_with_the_uvs(tmp_path):
    """The new UVs are turned by a quarter, so x becomes -y."""
    make = SceneMaker()
    stream = BytesIO()
    Image.new("RGB", (4, 4), (255, 128, 128)).save(stream, format="PNG")
    make.tree |= {
        "images": [{"bufferView": make.view(stream.getvalue()), "mimeType": "image/png"}],
        "textures": [{"source": 0}],
        "materials": [
            {"normalTexture": {"index": 0, "scale": 0.5}, "alphaMode": "MASK", "emissiveFactor": [1, 0, 0]},
            {},
        ],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    indices = make.accessor([0, 1, 2, 0, 2, 3], 5125)
    for name, uv in (("old", square[:, :2] * [1, -1] + [0, 1]), ("new", square[:, [1, 0]])):
        attributes = {"POSITION": make.accessor(square), "TEXCOORD_0": make.accessor(uv.copy())}
        make.tree["meshes"] = [
            {"primitives": [{"attributes": attributes, "indices": indices, "material": 0}]}
        ]
        (tmp_path / f"{name}.glb").write_bytes(make.glb())
    baked = transfer(tmp_path / "old.glb", tmp_path / "new.glb", resolution=8)
    normal = baked.images["normalTexture"]
    # The normal pointed along x, which is downwards in the new image; its scale is a half.
    assert np.abs(normal[..., :3].astype(int) - [128, 64, 192]).max() <= 1
    assert (baked.material["alphaMode"], baked.material["emissiveFactor"]) == ("MASK", [1, 0, 0])
    tree = coneflat.read_mesh(baked.save(tmp_path / "out.glb")).scene.data.tree
    assert (len(tree["images"]), len(tree["materials"])) == (2, 1)


def test_normal_maps_and_tangents_of_other_uvs(tmp_path):
    """The normal map has the second UVs, which are turned by a quarter; tangents of either file are not kept."""
    make = SceneMaker()
    stream = BytesIO()
    Image.new("RGB", (4, 4), (255, 128, 128)).save(stream, format="PNG")
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    plain, turned = square[:, :2] * [1, -1] + [0, 1], square[:, [1, 0]]
    attributes = {"POSITION": square, "TEXCOORD_0": plain, "TEXCOORD_1": turned, "TANGENT": np.ones((4, 4))}
    primitive = {
        "attributes": {name: make.accessor(values.copy()) for name, values in attributes.items()},
        "indices": make.accessor([0, 1, 2, 0, 2, 3], 5125),
        "material": 0,
        "targets": [{"TANGENT": make.accessor(np.ones((4, 3))), "POSITION": make.accessor(np.zeros((4, 3)))}],
    }
    transform = {"extensions": {"KHR_texture_transform": {"texCoord": 1, "offset": [0.5, 0]}}}
    make.tree |= {
        "images": [{"bufferView": make.view(stream.getvalue()), "mimeType": "image/png"}],
        "textures": [{"source": 0}],
        "materials": [{"normalTexture": {"index": 0, **transform}}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "meshes": [{"primitives": [primitive]}],
    }
    (tmp_path / "old.glb").write_bytes(make.glb())
    baked = transfer(tmp_path / "old.glb", tmp_path / "old.glb", resolution=8)
    # The normal pointed along the first direction of the second UVs, which is the second of the first.
    assert np.abs(baked.images["normalTexture"][..., :3].astype(int) - [128, 255, 128]).max() <= 1
    assert any("Tangents" in note for note in baked.notes)
    scene = coneflat.read_mesh(baked.save(tmp_path / "out.glb")).scene
    (after,) = scene.data.tree["meshes"][0]["primitives"]
    assert set(after["attributes"]) == {"POSITION", "TEXCOORD_0", "TEXCOORD_1"}
    assert set(after["targets"][0]) == {"POSITION"}
    assert np.array_equal(scene.data.values(after["attributes"]["TEXCOORD_1"], 2), turned)
    make.tree["materials"][0]["normalTexture"]["texCoord"] = -1
    make.tree["materials"][0]["normalTexture"]["extensions"] = {}
    (tmp_path / "bad.glb").write_bytes(make.glb())
    with pytest.raises(MeshFileError, match="'texCoord' is -1, not an integer from 0"):
        transfer(tmp_path / "bad.glb", tmp_path / "old.glb", resolution=8)


def test_the_sides_of_a_thin_wall_stay_apart():
    square = np.array(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1e-4], [1, 0, 1e-4], [0, 1, 1e-4]], dtype=float
    )
    tree = TriangleTree(square, np.array([[0, 2, 1], [3, 4, 5]]))
    points = np.tile([0.25, 0.25, 5e-5], (2, 1))
    assert tree.nearest(points, np.array([[0.0, 0, 1], [0.0, 0, -1]]))[0].tolist() == [1, 0]


def test_nearest_triangles_are_those_of_all_pairs():
    rng = np.random.default_rng(1)
    vertices, faces = rng.normal(size=(60, 3)), rng.integers(0, 60, (200, 3))
    points = rng.normal(size=(50, 3))
    on, weights = TriangleTree(vertices, faces).nearest(points)
    distances = np.linalg.norm(np.einsum("qi,qix->qx", weights, vertices[faces[on]]) - points, axis=1)
    nearest = [TriangleTree(vertices, face[None]).nearest(points)[1] @ vertices[face] for face in faces]
    assert np.allclose(distances, np.linalg.norm(np.array(nearest) - points, axis=2).min(axis=0), atol=1e-12)


@pytest.mark.slow
def test_bad_input_is_named(folder, tmp_path):
    plain = tmp_path / "plain.glb"
    plain.write_bytes(model(torus, image=False))
    with pytest.raises(OptionError, match="must have textures or vertex colours, got neither"):
        transfer(plain, folder / "new.glb")
    broken = tmp_path / "broken.glb"
    broken.write_bytes(model(torus).replace(b"\x89PNG", b"\x89GNP"))
    with pytest.raises(MeshFileError, match="image 0 is not a readable image"):
        transfer(broken, folder / "new.glb")
    coneflat.read_mesh(plain)
    (tmp_path / "no_uv.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(MissingUVError):
        transfer(folder / "old.glb", tmp_path / "no_uv.obj")
    with pytest.raises(MeshFileError, match="must have UVs"):
        transfer(tmp_path / "no_uv.obj", folder / "new.glb", texture=tmp_path / "any.png")
    with pytest.raises(OptionError, match="resolution must be an integer from 1 to 16,384, got 1,000,000"):
        transfer(folder / "old.glb", folder / "new.glb", resolution=1_000_000)


def test_the_command_writes_a_model_and_notes(folder, tmp_path):
    done = command(
        "transfer", folder / "old.glb", folder / "new.glb", "-o", "out.glb", "--resolution", 64, cwd=tmp_path
    )
    assert (done.returncode, "wrote out.glb" in done.stdout) == (0, True)
    assert mean_difference(tmp_path / "out.glb") < 8
    done = command("transfer", folder / "old.glb", folder / "new.glb", "-o", "out.obj", cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
