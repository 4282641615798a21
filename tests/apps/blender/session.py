"""Sessions in Blender, without a window: `python session.py NAME EXTENSION` runs one of the functions below.

The settings of Blender are in the folder BLENDER_USER_RESOURCES. CONEFLAT_PYTHON runs coneflat, by default this Python.
Each session has a process of its own, since bpy cannot be reset, and hangs at the exit of Python once a class is
registered.
"""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
import time
import traceback
from io import StringIO
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np

NAME = "bl_ext.user_default.coneflat"


def module(name):
    return importlib.import_module(f"{NAME}.{name}")


def start(extension):
    """Install the extension, and empty the scene."""
    bpy.ops.wm.read_factory_settings()
    bpy.ops.extensions.package_install_files(repo="user_default", filepath=extension, enable_on_install=True)
    preferences().python = os.environ.get("CONEFLAT_PYTHON", sys.executable)
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)


def preferences():
    return bpy.context.preferences.addons[NAME].preferences


def settings():
    return bpy.context.scene.coneflat


def add(kind, name, **properties):
    getattr(bpy.ops.mesh, f"primitive_{kind}_add")(**properties)
    bpy.context.object.name = name
    return bpy.context.object


def select(*items):
    for item in bpy.data.objects:
        item.select_set(item in items)
    bpy.context.view_layer.objects.active = items[0] if items else None


def run(command, **properties):
    """Run an operator, and return what it reports, one line each."""
    out = StringIO()
    descriptor = os.dup(1)
    path = Path(os.environ["BLENDER_USER_RESOURCES"]) / "reports"
    with path.open("w") as file:
        os.dup2(file.fileno(), 1)
        try:
            getattr(bpy.ops.coneflat, command)("EXEC_DEFAULT", True, **properties)
        except RuntimeError as error:
            out.write(str(error))
        finally:
            sys.stdout.flush()
            os.dup2(descriptor, 1)
            os.close(descriptor)
    return path.read_text() + out.getvalue()


def values(rows, name, width=1, kind=np.float32):
    flat = np.empty(len(rows) * width, kind)
    rows.foreach_get(name, flat)
    return flat.reshape(-1, width) if width > 1 else flat


def uv_of(mesh):
    return values(mesh.uv_layers.active.data, "uv", 2)


def flags(mesh, name="use_seam"):
    return values(mesh.edges, name, kind=bool)


def torn_edges(mesh):
    """Return (e,) whether the UVs of an edge differ on its two sides."""
    uv, torn = uv_of(mesh), np.zeros(len(mesh.edges), bool)
    seen = {}
    for polygon in mesh.polygons:
        loops = list(polygon.loop_indices)
        for loop, next_loop in zip(loops, loops[1:] + loops[:1], strict=True):
            ends = {
                mesh.loops[loop].vertex_index: uv[loop],
                mesh.loops[next_loop].vertex_index: uv[next_loop],
            }
            edge = mesh.loops[loop].edge_index
            first_ends = seen.setdefault(edge, ends)
            torn[edge] |= any((first_ends[v] != ends[v]).any() for v in ends)
    return torn


def areas(item):
    """Return the areas of the triangles of an object in the scene and in the plane."""
    mesh = item.data
    mesh.calc_loop_triangles()
    loops = values(mesh.loop_triangles, "loops", 3, np.int32)
    corners = values(mesh.loops, "vertex_index", kind=np.int32)[loops]
    frame = np.array(item.matrix_world)[:3, :3]
    a, b, c = (values(mesh.vertices, "co", 3) @ frame.T)[corners].transpose(1, 0, 2)
    p, q, r = uv_of(mesh).astype(float)[loops].transpose(1, 0, 2)
    u, v = (q - p).T, (r - p).T
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2, (u[0] * v[1] - u[1] * v[0]) / 2


