"""Files of integer grids (OBJ with grid coordinates as UVs, and NPZ) and of quad meshes."""

from __future__ import annotations

import json
import re
import zipfile
from collections.abc import Iterator
from dataclasses import fields
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, Any

import numpy as np

from ..base import FloatArray, IntArray, Use, endings
from ..errors import MeshError, MeshFileError
from ..geometry import quarters_around, sides_between, vertex_normals
from ..geometry.nearest import TriangleTree
from ..io import (
    FOR_INDICES,
    FOR_VERTICES,
    GROUPS,
    MATERIAL,
    MATERIALS,
    OBJECTS,
    CheckedArrays,
    Glb,
    as_path,
    atomic_write,
    bounds,
    checked_target,
    imported,
    known_ending,
    lines_of,
    local_positions,
    losses,
    number,
    read_archive,
    relocated,
    shading_normals,
    write_parts,
    write_stl,
)
from ..io.mesh_file import MeshFile
from ..mesh.check import check_mesh
from ..mesh.connectivity import TriangleMesh, are_among
from .integer_map import IntegerGrid, grid_of_corners, on_lines
from .quad_mesh import QuadMesh, least_jacobians

#: Names of the formats that meshio writes, by their extensions.
_MESHIO = {".vtk": "vtk", ".vtu": "vtu", ".inp": "abaqus", ".msh": "gmsh"}
#: Extensions of the files that `write_quads` writes.
QUAD_FORMATS = endings(Use.QUADS | Use.MESHIO)
#: Arrays from which a quad mesh is restored.
_NAMES = ("vertices", "quads", "faces", "barycentric", "surface_vertices", "surface_faces", "report")
#: Extensions of the files that `write_grid` writes.
GRID_FORMATS = endings(Use.GRID)
#: Names of the arrays of an integer grid.
_ARRAYS = [field.name for field in fields(IntegerGrid) if str(field.type).endswith("Array")]
#: Arrays from which a grid is restored.
_RESTORED = ("vertices", "faces", "corner_grid", "corners", "corner_quarters", "features", "report")
_STATE = re.compile(rb"(?m)^[ \t]*(mtllib|usemtl|g|o)(?![^ \t\r\n])[ \t]*([^\r\n]*?)[ \t]*\r?$")
_HEAD = (
    "# An integer grid by coneflat. Texture coordinates are in units of the grid, which continues across seams.",
    "# Lines (l) are sharp edges on grid lines.",
)


def check_quads_output(path: str | PathLike[str]) -> Path:
    """Return a path that `write_quads` can write, or raise the same errors in advance."""
    target = checked_target(path, endings=QUAD_FORMATS, usage="quads are written as")
    if target.suffix.lower() in _MESHIO:
        imported("meshio", "meshes of meshio need meshio", "meshio")
    return target


def check_grid_output(path: str | PathLike[str]) -> Path:
    """Return a path that `write_grid` can write, or raise the same errors in advance."""
    return checked_target(path, endings=GRID_FORMATS, usage="integer grids are written as")


def write_quads(path: str | PathLike[str], mesh: QuadMesh) -> Path:
    """Write a quad mesh atomically and return the path.

    An .obj has as many digits as are needed to read the same numbers, the UVs of `QuadMesh.uv`, and the materials and
    groups of the .obj that the mesh was read from, by which quads are sorted. A .ply is binary, with double coordinates
    and the UVs as the list `texcoord` of each face. An .stl, for printing, has the two triangles of each quad of
    `QuadMesh.triangles`. A .glb, which has no quads, has the same triangles and the edges of quads as lines; see
    `_write_glb`. An .npz has all arrays of the `QuadMesh`, from which `read_quads` restores it, and the irregular
    vertices with their valences. VTK (.vtk, .vtu), Abaqus (.inp) and Gmsh (.msh) are written by meshio; all but Abaqus
    have the valences of vertices, and the least scaled Jacobians of quads. Errors are those of `QuadMesh.save`.
    """
    path = check_quads_output(path)
    with atomic_write(path) as stream:
        write_quads_stream(mesh, stream, path.suffix.lower(), path)
    return path


def quads_left_out(source: MeshFile | None, ending: str) -> tuple[str, ...]:
    """Return a note on data of the file that a mesh was read from and that a file of its quads does not keep."""
    is_obj = source is not None and source.obj is not None and ending == ".obj"
    return losses(source, ending, (GROUPS, OBJECTS, MATERIALS) if is_obj else ())


