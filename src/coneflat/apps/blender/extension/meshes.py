"""Meshes of Blender: their faces as parts, and UVs, seams, cones and quads written back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from .exchange import Map, Part
from .job import Failure

#: Marks the seams that coneflat has marked, which do not constrain the next cut.
OWN_SEAMS = "coneflat_seams"
MAX_UV_MAPS = 8
#: The UV map of lightmaps, and the one before it, as engines read a lightmap from the second one.
LIGHTMAP, FIRST_MAP = "Lightmap", "UVMap"
#: The name of the vertex group that an option takes, and the kind of the option, by the name of the option.
Groups = dict[str, tuple[str, str]]


@dataclass(frozen=True, eq=False)
class Source:
    """Faces of the mesh of an object, as they were read.

    Attributes:
        name: of the object.
        part: the faces.
        vertices: (n,) vertex of the mesh for each of the part.
        loops: (c,) loop of the mesh for each corner of the part.
        edges: (c,) edge of the mesh that starts at each corner of the part.
        is_mirrored: the first coordinates of the part are those of the scene with the opposite sign, since the faces of
            an object of negative scale would be inside out.
        counts: numbers of vertices, edges and loops of the mesh.
    """

    name: str
    part: Part
    vertices: NDArray[np.int64]
    loops: NDArray[np.int64]
    edges: NDArray[np.int64]
    is_mirrored: bool
    counts: tuple[int, int, int]


def chosen_objects(context: Any) -> list[Any]:
    """Return the mesh objects that are edited, or else selected; of those that share a mesh only the first.

    Raises:
        Failure: there are none, or one cannot be changed.
    """
    in_edit = context.mode == "EDIT_MESH"
    objects = context.objects_in_mode if in_edit else context.selected_objects
    by_mesh = {item.data: item for item in reversed(list(objects)) if item.type == "MESH"}
    if not by_mesh:
        raise Failure("no mesh object is selected")
    for item in by_mesh.values():
        if item.data.library is not None:
            raise Failure(f"{item.name} is linked from another file and cannot be changed")
    return sorted(by_mesh.values(), key=lambda item: item.name)


@contextmanager
def object_mode(context: Any, returns: bool = True) -> Iterator[bool]:
    """Be in object mode, in which the data of meshes can be accessed, and yield whether it was edit mode.

    returns: return to edit mode.
    """
    in_edit = context.mode == "EDIT_MESH"
    if in_edit:
        bpy.ops.object.mode_set(mode="OBJECT")
    try:
        yield in_edit
    finally:
        if in_edit and returns:
            bpy.ops.object.mode_set(mode="EDIT")


def values(rows: Any, name: str, kind: Any = np.int64, width: int = 1) -> NDArray[Any]:
    """Return one property of all elements of a collection."""
    stored: Any = {np.int64: np.int32, np.float64: np.float32}.get(kind, bool)
    flat = np.empty(len(rows) * width, stored)
    rows.foreach_get(name, flat)
    return flat.astype(kind).reshape((len(rows), width) if width > 1 else -1)


def read_source(
    item: Any, mesh: Any, *, selected: bool, groups: Groups, marks: str = "NONE", sharp: bool = False
) -> Source | None:
    """Return the faces of an object's mesh; None if there are none to use.

    Args:
        item: the object.
        mesh: its mesh, or the one that its modifiers make.
        selected: use the selected faces only.
        groups: vertex groups by option; those that the object lacks are left out.
        marks: which marked seams are cut: OWN for those that coneflat has not marked, ALL or NONE.
        sharp: also cut edges that are marked as sharp.

    Raises:
        Failure: the object has no volume in the scene.
    """
    sizes, starts = values(mesh.polygons, "loop_total"), values(mesh.polygons, "loop_start")
    if selected:
        chosen = values(mesh.polygons, "select", bool) & ~values(mesh.polygons, "hide", bool)
        sizes, starts = sizes[chosen], starts[chosen]
    if not len(sizes):
        return None
    loops = np.repeat(starts - (np.cumsum(sizes) - sizes), sizes) + np.arange(sizes.sum())
    vertices, corners = np.unique(values(mesh.loops, "vertex_index")[loops], return_inverse=True)
    edges = values(mesh.loops, "edge_index")[loops]
    frame = np.array(item.matrix_world, np.float64)
    determinant = np.linalg.det(frame[:3, :3])
    if determinant == 0:
        raise Failure(f"{item.name} has a scale of 0")
    if determinant < 0:
        frame[0] *= -1
    is_base = mesh == item.data and mesh.shape_keys is not None
    rows = mesh.shape_keys.reference_key.data if is_base else mesh.vertices
    positions = values(rows, "co", np.float64, 3)[vertices] @ frame[:3, :3].T + frame[:3, 3]
    edge_numbers, times = np.unique(edges, return_counts=True)
    is_cut = np.zeros(len(mesh.edges), bool)
    if marks != "NONE":
        own_marks = own_seams(mesh) if marks == "OWN" else False
        is_cut |= values(mesh.edges, "use_seam", bool) & ~np.asarray(own_marks)
    if sharp:
        is_cut |= values(mesh.edges, "use_edge_sharp", bool)
    inner = edge_numbers[(times > 1) & is_cut[edge_numbers]]
    ends = values(mesh.edges, "vertices", np.int64, 2)[inner]
    weights, lists = {}, {"seams": np.searchsorted(vertices, ends).reshape(-1, 2)}
    for option, (name, kind) in groups.items():
        if name in item.vertex_groups:
            group_weights = _weights(mesh, item.vertex_groups[name].index)[vertices]
            if kind == "vertices":
                lists[option] = np.flatnonzero(group_weights >= 0.5)
            else:
                weights[option] = group_weights
    part = Part(item.name, positions, corners.reshape(-1), sizes, weights, lists)
    return Source(item.name, part, vertices, loops, edges, bool(determinant < 0), counts(mesh))


def counts(mesh: Any) -> tuple[int, int, int]:
    """Return the numbers of vertices, edges and loops."""
    return len(mesh.vertices), len(mesh.edges), len(mesh.loops)


def _weights(mesh: Any, group: int) -> NDArray[np.float64]:
    """Return (n,) the weights of a vertex group, 0 outside."""
    weights = [
        next((member.weight for member in v.groups if member.group == group), 0.0) for v in mesh.vertices
    ]
    return np.array(weights, np.float64)


def own_seams(mesh: Any) -> NDArray[np.bool_]:
    """Return (e,) whether coneflat has marked an edge as a seam."""
    attribute = mesh.attributes.get(OWN_SEAMS)
    if attribute is None or attribute.domain != "EDGE" or attribute.data_type != "BOOLEAN":
        return np.zeros(len(mesh.edges), bool)
    return values(attribute.data, "value", bool)


def left_as_is(item: Any, applied: bool) -> list[str]:
    """Return a note that says which modifiers and shape keys of an object are used or not, or no note."""
    names = ", ".join(modifier.name for modifier in item.modifiers if modifier.show_viewport)
    words = [f"modifiers {names} are {'applied' if applied else 'not applied'}"] if names else []
    if item.data.shape_keys is not None:
        words.append("shape keys are applied" if applied else "of the shape keys, the basis is used")
    return [f"{item.name}: {'; '.join(words)}"] if words else []


def item_of(source: Source, is_same: bool = True) -> Any:
    """Return the object that a part is of; `is_same`: its mesh must have the same numbers of elements.

    Raises:
        Failure: the object has been removed or its mesh changed.
    """
    item = bpy.data.objects.get(source.name)
    if item is None or (is_same and counts(item.data) != source.counts):
        raise Failure(f"{source.name} has changed while coneflat was running")
    return item


def check_uv_map(item: Any, name: str) -> None:
    """Raise Failure if a UV map of this name, or any if it is "", can neither be found nor added."""
    layers = item.data.uv_layers
    if len(layers) >= MAX_UV_MAPS and name and name not in layers:
        raise Failure(f"{item.name} has {len(layers)} UV maps, and {name} cannot be added")


def write_map(source: Source, layout: Map, name: str, *, mark: bool, select: str) -> None:
    """Write UVs, seams and cones of a part to the mesh of its object, in object mode.

    Args:
        source: the part as it was read.
        layout: its UVs.
        name: the UV map, which is added if it does not exist, that of lightmaps after another one; "" for the active
            one.
        mark: mark the cut edges as seams.
        select: what to select: SEAMS, CONES or NONE.

    Raises:
        Failure: the object has been removed or its mesh changed.
    """
    mesh = item_of(source).data
    if name == LIGHTMAP and not mesh.uv_layers:
        _write_uv(mesh, source, layout, FIRST_MAP)
    _write_uv(mesh, source, layout, name)
    cut = _edges_between(mesh, source, layout.seams)
    if mark:
        _mark(mesh, source, cut)
    if select == "SEAMS":
        _select(mesh, np.unique(values(mesh.edges, "vertices", np.int64, 2)[cut]), cut)
    elif select == "CONES":
        _select(mesh, source.vertices[layout.cones], [])
    mesh.update()


def _write_uv(mesh: Any, source: Source, layout: Map, name: str) -> None:
    """Write UVs of a part to a UV map of its mesh, which is active then; materials use the same map as before."""
    layer = mesh.uv_layers.get(name) if name else mesh.uv_layers.active
    layer = layer or mesh.uv_layers.new(name=name or FIRST_MAP, do_init=False)
    mesh.uv_layers.active = layer
    uv = values(layer.data, "uv", np.float64, 2)
    has_uv = np.isfinite(layout.uv).all(axis=1)
    uv[source.loops[has_uv]] = layout.uv[has_uv]
    layer.data.foreach_set("uv", uv.astype(np.float32).ravel())


def _edges_between(mesh: Any, source: Source, pairs: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the edges of a mesh between pairs of vertices of a part; diagonals of polygons are no edges."""
    edges = np.unique(source.edges)
    n = len(source.vertices)
    ends = np.searchsorted(source.vertices, values(mesh.edges, "vertices", np.int64, 2)[edges])
    edge_keys, pair_keys = (rows.min(axis=1) * n + rows.max(axis=1) for rows in (ends, pairs))
    return edges[np.isin(edge_keys, pair_keys)]


