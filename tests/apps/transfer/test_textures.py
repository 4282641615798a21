"""Textures of every format are read as their formats define them: pixel values worked out by hand."""

from __future__ import annotations

from io import BytesIO

import numpy as np
import pytest
from command import command
from gltf_scenes import SceneMaker, opened

import coneflat
from coneflat import errors
from coneflat.apps.transfer import transfer
from coneflat.apps.transfer.sampling import wrapped

Image = pytest.importorskip("PIL.Image")

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
#: Red, green; blue, white: upper row first.
PIXELS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
REPEAT, MIRRORED, CLAMP, NEAREST = 10497, 33648, 33071, 9728
#: The column of an image of two columns at -0.75, -0.25, 0.25, 0.75, 1.25 and 1.75, by the definition of each mode.
COLUMNS = {REPEAT: [0, 1, 0, 1, 0, 1], MIRRORED: [1, 0, 0, 1, 1, 0], CLAMP: [0, 0, 0, 1, 1, 1]}


def png(pixels):
    stream = BytesIO()
    Image.fromarray(np.asarray(pixels)).save(stream, format="PNG")
    return stream.getvalue()


def solid(colour, path):
    path.write_bytes(png(np.full((2, 2, 3), colour, np.uint8)))


def new_square(folder):
    """A square with the whole unit square as its UVs."""
    lines = [f"v {x} {y} {z}" for x, y, z in SQUARE] + [f"vt {x} {y}" for x, y, _ in SQUARE]
    path = folder / "new.obj"
    path.write_text("\n".join([*lines, "f 1/1 2/2 3/3", "f 1/1 3/3 4/4", ""]))
    return path


def two_squares(folder):
    """The squares from 0 to 1 and from 1 to 2, with the left and the right half of the texture."""
    xs, lines = (0, 1, 2), []
    for y in (0, 1):
        lines += [f"v {x} {y} 0\nvt {x / 2} {y}" for x in xs]
    lines += [
        "f 1/1 2/2 5/5 4/4",
        "f 2/2 3/3 6/6 5/5",
    ]
    path = folder / "new.obj"
    path.write_text("\n".join([*lines, ""]))
    return path


def scene(folder, material, uv=SQUARE[:, :2], pixels=PIXELS, sampler=None, name="old.glb", **entries):
    """Write a square with a material, and UVs with v downwards."""
    make = SceneMaker()
    attributes = {"POSITION": make.accessor(SQUARE), "TEXCOORD_0": make.accessor(np.array(uv, float))}
    indices = make.accessor([0, 1, 2, 0, 2, 3], 5125)
    make.tree |= {
        "images": [{"bufferView": make.view(png(pixels)), "mimeType": "image/png"}],
        "samplers": [sampler or {}],
        "textures": [{"source": 0, "sampler": 0}],
        "materials": [material],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": indices, "material": 0}]}],
        **entries,
    }
    path = folder / name
    path.write_bytes(make.glb())
    return path


def base(**properties):
    return {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, **properties}}


def colours(baked):
    return baked.images["baseColorTexture"][..., :3]