def write_quads_stream(mesh: QuadMesh, stream: IO[bytes], ending: str, path: Path = Path()) -> None:
    """Write a quad mesh to the binary stream of a file; `ending` is one of `QUAD_FORMATS`, see `write_quads`."""
    if ending == ".obj":
        _write_obj(mesh, stream, path)
    elif ending == ".ply":
        places = np.ascontiguousarray(mesh.vertices, "<f8")
        texcoord = mesh.uv.reshape(-1, 8).astype(np.float32)
        axes = [f"double {axis}" for axis in "xyz"]
        write_parts(stream, ["comment quads by coneflat"], axes, places, mesh.quads, {"texcoord": texcoord})
    elif ending == ".stl":
        write_stl(stream, mesh.vertices, mesh.triangles)
    elif ending == ".glb":
        _write_glb(mesh, stream)
    elif ending in _MESHIO:
        _write_by_meshio(mesh, stream, ending)
    else:
        _write_quads_npz(mesh, stream)


def _write_obj(mesh: QuadMesh, stream: IO[bytes], path: Path) -> None:
    libraries, states, state_of = _states(mesh, path)
    points, index = np.unique(mesh.uv.reshape(-1, 2), axis=0, return_inverse=True)
    stream.write(libraries)
    stream.writelines(lines_of("v", mesh.vertices, b"\n"))
    stream.writelines(lines_of("vt", points, b"\n"))
    corners = np.stack([mesh.quads, index.reshape(mesh.quads.shape)], axis=2).reshape(-1, 8) + 1
    for which, lines in enumerate(states):
        if len(rows := corners[state_of == which]):
            stream.write(lines)
            stream.writelines(_face_lines(rows))


def _states(mesh: QuadMesh, path: Path) -> tuple[bytes, list[bytes], IntArray]:
    """Return lines for the material libraries, and for materials and groups, and (p,) which of these each quad has.

    They are those of the OBJ file that the mesh was read from, of the polygon nearest to the centre of the quad.
    """
    source, current, states, starts = mesh.source, dict[bytes, bytes](), dict[bytes, int]({b"": 0}), [(0, 0)]
    if source is None or source.obj is None:
        return b"", [b""], np.zeros(len(mesh.quads), dtype=np.int64)
    libraries = list[bytes]()
    for polygon, gap in sorted(relocated(source.obj, source.path.parent, path.parent).gaps.items()):
        lines = [(word, b"%s %s\n" % (word, names)) for word, names in _STATE.findall(gap)]
        libraries += [line for word, line in lines if word == b"mtllib"]
        current |= {word: line for word, line in lines if word != b"mtllib"}
        starts.append((polygon, states.setdefault(b"".join(current.values()), len(states))))
    corners = mesh.vertices[mesh.quads]
    normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    on, _ = TriangleTree(source.vertices, source.triangles).nearest(corners.mean(axis=1), normals)
    polygon_of = np.repeat(np.arange(len(source.offsets) - 1), np.diff(source.offsets) - 2)[on]
    first, which = np.array(starts).T
    state_of = which[np.searchsorted(first, polygon_of, side="right") - 1]
    return b"".join(dict.fromkeys(libraries)), list(states), state_of