def three_objects():
    """Three objects, one mirrored and one with marked seams, in one atlas of one density; undo removes it."""
    tube = add("cylinder", "tube", vertices=24, location=(3, 0, 0))
    ring = add("torus", "ring", major_segments=24, minor_segments=12, location=(0, 3, 0))
    ball = add("uv_sphere", "ball", segments=16, ring_count=8, scale=(-2, 1, 1))
    caps = [edge for polygon in tube.data.polygons if len(polygon.vertices) > 4 for edge in polygon.edge_keys]
    for edge in tube.data.edges:
        edge.use_seam = edge.key in caps
    for item in (tube, ring, ball):
        while item.data.uv_layers:
            item.data.uv_layers.remove(item.data.uv_layers[0])
    marked = flags(tube.data)
    select(tube, ring, ball)
    bpy.ops.ed.undo_push(message="before")
    lines = run("unwrap")
    assert "ball, ring, tube: charts" in lines, lines
    items = [bpy.data.objects[name] for name in ("tube", "ring", "ball")]
    densities = []
    for item in items:
        mesh = item.data
        assert ((uv_of(mesh) >= 0) & (uv_of(mesh) <= 1)).all()
        assert (torn_edges(mesh) == flags(mesh)).all()
        area, flat = areas(item)
        assert (flat > 0).all()
        densities.append(flat.sum() / area.sum())
    # The energy of each component is about that of an isometry, so densities can differ by a few per cent.
    assert max(densities) < 1.1 * min(densities), densities
    mesh = bpy.data.objects["tube"].data
    assert flags(mesh)[marked].all()
    assert not module("meshes").own_seams(mesh)[marked].any()
    bpy.ops.ed.undo()
    mesh = bpy.data.objects["tube"].data
    assert (flags(mesh) == marked).all()
    assert len(mesh.uv_layers) == 0


def again():
    """Seams that coneflat has marked do not constrain the next run, which gives the same UVs; those of a user do."""
    ring = add("torus", "ring", major_segments=24, minor_segments=12)
    run("unwrap")
    first, seams = uv_of(ring.data), flags(ring.data)
    run("unwrap")
    assert (uv_of(ring.data) == first).all()
    assert (flags(ring.data) == seams).all()
    settings().unwrap.max_energy = 4.02
    run("unwrap")
    assert not (flags(ring.data) == seams).all()
    settings().marks = "ALL"
    settings().unwrap.max_energy = 4.1
    seams = flags(ring.data)
    run("unwrap")
    assert flags(ring.data)[seams].all()


def maps_of(mesh):
    """Return the UVs of each UV map of a mesh, by name."""
    return {layer.name: values(layer.data, "uv", 2) for layer in mesh.uv_layers}


def lightmaps():
    """A lightmap is a UV map after that of the textures, which materials still use."""
    ball, bare = add("uv_sphere", "ball", segments=16, ring_count=8), add("cube", "bare", location=(5, 0, 0))
    bare.data.uv_layers.remove(bare.data.uv_layers[0])
    before = maps_of(ball.data)["UVMap"]
    settings().unwrap.lightmap = 256
    select(ball, bare)
    run("unwrap")
    for mesh in (ball.data, bare.data):
        assert list(maps_of(mesh)) == ["UVMap", "Lightmap"]
        assert mesh.uv_layers["UVMap"].active_render
        assert mesh.uv_layers.active.name == "Lightmap"
    assert (maps_of(ball.data)["UVMap"] == before).all()
    assert (maps_of(bare.data)["UVMap"] == maps_of(bare.data)["Lightmap"]).all()
    low = np.concatenate([maps_of(mesh)["Lightmap"] for mesh in (ball.data, bare.data)]).min(axis=0) * 256
    assert (np.abs(low - 4 * np.round(low / 4)) < 1e-3).all(), low
    settings().unwrap.stack = "copies"
    assert "lightmap and stack copies cannot be combined" in run("unwrap")