class TestWrapModes:
    @pytest.mark.parametrize("u", COLUMNS)
    @pytest.mark.parametrize("v", COLUMNS)
    def test_each_direction_has_the_mode_of_its_sampler(self, tmp_path, u, v):
        """UVs from -1 to 2 over six texels, whose centres are those of pixels."""
        old = scene(
            tmp_path, base(), uv=3 * (SQUARE[:, :2] * [1, -1] + [0, 1]) - 1, sampler={"wrapS": u, "wrapT": v}
        )
        baked = transfer(old, new_square(tmp_path), resolution=6)
        assert np.array_equal(colours(baked), PIXELS[np.ix_(COLUMNS[v], COLUMNS[u])])
        assert baked.notes == ()

    def test_a_mirrored_image_at_five_quarters_shows_three_quarters(self, tmp_path):
        uv = np.array([[1.25, 0.25]] * 4)
        for mode, colour in ((MIRRORED, [0, 255, 0]), (REPEAT, [255, 0, 0])):
            old = scene(tmp_path, base(), uv=uv, sampler={"wrapS": mode})
            assert (colours(transfer(old, new_square(tmp_path), resolution=2)) == colour).all()

    def test_a_filter_without_interpolation_gives_pixels(self, tmp_path):
        old = scene(tmp_path, base(), uv=SQUARE[:, :2] * [1, -1] + [0, 1], sampler={"magFilter": NEAREST})
        pixel_colours = colours(transfer(old, new_square(tmp_path), resolution=8))
        assert np.array_equal(pixel_colours, np.kron(PIXELS, np.ones((4, 4, 1), np.uint8)))
        old = scene(tmp_path, base(), uv=SQUARE[:, :2] * [1, -1] + [0, 1])
        assert not np.array_equal(pixel_colours, colours(transfer(old, new_square(tmp_path), resolution=8)))

    def test_wrapped_pixels(self):
        pixels = np.arange(-7, 8)
        assert wrapped(pixels, 3, MIRRORED).tolist() == [0, 0, 1, 2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0, 1]
        assert wrapped(pixels, 3, REPEAT).tolist() == [2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1]
        assert wrapped(pixels, 3, CLAMP).tolist() == [0] * 8 + [1] + [2] * 6

    @pytest.mark.parametrize("mode", COLUMNS)
    def test_huge_uvs_have_a_colour(self, tmp_path, mode):
        uv = np.full((4, 2), 1e30)
        baked = transfer(
            scene(tmp_path, base(), uv=uv, sampler={"wrapS": mode, "wrapT": mode}),
            new_square(tmp_path),
            resolution=2,
        )
        assert colours(baked).any()


def test_colours_are_baked_into_the_second_set(tmp_path):
    """NEW has its square in the lower left quarter of the second set, v upwards."""
    old = scene(tmp_path, base(), uv=SQUARE[:, :2] * [1, -1] + [0, 1], sampler={"magFilter": NEAREST})
    make = SceneMaker()
    sets = {"TEXCOORD_0": SQUARE[:, :2], "TEXCOORD_1": SQUARE[:, :2] * [0.5, -0.5] + [0, 1]}
    attributes = {"POSITION": make.accessor(SQUARE)}
    attributes |= {name: make.accessor(np.array(uv, float)) for name, uv in sets.items()}
    primitive = {"attributes": attributes, "indices": make.accessor([0, 1, 2, 0, 2, 3], 5125)}
    make.tree |= {"nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}], "meshes": [{"primitives": [primitive]}]}
    target = tmp_path / "new.glb"
    target.write_bytes(make.glb())
    baked = transfer(old, target, resolution=8, uv_set=1)
    assert np.array_equal(colours(baked)[4:, :4], np.kron(PIXELS, np.ones((2, 2, 1), np.uint8)))
    tree = opened(baked.save(tmp_path / "baked.glb").read_bytes())[0]
    assert tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] == 1
    assert {*sets} <= {*tree["meshes"][0]["primitives"][0]["attributes"]}