def _face_lines(corners: IntArray, at_once: int = 1 << 15) -> Iterator[bytes]:
    """Yield the lines of faces of k corners, each with the numbers (p, 2k) of a vertex and a UV point."""
    line = "f" + " %d/%d" * (corners.shape[1] // 2) + "\n"
    for i in range(0, len(corners), at_once):
        block = corners[i : i + at_once]
        yield (line * len(block) % tuple(block.ravel().tolist())).encode()


def _write_by_meshio(mesh: QuadMesh, stream: IO[bytes], ending: str) -> None:
    meshio = imported("meshio", "meshes of meshio need meshio", "meshio")
    jacobians = least_jacobians(mesh.vertices, mesh.quads)
    data: dict[str, Any] = {}
    if ending != ".inp":
        data = {"point_data": {"valence": mesh.valences}, "cell_data": {"jacobian": [jacobians]}}
    written = meshio.Mesh(mesh.vertices, [("quad", mesh.quads)], **data)
    with TemporaryDirectory() as folder:  # not all writers of meshio take streams
        path = Path(folder) / f"quads{ending}"
        meshio.write(path, written, _MESHIO[ending])
        stream.write(path.read_bytes())


def _write_quads_npz(mesh: QuadMesh, stream: IO[bytes]) -> None:
    report = {"left_out": mesh.left_out, "area_left_out": mesh.area_left_out, "notes": list(mesh.notes)}
    arrays = {name: getattr(mesh, name) for name in (*_NAMES[:4], "irregular")}
    surface: dict[str, Any] = {"surface_vertices": mesh.surface.vertices, "surface_faces": mesh.surface.faces}
    valences, text = mesh.valences[mesh.irregular], np.array(json.dumps(report))
    np.savez(stream, **arrays, **surface, valences=valences, report=text)


def holds_quads(path: str | PathLike[str]) -> bool:
    """Return whether a file is an .npz archive with quads; its content is not validated."""
    path = as_path(path)
    try:
        with zipfile.ZipFile(path) as archive:
            return path.suffix.lower() == ".npz" and "quads.npy" in archive.namelist()
    except (OSError, ValueError, zipfile.BadZipFile):
        return False


def read_quads(path: str | PathLike[str]) -> QuadMesh:
    """Return a quad mesh from an .npz file; see `QuadMesh.load`."""
    path = as_path(path)
    known_ending(path, (".npz",), "quads with their surface are read from")
    return read_archive(path, _NAMES, _quad_mesh)


def _quad_mesh(reading: CheckedArrays) -> QuadMesh:
    reading.need(_NAMES, "mesh of quads")
    report = reading.report()
    vertices, surface = reading.finite("vertices", (None, 3)), reading.finite("surface_vertices", (None, 3))
    faces = reading.indices("surface_faces", (None, 3), len(surface))
    quads = reading.indices("quads", (None, 4), len(vertices))
    if not len(quads):
        raise MeshFileError(f"{reading.path} holds no mesh of quads: its array 'quads' is empty")
    return QuadMesh(
        vertices=vertices,
        quads=quads,
        faces=reading.indices("faces", (len(vertices),), len(faces)),
        barycentric=reading.finite("barycentric", (len(vertices), 3)),
        left_out=int(number(report["left_out"])),
        area_left_out=number(report["area_left_out"]),
        surface=TriangleMesh(surface, faces),
        notes=reading.notes(report),
    )


_LINE_MATERIAL: dict[str, Any] = {
    "name": "edges",
    "pbrMetallicRoughness": {"baseColorFactor": [0.02] * 3 + [1.0], "metallicFactor": 0.0},
    # Lines have no normals for lighting.
    "extensions": {"KHR_materials_unlit": {}},
}


def _write_glb(mesh: QuadMesh, stream: IO[bytes]) -> None:
    """Write a quad mesh as GLB: two triangles for each quad, and the edges of quads as visible lines.

    The first primitive has the vertices in their order, and for each quad its triangles of `QuadMesh.triangles`.
    The second has the edges, raised above the quads by a hundredth of the mean edge length; closer lines
    appear dashed in viewers. Coordinates are 32-bit floats, relative to the node if the mesh is far from the origin.

    Raises:
        MeshFileError: the file would be larger than GLB allows.
    """
    normals = shading_normals(vertex_normals(mesh.vertices, mesh.triangles))
    ends = mesh.vertices[mesh.edges]
    length = float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).mean())
    places = local_positions(mesh.vertices)
    glb = Glb(
        {
            "asset": {"version": "2.0", "generator": "coneflat"},
            "extensionsUsed": ["KHR_materials_unlit"],
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0, "name": "quads"} | places.node],
            "materials": [MATERIAL, _LINE_MATERIAL],
        }
    )

    def floats(rows: FloatArray, **form_entries: Any) -> int:
        form = {"componentType": 5126, "type": "VEC3", **form_entries}
        return glb.add_array(rows.astype("<f4"), form, FOR_VERTICES)

    def primitive(places: FloatArray, indices: IntArray, **entries: int) -> dict[str, Any]:
        form = {"componentType": 5125, "type": "SCALAR"}
        at = glb.add_array(indices.reshape(-1, 1).astype("<u4"), form, FOR_INDICES)
        attributes = {"POSITION": floats(places, **bounds(places.astype("<f4")))}
        return {"attributes": attributes, "indices": at, **entries}

    faces = primitive(places.local.astype(np.float64), mesh.triangles, material=0)
    faces["attributes"]["NORMAL"] = floats(normals)
    raised = places.local.astype(np.float64) + 0.01 * length * normals
    lines = primitive(raised, mesh.edges, material=1, mode=1)
    glb.tree["meshes"] = [{"name": "quads", "primitives": [faces, lines]}]
    glb.write(stream)