def second_uv_set():
    """A GLB with two UV sets has two UV maps, and its image the first one."""
    folder = Path(os.environ["BLENDER_USER_RESOURCES"])
    python = os.environ.get("CONEFLAT_PYTHON", sys.executable)
    ball = add("uv_sphere", "ball", segments=16, ring_count=8)
    bpy.ops.wm.obj_export(filepath=str(folder / "ball.obj"), export_materials=False)
    bpy.data.objects.remove(ball)
    for arguments in (
        ("ball.obj", "-o", "textured.glb", "--texture", "checker"),
        ("textured.glb", "-o", "lightmap.glb", "--lightmap", "256"),
    ):
        subprocess.run([python, "-m", "coneflat", "unwrap", *arguments], cwd=folder, check=True)
    maps = []
    for name in ("textured", "lightmap"):
        bpy.ops.import_scene.gltf(filepath=str(folder / f"{name}.glb"))
        (item,) = bpy.context.selected_objects
        corners = values(item.data.loops, "vertex_index", kind=np.int32)
        points = values(item.data.vertices, "co", 3)[corners]
        uvs = maps_of(item.data)
        maps.append({tuple(np.round([*p, *uv], 5)) for p, uv in zip(points, uvs["UVMap"], strict=True)})
        (material,) = item.data.materials
        kinds = [node.type for node in material.node_tree.nodes]
        assert "TEX_IMAGE" in kinds
        named = [node.uv_map for node in material.node_tree.nodes if node.type == "UVMAP"]
        assert set(named) <= {"UVMap"}
    assert list(uvs) == ["UVMap", "UVMap.001"]
    assert maps[0] == maps[1]
    assert item.data.uv_layers["UVMap"].active_render
    first, second = uvs.values()
    assert not (first == second).all()
    assert ((second > 0) & (second < 1)).all()


def selected_faces():
    """In edit mode only the selected faces get UVs and seams; cones are selected."""
    ball = add("uv_sphere", "ball", segments=16, ring_count=8)
    before = uv_of(ball.data).copy()
    chosen = [polygon.index for polygon in ball.data.polygons if polygon.center.z > -0.5]
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    bpy.ops.object.mode_set(mode="OBJECT")
    for i in chosen:
        ball.data.polygons[i].select = True
    bpy.ops.object.mode_set(mode="EDIT")
    settings().select = "CONES"
    settings().flatten.cone_count = 3
    lines = run("flatten")
    assert bpy.context.mode == "EDIT_MESH"
    assert "cones 3" in lines, lines
    bpy.ops.object.mode_set(mode="OBJECT")
    mesh = ball.data
    is_chosen = np.zeros(len(mesh.loops), bool)
    for i in chosen:
        is_chosen[mesh.polygons[i].loop_indices] = True
    assert (uv_of(mesh)[~is_chosen] == before[~is_chosen]).all()
    assert (uv_of(mesh)[is_chosen] != before[is_chosen]).any()
    assert sum(vertex.select for vertex in mesh.vertices) == 3
    inside = {key for i in chosen for key in mesh.polygons[i].edge_keys}
    assert all(edge.key in inside for edge in mesh.edges if edge.use_seam)
    for polygon in mesh.polygons:
        polygon.select = False
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    assert "Error: no faces are selected" in run("unwrap")


def sharp_edges():
    """Marked sharp edges are cut on request: all edges of a cube give six squares."""
    cube = add("cube", "cube")
    for edge in cube.data.edges:
        edge.use_edge_sharp = True
    settings().sharp = True
    lines = run("flatten")
    assert "charts 6" in lines, lines
    assert flags(cube.data).all()
    area, flat = areas(cube)
    assert np.allclose(flat / area, flat.sum() / area.sum(), rtol=1e-5)


