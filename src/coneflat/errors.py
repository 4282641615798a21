"""The package's exceptions; every failure a user can cause ends in one of these.

All derive from `ConeflatError`. Messages are one line: what is wrong, where, and what to do about it.

Examples:
    >>> try:
    ...     coneflat.read_mesh("missing.obj")
    ... except coneflat.errors.MeshFileError as error:
    ...     print(error)
    missing.obj: there is no such file
"""

from __future__ import annotations


class ConeflatError(Exception):
    """Base of every exception that coneflat raises on purpose.

    Examples:
        >>> try:
        ...     coneflat.flatten([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 9]])
        ... except coneflat.ConeflatError as error:
        ...     print(error)
        1 face with a vertex index outside 0..2: 0; face 0 is (0, 1, 9)
    """

    def __str__(self) -> str:
        """Return the message in one line, also with file names that contain line breaks."""
        return " ".join(super().__str__().splitlines())


class MeshError(ConeflatError, ValueError):
    """The mesh is not one that can be flattened."""


class EmptyMeshError(MeshError):
    """There is no vertex or no face."""


class ArrayShapeError(MeshError):
    """An array has the wrong shape or type."""


class NonFiniteError(MeshError):
    """A coordinate is NaN or infinite."""


class FaceIndexError(MeshError):
    """A face names a vertex that does not exist."""


class DegenerateFaceError(MeshError):
    """A face uses a vertex twice, or has no area."""


class NonManifoldError(MeshError):
    """An edge has more than two faces, or a vertex more than one fan of faces."""


class NonOrientableError(MeshError):
    """The faces cannot be oriented consistently (a Moebius strip, a Klein bottle)."""


class LengthError(MeshError):
    """Side lengths are not a metric: they make no triangles, or differ between the two sides of an edge."""


class MissingUVError(MeshError):
    """The mesh has no UV coordinates, or none that are finite."""


class OptionError(ConeflatError, ValueError):
    """An option has a value that makes no sense."""


class CurvatureError(ConeflatError, ValueError):
    """The curvatures asked for belong to no metric (Gauss-Bonnet, or a cone of 2 pi and more)."""


class SeamError(ConeflatError, ValueError):
    """The seams asked for cannot be had."""


class MetricError(ConeflatError, ArithmeticError):
    """No usable flat metric or layout was found."""


class ConvergenceError(MetricError):
    """The solve ended short of its tolerance."""


class TooLargeError(ConeflatError, MemoryError):
    """The mesh needs more memory than is free."""


class GridError(MetricError):
    """No integer grid was found."""


class MeshFileError(ConeflatError, OSError):
    """A file cannot be read or written, or is not what its name says."""


class UnknownFormatError(MeshFileError):
    """The file's ending names no format that coneflat knows."""


class ProjectError(ConeflatError, ValueError):
    """A project of the studio cannot be read, or its mesh is not the one that it was made with."""


class StudioError(ConeflatError, ValueError):
    """The studio cannot do what it is asked for."""
