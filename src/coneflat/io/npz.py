"""Results as NumPy archives: every array, and the report as JSON."""

from __future__ import annotations

import json
from dataclasses import fields
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from .._arrays import FloatArray, IntArray
from ..errors import ConeflatError, MeshFileError
from .atomic import as_path
from .raw import read_bytes

if TYPE_CHECKING:
    from ..distortion import Distortion
    from ..result import Flattening
    from ..rotations import Rotations


def write_npz(result: Flattening, stream: IO[bytes]) -> None:
    """Write all arrays of a result and its report as JSON."""
    origin = result.vertex_origin
    arrays: dict[str, Any] = {
        "vertices": result.vertices,
        "faces": result.faces,
        "uv": result.uv,
        "uv_faces": result.uv_faces,
        "cones": result.cones,
        "curvatures": result.curvatures,
        "log_scale": result.log_scale,
        "prescribed": result.prescribed,
        "curvature_residual": result.curvature_residual,
        "seams": result.seams,
        "vertex_origin": np.arange(len(result.vertices)) if origin is None else origin,
        "face_origin": np.arange(len(result.faces)) if result.face_origin is None else result.face_origin,
        "qc": result.distortion.qc,
        "log_area_scale": result.distortion.log_area_scale,
        "uv_scale": np.float64(result.uv_scale),
        "report": np.array(json.dumps(result.report())),
    }
    np.savez(stream, **arrays)


def read_flattening(path: str | PathLike[str]) -> Flattening:
    """Return a result that was written as .npz; what it says of the file it came from is not kept.

    Raises:
        MeshFileError: the file is not there, may not be read, or is not such a result.
    """
    path = as_path(path)
    content = read_bytes(path)
    try:
        with np.load(BytesIO(content), allow_pickle=False) as archive:
            arrays = dict(archive)
        return _flattening(path, arrays)
    except (ConeflatError, MemoryError):
        raise
    except Exception as error:
        # Whatever a damaged file makes NumPy do, the caller sees one kind of error.
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise MeshFileError(f"{path} is not a readable NPZ file: {reason}") from error


def _flattening(path: Path, arrays: dict[str, Any]) -> Flattening:
    from ..figures import SolveFigures
    from ..result import Flattening

    for name in ("uv", "uv_faces", "vertices", "faces", "cones", "curvatures", "seams", "report"):
        if name not in arrays:
            what = "UVs" if name.startswith("uv") else "result of coneflat"
            raise MeshFileError(
                f"{path} holds no {what}: {name!r} is missing; write it by `coneflat flatten`"
            )
    report = json.loads(str(arrays["report"]))
    # Archives of version 0.1.0 have none.
    arrays.setdefault("prescribed", np.full(len(arrays["vertices"]), np.nan))
    vertices, uv = _floats(path, arrays, "vertices", 3), _floats(path, arrays, "uv", 2)
    faces = _indices(path, arrays, "faces", 3, len(vertices))
    uv_faces = _indices(path, arrays, "uv_faces", 3, len(uv))
    cones = _indices(path, arrays, "cones", 0, len(vertices))
    if len(uv_faces) != len(faces) or len(arrays["curvatures"]) != len(cones) or not len(faces):
        counts = f"{len(faces)} faces, {len(uv_faces)} of them with UVs; {len(cones)} cones"
        raise MeshFileError(f"{path} is no result of coneflat: it has {counts}")
    if not (np.isfinite(vertices).all() and np.isfinite(uv).all()):
        raise MeshFileError(f"{path} is no result of coneflat: it has positions or UVs that are not finite")
    return Flattening(
        vertices=vertices,
        faces=faces,
        uv=uv,
        uv_faces=uv_faces,
        uv_scale=float(arrays["uv_scale"]),
        cones=cones,
        curvatures=_floats(path, arrays, "curvatures", 0),
        log_scale=_floats(path, arrays, "log_scale", 0),
        prescribed=_floats(path, arrays, "prescribed", 0),
        curvature_residual=_floats(path, arrays, "curvature_residual", 0),
        seams=_indices(path, arrays, "seams", 2, len(vertices)),
        packing_efficiency=report["packing_efficiency"],
        distortion=_distortion(arrays, report),
        seconds=report["seconds"],
        notes=tuple(report["notes"]),
        settings=report["settings"],
        solve=SolveFigures(**{field.name: report[field.name] for field in fields(SolveFigures)}),
        solvers=tuple(report["solvers"]),
        rotations=_rotations(report),
        vertex_origin=arrays["vertex_origin"],
        face_origin=arrays["face_origin"],
    )


def _floats(path: Path, arrays: dict[str, Any], name: str, columns: int) -> FloatArray:
    """Return an array of numbers, (k, columns) or, for 0 columns, (k,)."""
    values = np.asarray(arrays[name])
    if values.dtype.kind not in "iuf" or values.shape[1:] != ((columns,) if columns else ()):
        raise MeshFileError(f"{path}: {name!r} has the shape {values.shape} and the type {values.dtype}")
    return values.astype(np.float64)


def _indices(path: Path, arrays: dict[str, Any], name: str, columns: int, bound: int) -> IntArray:
    """Return an array of indices from 0 up to a bound."""
    values = _floats(path, arrays, name, columns).astype(np.int64)
    if values.size and (values.min() < 0 or values.max() >= bound):
        raise MeshFileError(f"{path}: {name!r} has indices beyond the {bound} there are")
    return values


def _distortion(arrays: dict[str, Any], report: dict[str, Any]) -> Distortion:
    from ..distortion import Distortion
    from ..report import MEASURES

    # JSON has no NaN: the report has None for it.
    numbers: dict[str, Any] = {
        name: np.nan if report.get(name) is None else report[name] for name in MEASURES
    }
    return Distortion(qc=arrays["qc"], log_area_scale=arrays["log_area_scale"], **numbers)


def _rotations(report: dict[str, Any]) -> Rotations | None:
    from ..rotations import Rotations

    if report["rotation_deviation"] is None:
        return None
    return Rotations(
        report["settings"]["quantum"], report["rotation_deviation"], tuple(report["handle_deviations"])
    )