def vertex_groups():
    """Weights of a vertex group lower the area distortion there; a group that does not exist is an error."""
    ball = add("uv_sphere", "ball", segments=32, ring_count=16, scale=(1, 1, 3))
    group = ball.vertex_groups.new(name="face")
    group.add([v.index for v in ball.data.vertices if v.co.z > 0.5], 1.0, "REPLACE")
    at = [p.index for p in ball.data.polygons if p.center.z > 0.6]
    spreads = []
    for name in ("", "face"):
        settings().flatten.weights, settings().flatten.cone_count = name, 4
        lines = run("flatten")
        assert "cones 4" in lines, lines
        area, flat = areas(ball)
        ratio = np.log(flat / area)[np.isin([t.polygon_index for t in ball.data.loop_triangles], at)]
        spreads.append(ratio.std())
    assert spreads[1] < spreads[0]
    settings().flatten.weights = "nose"
    assert "Error: there is no vertex group 'nose' in ball" in run("flatten")


def quads():
    """Quads are a new object on the surface of the old one, with its modifiers and its place."""
    ring = add(
        "torus", "ring", major_segments=24, minor_segments=12, location=(1, 2, 3), rotation=(0.3, 0.2, 0.1)
    )
    ring.scale = (-1, 2, 1)
    ring.modifiers.new("fine", "SUBSURF").levels = 1
    bpy.context.view_layer.update()
    settings().quads.quads = 400
    settings().select = "CONES"
    lines = run("quads")
    assert "ring: modifiers fine are applied" in lines, lines
    made = bpy.context.object
    assert made.name == "ring_quads"
    assert (ring.hide_get(), ring.select_get(), made.hide_get(), made.select_get()) == (
        True,
        False,
        False,
        True,
    )
    mesh = made.data
    assert {len(polygon.vertices) for polygon in mesh.polygons} == {4}
    assert len(mesh.vertices) - len(mesh.edges) + len(mesh.polygons) == 0
    degrees = np.bincount(np.ravel([edge.vertices for edge in mesh.edges]))
    assert [vertex.select for vertex in mesh.vertices] == (degrees != 4).tolist()
    smooth = ring.evaluated_get(bpy.context.evaluated_depsgraph_get())
    for vertex in mesh.vertices:
        _, point, _, _ = smooth.closest_point_on_mesh(vertex.co)
        assert (point - vertex.co).length < 0.02
    bpy.context.view_layer.update()
    assert np.allclose(made.matrix_world, ring.matrix_world, atol=1e-5)
    normals = [smooth.closest_point_on_mesh(p.center)[2].dot(p.normal) for p in mesh.polygons]
    assert min(normals) > 0


def unapplied():
    """Modifiers and shape keys are named: the map is of the mesh itself and of the basis."""
    cube = add("cube", "cube")
    cube.modifiers.new("fine", "SUBSURF")
    cube.shape_key_add(name="Basis")
    cube.shape_key_add(name="long").data[0].co.z = 50
    cube.data.shape_keys.key_blocks["long"].value = 1
    lines = run("unwrap")
    assert "cube: modifiers fine are not applied; of the shape keys, the basis is used" in lines, lines
    area, flat = areas(cube)
    assert np.allclose(flat / area, flat.sum() / area.sum(), rtol=1e-5)


def failures():
    """Every failure is one line, and changes nothing."""
    assert "Error: no mesh object is selected" in run("unwrap")
    cube = add("cube", "cube")
    empty = bpy.data.objects.new("empty", bpy.data.meshes.new("empty"))
    bpy.context.collection.objects.link(empty)
    select(empty)
    assert "Error: the selected objects have no faces" in run("unwrap")
    select(cube)
    cube.scale.x = 0
    bpy.context.view_layer.update()
    assert "Error: cube has a scale of 0" in run("unwrap")
    cube.scale.x = 1
    bpy.context.view_layer.update()
    settings().unwrap.max_energy = 3.5
    assert "Error: Unwrap: max_energy must be above 4" in run("unwrap")
    settings().unwrap.max_energy = 4.1
    while len(cube.data.uv_layers) < 8:
        cube.data.uv_layers.new()
    settings().uv_map = "ninth"
    assert "Error: cube has 8 UV maps, and ninth cannot be added" in run("unwrap")
    settings().uv_map = ""
    operators = module("operators")
    operators.OLDEST = "99.1"
    assert "Error: Blender 99.1 or later is needed, this is " in run("unwrap")
    operators.OLDEST = "4.2"
    preferences().python = "/missing/python"
    assert "Error: /missing/python does not run coneflat: No such file" in run("unwrap")
    preferences().python = ""
    os.environ["PATH"] = ""
    named = "in the preferences of the extension, name a Python that has coneflat, or a folder of wheels"
    assert f"Error: coneflat is not installed: {named}" in run("unwrap")
    preferences().requirement = "coneflat"
    assert f"Error: online access is off: allow it; or, {named}" in run("unwrap")
    preferences().wheels = os.environ["BLENDER_USER_RESOURCES"]
    os.environ.pop("PYTHONPATH")  # With a coneflat there, pip has nothing to do.
    lines = run("install")
    assert "Error: install coneflat: No matching distribution found for coneflat" in lines, lines
    assert not flags(cube.data).any()