def write_grid(path: str | PathLike[str], grid: IntegerGrid) -> Path:
    """Write an integer grid atomically and return the path.

    An .obj has the grid coordinates of every triangle corner as texture coordinates, with all digits, as programs that
    extract quads expect them, for example libQEx. An .npz has all arrays of the `IntegerGrid` and its report. Errors
    are those of `IntegerGrid.save`.
    """
    path = check_grid_output(path)
    with atomic_write(path) as stream:
        (_write_grid_obj if path.suffix.lower() == ".obj" else _write_grid_npz)(grid, stream)
    return path


def _write_grid_obj(grid: IntegerGrid, stream: IO[bytes]) -> None:
    # Corners of the same vertex with equal coordinates share a point.
    keys = np.concatenate([grid.faces.reshape(-1, 1), grid.corner_grid.reshape(-1, 2)], axis=1)
    points, number_of = np.unique(keys, axis=0, return_inverse=True)
    stream.write(("\n".join(_HEAD) + "\n").encode("ascii"))
    stream.writelines(lines_of("v", grid.vertices, b"\n"))
    stream.writelines(lines_of("vt", points[:, 1:], b"\n"))
    corners = np.stack([grid.faces.ravel(), number_of.ravel()], axis=1).reshape(-1, 6) + 1
    stream.writelines(_face_lines(corners))
    stream.writelines(lines_of("l", grid.features + 1, b"\n"))


def _write_grid_npz(grid: IntegerGrid, stream: IO[bytes]) -> None:
    arrays: dict[str, Any] = {name: getattr(grid, name) for name in _ARRAYS}
    report = {"size": grid.size, "notes": list(grid.notes)}
    np.savez(stream, **arrays, report=np.array(json.dumps(report)))


def read_grid(path: str | PathLike[str]) -> IntegerGrid:
    """Return an integer grid from an .npz file; see `IntegerGrid.load`."""
    path = as_path(path)
    known_ending(path, (".npz",), "integer grids are read from")
    return read_archive(path, _RESTORED, _grid_of_archive)


def _require_mesh(path: Path, vertices: FloatArray, faces: IntArray) -> None:
    """Raise MeshFileError unless the triangles are a consistently oriented manifold."""
    vertices_of_faces, numbers = np.unique(faces, return_inverse=True)
    again = numbers.reshape(-1, 3)
    try:
        checked = check_mesh(vertices[vertices_of_faces], again)
    except MeshError as error:
        # The rest of the message advises a repair, which would break the map.
        raise MeshFileError(f"{path} holds no integer grid: {str(error).split(';')[0]}") from error
    if (checked.mesh.faces != again).any():
        raise MeshFileError(
            f"{path} holds no integer grid: neighbouring triangles have opposite orientations"
        )


def _require_lines(path: Path, grid: IntegerGrid) -> None:
    """Raise MeshFileError unless corners are grid points with the given angles, and features edges on grid lines."""
    mesh, corners = TriangleMesh(grid.vertices, grid.faces), grid.corners
    quarters = quarters_around(mesh, sides_between(grid.corner_grid))[corners]
    places = grid.corner_grid[np.isin(grid.faces, corners)]
    is_twice = len(np.unique(corners)) < len(corners)
    if is_twice or (quarters != grid.corner_quarters).any() or (places != np.rint(places)).any():
        raise MeshFileError(
            f"{path} holds no integer grid: its corners are listed twice, are not on grid points, or have other angles"
        )
    if not are_among(grid.features, mesh.edges[on_lines(mesh, grid.corner_grid)]).all():
        raise MeshFileError(f"{path} holds no integer grid: its sharp edges are not edges on grid lines")


def _grid_of_archive(reading: CheckedArrays) -> IntegerGrid:
    reading.need(_RESTORED, "integer grid")
    report = reading.report()
    vertices = reading.finite("vertices", (None, 3))
    n = len(vertices)
    faces = reading.indices("faces", (None, 3), n)
    corners = reading.indices("corners", (None,), n)
    _require_mesh(reading.path, vertices, faces)
    grid = grid_of_corners(
        vertices,
        faces,
        reading.finite("corner_grid", (len(faces), 3, 2)),
        size=float(number(report["size"])),
        notes=reading.notes(report),
        corners=corners,
        corner_quarters=reading.indices("corner_quarters", (len(corners),), None),
        features=reading.indices("features", (None, 2), n),
    )
    _require_lines(reading.path, grid)
    return grid