class TestScenes:
    def test_diffuse_colours_of_specular_glossiness_are_the_base_colour(self, tmp_path):
        """Its factor is linear: a half is 188 in sRGB."""
        extension = {
            "diffuseTexture": {"index": 0},
            "diffuseFactor": [1, 0.5, 1, 1],
            "glossinessFactor": 0.25,
        }
        name = "KHR_materials_pbrSpecularGlossiness"
        old = scene(tmp_path, {"extensions": {name: extension}}, pixels=np.full((2, 2, 3), 255, np.uint8))
        baked = transfer(old, new_square(tmp_path), resolution=2)
        assert (colours(baked) == [255, 188, 255]).all()
        assert baked.material["pbrMetallicRoughness"] == {"metallicFactor": 0.0, "roughnessFactor": 0.75}
        assert any("Specular colours" in note for note in baked.notes)
        # The texture of the fallback is the better one for a metallic-roughness material.
        old = scene(tmp_path, base() | {"extensions": {name: {"diffuseFactor": [0, 0, 0, 1]}}})
        assert colours(transfer(old, new_square(tmp_path), resolution=2)).any()

    def test_the_example_of_the_transform_shows_the_lower_left_quadrant_turned(self, tmp_path):
        """Of the specification of KHR_texture_transform: rotated clockwise by 90 degrees."""
        transform = {"offset": [0, 1], "rotation": np.pi / 2, "scale": [0.5, 0.5]}
        slot = {"index": 0, "extensions": {"KHR_texture_transform": transform}}
        pixels = np.arange(16 * 3, dtype=np.uint8).reshape(4, 4, 3)
        old = scene(
            tmp_path,
            {"pbrMetallicRoughness": {"baseColorTexture": slot}},
            uv=SQUARE[:, :2] * [1, -1] + [0, 1],
            pixels=pixels,
        )
        baked = transfer(old, new_square(tmp_path), resolution=2)
        assert np.array_equal(colours(baked), np.rot90(pixels[2:, :2], -1))
        assert baked.notes == ()

    def test_unlit_materials_stay_unlit(self, tmp_path):
        extensions = {"extensions": {"KHR_materials_unlit": {}}}
        declarations = {
            "extensionsUsed": ["KHR_materials_unlit"],
            "extensionsRequired": ["KHR_materials_unlit"],
        }
        old = scene(tmp_path, base() | extensions, **declarations)
        lit = scene(tmp_path, base(), name="lit.glb")
        for source, target, extensions_used in (
            (old, new_square(tmp_path), ["KHR_materials_unlit"]),
            (old, lit, ["KHR_materials_unlit"]),
            (lit, old, None),
        ):
            out = transfer(source, target, resolution=2).save(tmp_path / "out.glb")
            tree = coneflat.read_mesh(out).scene.data.tree
            assert tree.get("extensionsUsed") == extensions_used
            assert ("extensions" in tree["materials"][0]) == (extensions_used is not None)
            assert set(tree.get("extensionsRequired", ())) <= set(extensions_used or ())

    def test_extensions_that_are_not_baked_are_named_and_not_left_declared(self, tmp_path):
        coat = {"extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 1}}}
        declarations = {"extensionsUsed": ["KHR_materials_clearcoat", "KHR_mesh_quantization"]}
        old = scene(tmp_path, base() | coat, **declarations)
        baked = transfer(old, old, resolution=2)
        assert any("KHR_materials_clearcoat" in note for note in baked.notes)
        tree = coneflat.read_mesh(baked.save(tmp_path / "out.glb")).scene.data.tree
        assert tree["extensionsUsed"] == ["KHR_mesh_quantization"]

    def test_variants_are_named(self, tmp_path):
        variants = {"extensions": {"KHR_materials_variants": {"variants": [{"name": "a"}]}}}
        old = scene(tmp_path, base(), extensionsUsed=["KHR_materials_variants"], **variants)
        baked = transfer(old, old, resolution=2)
        assert any("Variants of materials" in note for note in baked.notes)
        tree = coneflat.read_mesh(baked.save(tmp_path / "out.glb")).scene.data.tree
        assert not {"extensionsUsed", "extensions"} & set(tree)

    def test_a_texture_without_uvs_is_named(self, tmp_path):
        old = scene(tmp_path, {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}}})
        with pytest.raises(errors.MeshFileError, match="must have UVs"):
            transfer(old, new_square(tmp_path), resolution=2)

    @pytest.mark.parametrize(
        "material",
        [
            base(baseColorFactor=[1, 2]),
            base(baseColorFactor="red"),
            {"pbrMetallicRoughness": {"baseColorTexture": {"index": 7}}},
            {"pbrMetallicRoughness": {"baseColorTexture": [0]}},
            {"pbrMetallicRoughness": 3},
            {"extensions": {"KHR_materials_pbrSpecularGlossiness": {"diffuseTexture": 1}}},
            base() | {"emissiveFactor": [1, 2, "x"]},
            {"normalTexture": {"index": 0, "scale": "x"}},
            {
                "normalTexture": {
                    "index": 0,
                    "extensions": {"KHR_texture_transform": {"scale": [1, 2, 3]}},
                }
            },
        ],
    )
    def test_invalid_materials_are_named(self, tmp_path, material):
        with pytest.raises(errors.MeshFileError, match=r"old\.glb"):
            transfer(scene(tmp_path, material), new_square(tmp_path), resolution=2)

    def test_an_image_of_another_format_is_named(self, tmp_path):
        textures = {"textures": [{"extensions": {"KHR_texture_basisu": {"source": 0}}}]}
        with pytest.raises(
            errors.MeshFileError, match="no image of a format that is read .KHR_texture_basisu"
        ):
            transfer(scene(tmp_path, base(), **textures), new_square(tmp_path), resolution=2)

    def test_a_png_names_the_other_images(self, tmp_path):
        old = scene(tmp_path, base() | {"occlusionTexture": {"index": 0}})
        done = command("transfer", old, new_square(tmp_path), "-o", "a.png", "--resolution", 2, cwd=tmp_path)
        assert "note: A .png has the base colour only, not occlusionTexture" in done.stdout