def all_or_none():
    """A failure at the second of two objects, which each have a map of their own, leaves both as they were."""
    items = [add("cube", "first"), add("cube", "second", location=(3, 0, 0))]
    before = [uv_of(item.data).copy() for item in items]
    select(*items)
    settings().together = False
    exchange, read = module("exchange"), module("exchange").read_maps

    def unreadable(folder, parts):
        if parts[0].name == "second":
            (folder / exchange.RESULT).unlink()
        return read(folder, parts)

    def changed(folder, parts):
        items[1].data.vertices.add(1)
        return read(folder, parts)

    for fails, message in (
        (unreadable, "cannot be read"),
        (changed, "second has changed while coneflat was running"),
    ):
        exchange.read_maps = fails
        lines = run("unwrap")
        assert message in lines, lines
        for item, uv in zip(items, before, strict=True):
            assert (uv_of(item.data) == uv).all()
            assert not flags(item.data).any()
    exchange.read_maps = read
    assert "second: charts" in run("unwrap")
    assert all(flags(item.data).any() for item in items)


def disable():
    """The extension can be disabled and enabled; settings of the scene remain."""
    settings().unwrap.resolution = 512
    bpy.ops.preferences.addon_disable(module=NAME)
    assert not hasattr(bpy.context.scene, "coneflat")
    assert not hasattr(bpy.types, "CONEFLAT_OT_unwrap")
    bpy.ops.preferences.addon_enable(module=NAME)
    assert settings().unwrap.resolution == 512


def edited_together():
    """Objects that are edited together share an atlas and stay in edit mode; of two with one mesh, one is used."""
    ring, ball = add("torus", "ring"), add("uv_sphere", "ball", location=(3, 0, 0))
    select(ring, ball)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    settings().select = "SEAMS"
    assert "ball, ring: charts" in run("unwrap")
    assert {item.name for item in bpy.context.objects_in_mode} == {"ball", "ring"}
    assert tuple(bpy.context.tool_settings.mesh_select_mode) == (False, True, False)
    bpy.ops.object.mode_set(mode="OBJECT")
    for item in (ring, ball):
        assert (flags(item.data, "select") == flags(item.data)).all()
    twin = bpy.data.objects.new("twin", ring.data)
    bpy.context.collection.objects.link(twin)
    select(ring, ball, twin)
    settings().together = False
    lines = run("unwrap")
    assert [line.split()[1] for line in lines.splitlines() if "charts" in line] == ["ball:", "ring:"], lines


