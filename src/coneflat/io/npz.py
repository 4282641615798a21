"""NumPy archives: writing of results, and reading with validation of every array.

The archive of a result contains all its arrays, and its report as JSON.
"""

from __future__ import annotations

import json
import math
import zipfile
from collections.abc import Callable, Iterable
from dataclasses import fields
from io import BytesIO
from pathlib import Path
from typing import IO, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import FloatArray, IntArray
from ..errors import MeshFileError
from ..measures.distortion import Distortion
from ..measures.report import MEASURES
from ..measures.seam_data import Rotations
from ..result import Flattening
from ..stages import SolveStatistics
from .files import PathName, as_path, read_bytes, readable

#: The arrays that define a result. The other arrays of an archive, those of `SeamData`, follow from them.
_NAMES = (
    "uv", "uv_faces", "vertices", "faces", "cones", "curvatures", "log_scale", "curvature_residual", "seams",
    "vertex_origin", "face_origin", "qc", "log_area_scale", "uv_scale", "report",
)  # fmt: skip
#: Optional arrays: archives of version 0.1.0 do not have these, and only results for given lengths have lengths.
_NEWER = ("prescribed", "strain", "lengths")


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
        "strain": result.distortion.strain,
        "uv_scale": np.float64(result.uv_scale),
        "report": np.array(json.dumps(result.report())),
    }
    if result.lengths is not None:
        arrays["lengths"] = result.lengths
    np.savez(stream, **arrays)


def read_flattening(path: PathName) -> Flattening:
    """Return a result that was written as .npz, without its source file.

    Args:
        path: the .npz file.

    Raises:
        MeshFileError: the file does not exist, cannot be read, or is not a result of coneflat.

    Examples:
        >>> import tempfile
        >>> result = coneflat.flatten(np.eye(4)[:, :3], [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     again = coneflat.read_flattening(result.save(folder + "/result.npz"))
        >>> bool((again.uv == result.uv).all())
        True
    """
    return read_archive(as_path(path), (*_NAMES, *_NEWER), _flattening)


def _flattening(reading: CheckedArrays) -> Flattening:
    """Return the result in an archive.

    Raises:
        MeshFileError, ValueError: the archive is not one of a result, or is damaged.
    """
    arrays, floats, indices = reading.arrays, reading.floats, reading.indices
    reading.need(_NAMES, "result of coneflat with UVs")
    report = _checked_report(reading)
    notes = reading.notes(report)
    vertices, uv = reading.finite("vertices", (None, 3)), reading.finite("uv", (None, 2))
    n, u = len(vertices), len(uv)
    faces = indices("faces", (None, 3), n)
    m = len(faces)
    uv_faces, cones = indices("uv_faces", (m, 3), u), indices("cones", (None,), n)
    if not m:
        raise MeshFileError(f"{reading.path} is not a result of coneflat: it has no faces")
    uv_scale = float(reading.finite("uv_scale", ()))
    if not uv_scale > 0:
        raise MeshFileError(f"{reading.path} is not a result of coneflat: its UV scale is {uv_scale:g}")
    has_prescribed = "prescribed" in arrays  # Not so in files of old versions.
    return Flattening(
        vertices=vertices,
        faces=faces,
        uv=uv,
        uv_faces=uv_faces,
        uv_scale=uv_scale,
        cones=cones,
        curvatures=floats("curvatures", (len(cones),)),
        log_scale=floats("log_scale", (n,)),
        prescribed=floats("prescribed", (n,)) if has_prescribed else np.full(n, np.nan),
        curvature_residual=floats("curvature_residual", (n,)),
        seams=indices("seams", (None, 2), n),
        packing_efficiency=number(report["packing_efficiency"]),
        distortion=_distortion(reading, report, m),
        seconds=report["seconds"],
        notes=notes,
        settings=report["settings"],
        solve=_statistics(report),
        rotations=_rotations(report),
        vertex_origin=indices("vertex_origin", (n,), None),
        face_origin=indices("face_origin", (m,), None),
        lengths=floats("lengths", (m, 3)) if "lengths" in arrays else None,
    )


def _checked_report(reading: CheckedArrays) -> dict[str, Any]:
    """Return the report of an archive, whose times and settings are objects, and whose times are numbers."""
    report = reading.report()
    for name in ("seconds", "settings"):
        if not isinstance(report[name], dict):
            raise ValueError(f"{name!r} of its report is a {type(report[name]).__name__}")
    for value in report["seconds"].values():
        number(value)
    return report


def _distortion(reading: CheckedArrays, report: dict[str, Any], triangles: int) -> Distortion:
    """Return the measures of an archive: those of its triangles, and those in its report."""
    measures: dict[str, Any] = {name: number(report.get(name)) for name in MEASURES}
    qc, log_area_scale = (reading.floats(name, (triangles,)) for name in ("qc", "log_area_scale"))
    has_strain = "strain" in reading.arrays  # Not so in files of old versions.
    strain = reading.floats("strain", (triangles,)) if has_strain else np.full(triangles, np.nan)
    return Distortion(qc=qc, log_area_scale=log_area_scale, strain=strain, **measures)


def _statistics(report: dict[str, Any]) -> SolveStatistics:
    """Return the statistics of the solvers in a report."""
    return SolveStatistics(
        **{field.name: number(report.get(field.name, field.default)) for field in fields(SolveStatistics)}
    )


def _rotations(report: dict[str, Any]) -> Rotations | None:
    """Return the rotations across seams in a report, if it has them."""
    if report["rotation_deviation"] is None:
        return None
    settings = report["settings"]
    quantum = settings.get("quantise", settings.get("quantum"))  # the old name
    return Rotations(quantum, report["rotation_deviation"], tuple(report["handle_deviations"]))