def painted_obj(folder, library, materials=("a", "b"), uv="vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n", colour=""):
    """Write two squares with a material each, both with the whole texture; and their library."""
    vertices = [(0, 0), (1, 0), (1, 1), (0, 1), (2, 0), (2, 1)]
    lines = ["mtllib old.mtl", *(f"v {x} {y} 0{colour}" for x, y in vertices)]
    faces = [f"usemtl {materials[0]}", "f 1/1 2/2 3/3 4/4", f"usemtl {materials[1]}", "f 2/1 5/2 6/3 3/4", ""]
    (folder / "old.obj").write_text("\n".join([*lines, uv + faces[0], *faces[1:]]))
    if library is not None:
        (folder / "old.mtl").write_text(library)
    return folder / "old.obj"


class TestObj:
    def test_each_material_has_its_image_and_colour(self, tmp_path):
        """The diffuse colour is in sRGB, as in most programs, so a half is 128 of 255; names may have blanks."""
        solid([255, 0, 0], tmp_path / "a red.png")
        old = painted_obj(
            tmp_path, "newmtl a\nKd 1 1 1\nmap_Kd a red.png\nnewmtl the b\nKd 0 0.5 1\n", ("a", "the b")
        )
        baked = transfer(old, two_squares(tmp_path), resolution=4)
        assert (colours(baked)[:, :2] == [255, 0, 0]).all()
        assert (colours(baked)[:, 2:] == [0, 128, 255]).all()
        assert baked.notes == ()

    def test_the_image_is_multiplied_by_the_colour(self, tmp_path):
        solid([200, 100, 50], tmp_path / "x.png")
        old = painted_obj(
            tmp_path, "newmtl a\nKd 0.5 0.5 0.5\nmap_Kd x.png\nd 0.25\nnewmtl b\nmap_Kd x.png\n"
        )
        baked = transfer(old, two_squares(tmp_path), resolution=4)
        assert (
            np.abs(colours(baked)[:, :2].astype(int) - [100, 50, 25]).max() <= 5  # sRGB is not quite a power
        )  # sRGB is not quite a power
        assert (baked.images["baseColorTexture"][:, :2, 3] == 64).all()
        assert (colours(baked)[:, 2:] == [200, 100, 50]).all()
        assert baked.material["alphaMode"] == "BLEND"

    @pytest.mark.parametrize(
        ("options", "columns", "rows"),
        [
            ("", [0, 0, 1, 1], [0, 0, 1, 1]),
            ("-s 2 1 1", [0, 1, 0, 1], [0, 0, 1, 1]),
            ("-s 1 2", [0, 0, 1, 1], [0, 1, 0, 1]),
            ("-o 0.5", [1, 1, 0, 0], [0, 0, 1, 1]),
            ("-o 0 0.5 0 -blendu on", [0, 0, 1, 1], [1, 1, 0, 0]),
            ("-clamp on -o 0.5 0 0", [1, 1, 1, 1], [0, 0, 1, 1]),
            # The upper half of the image, and above it its border.
            ("-clamp on -o 0 0.5", [0, 0, 1, 1], [0, 0, 0, 0]),
            ("-s 2 2 -clamp on", [0, 1, 1, 1], [0, 0, 0, 1]),
        ],
    )
    def test_options_of_the_image(self, tmp_path, options, columns, rows):
        """The image at uv * s + o is shown, v upwards; texels are a quarter wide, pixels a half with -s 1."""
        Image.fromarray(np.kron(PIXELS, np.ones((8, 8, 1), np.uint8))).save(tmp_path / "x.png")
        library = f"newmtl a\nmap_Kd {options} x.png\n"
        old = painted_obj(tmp_path, library, ("a", "a"))
        baked = transfer(old, two_squares(tmp_path), resolution=8)
        texels = colours(baked)[:, :4]
        assert np.array_equal(texels[::2], PIXELS[np.ix_(rows, columns)])
        assert baked.notes == ()

    def test_ignored_material_properties_are_named(self, tmp_path):
        solid([255, 0, 0], tmp_path / "x.png")
        library = "newmtl a\nKe 1 0 0\nmap_Kd -mm 0.1 2 x.png\nmap_Bump -bm 2 y.png\nnorm z.png\nnewmtl b\n"
        baked = transfer(painted_obj(tmp_path, library), two_squares(tmp_path), resolution=4)
        assert baked.notes == ("Not read of the material a: ke, -mm of map_Kd, map_bump, norm.",)

    def test_a_black_image_is_named(self, tmp_path):
        solid([255, 255, 255], tmp_path / "x.png")
        old = painted_obj(tmp_path, "newmtl a\nKd 0 0 0\nmap_Kd x.png\n", ("a", "a"))
        baked = transfer(old, two_squares(tmp_path), resolution=4)
        assert baked.notes == ("The material a is black (Kd 0 0 0), and so is its image x.png.",)
        assert not colours(baked).any()

    def test_missing_libraries_and_materials_are_named(self, tmp_path):
        target = two_squares(tmp_path)
        with pytest.raises(errors.OptionError, match=r"got neither.*old\.mtl: there is no such file"):
            transfer(painted_obj(tmp_path, None), target, resolution=4)
        baked = transfer(painted_obj(tmp_path, None, colour=" 1 0 0"), target, resolution=4)
        assert (colours(baked) == [255, 0, 0]).all()
        assert "there is no such file" in baked.notes[0]
        baked = transfer(painted_obj(tmp_path, "newmtl a\nKd 1 0 0\n"), target, resolution=4)
        assert baked.notes == ("Materials that are in no library are white: b.",)
        assert (colours(baked)[:, 2:] == 255).all()

    def test_materials_of_the_target_are_not_read(self, tmp_path):
        """They are replaced, so it does not matter that their library is missing."""
        solid([255, 0, 0], tmp_path / "x.png")
        target = two_squares(tmp_path)
        lines = (
            target.read_text()
            .replace("f 1/1", "mtllib none.mtl\nusemtl a\nf 1/1")
            .replace("f 2/2", "usemtl b\nf 2/2")
        )
        target.write_text(lines)
        old = painted_obj(tmp_path, "newmtl a\nmap_Kd x.png\n", ("a", "a"))
        assert transfer(old, target, resolution=4).notes == ()

    @pytest.mark.parametrize(
        ("library", "message"),
        [
            ("Kd 1 x 1", "kd in line 2 (could not convert"),
            ("Kd nan 1 1", "kd in line 2 (nan is not a finite number)"),
            ("map_Kd -s 1 1", "map_kd in line 2 (there is no file name)"),
            ("d 0.5 y", "d in line 2 ("),
            ("Tr", "tr in line 2 ("),
            ("Ke spectral x.rfl", "ke in line 2 ("),
        ],
    )
    def test_lines_that_cannot_be_read_are_named(self, tmp_path, library, message):
        old = painted_obj(tmp_path, f"newmtl a\n{library}\nnewmtl b\nKd 1 0 0\n")
        baked = transfer(old, two_squares(tmp_path), resolution=4)
        assert any(
            note.startswith("Not read of the material a: ") and message in note for note in baked.notes
        )

    def test_missing_images_are_named(self, tmp_path):
        with pytest.raises(errors.MeshFileError, match=r"missing\.png: there is no such file"):
            transfer(
                painted_obj(tmp_path, "newmtl a\nmap_Kd missing.png\n"), two_squares(tmp_path), resolution=4
            )

    def test_vertex_colours_and_missing_uvs(self, tmp_path):
        """A scan has the same colours at vertices and in its image, which are not multiplied."""
        solid([200, 100, 50], tmp_path / "x.png")
        old = painted_obj(tmp_path, "newmtl a\nmap_Kd x.png\nnewmtl b\n", colour=" 0 1 0")
        baked = transfer(old, two_squares(tmp_path), resolution=4)
        assert (colours(baked)[:, :2] == [200, 100, 50]).all()
        assert (colours(baked)[:, 2:] == [0, 255, 0]).all()
        assert baked.notes == ("Vertex colours of old.obj are left out where it has a texture.",)
        old = painted_obj(tmp_path, "newmtl a\nKd 0 0 1\nmap_Kd x.png\n", ("a", "a"))
        old.write_text(old.read_text().replace("f 2/1 5/2 6/3 3/4", "f 2 5 6 3"))
        with pytest.warns(
            coneflat.GuaranteeWarning, match="2 triangles of old.obj without UVs for a texture"
        ):
            baked = transfer(old, two_squares(tmp_path), resolution=4)
        assert (colours(baked)[:, 2:] == [0, 0, 255]).all()