def vertex_lists():
    """A vertex group keeps seams away, or has the cones; also for one of several objects, and with sizes of quads."""
    ball = add("uv_sphere", "ball", segments=32, ring_count=16)
    add("cube", "cube", location=(3, 0, 0))
    select(ball, bpy.data.objects["cube"])
    group = ball.vertex_groups.new(name="face")
    front = [vertex.index for vertex in ball.data.vertices if vertex.co.y < -0.2]
    group.add(front, 1.0, "REPLACE")
    group.add([vertex.index for vertex in ball.data.vertices if vertex.co.y >= -0.2], 0.3, "REPLACE")
    settings().unwrap.no_seams = "face"
    assert "ball, cube: charts" in run("unwrap")
    assert not any(edge.use_seam and set(edge.vertices) <= set(front) for edge in ball.data.edges)
    cones = ball.vertex_groups.new(name="cones")
    cones.add([5, 40, 70, 200], 1.0, "REPLACE")
    select(ball)
    settings().select, settings().flatten.required_cones, settings().flatten.cone_count = "CONES", "cones", 4
    assert "cones 4" in run("flatten")
    assert [vertex.index for vertex in ball.data.vertices if vertex.select] == [5, 40, 70, 200]
    ball.vertex_groups.new(name="nobody")
    settings().flatten.required_cones = "nobody"
    assert "Error: the vertex group 'nobody' has no vertices of the chosen faces of ball" in run("flatten")
    coarse = ball.vertex_groups.new(name="coarse")
    coarse.add([vertex.index for vertex in ball.data.vertices if vertex.co.z > 0], 0.2, "REPLACE")
    settings().quads.size, settings().quads.quads = "coarse", 500
    run("quads")
    lengths = [(polygon.center.z > 0, polygon.area**0.5) for polygon in bpy.context.object.data.polygons]
    upper, lower = ([length for is_upper, length in lengths if is_upper == side] for side in (True, False))
    assert np.median(upper) > 1.5 * np.median(lower)
    ball.hide_set(False)
    select(ball)
    settings().quads.size = "nose"
    assert "Error: there is no vertex group 'nose' in ball" in run("quads")


def mirrored():
    """The two halves of a mirrored model share their texels; and without further seams only marked ones are cut."""
    wing = add("grid", "wing", x_subdivisions=8, y_subdivisions=6)
    for vertex in wing.data.vertices:
        vertex.co.x, vertex.co.z = vertex.co.x + 1, np.sin(3 * vertex.co.x + vertex.co.y) / 3
    wing.modifiers.new("two", "MIRROR")
    bpy.ops.object.modifier_apply(modifier="two")
    settings().unwrap.stack = "mirrored"
    lines = run("unwrap")
    assert "The two halves share their texels" in lines, lines
    places, counts = np.unique(np.round(uv_of(wing.data), 5), axis=0, return_counts=True)
    assert (counts % 2 == 0).all()
    assert len(places) == 9 * 7
    ring = add("torus", "ring", major_segments=24, minor_segments=12)
    settings().unwrap.stack, settings().unwrap.seams = "none", "none"
    for edge in ring.data.edges:
        edge.use_seam = all(vertex % 12 == 0 for vertex in edge.vertices)
    assert "ring: charts 1, cones 0" in run("unwrap")
    settings().unwrap.charts = "4"
    assert "ring: charts 4" in run("unwrap")
    settings().unwrap.charts = "some"
    assert "Error: Unwrap: charts must be atlas, one or an integer" in run("unwrap")


class Layout:
    """Stands for the layout of a panel, which Blender gives in windows only; it notes what is drawn."""

    def __init__(self, drawn):
        self.drawn = drawn

    def prop(self, owner, name, **_):
        assert name in owner.bl_rna.properties
        self.drawn.append(name)

    def prop_search(self, owner, name, where, collection):
        assert collection in where.bl_rna.properties
        self.prop(owner, name)

    def operator(self, name):
        self.drawn.append(name)

    def label(self, **_):
        pass

    def row(self):
        return self

    def panel(self, idname, default_closed=False):
        assert {"idname", "default_closed"} <= set(
            bpy.types.UILayout.bl_rna.functions["panel"].parameters.keys()
        )
        return self, self


