"""Results as NumPy archives: every array, and the report as JSON."""

from __future__ import annotations

import json
import math
import zipfile
from dataclasses import fields
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import FloatArray, IntArray
from ..errors import ConeflatError, MeshFileError
from .atomic import as_path
from .raw import read_bytes

if TYPE_CHECKING:
    from ..quality.distortion import Distortion
    from ..quality.rotations import Rotations
    from ..result.flattening import Flattening
    from ..result.symmetry import MirrorSymmetry


#: The arrays that make a result. The others of an archive, those of `SeamData`, follow from them.
_NAMES = (
    "uv", "uv_faces", "vertices", "faces", "cones", "curvatures", "log_scale", "curvature_residual", "seams",
    "vertex_origin", "face_origin", "qc", "log_area_scale", "uv_scale", "report",
)  # fmt: skip
#: Archives of version 0.1.0 do not have these, and only results of given lengths have lengths.
_NEWER = ("prescribed", "lengths")
#: Results are not packed; programs that pack them gain a factor of a few.
_MOST_UNPACKED = 30


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
    path = as_path(path)
    content = read_bytes(path)
    try:
        return _flattening(path, _arrays(path, content))
    except (ConeflatError, MemoryError):
        raise
    except Exception as error:
        # Whatever a damaged file makes NumPy do, the caller sees one kind of error.
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise MeshFileError(f"{path} is not a readable NPZ file: {reason}") from error


def _arrays(path: Path, content: bytes) -> dict[str, NDArray[Any]]:
    """Return the arrays that a result has, none of which is larger than it can be in a file of this size.

    NumPy allocates what the header of an array asks for, and unpacks whatever an archive holds.
    """
    arrays: dict[str, NDArray[Any]] = {}
    left = _MOST_UNPACKED * len(content)
    with zipfile.ZipFile(BytesIO(content)) as archive:
        for name in (*_NAMES, *_NEWER):
            try:
                member = archive.getinfo(f"{name}.npy")
            except KeyError:
                continue
            left -= member.file_size
            if left < 0:
                raise MeshFileError(
                    f"{path} unpacks to more than {_MOST_UNPACKED} times its size: it is no result"
                )
            with archive.open(member) as stream:
                arrays[name] = _array(stream.read())
    return arrays


def _array(content: bytes) -> NDArray[Any]:
    """Return the array that a .npy file holds."""
    stream = BytesIO(content)
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, is_fortran, kind = read(stream)
    if kind.hasobject:
        raise ValueError("it holds Python objects")
    count = math.prod(shape)
    if min(shape, default=0) < 0 or count * kind.itemsize != len(content) - stream.tell():
        raise ValueError(f"an array of the shape {shape} is not as large as it should be")
    values = np.frombuffer(content, kind, count, stream.tell()) if count else np.empty(0, kind)
    return values.reshape(shape, order="F" if is_fortran else "C")


def _flattening(path: Path, arrays: dict[str, NDArray[Any]]) -> Flattening:
    from ..quality.statistics import SolveStatistics
    from ..result.flattening import Flattening

    for name in _NAMES:
        if name not in arrays:
            what = "UVs" if name.startswith("uv") else "result of coneflat"
            raise MeshFileError(
                f"{path} holds no {what}: {name!r} is missing; write it by `coneflat flatten`"
            )
    report = json.loads(str(arrays["report"]))
    arrays.setdefault("prescribed", np.full(len(arrays["vertices"]), np.nan))
    _check_report(report)
    reading = _Checked(path, arrays)
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
        packing_efficiency=_number(report["packing_efficiency"]),
        distortion=_distortion(reading, report, m),
        seconds=report["seconds"],
        notes=tuple(report["notes"]),
        settings=report["settings"],
        solve=SolveStatistics(
            **{
                field.name: _number(report.get(field.name, field.default))
                for field in fields(SolveStatistics)
            }
        ),
        solvers=tuple(report["solvers"]),
        rotations=_rotations(report),
        symmetry=_symmetry(report),
        # Vertices that a refinement added come from none.
        vertex_origin=reading.indices("vertex_origin", (n,), None, least=-1),
        face_origin=reading.indices("face_origin", (m,), None),
        lengths=reading.floats("lengths", (m, 3)) if "lengths" in arrays else None,
    )


