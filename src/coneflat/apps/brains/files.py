"""Files of flat maps: GIFTI surfaces and FreeSurfer's patches, read and written."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ... import MeshFile
from ...base import BoolArray, FloatArray, IntArray
from ...errors import MeshFileError, OptionError
from ...io import (
    Attribute,
    UVMesh,
    atomic_write,
    known_ending,
    nibabel,
    read_bytes,
    read_mesh,
    read_structure,
)

#: Endings of flat maps; FreeSurfer's patches, such as lh.flat.patch.3d, have the ending .3d.
FLAT_FORMATS = (".gii", ".3d")
_PATCH = np.dtype([("vertex", ">i4"), ("point", ">f4", 3)])
_SIDES = {
    "left": r"(^|[._-])(lh|l|left|hemi-l)([._-]|$)",
    "right": r"(^|[._-])(rh|r|right|hemi-r)([._-]|$)",
}


def structure_of(path: Path) -> str:
    """Return the anatomical structure of a surface or label, such as CortexLeft; "" if nothing tells it.

    GIFTI files name it; else the file name tells the hemisphere: lh.pial, sub_hemi-R_pial.gii.
    """
    sides = [side for side, form in _SIDES.items() if re.search(form, path.name.lower())]
    return read_structure(path) or (f"Cortex{sides[0].title()}" if len(sides) == 1 else "")


def check_same_side(surface: Path, values: dict[str, Path]) -> None:
    """Raise OptionError if a file is of the other hemisphere than the surface."""
    for name, path in values.items():
        structures = structure_of(surface), structure_of(path)
        if set(structures) == {"CortexLeft", "CortexRight"}:
            side, values_side = (structure.removeprefix("Cortex").lower() for structure in structures)
            raise OptionError(
                f"{name} {path} must be of the {side} hemisphere, like {surface}, got the {values_side} one"
            )


def kept_in_flat(surface: MeshFile, ending: str) -> list[Attribute]:
    """Return the attributes of the file of a surface that its flat map keeps: the hemisphere, if something tells it."""
    keeps_side = ending == ".gii" and structure_of(surface.path)
    # The flat map has its own geometric type.
    names = ("GeometricType", "AnatomicalStructurePrimary")[: 1 + bool(keeps_side)]
    return [Attribute("metadata", name) for name in names]


def write_gifti(path: Path, points: FloatArray, faces: IntArray, structure: str) -> None:
    """Write a flat map (n, 2) of a structure with triangles (m, 3) as a GIFTI surface, z = 0."""
    package = nibabel()
    image, gifti = package.GiftiImage(), package.gifti
    meta = {"GeometricType": "Flat"} | ({"AnatomicalStructurePrimary": structure} if structure else {})
    for values, intent in ((np.pad(points, ((0, 0), (0, 1))), "POINTSET"), (faces, "TRIANGLE")):
        kind = np.float32 if intent == "POINTSET" else np.int32
        further = {"meta": gifti.GiftiMetaData(meta)} if intent == "POINTSET" else {}
        image.add_gifti_data_array(
            gifti.GiftiDataArray(
                values.astype(kind), intent=f"NIFTI_INTENT_{intent}", datatype=kind, **further
            )
        )
    with atomic_write(path) as stream:
        stream.write(image.to_bytes())


def write_patch(path: Path, points: FloatArray, vertices: IntArray, is_border: BoolArray) -> None:
    """Write the vertices (k,) of a surface and their points (n, 2) as a FreeSurfer patch; borders are negative."""
    rows = np.empty(len(vertices), _PATCH)
    rows["vertex"] = np.where(is_border, -1 - vertices, vertices + 1)
    rows["point"] = np.pad(points, ((0, 0), (0, 1)))[vertices]
    with atomic_write(path) as stream:
        stream.write(np.array([-1, len(rows)], ">i4").tobytes() + rows.tobytes())


def read_flat(path: Path, surface: Path) -> UVMesh:
    """Return a flat map with the positions of a surface: a GIFTI surface, or a FreeSurfer patch.

    Triangles of a patch are those of the surface whose vertices are all in it.

    Raises:
        MeshFileError: a file cannot be read.
        OptionError: the flat map has other vertices than the surface, or is of the other hemisphere.
    """
    known_ending(path, FLAT_FORMATS, "flat maps are read from")
    check_same_side(surface, {"the flat map": path})
    mesh = read_mesh(surface, weld=False)
    count, faces = len(mesh.vertices), mesh.triangles
    points = np.full((count, 2), np.nan)
    if path.suffix.lower() == ".gii":
        flat = read_mesh(path, weld=False)
        faces, vertices, planar = flat.triangles, np.arange(len(flat.vertices)), flat.vertices
    else:
        vertices, planar = _read_patch(path)
    if (len(vertices) and not 0 <= vertices.min() <= vertices.max() < count) or (
        path.suffix.lower() == ".gii" and len(planar) != count
    ):
        raise OptionError(
            f"{path} must be a flat map of {surface} with {count:,} vertices, got {vertices.max() + 1:,}"
        )
    points[vertices] = planar[:, :2]
    faces = faces[np.isfinite(points[faces]).all(axis=(1, 2))]
    return UVMesh(mesh.vertices, faces, points[faces], len(faces), 0, 0, source=mesh)


def _read_patch(path: Path) -> tuple[IntArray, FloatArray]:
    """Return the (k,) vertices of a patch and their (k, 3) points."""
    content = read_bytes(path)
    head = np.frombuffer(content[:8], ">i4") if len(content) >= 8 else np.zeros(2)
    if head[0] != -1 or len(content) != 8 + _PATCH.itemsize * head[1]:
        raise MeshFileError(f"{path} must be a FreeSurfer patch, got {len(content):,} bytes that are not")
    rows = np.frombuffer(content, _PATCH, offset=8)
    return np.abs(rows["vertex"].astype(np.int64)) - 1, rows["point"].astype(np.float64)
