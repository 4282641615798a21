"""An OBJ file with all that such files may have, and a flattening of it."""

from __future__ import annotations

import numpy as np

from coneflat.geometry.triangulate import triangulate
from coneflat.io import read_mesh
from coneflat.measures.distortion import measure
from coneflat.mesh.connectivity import TriangleMesh
from coneflat.result import Flattening

OBJ = b"""\
# a bar of two cells \xe9
mtllib bar.mtl more/paint.mtl
o bar
v 0 0 0 1 0 0
v 1 0 0 1 0 0
v 2 0 0.30000000000000004 1 0 0
v 0 1 0 0 1 0
v 1 1 0 0 1 0
v 2 1 1e-17 0 1 0
v 7 7 7
vt 0.5 0.5
vn 0 0 1
g left
usemtl red
f 1/1/1 2/1/1 5/1/1 4/1/1
s off
l 1/1 2/1
g right
f -6//-1 -5//-1 -2//-1 # the triangle
# between
f 2/1 6 5
# the end"""

POINTS = np.array(
    [[0, 0, 0], [1, 0, 0], [2, 0, 0.1 + 0.2], [0, 1, 0], [1, 1, 0], [2, 1, 1e-17], [7, 7, 7]], dtype=float
)


def flattening(vertices, faces, uv, uv_faces, source=None, face_corners=None, origin=None):
    vertices, faces = np.asarray(vertices, dtype=float), np.asarray(faces)
    uv, uv_faces = np.asarray(uv, dtype=float), np.asarray(uv_faces)
    return Flattening(
        vertices=vertices,
        faces=faces,
        uv=uv,
        uv_faces=uv_faces,
        uv_scale=0.25,
        cones=np.array([1]),
        curvatures=np.array([np.pi / 2]),
        log_scale=np.linspace(0, 1, len(vertices)),
        prescribed=np.full(len(vertices), np.nan),
        curvature_residual=np.zeros(len(vertices)),
        seams=np.array([[1, 4]]),
        packing_efficiency=0.5,
        distortion=measure(TriangleMesh(vertices, faces), uv[uv_faces]),
        seconds={"check": 0.0},
        notes=("größer",),
        vertex_origin=np.arange(len(vertices)) if origin is None else np.asarray(origin),
        face_corners=face_corners,
        source=source,
    )


def cut_bar(source, keep=slice(None), flip=()):
    """Return a result whose layout is x and y, with a seam along the edge 1-4 between the cells."""
    faces, face_corners = triangulate(source.vertices, source.corners, source.offsets)
    right = np.array([False, False, *[True] * (len(faces) - 2)])[:, None]
    uv = np.concatenate((source.vertices[:, :2] / 3, source.vertices[[1, 4], :2] / 3 + [0.3, 0]))
    shifted = {1: 7, 4: 8}
    uv_faces = np.where(right, np.vectorize(lambda v: shifted.get(v, v))(faces), faces)
    for t in flip:
        for rows in (faces, uv_faces, face_corners):
            rows[t] = rows[t, ::-1]
    return flattening(source.vertices, faces[keep], uv, uv_faces[keep], source, face_corners[keep])


def read_bar(folder):
    """Return the bar, read from a file in a new folder `in`."""
    (folder / "in").mkdir()
    path = folder / "in" / "bar.obj"
    path.write_bytes(OBJ)
    return read_mesh(path)