def _check_report(report: Any) -> None:
    """Raise ValueError if what a report says in words or lists is none of these."""
    kinds = {"seconds": dict, "settings": dict, "notes": list, "solvers": list}
    for name, kind in kinds.items():
        if not isinstance(report[name], kind):
            raise ValueError(f"{name!r} of its report is a {type(report[name]).__name__}")
    if not all(isinstance(one, str) for one in (*report["notes"], *report["solvers"])):
        raise ValueError("its report has notes that are no text")
    for value in (report["packing_efficiency"], *report["seconds"].values()):
        _number(value)


def _number(value: Any) -> Any:
    """Return a number of a report; JSON has no NaN, for which it has None.

    Raises:
        ValueError: it is none.
    """
    if value is not None and not isinstance(value, (int, float)):
        raise ValueError(f"its report has {str(value)[:20]!r} for a number")
    return math.nan if value is None else value


class _Checked:
    """Arrays of an archive, each of which must be what a result has there."""

    def __init__(self, path: Path, arrays: dict[str, NDArray[Any]]) -> None:
        self._path, self._arrays = path, arrays

    def floats(self, name: str, shape: tuple[int | None, ...]) -> FloatArray:
        """Return an array of numbers of a shape; None stands for any length.

        Raises:
            MeshFileError: it has another shape, or is of no numbers.
        """
        values = self._arrays[name]
        lengths = [
            np.shape(values)[i : i + 1] == (length,) or length is None for i, length in enumerate(shape)
        ]
        if values.dtype.kind not in "iuf" or values.ndim != len(shape) or not all(lengths):
            wanted = ", ".join("any" if length is None else f"{length}" for length in shape)
            raise MeshFileError(
                f"{self._path}: {name!r} has the shape {values.shape} and the type {values.dtype}, not the shape "
                f"({wanted}) and a type of numbers"
            )
        return values.astype(np.float64)

    def indices(
        self, name: str, shape: tuple[int | None, ...], bound: int | None, least: int = 0
    ) -> IntArray:
        """Return an array of whole numbers from `least` up to a bound, or to what an index can be.

        Raises:
            MeshFileError: it has another shape, or numbers beyond.
        """
        values = self.floats(name, shape)
        end = 2**53 if bound is None else bound
        if values.size and not (
            values.min() >= least and values.max() < end and np.all(values == np.floor(values))
        ):
            there = "indices can be" if bound is None else f"the {bound} there are"
            raise MeshFileError(f"{self._path}: {name!r} has indices beyond {there}")
        return values.astype(np.int64)


def _distortion(reading: _Checked, report: dict[str, Any], count: int) -> Distortion:
    from ..quality.distortion import Distortion
    from ..result.report import MEASURES

    numbers: dict[str, Any] = {name: _number(report.get(name)) for name in MEASURES}
    return Distortion(
        qc=reading.floats("qc", (count,)),
        log_area_scale=reading.floats("log_area_scale", (count,)),
        **numbers,
    )


def _symmetry(report: dict[str, Any]) -> tuple[MirrorSymmetry, ...]:
    """Return the planes of symmetry that a report has; those of earlier versions have none."""
    from ..result.symmetry import MirrorSymmetry

    planes = []
    for one in report.get("symmetry", []):
        x, y, z = (float(_number(value)) for value in one["normal"])
        planes.append(MirrorSymmetry(**{**one, "normal": (x, y, z)}))
        for name in ("offset", "deviation", "layout"):
            _number(one[name])
    return tuple(planes)


def _rotations(report: dict[str, Any]) -> Rotations | None:
    from ..quality.rotations import Rotations

    if report["rotation_deviation"] is None:
        return None
    settings = report["settings"]
    quantum = settings.get("quantise", settings.get("quantum"))  # as it was called at first
    return Rotations(quantum, report["rotation_deviation"], tuple(report["handle_deviations"]))
