"""Results as NumPy archives: every array, and the report as JSON."""

from __future__ import annotations

import json
from dataclasses import fields
from os import PathLike
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from ..errors import MeshFileError
from .archive import CheckedArrays, number, read_archive
from .atomic import as_path

if TYPE_CHECKING:
    from ..measure.distortion import Distortion
    from ..measure.seam_data import Rotations
    from ..result import Flattening


#: The arrays that make a result. The others of an archive, those of `SeamData`, follow from them.
_NAMES = (
    "uv", "uv_faces", "vertices", "faces", "cones", "curvatures", "log_scale", "curvature_residual", "seams",
    "vertex_origin", "face_origin", "qc", "log_area_scale", "uv_scale", "report",
)  # fmt: skip
#: Archives of version 0.1.0 do not have these, and only results of given lengths have lengths.
_NEWER = ("prescribed", "lengths")


def write_npz(result: Flattening, stream: IO[bytes]) -> None:
    """Write all arrays of a result, those of its cut, and its report as JSON."""
    origin = result.vertex_origin
    arrays: dict[str, Any] = {
        "vertices": result.vertices,
        "faces": result.faces,
        "uv": result.uv,
        "uv_faces": result.uv_faces,
        **result.seam_data.as_arrays(),
        "curvatures": result.curvatures,
        "log_scale": result.log_scale,
        "prescribed": result.prescribed,
        "curvature_residual": result.curvature_residual,
        "vertex_origin": np.arange(len(result.vertices)) if origin is None else origin,
        "face_origin": np.arange(len(result.faces)) if result.face_origin is None else result.face_origin,
        "qc": result.distortion.qc,
        "uv_scale": np.float64(result.uv_scale),
        "report": np.array(json.dumps(result.report())),
    }
    if result.lengths is not None:
        arrays["lengths"] = result.lengths
    np.savez(stream, **arrays)


def read_flattening(path: str | PathLike[str]) -> Flattening:
    """Return a result that was written as .npz; what it says of the file it came from is not kept.

    Raises:
        MeshFileError: the file is not there, may not be read, or is not such a result.
    """
    return read_archive(as_path(path), (*_NAMES, *_NEWER), _flattening)


def _flattening(reading: CheckedArrays) -> Flattening:
    from ..result import Flattening
    from ..stages import SolveStatistics

    path, arrays = reading.path, reading.arrays
    for name in _NAMES:
        if name not in arrays:
            what = "UVs" if name.startswith("uv") else "result of coneflat"
            raise MeshFileError(
                f"{path} holds no {what}: {name!r} is missing; write it by `coneflat flatten`"
            )
    report = json.loads(str(arrays["report"]))
    arrays.setdefault("prescribed", np.full(len(arrays["vertices"]), np.nan))
    _check_report(report)
    vertices, uv = reading.floats("vertices", (None, 3)), reading.floats("uv", (None, 2))
    n, u = len(vertices), len(uv)
    faces = reading.indices("faces", (None, 3), n)
    m = len(faces)
    uv_faces = reading.indices("uv_faces", (m, 3), u)
    cones = reading.indices("cones", (None,), n)
    if not m:
        raise MeshFileError(f"{path} is no result of coneflat: it has no faces")
    if not (np.isfinite(vertices).all() and np.isfinite(uv).all()):
        raise MeshFileError(f"{path} is no result of coneflat: it has positions or UVs that are not finite")
    uv_scale = float(reading.floats("uv_scale", ()))
    if not (np.isfinite(uv_scale) and uv_scale > 0):
        raise MeshFileError(f"{path} is no result of coneflat: its UV scale is {uv_scale:g}")
    return Flattening(
        vertices=vertices,
        faces=faces,
        uv=uv,
        uv_faces=uv_faces,
        uv_scale=uv_scale,
        cones=cones,
        curvatures=reading.floats("curvatures", (len(cones),)),
        log_scale=reading.floats("log_scale", (n,)),
        prescribed=reading.floats("prescribed", (n,)),
        curvature_residual=reading.floats("curvature_residual", (n,)),
        seams=reading.indices("seams", (None, 2), n),
        packing_efficiency=number(report["packing_efficiency"]),
        distortion=_distortion(reading, report, m),
        seconds=report["seconds"],
        notes=tuple(report["notes"]),
        settings=report["settings"],
        solve=SolveStatistics(
            **{field.name: number(report.get(field.name, field.default)) for field in fields(SolveStatistics)}
        ),
        rotations=_rotations(report),
        vertex_origin=reading.indices("vertex_origin", (n,), None),
        face_origin=reading.indices("face_origin", (m,), None),
        lengths=reading.floats("lengths", (m, 3)) if "lengths" in arrays else None,
    )


def _check_report(report: Any) -> None:
    """Raise ValueError if what a report says in words or lists is none of these."""
    kinds = {"seconds": dict, "settings": dict, "notes": list}
    for name, kind in kinds.items():
        if not isinstance(report[name], kind):
            raise ValueError(f"{name!r} of its report is a {type(report[name]).__name__}")
    if not all(isinstance(one, str) for one in report["notes"]):
        raise ValueError("its report has notes that are no text")
    for value in (report["packing_efficiency"], *report["seconds"].values()):
        number(value)


def _distortion(reading: CheckedArrays, report: dict[str, Any], count: int) -> Distortion:
    from ..measure.distortion import Distortion
    from ..measure.report import MEASURES

    numbers: dict[str, Any] = {name: number(report.get(name)) for name in MEASURES}
    return Distortion(
        qc=reading.floats("qc", (count,)),
        log_area_scale=reading.floats("log_area_scale", (count,)),
        **numbers,
    )


def _rotations(report: dict[str, Any]) -> Rotations | None:
    from ..measure.seam_data import Rotations

    if report["rotation_deviation"] is None:
        return None
    settings = report["settings"]
    quantum = settings.get("quantise", settings.get("quantum"))  # as it was called at first
    return Rotations(quantum, report["rotation_deviation"], tuple(report["handle_deviations"]))