def panels():
    """The panels draw every option once, in the sidebars of both editors; the preferences have their rows."""
    add("cube", "cube")
    expected_commands = module("settings").COMMANDS
    for panel in importlib.import_module(NAME).PANELS:
        drawn = []
        panel.draw(SimpleNamespace(layout=Layout(drawn)), bpy.context)
        assert len(set(drawn)) == len(drawn)
        command = panel.__name__.rpartition("_")[2]
        expected = {f"coneflat.{command}", *(record["name"] for record in expected_commands.get(command, ()))}
        assert command == "coneflat" or expected <= set(drawn) <= expected | {"modifiers"}
    drawn = []
    expected_commands = {
        "environment": None,
        "reason": "",
        "layout": Layout(drawn),
        "bl_rna": preferences().bl_rna,
    }
    module("settings").Preferences.draw(type("Shown", (), expected_commands)(), bpy.context)
    assert drawn == ["python", "wheels", "requirement", "coneflat.check", "coneflat.install"]
    properties = settings().unwrap.bl_rna.properties
    assert {"seams", "charts", "area", "stack", "threads"} <= set(properties.keys())
    assert [word.identifier for word in properties["seams"].enum_items] == ["automatic", "none"]


class Manager:
    """Stands for the window manager, which has no events without a window."""

    def __getattr__(self, name):
        return lambda *_, **__: None


def escape():
    """A mesh of 100,000 triangles: the operator gives progress, Esc ends the process, and nothing has changed."""
    ball = add("uv_sphere", "ball", segments=256, ring_count=197)
    assert len(ball.data.polygons) > 50_000
    before = uv_of(ball.data)
    operators, lines = module("operators"), []

    class Unwrap(operators.Command):
        command, title = "unwrap", "Unwrap"

        def report(self, _, text):
            lines.append(text)

    context = SimpleNamespace(
        **{name: getattr(bpy.context, name) for name in ("mode", "selected_objects", "scene", "preferences")},
        **dict.fromkeys(("window", "workspace", "screen")),
        window_manager=Manager(),
    )
    operator = Unwrap()
    event = SimpleNamespace(type="TIMER")
    assert operator.invoke(context, event) == {"RUNNING_MODAL"}
    assert operator.modal(context, SimpleNamespace(type="A")) == {"RUNNING_MODAL"}
    assert operator.modal(context, SimpleNamespace(type="WHEELUPMOUSE")) == {"PASS_THROUGH"}
    second = Unwrap()
    assert second.invoke(context, event) == {"CANCELLED"}
    while operator.progress[1] == 0:
        assert operator.modal(context, event) == {"PASS_THROUGH"}
        time.sleep(0.05)
    process = operator.job._process
    assert process.poll() is None
    assert operator.modal(context, SimpleNamespace(type="ESC")) == {"CANCELLED"}
    assert process.poll() is not None
    assert lines == ["coneflat is already running", "coneflat was stopped; nothing has changed"]
    assert (uv_of(ball.data) == before).all()
    assert not flags(ball.data).any()
    assert operators.Runner.running is None
    # A crash stays outside, too.
    crashed = Unwrap()
    assert crashed.invoke(context, event) == {"RUNNING_MODAL"}
    crashed.job._process.kill()
    while (result := crashed.modal(context, event)) == {"PASS_THROUGH"}:
        time.sleep(0.05)
    assert result == {"CANCELLED"}
    assert lines[-1].startswith("Unwrap crashed or was ended by SIGKILL"), lines
    # And it ends well.
    settings().select = "SEAMS"
    complete = Unwrap()
    context.tool_settings = bpy.context.tool_settings
    assert complete.invoke(context, event) == {"RUNNING_MODAL"}
    while (result := complete.modal(context, event)) == {"PASS_THROUGH"}:
        time.sleep(0.05)
    assert result == {"FINISHED"}, lines
    assert (torn_edges(ball.data) == flags(ball.data)).all()
    assert (flags(ball.data, "select") == flags(ball.data)).all()


def main():
    name, extension = sys.argv[1:]
    code = 1
    try:
        start(extension)
        globals()[name]()
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


if __name__ == "__main__":
    main()