HEADER = "ply\nformat {form} 1.0\ncomment VCGLIB generated\n{images}element vertex 6\n"
HEADER += "property float x\nproperty float y\nproperty float z\n{colour}"
HEADER += "element face 2\nproperty list uchar int vertex_indices\n"
HEADER += "property list uchar float texcoord\n{number}end_header\n"
CORNERS = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0]]
FACES = [[0, 1, 2, 3], [1, 4, 5, 2]]
SHADES = ("red", "green", "blue", "alpha")
FULL_SQUARE = [0, 0, 1, 0, 1, 1, 0, 1]


def painted_ply(folder, images, numbers=None, form="ascii", colour=None):
    header = HEADER.format(
        form=form,
        images="".join(f"comment TextureFile {name}\n" for name in images),
        colour=""
        if colour is None
        else "".join(f"property uchar {name}\n" for name in ("red", "green", "blue", "alpha")),
        number="" if numbers is None else "property int texnumber\n",
    )
    path = folder / "old.ply"
    shades = [] if colour is None else list(colour)
    numbers_of = [[]] * 2 if numbers is None else [[number] for number in numbers]
    if form == "ascii":
        rows = [[*corner, *shades] for corner in CORNERS]
        rows += [[4, *face, 8, *FULL_SQUARE, *number] for face, number in zip(FACES, numbers_of, strict=True)]
        path.write_text(header + "\n".join(" ".join(map(str, row)) for row in rows) + "\n")
        return path
    order = ">" if "big" in form else "<"
    body = b"".join(np.array(corner, f"{order}f4").tobytes() + bytes(shades) for corner in CORNERS)
    for face, number in zip(FACES, numbers_of, strict=True):
        body += (
            b"\4"
            + np.array(face, f"{order}i4").tobytes()
            + b"\x08"
            + np.array(FULL_SQUARE, f"{order}f4").tobytes()
        )
        body += np.array(number, f"{order}i4").tobytes()
    path.write_bytes(header.encode() + body)
    return path