def _mark(mesh: Any, source: Source, cut: NDArray[np.int64]) -> None:
    """Mark the cut edges of a part, instead of those that coneflat has marked before."""
    seam, is_own = values(mesh.edges, "use_seam", bool), own_seams(mesh)
    seam[source.edges] &= ~is_own[source.edges]
    is_own[source.edges] = False
    is_own[cut[~seam[cut]]] = True
    seam[cut] = True
    mesh.edges.foreach_set("use_seam", seam)
    attribute = mesh.attributes.get(OWN_SEAMS) or mesh.attributes.new(OWN_SEAMS, "BOOLEAN", "EDGE")
    attribute.data.foreach_set("value", is_own)


def _select(mesh: Any, vertices: Sequence[int] | NDArray[Any], edges: Sequence[int] | NDArray[Any]) -> None:
    """Select these elements of a mesh, and no others."""
    for rows, chosen in ((mesh.vertices, vertices), (mesh.edges, edges), (mesh.polygons, ())):
        flags = np.zeros(len(rows), bool)
        flags[np.asarray(chosen, np.int64)] = True
        rows.foreach_set("select", flags)


def add_quads(source: Source, result: dict[str, NDArray[Any]], select: bool) -> Any:
    """Add an object with quads beside the object that they were made of, and return it.

    select: select the irregular vertices.

    Raises:
        Failure: the object has been removed.
    """
    item = item_of(source, is_same=False)
    mesh = bpy.data.meshes.new(f"{item.data.name}_quads")
    added = bpy.data.objects.new(f"{item.name}_quads", mesh)
    added.matrix_world = item.matrix_world.copy()
    frame = np.array(added.matrix_basis, np.float64)  # This has no shear, which parents can cause.
    points = result["vertices"] * ([-1, 1, 1] if source.is_mirrored else [1, 1, 1]) - frame[:3, 3]
    local = np.linalg.solve(frame[:3, :3], points.T).T
    quads = result["quads"]
    # Blender 5.0 crashes at the selection of edges that it has found itself.
    edges = np.unique(np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], -1).reshape(-1, 2)), axis=0)
    mesh.from_pydata(local.tolist(), edges.tolist(), quads.tolist())
    for material in item.data.materials:
        mesh.materials.append(material)
    if select:
        _select(mesh, result["irregular"], [])
    mesh.update()
    for collection in item.users_collection:
        collection.objects.link(added)
    return added
