"""Reading glTF and GLB scenes, by trimesh's loader."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from .._arrays import FloatArray, IntArray
from ..errors import EmptyMeshError, MeshFileError
from .raw import RawMesh, triangle_offsets


def parse_gltf(path: Path, content: bytes) -> RawMesh:
    """Return all triangle meshes of the scene as one, in scene coordinates.

    A mesh that several nodes show is there as often as it is shown. Lines and points are left out.

    Raises:
        EmptyMeshError: the scene shows no triangle.
        MeshFileError: its data are compressed in a way that cannot be decoded.
    """
    # trimesh takes about a second to import.
    from trimesh.exchange.gltf import load_glb, load_gltf
    from trimesh.resolvers import FilePathResolver

    load = load_glb if content[:4] == b"glTF" else load_gltf
    scene = load(BytesIO(content), resolver=FilePathResolver(str(path)), skip_materials=True)
    nodes = {node["frame_to"]: node for node in scene["graph"]}

    vertices: list[FloatArray] = [np.empty((0, 3))]
    faces: list[IntArray] = [np.empty((0, 3), dtype=np.int64)]
    count = 0
    for frame, node in nodes.items():
        shape = scene["geometry"].get(node.get("geometry"), {})
        if "faces" not in shape:
            continue
        points = np.asarray(shape["vertices"], dtype=np.float64)
        triangles = np.asarray(shape["faces"]).astype(np.int64)
        if len(points) and not points.any():
            # The loader gives zeros for sparse and compressed data.
            raise MeshFileError(f"{path}: its positions cannot be decoded; save it without compression")
        matrix = _placement(nodes, frame)
        if np.linalg.det(matrix[:3, :3]) < 0:
            # The glTF specification turns the winding under a mirroring node.
            triangles = triangles[:, ::-1]
        vertices.append(points @ matrix[:3, :3].T + matrix[:3, 3])
        faces.append(triangles + count)
        count += len(points)
    joined = np.concatenate(faces)
    if not len(joined):
        raise EmptyMeshError(f"{path} has no faces")
    corners = joined.reshape(-1)
    # A vertex is repeated wherever its UVs differ.
    texture = corners if b"TEXCOORD_0" in content else None
    return RawMesh(np.concatenate(vertices), corners, triangle_offsets(len(joined)), texture=texture)


def _placement(nodes: dict[str, dict[str, Any]], frame: str) -> FloatArray:
    """Return (4, 4) the transform from a node to the scene."""
    matrix: FloatArray = np.eye(4)
    seen = set()
    while frame in nodes and frame not in seen:
        seen.add(frame)
        matrix = np.asarray(nodes[frame].get("matrix", np.eye(4)), dtype=np.float64) @ matrix
        frame = nodes[frame]["frame_from"]
    return matrix