class TestPly:
    @pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
    def test_faces_have_the_image_of_their_number(self, tmp_path, form):
        for name, colour in (("a.png", [255, 0, 0]), ("the b.png", [0, 0, 255])):
            solid(colour, tmp_path / name)
        old = painted_ply(tmp_path, ["a.png", "the b.png"], [1, 0], form)
        baked = transfer(old, two_squares(tmp_path), resolution=4)
        assert (colours(baked)[:, :2] == [0, 0, 255]).all()
        assert (colours(baked)[:, 2:] == [255, 0, 0]).all()
        assert baked.notes == ()

    def test_a_single_image_needs_no_number(self, tmp_path):
        """The grey of vertices is what MeshLab writes for a mesh without colours."""
        Image.fromarray(np.kron(PIXELS, np.ones((8, 8, 1), np.uint8))).save(tmp_path / "a.png")
        old = painted_ply(tmp_path, ["a.png"], colour=[192, 192, 192, 255])
        baked = transfer(old, two_squares(tmp_path), resolution=4)
        assert np.array_equal(colours(baked)[[0, 3], :2], PIXELS)
        assert baked.notes == ("Vertex colours of old.ply are left out where it has a texture.",)

    def test_other_numbers_have_no_image(self, tmp_path):
        solid([255, 0, 0], tmp_path / "a.png")
        baked = transfer(painted_ply(tmp_path, ["a.png"], [0, -1]), two_squares(tmp_path), resolution=4)
        assert (colours(baked)[:, 2:] == 255).all()
        assert baked.notes == ()
        baked = transfer(
            painted_ply(tmp_path, ["a.png", "b.png"], [0, 2]), two_squares(tmp_path), resolution=4
        )
        assert "1 face" in baked.notes[0]
        assert "b.png" in baked.notes[1]

    def test_transparent_vertex_colours(self, tmp_path):
        old = painted_ply(tmp_path, [], colour=[255, 128, 0, 128])
        baked = transfer(old, two_squares(tmp_path), resolution=4)
        assert (baked.images["baseColorTexture"] == [255, 128, 0, 128]).all()
        assert baked.material["alphaMode"] == "BLEND"


