"""Writing meshes of quads as binary glTF, which knows triangles and lines alone."""

from __future__ import annotations

from typing import IO, TYPE_CHECKING, Any

import numpy as np

from ..._arrays import FloatArray, IntArray
from ...geometry.normals import vertex_normals
from ..normals import shading_normals
from .glb import FOR_INDICES, FOR_VERTICES, MATERIAL, Glb, bounds

if TYPE_CHECKING:
    from ...grid import QuadMesh

LINES = 1
#: By how much of the mean edge lines lie above the quads: less, and viewers draw them in dashes.
ABOVE = 0.01
LINE_MATERIAL: dict[str, Any] = {
    "name": "edges",
    "pbrMetallicRoughness": {
        "baseColorFactor": [0.02, 0.02, 0.02, 1.0],
        "metallicFactor": 0.0,
        "roughnessFactor": 1.0,
    },
    # Lines have no side to be lit from.
    "extensions": {"KHR_materials_unlit": {}},
}


def write_quads_glb(mesh: QuadMesh, stream: IO[bytes]) -> None:
    """Write a mesh of quads as GLB: two triangles for each quad, and its edges as lines, so that quads are seen.

    The first primitive has the vertices in their order and the triangles on either side of the shorter diagonal of quad
    after quad; the second has the edges, a hundredth of the mean edge above the quads. All are 32-bit floats.

    Raises:
        MeshFileError: it is larger than GLB can be.
    """
    normals = shading_normals(vertex_normals(mesh.vertices, mesh.triangles))
    ends = mesh.vertices[mesh.edges]
    length = float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).mean())
    glb = Glb(
        {
            "asset": {"version": "2.0", "generator": "coneflat"},
            "extensionsUsed": ["KHR_materials_unlit"],
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0, "name": "quads"}],
            "materials": [MATERIAL, LINE_MATERIAL],
        }
    )
    normal = _floats(glb, normals)
    faces = {"attributes": {"POSITION": _places(glb, mesh.vertices), "NORMAL": normal}, "material": 0}
    lines = {
        "attributes": {"POSITION": _places(glb, mesh.vertices + ABOVE * length * normals)},
        "material": 1,
    }
    glb.tree["meshes"] = [
        {
            "name": "quads",
            "primitives": [
                faces | {"indices": _indices(glb, mesh.triangles)},
                lines | {"indices": _indices(glb, mesh.edges), "mode": LINES},
            ],
        }
    ]
    glb.write(stream)


def _floats(glb: Glb, rows: FloatArray, **more: Any) -> int:
    form = {"componentType": 5126, "type": "VEC3", **more}
    return glb.add_array(rows.astype("<f4"), form, FOR_VERTICES)


def _places(glb: Glb, rows: FloatArray) -> int:
    return _floats(glb, rows, **bounds(rows.astype("<f4")))


def _indices(glb: Glb, rows: IntArray) -> int:
    form = {"componentType": 5125, "type": "SCALAR"}
    return glb.add_array(rows.reshape(-1, 1).astype("<u4"), form, FOR_INDICES)