Built = TypeVar("Built")

#: Maximum ratio of uncompressed to compressed size. Results are written uncompressed; programs that compress them reach
#: a factor of a few.
_MAX_UNPACKING = 30


class CheckedArrays:
    """Arrays of an archive, with validated access.

    Attributes:
        path: the archive.
        arrays: the unvalidated arrays by name.
    """

    def __init__(self, path: Path, arrays: dict[str, NDArray[Any]]) -> None:
        self.path, self.arrays = path, arrays

    def need(self, names: Iterable[str], content: str) -> None:
        """Raise MeshFileError if arrays are missing; `content` is what the file should contain."""
        for name in names:
            if name not in self.arrays:
                raise MeshFileError(f"{self.path} holds no {content}: {name!r} is missing")

    def floats(self, name: str, shape: tuple[int | None, ...]) -> FloatArray:
        """Return an array of numbers of a given shape, in which None stands for any length.

        Raises:
            MeshFileError: it has another shape, or does not contain numbers.
        """
        values = self.arrays[name]
        fits = len(shape) == values.ndim and all(
            length in (None, size) for length, size in zip(shape, values.shape, strict=True)
        )
        if values.dtype.kind not in "iuf" or not fits:
            expected = ", ".join("any" if length is None else f"{length}" for length in shape)
            raise MeshFileError(
                f"{self.path}: {name!r} has the shape {values.shape} and the type {values.dtype}, not the shape "
                f"({expected}) and a numeric type"
            )
        return values.astype(np.float64)

    def finite(self, name: str, shape: tuple[int | None, ...]) -> FloatArray:
        """Return an array of finite numbers of a given shape.

        Raises:
            MeshFileError: it has another shape, or numbers that are not finite.
        """
        values = self.floats(name, shape)
        if not np.isfinite(values).all():
            raise MeshFileError(f"{self.path}: {name!r} has numbers that are not finite")
        return values

    def indices(self, name: str, shape: tuple[int | None, ...], bound: int | None) -> IntArray:
        """Return an array of integers from 0 to below `bound`, or below 2^53 if it is None.

        Raises:
            MeshFileError: it has another shape, or values out of range.
        """
        values = self.floats(name, shape)
        end = 2**53 if bound is None else bound
        if not np.all((values >= 0) & (values < end) & (values == np.floor(values))):
            indexed = "integers" if bound is None else f"{bound} elements"
            raise MeshFileError(f"{self.path}: {name!r} has indices outside the range of {indexed}")
        return values.astype(np.int64)

    def notes(self, report: dict[str, Any]) -> tuple[str, ...]:
        """Return the notes of a report.

        Raises:
            ValueError: they are not a list of strings.
        """
        notes = report["notes"]
        if not isinstance(notes, list) or not all(isinstance(note, str) for note in notes):
            raise ValueError("its report has notes that are not strings")
        return tuple(notes)

    def report(self) -> dict[str, Any]:
        """Return the report of the archive, parsed from JSON.

        Raises:
            ValueError: the report is not an object.
        """
        report = json.loads(str(self.arrays["report"]))
        if not isinstance(report, dict):
            raise ValueError(f"its report is a {type(report).__name__}")
        return report


def number(value: Any) -> Any:
    """Return a number of a report, NaN for None, as JSON has no NaN.

    Raises:
        ValueError: the value is neither a number nor None.
    """
    if value is not None and not isinstance(value, (int, float)):
        raise ValueError(f"its report has {str(value)[:20]!r} instead of a number")
    return math.nan if value is None else value


def read_archive(path: Path, names: Iterable[str], build: Callable[[CheckedArrays], Built]) -> Built:
    """Return the object that a function builds from the arrays of an .npz file.

    Args:
        path: the file.
        names: the arrays to read.
        build: function of the arrays.

    Raises:
        MeshFileError: the file does not exist, cannot be read, or is damaged.
    """
    content = read_bytes(path)
    with readable(path, "NPZ file"):
        return build(CheckedArrays(path, _arrays(path, content, names)))


def _arrays(path: Path, content: bytes, names: Iterable[str]) -> dict[str, NDArray[Any]]:
    """Return the arrays with given names, after a check that their size is plausible for the size of the file.

    NumPy itself allocates any size given in the header of an array, and decompresses any archive.
    """
    arrays: dict[str, NDArray[Any]] = {}
    left = _MAX_UNPACKING * len(content)
    with zipfile.ZipFile(BytesIO(content)) as archive:
        members = archive.namelist()
        for name in names:
            if f"{name}.npy" not in members:
                continue
            member = archive.getinfo(f"{name}.npy")
            left -= member.file_size
            if left < 0:
                raise MeshFileError(
                    f"{path} unpacks to more than {_MAX_UNPACKING} times its size: it is not a result"
                )
            with archive.open(member) as stream:
                arrays[name] = _array(stream.read())
    return arrays


def _array(content: bytes) -> NDArray[Any]:
    """Return the array in the content of a .npy file."""
    stream = BytesIO(content)
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, is_fortran, kind = read(stream)
    if kind.hasobject:
        raise ValueError("it contains Python objects")
    count = math.prod(shape)
    if min(shape, default=0) < 0 or count * kind.itemsize != len(content) - stream.tell():
        raise ValueError(f"an array of the shape {shape} does not have the expected number of bytes")
    values = np.frombuffer(content, kind, count, stream.tell()) if count else np.empty(0, kind)
    return values.reshape(shape, order="F" if is_fortran else "C")