class TestImages:
    @pytest.mark.parametrize(
        ("ending", "kind"), [("png", np.uint16), ("tif", np.uint16), ("tif", np.float32)]
    )
    def test_greys_of_more_than_8_bits_are_converted_by_their_range(self, tmp_path, ending, kind):
        """A value of 65,535 is white, and 257 k is k."""
        steps = np.array([[0, 1, 128, 255]] * 2)
        grey = (257 * steps).astype(np.uint16) if kind is np.uint16 else (steps / 255).astype(np.float32)
        Image.fromarray(grey).save(tmp_path / f"x.{ending}")
        old = scene(tmp_path, base(), uv=SQUARE[:, :2] * [1, -1] + [0, 1])
        baked = transfer(old, new_square(tmp_path), resolution=4, texture=tmp_path / f"x.{ending}")
        assert np.array_equal(colours(baked)[0], np.repeat(steps[0][:, None], 3, axis=1))

    @pytest.mark.parametrize("mode", ["1", "L", "LA", "P", "RGB", "RGBA", "CMYK", "I;16", "I", "F"])
    def test_white_is_white_and_black_black_in_every_mode(self, tmp_path, mode):
        old, target = scene(tmp_path, base(), uv=SQUARE[:, :2] * [1, -1] + [0, 1]), new_square(tmp_path)
        whites = {"I;16": np.uint16(65535), "I": np.int32(65535), "F": np.float32(1)}
        for shade in (0, 255):
            if mode in whites:
                image = Image.fromarray(np.full((2, 2), whites[mode] * (shade > 0), whites[mode].dtype))
            else:
                image = Image.new("L", (2, 2), shade).convert(mode)
            assert image.mode == mode
            image.save(tmp_path / "x.tif")
            baked = transfer(old, target, resolution=2, texture=tmp_path / "x.tif")
            assert (colours(baked) == shade).all()


class TestModels:
    def test_a_model_of_one_point_is_refused(self, tmp_path):
        old = tmp_path / "point.obj"
        old.write_text("v 1 1 1 1 0 0\n" * 3 + "f 1 2 3\n")
        with pytest.raises(errors.OptionError, match="all points of .*point.obj are at one position"):
            transfer(old, new_square(tmp_path), resolution=2)
        done = command("transfer", old, new_square(tmp_path), "-o", "a.png", cwd=tmp_path)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)

    @pytest.mark.parametrize("size", [1e-200, 1e-30, 1e30, 1e200])
    def test_any_size_has_the_same_colours(self, tmp_path, size):
        lines = [f"v {size * x} {size * y} 0 {x} {y} 0" for x, y, _ in SQUARE]
        (tmp_path / "old.obj").write_text("\n".join([*lines, "f 1 2 3", "f 1 3 4", ""]))
        points = [f"v {size * x} {size * y} 0" for x, y, _ in SQUARE] + [f"vt {x} {y}" for x, y, _ in SQUARE]
        (tmp_path / "new.obj").write_text("\n".join([*points, "f 1/1 2/2 3/3", "f 1/1 3/3 4/4", ""]))
        baked = transfer(tmp_path / "old.obj", tmp_path / "new.obj", resolution=4)
        assert colours(baked)[0, 3].min() == 0
        assert colours(baked)[0, 3, :2].min() > 200
        assert baked.notes == ()

    def test_positions_that_are_not_finite_are_named(self, tmp_path):
        (tmp_path / "old.obj").write_text("v 0 0 0 1 0 0\nv 1 0 nan 1 0 0\nv 0 1 0 1 0 0\nf 1 2 3\n")
        with pytest.raises(errors.NonFiniteError, match=r"old\.obj has positions that are NaN"):
            transfer(tmp_path / "old.obj", new_square(tmp_path), resolution=2)
